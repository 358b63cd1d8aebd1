"""What the engines' parser reads, by rules that are written down here by hand."""

from __future__ import annotations

import pytest

from gpsfsm.errors import InputError
from gpsfsm.model.engine import Content, EngineDocument, EngineElement, Unreadable
from gpsfsm.syntax import Limits
from gpsfsm.syntax.tinyxml import parse_document


def read(text: str) -> EngineDocument:
    document = parse_document(text)
    assert isinstance(document, EngineDocument), document
    return document


def shape(document: EngineDocument) -> list[object]:
    """Elements as [name, …children], other nodes as (kind, value)."""

    def of(index: int) -> object:
        node = document.nodes[index]
        assert node.index == index
        if isinstance(node, Content):
            return (node.kind.value, node.value)
        assert all(document.nodes[child].parent == index for child in node.children)
        return [node.tag, *map(of, node.children)]

    return [of(root) for root in document.roots]


def value(written: str) -> str | None:
    return read(f'<a b="{written}"/>').element(0).text("b")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<a/>", [["a"]]),
        ("<a></a>", [["a"]]),
        ("< a >< b/></a >", [["a", ["b"]]]),
        ("<a> </a>", [["a"]]),
        ("<a> t <b/>u</a>", [["a", ("text", " t "), ["b"], ("text", "u")]]),
        ("<a>1 &lt; 2</a>", [["a", ("text", "1 < 2")]]),
        ("<a/><b/>", [["a"], ["b"]]),
        ("said: <a/>", [("text", "said: "), ["a"]]),
        ("\ufeff<a/>", [["a"]]),
        (" \ufeff<a/>", [["a"]]),
        ("<a/>\0<", [["a"]]),
        ("<a/></b> and whatever < follows", [["a"]]),
        ("<a></a x='1'>", [["a"]]),
        ("<a></b/></a>", [["a", ["b"]]]),
        ("<é/>", [["é"]]),
        ("<!DOCTYPE a><a/>", [("unknown", "DOCTYPE a"), ["a"]]),
        ("<?a?><?b?><a/>", [("declaration", "a"), ("declaration", "b"), ["a"]]),
        ("<!-- a -- b --><a/>", [("comment", " a -- b "), ["a"]]),
        ("<a><![CDATA[<&amp;]]></a>", [["a", ("cdata", "<&amp;")]]),
        ("<!-- only -->", [("comment", " only ")]),
    ],
)
def test_what_is_read(text: str, expected: list[object]) -> None:
    assert shape(read(text)) == expected


@pytest.mark.parametrize(
    ("text", "name", "line", "offset"),
    [
        ("", "XML_ERROR_EMPTY_DOCUMENT", 0, 0),
        (" \n", "XML_ERROR_EMPTY_DOCUMENT", 0, 2),
        ("\0<a/>", "XML_ERROR_EMPTY_DOCUMENT", 0, 0),
        ("prose", "XML_ERROR_PARSING_TEXT", 1, 0),
        ("<a/>\n after", "XML_ERROR_PARSING_TEXT", 2, 6),
        ("<a>t<", "XML_ERROR_PARSING", 1, 4),
        ("<1/>", "XML_ERROR_PARSING", 1, 0),
        ("<a>\n<b></a>", "XML_ERROR_MISMATCHED_ELEMENT", 2, 7),
        ("<a>", "XML_ERROR_MISMATCHED_ELEMENT", 1, 0),
        ("<a> ", "XML_ERROR_PARSING", 1, 0),
        ("<a\n//>", "XML_ERROR_PARSING_ELEMENT", 1, 3),
        ("<a", "XML_ERROR_PARSING_ELEMENT", 1, 2),
        ("<a\nb=1/>", "XML_ERROR_PARSING_ATTRIBUTE", 2, 3),
        ("<a b/>", "XML_ERROR_PARSING_ATTRIBUTE", 1, 3),
        ("<a b='1/>", "XML_ERROR_PARSING_ATTRIBUTE", 1, 3),
        ("<a b='1' b='1'/>", "XML_ERROR_PARSING_ATTRIBUTE", 1, 9),
        ("<a><!-- b</a>", "XML_ERROR_PARSING_COMMENT", 1, 3),
        ("<![CDATA[", "XML_ERROR_PARSING_CDATA", 1, 0),
        ("<!DOCTYPE", "XML_ERROR_PARSING_UNKNOWN", 1, 0),
        ("<!---->\n<?xml?><a/>", "XML_ERROR_PARSING_DECLARATION", 2, 8),
        ("<a><?xml?></a>", "XML_ERROR_PARSING_DECLARATION", 1, 3),
        ("<a>" * 499 + " ", "XML_ELEMENT_DEPTH_EXCEEDED", 1, 3 * 498),
    ],
)
def test_what_is_refused(text: str, name: str, line: int, offset: int) -> None:
    document = parse_document(text)
    assert isinstance(document, Unreadable)
    assert (document.name, document.line, document.offset) == (name, line, offset)
    assert document.message


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("&lt;&gt;&amp;&quot;&apos;", "<>&\"'"),
        ("&text &ltname& &x;", "&text &ltname& &x;"),
        ("&#65;&#x41;&#x00e9;&#20013;", "AAé中"),
        ("a\r\nb\rc\n\rd\n\te", "a\nb\nc\nd\n\te"),
        ("ab&#0;cd", "ab"),
        ("ab&#;cd", "ab"),
        ("&#x110000;&#-1;&#1 2;", "&#x110000;&#-1;&#1 2;"),
        ("&#&#65;.", "A."),
        ("end&#", "end#"),
        # The '&' of what it does not know turns into what stands where the decoded text ends.
        ("&amp;abc&x", "&abc;x"),
    ],
)
def test_values(written: str, read: str) -> None:
    assert value(written) == read


def test_spans_are_those_of_the_source() -> None:
    text = "\n <Plan  a = 'x' b=\"&amp;y\" ><!--c--></Plan>"
    plan = read(text).element(0)
    assert text[plan.start : plan.end] == "<Plan  a = 'x' b=\"&amp;y\" >"
    assert [text[each.start : each.end] for each in plan.attributes] == ["a = 'x'", 'b="&amp;y"']
    comment = read(text).nodes[1]
    assert text[comment.start : comment.end] == "<!--c-->"


def test_hostile_texts_are_bounded() -> None:
    many = "<a/>" * 2000
    with pytest.raises(InputError, match="--max-elements"):
        parse_document(many, Limits(max_elements=100))
    attributes = " ".join(f"a{number}=''" for number in range(300))
    with pytest.raises(InputError, match="--max-attributes"):
        parse_document(f"<a {attributes}/>")
    assert isinstance(parse_document("<a>" * 100_000), Unreadable)


@pytest.mark.parametrize(
    "written",
    [
        "&" * 300_000,
        "&amp;" + "&" * 300_000,
        "&#" * 150_000 + ";",
        "&#" * 100_000 + "z" + "1" * 100_000 + ";",
        "&#x" * 100_000 + "g;",
        "\r" * 300_000,
    ],
)
def test_long_values_are_read_in_linear_time(written: str) -> None:
    # None of these ends within minutes if a value is searched again for each of its references.
    assert isinstance(read(f'<a b="{written}"/>').nodes[0], EngineElement)
