"""GP309: a recovery that repeats the very action that failed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import control, go, plan
from gpsfsm.compile import UnitKind
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.plan import Element

__all__ = ["RULE"]


def find(context: Context) -> Iterator[Finding]:
    """One finding per repeated runner."""
    units = context.units
    for guard, kind in enumerate(units.kinds):
        if kind is not UnitKind.GUARD:
            continue
        tried: dict[tuple[object, ...], Element] = {}
        for unit in units.children[guard]:
            if units.kinds[unit] is not UnitKind.RUNNER:
                continue
            runner = context.element_of(unit)
            first = tried.setdefault(runner.action, runner)
            if first is not runner and context.reached[unit]:
                consistent = context.options.consistent
                yield RULE.finding(
                    f"{context.place(runner)} repeats the action that has just failed at line "
                    f"{first.line}"
                    + (": it fails again, for equal actions have equal outcomes" * consistent),
                    context.plan.location(runner),
                    severity=Severity.WARNING if consistent else Severity.INFO,
                    related=(context.related(first, "the first try"),),
                )


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
