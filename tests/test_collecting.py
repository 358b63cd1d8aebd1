"""Python looks for garbage less often for a while, and then as before."""

from __future__ import annotations

import gc

import pytest

from gpsfsm.late import collecting_rarely


@collecting_rarely()
def fail(seen: list[tuple[int, int, int]]) -> None:
    seen.append(gc.get_threshold())
    raise ZeroDivisionError


@pytest.mark.parametrize("before", [(700, 10, 10), (0, 10, 10), (90_000, 5, 5)])
def test_the_thresholds_are_as_before_also_after_an_error(before: tuple[int, int, int]) -> None:
    usual = gc.get_threshold()
    seen: list[tuple[int, int, int]] = []
    gc.set_threshold(*before)
    try:
        with pytest.raises(ZeroDivisionError):
            fail(seen)
        assert gc.get_threshold() == before
    finally:
        gc.set_threshold(*usual)
    # one who has switched it off, or looks even less often, keeps that
    assert seen == [(50_000, 10, 10) if before[0] == 700 else before]


def test_inside_of_itself_it_changes_nothing() -> None:
    usual = gc.get_threshold()
    with collecting_rarely(), collecting_rarely():
        pass
    assert gc.get_threshold() == usual
