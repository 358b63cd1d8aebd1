"""The scanner and lxml agree on what is well-formed, and on what the attributes say."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st
from lxml import etree

from gpsfsm.syntax import DEFAULT_LIMITS, parse
from gpsfsm.syntax.frontend import well_formedness_fault
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.text import ILLEGAL, Lines
from gpsfsm.syntax.token_reader import Collector
from gpsfsm.syntax.tree import TreeBuilder
from tests.syntax.support import GO

PIECES = [
    *("<", ">", "/", '"', "'", "=", "&", "&lt;", "&#65;", "&#x1F600;", "&#0;", "&x;", ";", "-"),
    *("--", "-->", "<!--", "<!", "<?", "?>", "?", "<![CDATA[", "]]>", "]", " ", "\n", "\t", "\r"),
    *("é", "\u00a0", "\x00", "\x0b", "\ufffe", "\U0001f600", "\ufeff", "a", "b", "1", ".", "#"),
    *("<a>", "</a>", "<a/>", '<a b="1">', '<a b="1" b="2"/>', "Plan", "<Plan>", "</Plan>"),
    *("<Plan/>", "Control", "xml", "<1>", "a:b", 'xmlns:a="u"', 'standalone="yes"'),
    *('<?xml version="1.0"?>', '<?xml version="1.0" encoding="UTF-8"?>', "<?xml", 'x="1"'),
]
PLANS = [
    '<?xml version="1.0" encoding="UTF-8"?>\n<!-- hi -->\n<Plan name="é">\n'
    f'{GO}\n<Control type="recovery">{GO}<!-- c --></Control>\n<?p q?><![CDATA[ ]]></Plan>\n',
    f"<Plan>{GO}</Plan>",
    '<Plan xmlns:a="u"><a:b a:c="1"/>text &amp; more</Plan>',
    "<Plan xmlns=''><a t='&lt;\n&#10;\t&apos;'/></Plan>",
]

near_xml = st.lists(st.sampled_from(PIECES), max_size=12).map("".join)
edits = st.lists(
    st.tuples(st.integers(0, 400), st.integers(0, 6), st.sampled_from(["", *PIECES])), max_size=3
)


@st.composite
def mutated_plans(draw: st.DrawFn) -> str:
    text = draw(st.sampled_from(PLANS))
    for place, length, piece in draw(edits):
        start = place % (len(text) + 1)
        text = text[:start] + piece + text[start + length :]
    return text


def scanner_accepts(text: str) -> bool:
    if ILLEGAL.search(text):
        return False
    builder = TreeBuilder(text, "", DEFAULT_LIMITS, Collector(Lines(text), 10))
    builder.build(scan(text, DEFAULT_LIMITS))
    return not builder.broken


def lxml_reads(text: str) -> etree._Element | None:
    parser = etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True)
    try:
        return etree.fromstring(text.encode("utf-8", "surrogatepass"), parser)
    except etree.XMLSyntaxError:
        return None


def odd_namespace(text: str) -> bool:
    """Where a namespace is declared in a way that only lxml judges: by the URI, say."""
    return "xmlns" in text or "xml:" in text


def check(text: str) -> None:
    text = text.removeprefix("\ufeff")
    root = lxml_reads(text)
    accepted = scanner_accepts(text)
    assert not (root is not None and not accepted), "the scanner refuses what lxml accepts"
    if not odd_namespace(text):
        assert accepted == (root is not None), "the scanner accepts what lxml refuses"
    parsed = parse(text)
    reported = {problem.rule for problem in parsed.problems}
    if root is None:
        assert reported & {"GP101", "GP102", "GP104", "GP105", "GP108", "GP110", "GP114", "GP116"}
    else:
        assert not reported & {"GP101", "GP102", "GP110", "GP116"}
        same_attributes(text, root)


def same_attributes(text: str, root: etree._Element) -> None:
    plan = parse(text).plan
    if plan is None:
        return
    ours = [
        {a.name: a.text for a in element.attributes if ":" not in a.name}
        for element in (*plan.elements, *filter(None, [plan.dropped_completion]))
    ]
    entries = [e for e in root.iter() if e.tag in ("Plan", "Control", "Runner")]
    theirs = [
        {str(k): str(v) for k, v in e.attrib.items() if not str(k).startswith("{")}
        for e in entries
        if not any(ancestor.tag == "Runner" for ancestor in e.iterancestors())
    ]
    assert ours == theirs


@given(near_xml)
@example("<a><!--></a>")
@example("<a>]]></a>")
@example('<a b="1"/ >')
@example("<?xml?><a/>")
@example("<a/>&#32;")
@example("<a></a b>")
@example("<a b='&#x110000;'/>")
def test_random_texts(text):
    check(text)


@given(st.lists(st.sampled_from(PIECES), max_size=6).map("".join))
def test_random_content(text):
    check(f"<a>{text}</a>")


@given(st.lists(st.sampled_from(PIECES), max_size=6).map("".join))
def test_random_attributes(text):
    check(f"<Plan {text}/>")


@given(mutated_plans())
def test_mutated_plans(text):
    if "<!DOCTYPE" not in text:
        check(text)


@given(mutated_plans())
def test_places_are_inside_the_text(text):
    parsed = parse(text)
    lines = parsed.text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    places = []
    for problem in parsed.problems:
        line, column = problem.location.line, problem.location.column
        assert 1 <= line <= len(lines)
        assert 1 <= column <= len(lines[line - 1]) + 1
        assert column - 1 + problem.length <= len(lines[line - 1])
        assert problem.message
        assert problem.hint
        places.append((line, column))
    assert places == sorted(places)


def test_the_authority_itself_refuses():
    assert well_formedness_fault("<Plan/>") is None
    for text in (
        "<Plan>",
        '<Plan xmlns:xmlns="u"/>',
        "<Plan xmlns:k='a b' xml:space='odd'/>",
        "<Plan a='&x;'/>",
    ):
        assert well_formedness_fault(text) is not None
