"""GP306: a plan that can be stuck."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.stuck import stuck_claim
from gpsfsm.analysis.rules.base import Rule, go, look, plan
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """At most one, unless waiting joins (GP303) are the only reason."""
    stuck, _, _ = context.answers["stuck"] or (Frequency.UNKNOWN,) * 3
    if stuck not in (Frequency.SOMETIMES, Frequency.ALWAYS):
        return
    blocks = [waiting.deadlock.block for waiting in context.waiting]
    claim = stuck_claim(tuple(context.automaton.blocks[block] for block in blocks))
    if blocks and not context.possible(claim):
        return
    how = "is stuck in every scenario" if stuck is Frequency.ALWAYS else "can be stuck"
    yield RULE.finding(
        f"this {context.terms.whole} {how}: it neither completes nor gives up, "
        "and nothing more can happen",
        context.plan.location(0),
        scenario=context.scenario(RULE.code, claim, Statement.STUCK),
    )


RULE = Rule(
    code="GP306",
    name="stuck",
    severity=Severity.ERROR,
    summary="Some run neither completes nor gives up.",
    why=(
        "A stuck robot does nothing and says nothing. Without faults no plan can be stuck; with "
        "runners that hang or do not start it can."
    ),
    fix="give runners that may hang or not start a timeout, so that they fail instead",
    bad=plan(go(1.0, 2.0), look("Is the shelf full?")),
    good=plan(go(1.0, 2.0), go(3.0, 2.0)),
    options=("--faults", "hang", "--assume", "WaypointRunner never hangs"),
    find=find,
)
