"""Positions: held against the code units that Python's own codecs count."""

from __future__ import annotations

import pytest

pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")

from hypothesis import given
from hypothesis import strategies as st
from lsprotocol.types import Position

from gpsfsm.lsp.texts import Encoding, Places
from gpsfsm.syntax.text import Lines
from tests.lsp.client import line_begins

TEXTS = st.text(st.sampled_from("ab<é€😀\u2028\x0b\x85\n\r\t "), max_size=30)
CODECS: dict[Encoding, tuple[str, int]] = {
    "utf-8": ("utf-8", 1),
    "utf-16": ("utf-16-le", 2),
    "utf-32": ("utf-32-le", 4),
}


def units(text: str, encoding: Encoding) -> int:
    codec, size = CODECS[encoding]
    return len(text.encode(codec)) // size


@pytest.mark.parametrize("encoding", list(CODECS))
@given(text=TEXTS)
def test_there_and_back(encoding: Encoding, text: str) -> None:
    places = Places(text, encoding)
    begins = line_begins(text)
    for at in range(len(text) + 1):
        if text[at - 1 : at + 1] == "\r\n":
            continue  # no editor has a place between these two
        line = sum(begin <= at for begin in begins) - 1
        wanted = Position(line, units(text[begins[line] : at], encoding))
        assert places.position(at) == wanted
        assert places.offset(wanted) == at


@given(text=TEXTS)
def test_lines_and_columns_are_those_of_the_front_end(text: str) -> None:
    lines, places = Lines(text), Places(text, "utf-16")
    for at in range(len(text) + 1):
        if text[at - 1 : at + 1] != "\r\n":
            assert places.at(*lines.position(at)) == at


@pytest.mark.parametrize(
    ("line", "character", "wanted"), [(0, 99, 1), (1, 1, 2), (1, 2, 3), (7, 0, 5), (2, 9, 5)]
)
def test_places_that_are_none_become_the_nearest(line: int, character: int, wanted: int) -> None:
    assert Places("a\n😀\nb", "utf-16").offset(Position(line, character)) == wanted
