"""Lines and columns count code points, whatever the line ends."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.syntax import parse
from gpsfsm.syntax.text import Lines
from tests.syntax.support import the_only, underlined


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends(end):
    text = end.join(["<Plan>", "", '\t<Runner interface="a"', '  provider="b" x="&"/>', "</Plan>"])
    parsed = parse(text)
    (problem,) = parsed.problems
    assert (problem.location.line, problem.location.column) == (4, 19)
    assert underlined(parsed, problem) == "&"
    assert parsed.plan is not None
    runner = parsed.plan.runners[0]
    assert (runner.line, runner.column) == (3, 2)
    assert [(a.line, a.column) for a in runner.attributes] == [(3, 10), (4, 3), (4, 16)]
    assert text[runner.start : runner.end].startswith("<Runner")


@pytest.mark.parametrize("before", ["é", "\U0001f600", "e\u0301", "\t", "日本"])
def test_columns_count_code_points(before):
    text = f'<Plan><Runner interface="a{before}" provider="&"/></Plan>'
    problem = the_only(text)
    assert problem.location.column == text.index("&") + 1


def test_a_byte_order_mark_takes_no_column():
    problem = the_only(b'\xef\xbb\xbf<Plan><Runner interface="a"/></Plan>')
    assert (problem.location.line, problem.location.column) == (1, 7)


def test_an_underline_ends_with_its_line():
    parsed = parse('<Plan>\n<Runner interface="a"\n provider="b" goal="1,\n2"/></Plan>')
    (problem,) = parsed.problems
    assert underlined(parsed, problem) == 'goal="1,'


@given(st.text("ab\n\r\u00e9", max_size=40), st.integers(0, 40))
def test_lines_agree_with_counting(text, offset):
    offset = min(offset, len(text))
    if text[offset - 1 : offset + 1] == "\r\n":
        offset += 1
    lines = (text[:offset] + "|").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    assert Lines(text).position(offset) == (len(lines), len(lines[-1]))


@given(st.lists(st.integers(0, 30_000), min_size=1, max_size=20))
def test_positions_may_be_asked_in_any_order(offsets):
    text = ("x" * 5000 + "\n") * 3 + "\n" * 9000 + "y" * 6000
    lines = Lines(text)
    for offset in offsets:
        assert lines.position(offset) == (
            text.count("\n", 0, offset) + 1,
            offset - text.rfind("\n", 0, offset),
        )
        line, column = lines.position(offset)
        assert lines.offset(line, column) == offset
