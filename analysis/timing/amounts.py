"""Declared durations and energies as exact whole numbers (semantics, section 8.5).

All bounds of a plan are multiples of one small unit, since floats are fractions of powers of two.
So both deciders add without rounding, and what they find is turned back into a float once. What a
whole plan takes is put together from its units (``whole``).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

from gpsfsm.compile import UnitKind
from gpsfsm.late import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

UNBOUNDED = math.inf

Number = int | float
"""A whole number of units, or UNBOUNDED."""

Range = tuple[Number, Number]
"""The least and the greatest of something."""


@dataclass(frozen=True, slots=True)
class Amounts:
    """Amounts of each instance: ``ranges[number]`` in units of ``1 / scale`` (seconds, joules).

    ``declared`` holds the numbers of the instances for which a capability declares it.
    """

    ranges: tuple[Range, ...]
    declared: tuple[int, ...]
    scale: int

    def amount(self, number: Number) -> float | None:
        """A number of units in seconds or joules, as the nearest float; None: unbounded."""
        return None if number == UNBOUNDED else int(number) / self.scale

    def term(self, limit: float) -> str:
        """A number of seconds or joules, in units, as a term for z3."""
        numerator, denominator = limit.as_integer_ratio()
        return f"(/ {numerator * self.scale}.0 {denominator}.0)"

    def exceeds(self, number: Number, limit: float) -> bool:
        """True if a number of units is more than ``limit`` seconds or joules."""
        numerator, denominator = limit.as_integer_ratio()
        return number == UNBOUNDED or number * denominator > numerator * self.scale

    def interval(self, numbers: Range) -> tuple[float, float | None]:
        """Both bounds in seconds or joules; the greatest is None if it is unbounded."""
        return int(numbers[0]) / self.scale, self.amount(numbers[1])


def durations(compiled: Compiled) -> Amounts | None:
    """The durations; free where nothing is declared. None if no instance declares any."""
    spans = [None if binding is None else binding.duration for binding in compiled.bindings]
    return _amounts(spans, (0, UNBOUNDED))


def energies(compiled: Compiled) -> Amounts | None:
    """The energies; 0 where nothing is declared. None if no instance declares any."""
    spans = [None if binding is None else binding.energy for binding in compiled.bindings]
    return _amounts(spans, (0, 0))


def plus(*numbers: Number) -> Number:
    """The sum; Python cannot add infinity to whole numbers that no float holds."""
    return UNBOUNDED if UNBOUNDED in numbers else sum(numbers)


def _amounts(spans: list[tuple[float, float] | None], undeclared: Range) -> Amounts | None:
    declared = tuple(number for number, span in enumerate(spans) if span is not None)
    if not declared:
        return None
    scale = _scale(bound for span in spans if span is not None for bound in span)
    ranges = tuple(
        undeclared if span is None else (_units(span[0], scale), _units(span[1], scale))
        for span in spans
    )
    return Amounts(ranges, declared, scale)


def _scale(bounds: Iterable[float]) -> int:
    """The greatest denominator: it is a multiple of all others, which are powers of two too."""
    return max(
        (bound.as_integer_ratio()[1] for bound in bounds if bound != UNBOUNDED),
        default=1,
    )


def _units(bound: float, scale: int) -> Number:
    if bound == UNBOUNDED:
        return UNBOUNDED
    numerator, denominator = bound.as_integer_ratio()
    return numerator * (scale // denominator)


T = TypeVar("T")


def whole(
    structure: Structure,
    amounts: Amounts,
    made: Callable[[Range, Range | None], T],
    combined: Mapping[UnitKind, Callable[[Sequence[T]], T]],
) -> T | None:
    """The amount that the plan takes; None if no reachable instance declares any.

    ``made`` is given what an instance takes if it succeeds, and if it fails (None if it cannot).
    ``combined`` makes of what its children take what a unit of some kind takes.
    """
    if not any(structure.reached[structure.unit_of[number]] for number in amounts.declared):
        return None
    units = structure.units
    results: dict[int, T] = {}
    for unit in reversed(range(len(units))):  # children come after their parents
        kind = units.kinds[unit]
        if kind is UnitKind.RUNNER:
            amount = amounts.ranges[structure.number[unit]]
            results[unit] = made(amount, amount if structure.can_fail[unit] else None)
        else:
            results[unit] = combined[kind]([results[child] for child in units.children[unit]])
    return results[0]


def reached(solver: Solver, amounts: Amounts) -> Iterator[int]:
    """The numbers of the instances that declare something and that some run triggers."""
    for number in amounts.declared:
        node = solver.automaton.runner_node(number)
        if solver.decide([solver.encoding.triggered(node)])[0]:
            yield number
