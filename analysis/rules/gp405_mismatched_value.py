"""GP405: a value arrives that is of another type than the runner expects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.data_flow import DataFlow
from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import locate, plan, tell_pose
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context

__all__ = ["RULE"]


def find(context: Context) -> Iterator[Finding]:
    """One finding per value."""
    flow: DataFlow = context.answers["data_flow"] or DataFlow()
    for found in flow.mismatched:
        taker, giver = context.runner(found.runner), context.runner(found.source)
        yield RULE.finding(
            f"{context.place(taker)} expects '{found.name}' as {found.wanted}, and "
            f"{context.place(giver)} gives it as {found.given}",
            context.plan.location(taker),
            related=(context.related(giver, f"gives '{found.name}'"),),
            scenario=context.triggering(RULE.code, found.runner),
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
