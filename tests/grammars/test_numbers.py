"""Numbers between bounds: what the expressions allow, against comparing."""

from __future__ import annotations

import re
from decimal import Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.grammars.expressions import regular
from gpsfsm.grammars.forms import FRACTION, WHOLE, decimals, integers

BOUNDS = st.one_of(
    st.none(),
    st.integers(-1200, 1200).map(float),
    st.integers(-12000, 12000).map(lambda number: number / 100),
    st.floats(-1e6, 1e6),
    st.floats(allow_nan=False, allow_infinity=False),
)
DIGITS = st.integers(0, 10**6).map(str)
TEXTS = st.builds(
    lambda sign, whole, rest: f"{sign}{whole}{rest}",
    st.sampled_from(["", "-"]),
    DIGITS,
    st.one_of(st.just(""), st.text("0123456789", min_size=1, max_size=FRACTION).map(".{}".format)),
)


def allows(low: float | None, high: float | None, text: str, *, whole: bool = False) -> bool:
    result = integers(low, high) if whole else decimals(low, high)
    return result is not None and re.fullmatch(regular(result), text) is not None


def within(low: float | None, high: float | None, text: str) -> bool:
    """By comparing decimal numbers; what is negative and zero is not written."""
    value = Decimal(text)
    return (low is None or value >= Decimal(repr(low))) and (
        high is None or value <= Decimal(repr(high))
    )


def is_between(low: float | None, high: float | None, value: float) -> bool:
    return (low is None or value >= low) and (high is None or value <= high)


@given(BOUNDS, BOUNDS, TEXTS)
@example(0.1, None, "0.1")
@example(None, -0.001, "-0.001")
@example(-0.5, 0.5, "0")
@example(5.0, 5.0, "5.000")
def test_decimals(low: float | None, high: float | None, text: str) -> None:
    minus_zero = text.startswith("-") and not Decimal(text)
    allowed = allows(low, high, text)
    if allowed:
        assert is_between(low, high, float(text))
    if not minus_zero:
        assert allowed == within(low, high, text)


@given(BOUNDS, BOUNDS, st.integers(-2000, 2000))
def test_integers(low: float | None, high: float | None, value: int) -> None:
    assert allows(low, high, str(value), whole=True) == is_between(low, high, value)


@pytest.mark.parametrize(("low", "high"), [(7, 7), (0, 9), (3, 17), (95, 105), (-12, 3), (0, 1000)])
def test_every_integer_of_a_range(low: int, high: int) -> None:
    numbers = {
        number for number in range(-1500, 1500) if allows(low, high, str(number), whole=True)
    }
    assert numbers == set(range(low, high + 1))


@given(BOUNDS, BOUNDS, st.floats(allow_nan=False, allow_infinity=False))
def test_floats_near_a_bound(low: float | None, high: float | None, value: float) -> None:
    for near in (value, low, high):
        text = f"{near or 0:.{FRACTION}f}"
        if allows(low, high, text):
            assert is_between(low, high, float(text))


@pytest.mark.parametrize(
    ("low", "high"), [(1e16, None), (None, -1e16), (2.0, 1.0), (1e-30, 2e-30), (1e300, 1e301)]
)
def test_nothing_is_left(low: float | None, high: float | None) -> None:
    assert decimals(low, high) is None


@pytest.mark.parametrize("text", ["007", "+1", "1.", ".5", "1e3", "0x1F", " 1", "", "-", "nan"])
def test_other_spellings(text: str) -> None:
    assert not allows(None, None, text)
    assert not allows(-1e300, None, text)
    assert not allows(None, None, text, whole=True)


def test_the_expressions_stay_short() -> None:
    accepted = decimals(0.123456789, 987654.321)
    assert accepted is not None
    assert len(regular(accepted)) < 1500
    assert allows(None, None, "9" * WHOLE + "." + "9" * FRACTION)
    assert not allows(None, None, "9" * (WHOLE + 1))
