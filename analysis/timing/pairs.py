"""Pairs of instances that may be active at the same time, and the questions about them.

The pairs are read off the tree of units alone: without a parallel control around one of them only
one instance is active at a time. Whatever decides whether a pair really meets asks for them in this
order, and answers as ``Instants`` where durations are declared.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, NamedTuple, Protocol

from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.compile import Compiled, Units


class Row(NamedTuple):
    """One instance and those that it may meet: ``numbers[start:end]`` of the holders."""

    first: int
    start: int
    end: int


Candidates = dict[int, list[Row]]
"""By the unit of a parallel control; the pairs of each are in document order."""


def is_parallel(units: Units, unit: int) -> bool:
    """True if the unit is a parallel control of several units."""
    return units.kinds[unit] in (UnitKind.ALL, UnitKind.ANY) and len(units.children[unit]) > 1


def leaving(units: Units, blocks: Sequence[int]) -> int:
    """The control that leaves an instance behind, of those around it from the inside.

    It is the innermost parallel_any, or else the innermost parallel_all.
    """
    for block in blocks:
        if units.kinds[block] is UnitKind.ANY:
            return block
    return blocks[0]


def ranges_of(compiled: Compiled) -> list[tuple[int, int]]:
    """The runner numbers in each unit, as [first, last + 1): a unit is one piece of the text."""
    units = compiled.units
    numbers = {node.origin: number for number, node in enumerate(compiled.automaton.runners)}
    ranges = [(-1, -1)] * len(units)
    for unit in reversed(range(len(units))):
        if units.kinds[unit] is UnitKind.RUNNER:
            number = numbers[units.elements[unit]]
            ranges[unit] = number, number + 1
            continue
        inside = [ranges[child] for child in units.children[unit] if ranges[child][1] >= 0]
        if inside:
            ranges[unit] = min(low for low, _ in inside), max(high for _, high in inside)
    return ranges


def candidates(
    compiled: Compiled, numbers: Sequence[int], ranges: Sequence[tuple[int, int]]
) -> Candidates:
    """The pairs of ``numbers`` (sorted) by the control that may let them meet.

    It is the one that holds both, or, where the second comes later, the one that leaves the first
    behind.
    """
    units = compiled.units
    rows: Candidates = {}
    unit_of = {
        ranges[unit][0]: unit for unit, kind in enumerate(units.kinds) if kind is UnitKind.RUNNER
    }
    for number in numbers:
        child = unit_of[number]
        blocks: list[int] = []
        while units.parents[child] >= 0:
            parent = units.parents[child]
            start = bisect_left(numbers, ranges[child][1])
            end = bisect_left(numbers, ranges[parent][1])
            parallel = is_parallel(units, parent)
            if start < end and (parallel or blocks):
                block = parent if parallel else leaving(units, blocks)
                rows.setdefault(block, []).append(Row(number, start, end))
            if parallel:
                blocks.append(parent)
            child = parent
    return rows


class Instants(Protocol):
    """Answers about instants; may raise InconclusiveError."""

    def meet(self, first: int, second: int) -> bool:
        """True if in some run both instances are active at one instant, before it ends."""
        ...

    def outlives(self, number: int) -> bool:
        """True if in some run the instance is active when the plan completes."""
        ...
