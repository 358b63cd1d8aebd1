"""Mean and deviation of measurements, of one group and over several (docs/experiments.md)."""

from __future__ import annotations

from dataclasses import dataclass
from math import fsum, sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = ["Moments", "combined", "moments_of", "pooled_deviation"]


@dataclass(frozen=True, slots=True)
class Moments:
    """What is known of a group of ``count`` measurements, at least one; in their unit.

    ``deviation`` is the sample deviation, with ``count - 1`` below the sum of squares. One
    measurement has none.
    """

    count: int
    mean: float
    deviation: float | None


def moments_of(values: Iterable[float]) -> Moments | None:
    """Mean and sample deviation of finite numbers; None if there is no number."""
    found = list(values)
    count = len(found)
    if not count:
        return None
    mean = fsum(found) / count
    if count == 1:
        return Moments(count, mean, None)
    squares = fsum((value - mean) ** 2 for value in found)
    rounding = fsum(value - mean for value in found) ** 2 / count
    return Moments(count, mean, sqrt(max(0.0, squares - rounding) / (count - 1)))


def combined(groups: Sequence[Moments]) -> Moments | None:
    """The moments of all measurements of the groups together; None if there is no group.

    The mean is weighted by the counts. The sum of squares is that within the groups plus that of
    the means of the groups around the common mean.
    """
    count = sum(group.count for group in groups)
    if not count:
        return None
    mean = fsum(group.count * group.mean for group in groups) / count
    if count == 1:
        return Moments(count, mean, None)
    between = fsum(group.count * (group.mean - mean) ** 2 for group in groups)
    return Moments(count, mean, sqrt((_within(groups) + between) / (count - 1)))


def pooled_deviation(groups: Iterable[Moments]) -> float | None:
    """The deviation that the groups have in common: the root of the mean variance.

    Variances are weighted by their degrees of freedom, ``count - 1``. None if no group has more
    than one measurement. Differences between the means of the groups do not count.
    """
    several = [group for group in groups if group.deviation is not None]
    freedom = sum(group.count - 1 for group in several)
    return sqrt(_within(several) / freedom) if freedom else None


def _within(groups: Iterable[Moments]) -> float:
    """The sum of squares of the measurements around the means of their own groups."""
    return fsum((group.count - 1) * (group.deviation or 0.0) ** 2 for group in groups)
