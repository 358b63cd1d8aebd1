"""GP307: a recovery that guards nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, control, go, plan
from gpsfsm.analysis.words import listed
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per recovery; its runners are listed under it."""
    units = context.units
    dead = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.DEAD]
    for unit in sorted(dead, key=lambda unit: units.elements[unit]):
        runners = context.runners_in(unit)
        if not runners:
            continue  # an empty recovery is GP109's
        element = context.plan.elements[units.elements[unit]]
        names = listed([context.place(context.runner(number)) for number in runners])
        verb = "runs" if len(runners) == 1 else "run"
        yield RULE.finding(
            f"this recovery has nothing before it to recover from, so {names} never {verb}",
            context.plan.location(element),
            related=tuple(
                context.related(context.runner(number), "never runs") for number in runners
            ),
        )


RULE = Rule(
    code="GP307",
    name="recovery-without-predecessor",
    severity=Severity.ERROR,
    summary="A recovery comes first in its control, so it has nothing to recover from.",
    why=(
        "A recovery runs when the sibling right before it fails. Without one it never runs, and "
        "the plan goes on as if it were not there. Models write this when they take a recovery "
        "for a list of alternatives of which the first is the goal."
    ),
    fix="put the goal before the recovery, and only the alternatives inside it",
    bad=plan(control("recovery", go(1.0, 3.0), go(0.0, 2.0)), go(0.0, 0.0)),
    good=plan(go(1.0, 3.0), control("recovery", go(0.0, 2.0)), go(0.0, 0.0)),
    find=find,
)
