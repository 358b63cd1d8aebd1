"""Our parser and the library TinyXML-2 agree: the same errors on the same lines, the same trees."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.compile.fabric import printed
from gpsfsm.model.engine import Unreadable
from gpsfsm.syntax.tinyxml import parse_document, to_bytes
from tests.syntax.tinyxml.library import Library, Read, missing

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing() or "-")

BOM = b"\xef\xbb\xbf"
REFERENCES = [
    *("&", "&amp;", "&lt;", "&gt;", "&quot;", "&apos;", "&foo;", "&lt", "&#", "&#65;", "&#x41;"),
    *("&#X41;", "&#;", "&#x;", "&#0;", "&#xD800;", "&#1114111;", "&#1114112;", "&#x10FFFF;"),
    *("&#x110000;", "&#x0000041;", "&#00000065;", "&#99999999999;", "&#x10000000000041;"),
    *("&#5000000000;", "#", ";", "x", "6", "\r", "\n", "\r\n", "\n\r", "\t", " ", "a", "é", "日"),
    *("\udc80", "\x01", "'", "<", ">"),
]
PIECES = [
    *REFERENCES,
    *("/", '"', "=", "-", "_", ".", ":", "\x00", "\v", "\f", "\u2028", "\ufeff", "<Plan>"),
    *("</Plan>", "<Plan", "<a>", "</a>", "<a/>", "</a/>", "</b>", "< a>", "</ a>", "<a ", "<b "),
    *('<a b="1"c="2">', '<a b="1" b="2"/>', "<a b='", 'b="&amp;&x"', "<!--", "-->", "<![CDATA["),
    *("]]>", "<!", "<!DOCTYPE a [", "<?xml version='1.0'?>", "<?", "?>", "text"),
]

near_xml = st.lists(st.sampled_from(PIECES), max_size=14).map("".join)
values = st.lists(st.sampled_from(REFERENCES), max_size=12).map(
    lambda pieces: f'<a v="{"".join(pieces)}"/>'
)
texts = st.lists(st.sampled_from(REFERENCES), max_size=12).map(
    lambda pieces: f"<a>{''.join(pieces).replace('<', '')}</a>"
)
trees = st.recursive(
    st.sampled_from(["<a/>", "t ", "<!--c-->", "<![CDATA[z]]>", " \n", "<!U>", '<b x="1"/>']),
    lambda inside: st.builds(
        lambda name, parts: f"<{name}>{''.join(parts)}</{name}>",
        st.sampled_from("ab"),
        st.lists(inside, max_size=4),
    ),
    max_leaves=8,
)


@st.composite
def mutated(draw: st.DrawFn) -> str:
    text = draw(trees)
    for piece in draw(st.lists(st.sampled_from(["", *PIECES]), max_size=2)):
        start = draw(st.integers(0, len(text)))
        text = text[:start] + piece + text[start + draw(st.integers(0, 2)) :]
    return text


@pytest.fixture(scope="module")
def library() -> Library:
    return Library()


def ours(text: str) -> Read:
    document = parse_document(text)
    if isinstance(document, Unreadable):
        return Read(document.name, document.line, b"")
    data = to_bytes(printed(document, *document.roots))
    marked = text.lstrip(" \t\n\v\f\r").startswith("\ufeff")
    return Read("", 0, BOM + data if marked else data)


@given(st.one_of(near_xml, values, texts, trees, mutated(), st.text(max_size=20)))
def test_any_text(library: Library, text: str) -> None:
    assert ours(text) == library.read(to_bytes(text))


@pytest.mark.parametrize("depth", [1, 497, 498, 499, 500, 501, 700])
@pytest.mark.parametrize("inside", ["", " ", "<x/>", "<x>", "t", "\n<!---->"])
@pytest.mark.parametrize("closed", [True, False])
def test_depth(library: Library, depth: int, inside: str, closed: bool) -> None:
    text = "\n<a>" * depth + inside + "</a>" * (depth if closed else 0)
    assert ours(text) == library.read(to_bytes(text))
