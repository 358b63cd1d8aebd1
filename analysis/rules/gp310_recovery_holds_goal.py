"""GP310: a recovery whose first step looks like the goal itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, control, go, plan
from gpsfsm.compile import UnitKind
from gpsfsm.late import pattern
from gpsfsm.model.finding import Confidence, Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.plan import Element

_NUMBER = pattern(r"-?\d+(?:\.\d+)?")


def find(context: Context) -> Iterator[Finding]:
    """One finding per recovery for which the plan itself shows that it holds a goal.

    From its shape alone nobody can tell a goal with its alternative from two alternatives. So one
    of three signs is required, each of which makes no sense if the steps are two alternatives.
    """
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    misread = _orphaned_list(context)
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        guarded, first, *others = units.children[guard]
        if not others or units.kinds[first] is not UnitKind.RUNNER:
            continue
        goal, before = context.element_of(first), context.element_of(guarded)
        sign = (
            _named_after(context.plan.elements[units.elements[guard]], goal, before)
            or _in_a_row(context, guard)
            or misread
        )
        if sign and context.reached[first] and goal.action != before.action:
            yield RULE.finding(
                f"{context.place(goal)} only runs after {context.place(before)} has failed, but "
                f"it looks like a goal of its own: {sign}",
                context.plan.location(goal),
                related=(context.related(before, "must fail first"),),
            )


def _named_after(recovery: Element, goal: Element, before: Element) -> str:
    """The recovery's name holds the coordinates of its first step, not of what it guards."""
    label = recovery.text("name") or ""
    named = {float(number) for number in _NUMBER.findall(label)[:20]}
    mine, theirs = _coordinates(goal), _coordinates(before)
    if len(mine) > 1 and mine <= named and not (theirs and theirs <= named):
        return f"the recovery is named after it ('{label[:40]}')"
    return ""


def _coordinates(runner: Element) -> set[float]:
    return {
        float(value)
        for value in runner.parameters.values()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


def _in_a_row(context: Context, guard: int) -> str:
    """The recovery stands right beside another one, and both have several steps."""
    units = context.units
    neighbours = (units.parents[guard], units.children[guard][0])
    for other in neighbours:
        if other >= 0 and units.kinds[other] is UnitKind.GUARD:
            inner = guard if other == units.parents[guard] else other
            outer = other if inner == guard else guard
            nested = units.children[outer][0] == inner
            if nested and len(units.children[other]) > 2:
                return "another recovery with several steps stands right beside this one"
    return ""


def _orphaned_list(context: Context) -> str:
    """The plan has a recovery with several steps that guards nothing."""
    units = context.units
    for unit, kind in enumerate(units.kinds):
        if kind is UnitKind.DEAD and len(units.children[unit]) > 1:
            where = context.plan.elements[units.elements[unit]].where
            return f"the recovery at {where} lists a goal and its alternative in the same way"
    return ""


RULE = Rule(
    code="GP310",
    name="recovery-holds-goal",
    severity=Severity.WARNING,
    summary="A recovery seems to hold a goal together with its alternative.",
    why=(
        "Models take a recovery for a fallback that tries its children in order, goal first. It "
        "is not: it runs only after the sibling before it has failed, so in the normal run the "
        "goal is skipped in silence. The rule speaks only where the plan itself gives a sign: the "
        "recovery is named after its first step, stands beside another recovery with several "
        "steps, or shares the plan with one that guards nothing."
    ),
    fix="put the goal before the recovery, and only its alternatives inside",
    bad=plan(
        go(2.0, -0.5),
        control("recovery", go(1.0, 3.0), go(0.0, 2.0), name="recovery_for_1_3"),
        go(-2.0, 0.0),
    ),
    good=plan(
        go(2.0, -0.5),
        go(1.0, 3.0),
        control("recovery", go(0.0, 2.0), name="recovery_for_1_3"),
        go(-2.0, 0.0),
    ),
    confidence=Confidence.HEURISTIC,
    find=find,
)
