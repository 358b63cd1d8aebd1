"""GP308: a recovery after something that cannot fail."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, control, go, plan, say
from gpsfsm.analysis.words import listed
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per recovery; the runners that never run are listed under it."""
    units = context.units
    reported: set[int] = set()
    for unit in context.unreached_roots:
        parent = units.parents[unit]
        if parent < 0 or units.kinds[parent] is not UnitKind.GUARD or parent in reported:
            continue
        reported.add(parent)
        position = units.positions[unit]
        siblings = units.children[parent]
        runners = [number for other in siblings[position:] for number in context.runners_in(other)]
        if not runners:
            continue
        before = context.place(context.element_of(siblings[position - 1]))
        assumed = " under the assumptions" if context.options.assumptions else ""
        names = listed([context.place(context.runner(number)) for number in runners])
        yield RULE.finding(
            f"{before} cannot fail{assumed}, so this recovery never needs {names}",
            context.plan.location(units.elements[parent]),
            related=tuple(
                context.related(context.runner(number), "never runs") for number in runners
            ),
        )


RULE = Rule(
    code="GP308",
    name="needless-recovery",
    severity=Severity.WARNING,
    summary="A recovery follows something that cannot fail.",
    why=(
        "Its steps never run. Often the recovery was meant for another step, which is then left "
        "without one."
    ),
    fix="remove the steps that never run, or move them behind the step that can fail",
    bad=plan(say("I am leaving."), control("recovery", say("Mind the robot.")), go(1.0, 1.0)),
    good=plan(say("I am leaving."), go(1.0, 1.0), control("recovery", say("The way is blocked."))),
    options=("--assume", "SpeechRunner never fails"),
    find=find,
)
