"""The gist of answers that nothing can mend."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.grading.plan_gist import gist_of
from gpsfsm.syntax import parse


def shape(inside: str) -> str:
    """The gist of a plan, short: ``1,2`` is a drive, ``r[…]`` a recovery, ``s[…]`` a sequence."""
    text = gist_of(f"Here:<Plan ID='Main'>{inside}</Plan>")
    if not text:
        return ""
    assert parse(text).plan is not None
    text = re.sub(r'\s*<Runner [^>]* x="([^"]*)" y="([^"]*)" />\s*', r"\1,\2 ", text)
    text = re.sub(r'<Control type="(.)[^"]*">\s*', r"\1[", text).replace("</Control>", "] ")
    return " ".join(text.removeprefix("<Plan>").removesuffix("</Plan>\n").split()).replace(
        " ]", "]"
    )


@pytest.mark.parametrize(
    ("inside", "gist"),
    [
        ('<Go x="1" y="-2.5"/>', "1,-2.5"),
        ('<Go goal="1;2"/><Go goal="(3.0, .5)"/><Go goal="5 6"/>', "1,2 3.0,.5 5,6"),
        ('<Go goal="1;2;3"/><Go x="1" y=" 2"/><Go goalX="1" goalY="2"/>', "1,2 1,2 1,2"),
        ('<Go>(1, 2)</Go><Go goal="x: 1, y: 2;"/><Go ID="to [1,2]!"/>', "1,2 1,2 1,2"),
        ('<Go goal="1;2" turn="0 0 0 1"/><Go goal="1;2" ID="from (3, 4)"/>', "1,2 1,2"),
        ('<Say at="1;2"/><Log name="at (1, 2)"/><Go msg="go to (1, 2)"/><Go/>', ""),
        ('<Go at="1;2" to="3;4"/><Go ID="from (1, 2) to (3, 4)"/><Go x="1" z="2"/>', ""),
        ('<SetBlackboard output_key="k" value="1;2"/><Go to="{k}"/><Go to="{j}"/>', "1,2"),
        ('<IsThere goal="1;2"/><NavPreCheck goal="1;2"/><Island goal="1;2"/>', "1,2"),
        ('<Retry n="3"><Sequence><Go at="1;2"/></Sequence></Retry>', "s[s[1,2]]"),
        ('<Fallback><Go at="1;2"/><Go at="3;4"/><Say/></Fallback>', "s[1,2] r[s[3,4]]"),
        ('<Fallback><Say/><Go at="3;4"/></Fallback>', "s[3,4]"),
        ('<Control type="recovery"><Go at="1;2"/></Control>', "r[1,2]"),
        ('<Go at="1;2"><!-- a leaf all the same --></Go>', "1,2"),
        ('<Go at="1;2"/><Go at=3;4/>', "1,2"),
        ('<Control type="recovery"><Go at="1;2"/></Cntrol><Go at="3;4"/>', "r[1,2] 3,4"),
        ('</Cntrol><Go at="3;4"/>', "3,4"),
        ("nothing", ""),
    ],
)
def test_what_counts(inside: str, gist: str) -> None:
    assert shape(inside) == gist


def test_the_last_plan_counts() -> None:
    assert 'x="3"' in gist_of('<Plan><Go at="1;2"/></Plan> or <Plan><Go at="3;4"/></Plan>')
    assert gist_of('<Root><Go at="1;2"/></Root>') == ""


def test_deep_nesting_is_left_out() -> None:
    assert shape("<Fallback>" * 200 + '<Go at="1;2"/>' + "</Fallback>" * 200) == ""


PIECES = [
    "<Plan>",
    "</Plan>",
    "<A>",
    "</A>",
    '<G at="1;2"/>',
    "<Fallback>",
    "</",
    "&x;",
    "\0",
    "<!--",
]


@given(st.lists(st.sampled_from(PIECES), max_size=25).map("".join))
def test_no_text_breaks_it(text: str) -> None:
    assert gist_of(text) == "" or parse(gist_of(text)).plan is not None


@pytest.mark.parametrize(
    ("end", "counts"),
    [
        ('<Go x="1" y="2" /', True),
        ('<Go x="1" y="2"', True),
        ("<Go x='1' y='2'\n", True),
        ('<Go x="1" y="2', False),
        ('<Go x="1" y=', False),
        ('<Go x="1" y="2" z', True),
        ('<Go x="1" y="2" z =', True),
        ('<Go x="1" y="2" = z', False),
        ('<Go x=1 y="2" /', False),
    ],
)
def test_an_answer_that_ends_within_its_last_tag(end: str, counts: bool) -> None:
    assert ('x="1" y="2"' in gist_of(f"<Plan>{end}")) is counts
