"""The fast reader and the scanner say the same of each text that the fast reader accepts."""

from __future__ import annotations

import pickle
from copy import copy
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.model.plan import Element
from gpsfsm.syntax import DEFAULT_LIMITS, Limits, Parsed, frontend, parse
from gpsfsm.syntax.plain import read_plain
from gpsfsm.syntax.text import Lines
from tests.conftest import REPO
from tests.syntax.support import GO
from tests.syntax.test_agreement import PIECES

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.model.plan import Plan

SAY = "<Runner interface='say/Say' provider=\"say/Say\"\n\ttext = 'a &amp; b'  />"
PLANS = [
    f"<Plan>{GO}</Plan>",
    '<?xml version="1.0" encoding="UTF-8"?>\r\n<!-- hi -->\r\n<Plan name="é">\r\n'
    f'  {GO}\r\n\t<Control type="recovery">{GO}{GO}<!-- c --></Control>\r\n</Plan>\r\n',
    f"<Plan>\n<!-- gpsfsm: ignore GP302 because {GO} is safe -->\n"
    f'<Control type="sequential"\n  name="&lt;n&#65;">\n\n{GO}</Control >'
    f"<!-- gpsfsm: ignore GP303 -->\n</Plan>\n<!-- gpsfsm: ignore -->",
    "<Plan ><Runner interface='a/B' provider='a/B'\n x='1'\ny='2' text='1, 2'></Runner></Plan>",
    f'<Plan><Control type="parallel_all">{GO}<Control type="recovery">{GO}</Control></Control>'
    '<Runner text="&quot;1&#44; 2&quot;" interface="a/B" provider="c/D"/></Plan>',
    f"<Plan>{SAY}</Plan>",
]
MORE = [
    *PIECES,
    *(GO, SAY, "Runner", "recovery", "<Runner ", "</Runner>", "</Control>", "\r\n", "'", '"1,2"'),
    *('<Control type="recovery">', "<!-- gpsfsm: ignore GP302 -->", "<!-- c -->", "1 2", "&#44;"),
    *('interface="x"', 'name="CompletionRunner"', "CompletionRunner", "a/CompletionRunner", "\x85"),
]


def content(parsed: Parsed) -> list[Any]:
    """All that is read of a text, without what is looked up by its identity only."""
    parts = [getattr(parsed, each.name) for each in fields(parsed) if each.name != "plan"]
    return [*parts, parsed.plan and everything(parsed.plan)]


def everything(plan: Plan) -> list[Any]:
    names = [each.name for each in fields(Element) if each.name != "written"]
    elements = [*plan.elements, plan.dropped_completion]
    # Text, because nan is not equal to itself.
    return [plan.file, *([repr(getattr(e, n)) for n in names] if e else e for e in elements)]


def careful(text: str | bytes, limits: Limits = DEFAULT_LIMITS) -> Parsed:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frontend, "read_plain", lambda *_: None)
        return parse(text, limits=limits)


def is_plain(text: str, limits: Limits = DEFAULT_LIMITS) -> bool:
    return read_plain(Lines(text).text, "", limits) is not None


def check(text: str | bytes, limits: Limits = DEFAULT_LIMITS) -> None:
    assert content(parse(text, limits=limits)) == content(careful(text, limits))


@st.composite
def mutated(draw: st.DrawFn) -> str:
    text = draw(st.sampled_from(PLANS))
    for _ in range(draw(st.integers(0, 3))):
        start = draw(st.integers(0, len(text)))
        piece = draw(st.sampled_from(["", *MORE]))
        text = text[:start] + piece + text[start + draw(st.integers(0, 6)) :]
    return text


@given(mutated())
@example('<Plan><Runner interface="a" provider="b"/>"junk</Plan>')
@example('<Plan><Runner interface="a" provider="b" x="1&#44;2"/></Plan>')
@example('<Plan><Runner interface="a" provider="b" x="1\t2"/></Plan>')
@example("<Plan><Runner interface='a' provider='b' x='1,2'/></Plan>")
@example('<Plan><Runner interface="a" provider="b"/><!-- a -- b --></Plan>')
@example('<Plan><Runner interface="a" provider="b"/><!--></Plan>')
@example('<Plan><Runner interface="&#32;" provider="b"/></Plan>')
@example('<Plan><Runner interface="a" provider="b"><Runner interface="a" provider="b"/></Plan>')
@example('<Plan></Plan><Plan><Runner interface="a" provider="b"/></Plan>')
def test_mutated_plans_are_read_alike(text):
    check(text)


