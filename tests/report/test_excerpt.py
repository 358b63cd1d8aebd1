from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.report._words import excerpt, split_lines

ANY_LINE = st.text(st.characters(codec=None, exclude_categories=()), max_size=300)


def columns(text: str) -> int:
    """Terminal columns of text without control characters, counted naively."""
    wide = sum(unicodedata.east_asian_width(c) in ("W", "F") for c in text)
    zero = sum(unicodedata.category(c) in ("Mn", "Me") or c in "\u200c\u200d" for c in text)
    return len(text) + wide - zero


def show(line: str, column: int, length: int = 0, limit: int = 60) -> str:
    lines = excerpt(line, column, length=length, limit=limit)
    return f"{lines.text}\n{' ' * lines.offset}{'^' * lines.carets}"


@pytest.mark.parametrize(
    ("line", "column", "length", "expected"),
    [
        ("<Plan/>", 1, 5, "<Plan/>\n^^^^^"),
        ("<Plan/>", 2, 0, "<Plan/>\n ^"),
        ("\t\t<Plan/>", 3, 5, "        <Plan/>\n        ^^^^^"),
        ("a\tb", 2, 1, "a    b\n ^^^^"),
        ("世界x", 3, 1, "世界x\n    ^"),
        ("世界x", 1, 2, "世界x\n^^^^"),
        ("e\u0301x", 3, 1, "e\u0301x\n ^"),
        ("\x1b[0mx", 5, 1, "\\x1b[0mx\n       ^"),
        ("\x00", 1, 1, "\\x00\n^^^^"),
        ("ab", 9, 4, "ab\n  ^"),
        ("", 1, 1, "\n^"),
        ("ab  ", 1, 9, "ab\n^^^^"),
    ],
)
def test_carets_stand_under_the_place(line: str, column: int, length: int, expected: str) -> None:
    assert show(line, column, length) == expected


def test_a_long_line_is_clipped_behind_the_place() -> None:
    assert show("<Plan>" + "x" * 100, 2, 4, limit=20) == "<Plan>xxxxxxxxxxxx…\n ^^^^"


def test_a_long_line_is_clipped_on_both_sides() -> None:
    assert show("a" * 50 + "<b>" + "c" * 50, 51, 3, limit=20) == (
        "…aaaaaa<b>ccccccccc…\n       ^^^"
    )


def test_a_long_line_is_clipped_before_the_place() -> None:
    assert show("a" * 50 + "<b>", 51, 3, limit=20) == "…aaaaaa<b>\n       ^^^"


def test_a_line_that_fits_exactly_is_not_clipped() -> None:
    assert "…" not in show("a" * 20, 20, 1, limit=20)
    assert "…" in show("a" * 21, 1, 1, limit=20)


def test_an_underline_ends_where_the_line_is_clipped() -> None:
    lines = excerpt("x" * 1000, 1, length=900, limit=20)
    assert lines.carets == 18


@given(ANY_LINE, st.integers(-3, 400), st.integers(-1, 400), st.integers(36, 116))
def test_any_line_fits_its_limit(line: str, column: int, length: int, limit: int) -> None:
    lines = excerpt(line, column, length=length, limit=limit)
    assert columns(lines.text) <= limit
    assert 0 <= lines.offset <= limit
    assert 1 <= lines.carets <= limit
    assert not any(ord(c) < 0x20 or 0x7F <= ord(c) < 0xA0 for c in lines.text)
    lines.text.encode()


@given(st.text("ab\t世e\u0301\x1b", max_size=200), st.data())
def test_the_caret_is_under_the_character(line: str, data: st.DataObject) -> None:
    line += "#"  # the only one: where it is shown can be seen
    place = len(line)
    line += data.draw(st.text("ab\t世", max_size=200))
    lines = excerpt(line, place, length=1, limit=60)
    assert columns(lines.text[: lines.text.index("#")]) == lines.offset
    assert lines.carets == 1


GO = (
    '        <Runner interface="nav2_capabilities/WaypointRunner"'
    ' provider="nav2_capabilities/WaypointRunner" x="1.0" y="2.0"/>'
)
OTHER = GO.replace('provider="nav2_capabilities', 'provider="our_capabilities')
SAY = (
    '<Runner interface="demo/SpeechRunner" provider="demo/SpeechRunner"'
    ' text="Please step aside, the robot has to get past you to the door." voice="low"/>'
)


@pytest.mark.parametrize(
    ("line", "marked", "limit", "expected"),
    [
        (GO, "<Runner", 200, GO),
        (GO, "<Runner", 116, GO.strip()),
        (
            *(GO, "<Runner", 100),
            '<Runner interface="nav2_capabilities/WaypointRunner" … x="1.0" y="2.0"/>',
        ),
        (GO, "<Runner", 60, '<Runner interface="…/WaypointRunner" … x="1.0" y="2.0"/>'),
        (
            *(OTHER, "<Runner", 100),
            '<Runner interface="…/WaypointRunner" provider="…/WaypointRunner" x="1.0" y="2.0"/>',
        ),
        (OTHER, "<Runner", 60, '<Runner interface="…/WaypointRunner" … x="1.0" y="2.0"/>'),
        (
            *(GO, "provider", 90),
            '<Runner interface="…/WaypointRunner" provider="…/WaypointRunner" x="1.0" y="2.0"/>',
        ),
        (
            *(GO, '"nav2_capabilities/WaypointRunner"', 90),
            '<Runner interface="nav2_capabilities/WaypointRunner" … x="1.0" y="2.0"/>',
        ),
        (
            *(SAY, "<Runner", 100),
            '<Runner interface="…/SpeechRunner" … text="Please step aside, the r…to the door."'
            ' voice="low"/>',
        ),
    ],
)
def test_a_long_runner_loses_what_is_the_same_everywhere(
    line: str, marked: str, limit: int, expected: str
) -> None:
    lines = excerpt(line, line.index(marked) + 1, length=len(marked), limit=limit)
    assert lines.text == expected
    assert lines.text[lines.offset : lines.offset + lines.carets] == marked


NAMES = st.sampled_from(["interface", "provider", "x", "text"])
VALUES = st.one_of(
    st.sampled_from(["nav2_capabilities/WaypointRunner", "a/b", "1.0", "/", "", "a 'b/c' d"]),
    st.text("ab/ ", max_size=80),
)
TAGS = st.builds(
    lambda before, pairs: f"{before}<Runner{''.join(pairs)}/>",
    st.sampled_from(["", " ", "        ", "<Plan> ", "interface="]),
    st.lists(st.builds(' {}="{}"'.format, NAMES, VALUES), max_size=6),
)


@given(TAGS, st.data())
def test_above_the_carets_stands_what_they_mark(line: str, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(line) - 1))
    length = data.draw(st.integers(1, len(line) - start))
    lines = excerpt(line, start + 1, length=length, limit=data.draw(st.integers(36, 116)))
    above = lines.text[lines.offset : lines.offset + lines.carets]
    marked = line[start : start + length]
    assert marked.startswith(above)
    cut_off = lines.text.endswith("…") and lines.offset + lines.carets == len(lines.text) - 1
    assert lines.carets == length or cut_off or not marked[len(above) :].strip()


def test_a_huge_line_takes_no_time() -> None:
    line = "\u0301" * 5_000_000
    assert len(excerpt(line, 2_500_000, length=1_000_000, limit=100).text) <= 202


def test_lines_end_as_locations_count_them() -> None:
    assert split_lines("a\nb\r\nc\rd\u2028e\x0bf\n") == ["a", "b", "c", "d\u2028e\x0bf", ""]
