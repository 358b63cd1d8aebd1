"""Mean and deviations, against Python's ``statistics`` and the formulas written out."""

from __future__ import annotations

import math
import statistics
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.grading.tables import combined, moments_of, pooled_deviation

VALUES = st.lists(st.floats(0, 1e6), max_size=12)
GROUPS = st.lists(VALUES, max_size=6)


def close(one: float | None, other: float | None, scale: float = 1.0) -> bool:
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-7 * max(1.0, scale) ** 0.5)


@given(VALUES)
def test_moments_are_those_of_the_statistics_module(values: list[float]) -> None:
    moments = moments_of(values)
    if not values:
        assert moments is None
        return
    assert moments is not None
    assert moments.count == len(values)
    assert close(moments.mean, statistics.fmean(values))
    assert close(moments.deviation, statistics.stdev(values) if len(values) > 1 else None)


@given(GROUPS)
def test_groups_together_have_the_moments_of_all_their_values(groups: list[list[float]]) -> None:
    joined = combined([one for one in map(moments_of, groups) if one is not None])
    direct = moments_of([value for group in groups for value in group])
    if direct is None:
        assert joined is None
        return
    assert joined is not None
    assert joined.count == direct.count
    assert close(joined.mean, direct.mean)
    assert close(joined.deviation, direct.deviation, scale=direct.mean)


@given(st.lists(st.lists(st.integers(0, 1000), max_size=8), max_size=5))
def test_the_pooled_deviation_is_the_root_of_the_mean_variance(groups: list[list[int]]) -> None:
    """Exact: the squares around the mean of each group, over the degrees of freedom."""
    squares, freedom = Fraction(0), 0
    for group in groups:
        if group:
            mean = Fraction(sum(group), len(group))
            squares += sum((value - mean) ** 2 for value in group)
            freedom += len(group) - 1
    deviation = pooled_deviation([one for one in map(moments_of, groups) if one is not None])
    assert close(deviation, math.sqrt(squares / freedom) if freedom else None)


def test_values_far_from_zero_lose_nothing() -> None:
    moments = moments_of([1e9 + shift for shift in (4, 7, 13, 16)])
    assert moments is not None
    assert moments.deviation == pytest.approx(30**0.5, rel=1e-12)


def test_by_hand() -> None:
    """2 and 4 have the deviation √2, 10 and 16 have √18: pooled √10, together √(40 + 100)/3."""
    groups = [one for one in map(moments_of, ([2, 4], [10, 16], [9])) if one is not None]
    assert [one.deviation for one in groups] == [
        pytest.approx(2**0.5),
        pytest.approx(18**0.5),
        None,
    ]
    assert pooled_deviation(groups) == pytest.approx(10**0.5)
    both = combined(groups[:2])
    assert both is not None
    assert (both.mean, both.deviation) == (8, pytest.approx((120 / 3) ** 0.5))
