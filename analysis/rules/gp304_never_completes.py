"""GP304: a plan that completes in no scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.rules.base import Rule, control, go, look, plan, say
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """At most one; a plan that always gives up is GP305's."""
    completes, gives_up = context.answers["completion"] or (None, None)
    if completes is Frequency.NEVER and gives_up is not Frequency.ALWAYS:
        claim = Claim(absent=(context.automaton.complete,))
        yield RULE.finding(
            f"this {context.terms.whole} never completes, whatever happens: "
            "every run gives up or is stuck",
            context.plan.location(0),
            scenario=context.scenario(RULE.code, claim, Statement.NOT_COMPLETED),
        )


RULE = Rule(
    code="GP304",
    name="never-completes",
    severity=Severity.ERROR,
    summary="No run of the plan completes.",
    why="A plan that cannot complete cannot do its task; dispatching it only wastes time.",
    fix="make the steps that the assumptions rule out unnecessary, or drop an assumption",
    bad=plan(look("Is somebody there?"), go(1.0, 1.0), say("Hello.")),
    good=plan(
        look("Is somebody there?"),
        control("recovery", go(1.0, 1.0)),
        say("Hello."),
    ),
    options=("--faults", "hang", "--assume", "ImageAnalysisRunner never succeeds"),
    find=find,
)
