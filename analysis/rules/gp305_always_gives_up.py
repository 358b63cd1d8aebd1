"""GP305: a plan that gives up in every scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.completion import give_up_claim
from gpsfsm.analysis.rules.base import Rule, control, go, plan, say
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """At most one."""
    _, gives_up = context.answers["completion"] or (None, None)
    if gives_up is Frequency.ALWAYS:
        yield RULE.finding(
            f"this {context.terms.whole} gives up in every scenario, so it can never do its task",
            context.plan.location(0),
            scenario=context.scenario(RULE.code, give_up_claim(), Statement.UNHANDLED_FAILURE),
        )


RULE = Rule(
    code="GP305",
    name="always-gives-up",
    severity=Severity.ERROR,
    summary="Every run of the plan gives up.",
    why=(
        "Under the options of the check some unhandled failure is certain, so the plan never "
        "completes and a new one has to be generated in any case."
    ),
    fix="add a recovery after the runner that must fail, or drop the assumption that makes it fail",
    bad=plan(go(9.0, 9.0), say("Delivered.")),
    good=plan(go(9.0, 9.0), control("recovery", go(8.0, 8.0)), say("Delivered.")),
    options=("--assume", "WaypointRunner(x=9.0) always fails"),
    find=find,
)
