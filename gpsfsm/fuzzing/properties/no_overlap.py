"""No overlap: no two runners hold the same resource at one instant (semantics, section 8.4)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.fuzzing.properties.base import Breach, Property

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.runs import Run

_MOST = 20
"""Breaches that are told of one run: of a thousand runners side by side all pairs overlap."""


def _check(run: Run) -> Iterator[Breach]:
    overlaps = 0
    for resource, numbers in _holders(run).items():
        for one, other in _meeting(run, numbers):
            both = [run.runner(number) for number in (one, other)]
            yield Breach(
                f"{place(both[0])} and {place(both[1])} both hold the resource '{resource}'",
                (other, one),
                (resource, *(run.plan.path(runner) for runner in both)),
            )
            overlaps += 1
            if overlaps >= _MOST:
                return


def _holders(run: Run) -> dict[str, list[int]]:
    """The instances that were triggered and hold a resource, in document order."""
    holders: dict[str, list[int]] = {}
    for number in sorted(run.triggered):
        binding = run.compiled.bindings[number]
        for resource in () if binding is None else dict.fromkeys(binding.provider.resources):
            holders.setdefault(resource, []).append(number)
    return holders


def _meeting(run: Run, numbers: list[int]) -> Iterator[tuple[int, int]]:
    """The pairs that are active at one instant, not later than the one that fixes the end.

    In the order in which they come to meet; each pair in document order.
    """
    active: list[int] = []
    for number in sorted(numbers, key=lambda each: run.triggered[each]):
        begin = run.triggered[number]
        active = [each for each in active if run.ended.get(each, math.inf) > begin]
        for each in active:
            yield min(each, number), max(each, number)
        active.append(number)


PROPERTY = Property(
    "no-overlap", "no two runners hold the same resource at once", _check, by_default=True
)
