"""Declared durations and energies as exact whole numbers (semantics, section 8.5).

All bounds of a plan are multiples of one small unit, since floats are fractions of powers of two.
So both deciders add without rounding, and what they find is turned back into a float once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.compile import Compiled

__all__ = ["UNBOUNDED", "Amounts", "Number", "Range", "durations", "energies", "plus"]

UNBOUNDED = math.inf

Number = int | float
"""A whole number of units, or UNBOUNDED."""

Range = tuple[Number, Number]
"""The least and the greatest of something."""


@dataclass(frozen=True, slots=True)
class Amounts:
    """What each instance may take: ``ranges[number]`` in units of ``1 / scale`` (seconds, joules).

    ``declared`` holds the numbers of the instances for which a capability declares it.
    """

    ranges: tuple[Range, ...]
    declared: tuple[int, ...]
    scale: int

    def amount(self, found: Number) -> float | None:
        """A number of units in seconds or joules, as the nearest float; None: unbounded."""
        return None if found == UNBOUNDED else int(found) / self.scale

    def term(self, limit: float) -> str:
        """A number of seconds or joules, in units, as a term for z3."""
        numerator, denominator = limit.as_integer_ratio()
        return f"(/ {numerator * self.scale}.0 {denominator}.0)"

    def exceeds(self, found: Number, limit: float) -> bool:
        """Whether a number of units is more than ``limit`` seconds or joules."""
        numerator, denominator = limit.as_integer_ratio()
        return found == UNBOUNDED or found * denominator > numerator * self.scale

    def interval(self, found: Range) -> tuple[float, float | None]:
        """Both bounds in seconds or joules; the greatest is None if it is unbounded."""
        return int(found[0]) / self.scale, self.amount(found[1])


def durations(compiled: Compiled) -> Amounts | None:
    """The durations; free where nothing is declared. None if no instance declares any."""
    given = [None if binding is None else binding.duration for binding in compiled.bindings]
    return _amounts(given, (0, UNBOUNDED))


def energies(compiled: Compiled) -> Amounts | None:
    """The energies; 0 where nothing is declared. None if no instance declares any."""
    given = [None if binding is None else binding.energy for binding in compiled.bindings]
    return _amounts(given, (0, 0))


def plus(*numbers: Number) -> Number:
    """The sum; Python cannot add infinity to whole numbers that no float holds."""
    return UNBOUNDED if UNBOUNDED in numbers else sum(numbers)


def _amounts(given: list[tuple[float, float] | None], undeclared: Range) -> Amounts | None:
    declared = tuple(number for number, span in enumerate(given) if span is not None)
    if not declared:
        return None
    scale = _scale(bound for span in given if span is not None for bound in span)
    ranges = tuple(
        undeclared if span is None else (_units(span[0], scale), _units(span[1], scale))
        for span in given
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
