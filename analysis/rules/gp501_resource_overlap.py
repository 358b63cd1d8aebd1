"""GP501: two runners that need the same thing for themselves are active at the same time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.overlaps import overlap_claim
from gpsfsm.analysis.rules.base import Rule, control, go, look, plan
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.printable import clip
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context

_MAX_NAME = 60
_LEFT_ALL = (
    "nothing stops the units beside one that has failed: give each unit a recovery of its own, or "
    "let the recovery wait until the others are done"
)
_LEFT = (
    "nothing stops the units that a parallel control leaves behind: use a recovery if the second "
    "unit is only the alternative, or parallel_all if the plan has to wait for all"
)


def find(context: Context) -> Iterator[Finding]:
    """One finding per parallel control and resource, with the first pair."""
    units = context.units
    for overlap in context.answers["overlaps"] or ():
        first, second = context.runner(overlap.first), context.runner(overlap.second)
        inside = overlap.second in context.runners_in(overlap.block)
        block = context.plan.elements[units.elements[overlap.block]]
        resource = clip(overlap.resource, _MAX_NAME)
        if inside:
            message = (
                f"{context.place(first)} and {context.place(second)} can be active at the same "
                f"time, and each needs the {resource} for itself"
            )
        else:
            message = (
                f"{context.place(first)} can still be active when {context.place(second)} starts, "
                f"and each needs the {resource} for itself"
            )
        yield RULE.finding(
            message,
            context.plan.location(block),
            hint=""
            if inside
            else _LEFT
            if units.kinds[overlap.block] is UnitKind.ANY
            else _LEFT_ALL,
            related=(
                context.related(first, f"holds the {resource}"),
                context.related(second, f"holds the {resource}"),
            ),
            scenario=context.scenario(
                RULE.code,
                overlap_claim(context.clock, overlap.first, overlap.second),
                Sentence(Statement.HELD_TWICE, arguments=(resource,)),
            ),
        )


RULE = Rule(
    code="GP501",
    name="resource-overlap",
    severity=Severity.ERROR,
    summary="Two runners can hold the same exclusive resource at the same time.",
    why=(
        "A robot has one base, one speaker, one microphone. A second goal pushes the first one "
        "aside, which then fails; two speeches at once are noise. Runners that a parallel_any "
        "leaves behind count too: nothing stops them."
    ),
    fix="run the two one after the other",
    bad=plan(control("parallel_all", go(1.0, 2.0), go(3.0, 4.0))),
    good=plan(go(1.0, 2.0), control("parallel_all", go(3.0, 4.0), look("Is the door open?"))),
    find=find,
)