_forests = st.recursive(
    st.sampled_from([GO, SAY, GO.replace("/>", "></Runner>"), GO.replace('"', "'"), "<!-- c -->"]),
    lambda inside: st.builds(
        "<Control type={}>{}</Control>".format,
        st.sampled_from(['"recovery"', "'parallel_all'", '"sequential" name="n"']),
        st.lists(inside, max_size=4).map("".join),
    ),
)


@given(
    st.lists(_forests, min_size=1, max_size=5),
    st.sampled_from(["", "\n", "\r\n", "\r", "\n\t", "\n    ", " "]),
    st.integers(1, 5),
    st.integers(1, 8),
)
def test_generated_plans_are_read_alike_within_any_limits(forests, between, depth, elements):
    text = f"<Plan>{''.join(forests)}</Plan>".replace("><", f">{between}<")
    check(text)
    check(text, Limits(max_depth=depth, max_elements=elements))
    check(text, Limits(max_attributes=depth, max_attribute_length=10 * elements))


@pytest.mark.parametrize("text", PLANS[:5])
def test_usual_plans_are_plain(text):
    assert is_plain(text), "this test compares nothing otherwise"
    check(text)
    check(text.replace("\n", "\r\n").encode("utf-16"))


@pytest.mark.parametrize("text", ["<Plan/>", f"<Plan>{GO}", f"<Plan>{GO}{GO[:-2]}</Plan>", SAY, ""])
def test_what_is_to_be_reported_is_not_plain(text):
    assert not is_plain(text)
    assert parse(text).problems


def test_our_plans_are_read_alike():
    compare_all(REPO / "corpus")


def test_real_plans_are_read_alike(shared_corpus):
    compare_all(shared_corpus)


def compare_all(folder: Path) -> None:
    files = sorted(folder.rglob("*.xml"))
    plain = 0
    for file in files:
        data = file.read_bytes()
        check(data)
        plain += is_plain(parse(data).text)
    assert plain > len(files) // 5


def test_attributes_are_made_when_they_are_asked_for():
    """Copies, pickles and replacements of an element have them, asked for or not."""

    def runner() -> Element:
        return parse(two).plan.elements[1]

    two = f"<Plan>{GO}{GO}</Plan>"
    expected = careful(two).plan.elements[1].attributes
    assert runner().written is not None
    assert runner().attributes == expected
    assert copy(runner()).attributes == expected
    assert pickle.loads(pickle.dumps(runner())).attributes == expected  # noqa: S301
    assert replace(runner(), ordinal=7).attributes == expected
    element = runner()
    assert element.text("x") == "1.5"
    assert element.written is None
    with pytest.raises(AttributeError, match="no attribute 'colour'"):
        element.colour  # noqa: B018


@pytest.mark.parametrize(
    "text",
    [
        "<Plan>" + "<" * 200_000,
        "<Plan>" + "<!--" * 100_000,
        "<Plan>" + "<!-- < -->" * 100_000,
        "<Plan>" + '"' * 400_000,
        "<Plan" + " " * 400_000 + ">",
        '<Plan x="' + "1," * 200_000,
        '<Plan x="' + " " * 400_000,
        "<Plan>" + '="1' * 130_000,
        "<Plan>" + 'a="1 1"' * 60_000,
        "<Plan>" + "<Runner" + ' a="1"' * 60_000,
        "<Plan>" + "&" * 400_000,
    ],
    ids=lambda text: text[6:20],
)
def test_hostile_texts_are_left_to_the_scanner(text):
    """How their time grows with their size is measured in benchmarks/reading.py."""
    assert read_plain(text, "", DEFAULT_LIMITS) is None
