"""What is at a place of a half-written text: ``|`` is the cursor."""

from __future__ import annotations

import pytest

pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.lsp.session import is_plan
from gpsfsm.lsp.texts import Cursor, Where, cursor_at, tag_around

RUNNER = '<Runner interface="a/A" provider="a/B" x="1"/>'


def at(marked: str) -> Cursor:
    text = marked.replace("|", "", 1)
    return cursor_at(text, marked.index("|"))


@pytest.mark.parametrize(
    ("marked", "where", "replaced", "around"),
    [
        ("|", Where.CONTENT, "", ()),
        ("<|", Where.TAG, "", ()),
        ("<Pl|an>", Where.TAG, "Plan", ()),
        ("<Plan>|", Where.CONTENT, "", ("Plan",)),
        ("<Plan>\n  <|", Where.TAG, "", ("Plan",)),
        ("<Plan>\n  <Ru|\n</Plan>", Where.TAG, "Ru", ("Plan",)),
        ("<Plan></|", Where.END_TAG, "", ("Plan",)),
        ("<Plan></Pl|", Where.END_TAG, "Pl", ("Plan",)),
        ("<Plan></Plan>|", Where.CONTENT, "", ()),
        ('<Plan><Control type="|', Where.VALUE, "", ("Plan",)),
        ('<Plan><Control type="rec|"></Control></Plan>', Where.VALUE, "rec", ("Plan",)),
        ("<Plan><Control type='rec|overy'>", Where.VALUE, "recovery", ("Plan",)),
        ("<Plan><Control |", Where.NAME, "", ("Plan",)),
        ("<Plan><Control ty|pe=", Where.NAME, "type", ("Plan",)),
        ("<Plan><Control type=|", Where.OUTSIDE, "", ("Plan",)),
        ('<Plan><Control type="recovery">|', Where.CONTENT, "", ("Plan", "Control")),
        (f"<Plan>{RUNNER}|", Where.CONTENT, "", ("Plan",)),
        ("<Plan><Runner |\n<Runner/></Plan>", Where.NAME, "", ("Plan",)),
        ('<Plan><Runner interface="a/A|\n<Runner/></Plan>', Where.VALUE, "a/A", ("Plan",)),
        ('<Plan><Runner interface="a|  \n</Plan>', Where.VALUE, "a", ("Plan",)),
        ('<Plan><Runner interface="a| provider="p"/>', Where.VALUE, "a", ("Plan",)),
        ('<Plan><Runner text="a\nb| c"/>', Where.VALUE, "b", ("Plan",)),
        ('<Plan><Runner text="a | b"/>', Where.VALUE, "a  b", ("Plan",)),
        ('<Plan><Control type="recovery" na|', Where.NAME, "na", ("Plan",)),
        ('<Plan><Control type="recovery"|', Where.OUTSIDE, "", ("Plan",)),
        ("<a><b><c></a>|", Where.CONTENT, "", ()),
        ("<Plan><a><b></a></b>|", Where.CONTENT, "", ("Plan",)),
        ("<Plan><Control type= |>", Where.OUTSIDE, "", ("Plan",)),
        ("<Plan><Control type= x|>", Where.OUTSIDE, "", ("Plan",)),
        ("<Plan><Runner /|>", Where.OUTSIDE, "", ("Plan",)),
        ("<Plan><Runner / |>", Where.OUTSIDE, "", ("Plan",)),
        ("<Plan><!-- <Runner | -->", Where.OUTSIDE, "", ("Plan",)),
        ("<Plan><!-- <Control> -->|", Where.CONTENT, "", ("Plan",)),
        ("<Plan><!-- |", Where.OUTSIDE, "", ("Plan",)),
        ("<?xml version='1.0'?><Plan>|", Where.CONTENT, "", ("Plan",)),
        ("<Plan><![CDATA[<|]]>", Where.OUTSIDE, "", ("Plan",)),
        ("<Plan><Runner <Control>|", Where.CONTENT, "", ("Plan", "Control")),
        ("<Plan></Control>|", Where.CONTENT, "", ("Plan",)),
    ],
)
def test_what_is_there(marked: str, where: Where, replaced: str, around: tuple[str, ...]) -> None:
    position = at(marked)
    text = marked.replace("|", "", 1)
    assert (position.where, text[position.start : position.end], position.open) == (
        where,
        replaced,
        around,
    )


def test_the_tag_and_its_attributes_also_those_behind_the_cursor() -> None:
    position = at('<Plan><Runner interface="a/A&amp;B" | provider="p/P" x="1"/>')
    assert position.tag is not None
    values = {name: position.tag.value(name) for name in position.tag.attributes}
    assert values == {"interface": "a/A&B", "provider": "p/P", "x": "1"}
    assert position.attribute is None


def test_a_missing_quotation_mark_spoils_no_tag_but_its_own() -> None:
    position = at('<Plan><Runner interface="a/A/>\n<Runner interface="|"/></Plan>')
    assert position.where is Where.VALUE
    assert position.tag is not None
    assert position.tag.value("interface") == ""


@given(
    text=st.text(st.sampled_from("<>/\"'= !-?[]PlanRC\n"), max_size=40),
    offset=st.integers(0, 40),
)
def test_any_text_has_something_everywhere(text: str, offset: int) -> None:
    offset = min(offset, len(text))
    cursor = cursor_at(text, offset)
    assert 0 <= cursor.start <= offset <= max(cursor.end, offset) <= len(text)
    assert cursor.start <= cursor.end


def test_the_tag_around_a_place() -> None:
    text = "<Plan>\n  <Runner x='1'/>\n</Plan>"
    assert tag_around(text, text.index("x=")) == text.index("<Runner")
    assert tag_around(text, text.index("</Plan>")) is None
    assert tag_around("no tag", 3) is None


@pytest.mark.parametrize(
    "part",
    ["<?", "<!--", "<!", "<![CDATA[", "<a>", "</b>", "<a ", 'a="', "a ", "a", "=", "'", "<", " "],
)
@pytest.mark.parametrize("before", ["", "<Plan><Runner "])
def test_no_text_takes_long(before: str, part: str) -> None:
    """It would take minutes if any of these looked at the rest of the text for each part of it."""
    text = before + part * 40_000
    assert is_plan(text) == (before != "")
    assert cursor_at(text, len(text)).end <= len(text)
    assert tag_around(text, len(text)) is None


def test_closing_what_is_not_open_is_quick() -> None:
    text = "<Plan>" + "<a>" * 50_000 + "</b>" * 50_000
    assert len(cursor_at(text, len(text)).open) == 50_001
