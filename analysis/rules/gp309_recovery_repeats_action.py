"""GP309: a recovery that repeats the very action that failed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, control, go, plan
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.plan import Element


def find(context: Context) -> Iterator[Finding]:
    """One finding per runner that repeats the guarded action or an earlier step."""
    units = context.units
    guards = [unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.GUARD]
    for guard in sorted(guards, key=lambda unit: units.elements[unit]):
        tried: dict[tuple[object, ...], Element] = {}
        for step in units.children[guard]:
            for unit in _in_sequence(context, step):
                runner = context.element_of(unit)
                if context.reached[unit] and runner.action in tried:
                    yield _finding(context, runner, tried[runner.action])
            if units.kinds[step] is UnitKind.RUNNER:
                tried[context.element_of(step).action] = context.element_of(step)


def _finding(context: Context, runner: Element, before: Element) -> Finding:
    consistent = context.options.consistent
    again = ": it fails again, for equal actions have equal outcomes" if consistent else ""
    return RULE.finding(
        f"{context.place(runner)} repeats the action that has failed at {before.where}{again}",
        context.plan.location(runner),
        severity=Severity.WARNING if consistent else Severity.INFO,
        hint="try another action" if consistent else "",
        related=(context.related(before, "the earlier try"),),
    )


def _in_sequence(context: Context, unit: int) -> Iterator[int]:
    """The runners of a unit that is a runner, or a sequence of such."""
    pending = [unit]
    while pending:
        current = pending.pop()
        if context.units.kinds[current] is UnitKind.RUNNER:
            yield current
        elif context.units.kinds[current] is UnitKind.SEQUENCE:
            pending.extend(reversed(context.units.children[current]))


RULE = Rule(
    code="GP309",
    name="recovery-repeats-action",
    severity=Severity.INFO,
    summary="A recovery does again what has just failed.",
    why=(
        "A second try can be right, for a crowded corridor for instance. Where the world does not "
        "change meanwhile it fails again."
    ),
    fix="try another action, or keep it if a second try makes sense",
    bad=plan(go(1.0, 3.0), control("recovery", go(1, 3)), go(0.0, 0.0)),
    good=plan(go(1.0, 3.0), control("recovery", go(1.0, 2.0)), go(0.0, 0.0)),
    severities="warning under --consistent, where the repetition is proven to be useless",
    find=find,
)
