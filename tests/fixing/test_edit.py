"""Edits, and where offsets go by them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.fixing.fixer import Edit, Fix, apply_edits, apply_to, came_from, compatible


@st.composite
def _edits(draw: st.DrawFn) -> tuple[str, list[Edit]]:
    text = draw(st.text("abcdef", max_size=20))
    cuts = sorted(draw(st.lists(st.integers(0, len(text)), max_size=8, unique=True)))
    edits = [
        Edit(start, end, draw(st.text("XYZ", max_size=3)))
        for start, end in zip(cuts[::2], cuts[1::2], strict=False)
    ]
    return text, edits


@given(_edits())
def test_offsets_follow_what_is_not_edited(written: tuple[str, list[Edit]]) -> None:
    text, edits = written
    after = apply_edits(text, reversed(edits))
    for offset, character in enumerate(text):
        if any(edit.start <= offset < edit.end for edit in edits):
            continue
        moved = apply_to(offset, edits)
        assert after[moved] == character
        assert came_from(moved, edits) == offset
    for edit in edits:
        assert came_from(apply_to(edit.start, edits), edits) <= edit.end


def test_edits_that_overlap_are_refused() -> None:
    with pytest.raises(ValueError, match="overlap"):
        apply_edits("abc", [Edit(0, 2), Edit(1, 3)])


def test_a_fix_that_overlaps_itself_is_left_out() -> None:
    assert compatible([Fix("GP101", "a", 0, (Edit(0, 4), Edit(2, 5)))]) == []


def test_of_fixes_that_overlap_the_first_is_taken() -> None:
    first = Fix("GP101", "a", 0, (Edit(0, 2), Edit(6, 8)))
    second = Fix("GP101", "b", 1, (Edit(4, 7),))
    third = Fix("GP101", "c", 2, (Edit(2, 4), Edit(8, 8, "x")))
    fourth = Fix("GP101", "d", 3, (Edit(8, 9),))
    assert compatible([fourth, third, second, first]) == [first, third]
