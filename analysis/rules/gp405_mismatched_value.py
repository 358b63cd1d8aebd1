"""GP405: a value arrives that is of another type than the runner expects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.data_flow import DataFlow
from gpsfsm.analysis.rules.base import Rule, locate, plan, tell_pose
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per value."""
    flow: DataFlow = context.answers["data_flow"] or DataFlow()
    for value in flow.mismatched:
        taker, giver = context.runner(value.runner), context.runner(value.source)
        yield RULE.finding(
            f"{context.place(taker)} expects '{value.name}' as {value.wanted}, and "
            f"{context.place(giver)} gives it as {value.arriving}",
            context.plan.location(taker),
            related=(context.related(giver, f"gives '{value.name}'"),),
            scenario=context.triggering(RULE.code, value.runner),
        )


RULE = Rule(
    code="GP405",
    name="mismatched-value",
    severity=Severity.ERROR,
    summary="A value that arrives has the wrong type.",
    why=(
        "Names decide what a value is used for, types are not converted. A runner that gets text "
        "where it expects a number fails, and takes the engine with it in the original stack."
    ),
    fix="put a step between the two that gives no value of this name",
    bad="",  # no two runners of the built-in library disagree
    good=plan(locate(), tell_pose(flush="true")),
    find=find,
)
