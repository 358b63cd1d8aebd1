from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.model.printable import clip, printable

ANY_TEXT = st.text(st.characters(codec=None, exclude_categories=()))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("plain", "plain"),
        ("世界 é 👍", "世界 é 👍"),
        ("no\u00a0break", "no\u00a0break"),
        ("\x1b[31m", r"\x1b[31m"),
        ("\x9b31m", r"\x9b31m"),
        ("a\nb\tc\r", r"a\x0ab\x09c\x0d"),
        ("\u202eevil", r"\u202eevil"),
        ("\u2066\u2028\ufeff", r"\u2066\u2028\ufeff"),
        ("\ud800", r"\ud800"),
        ("\U000e0041", r"\U000e0041"),
        ("👨\u200d👩", "👨\u200d👩"),
    ],
)
def test_what_is_escaped(text: str, expected: str) -> None:
    assert printable(text) == expected


@given(ANY_TEXT)
def test_the_result_is_printable_and_can_be_encoded(text: str) -> None:
    shown = printable(text)
    shown.encode()
    assert printable(shown) == shown
    assert not any(ord(character) < 0x20 or 0x7F <= ord(character) < 0xA0 for character in shown)


def test_clip_counts_before_it_escapes() -> None:
    assert clip("abcdef", 6) == "abcdef"
    assert clip("abcdef", 4) == "abc…"
    assert clip("\x00" * 9, 3) == r"\x00\x00…"
