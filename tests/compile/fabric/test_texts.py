"""What engines make of a text as a whole: its root, what is around it, what is wrong with it."""

from __future__ import annotations

import pytest

from gpsfsm.compile.fabric import PROFILES, compile_document
from gpsfsm.model.engine import Crashed, EnginePlan, OptionType, Rejected
from gpsfsm.syntax.tinyxml import parse_document
from tests.compile.fabric.support import NAMES, listed

GO = '<Runner interface="A" provider="A"/>'
CRASH = {"crash": "signal 11"}
UNREADABLE = {1: {"error": "parse"}, 2: {"error": "check_compatibility failed"}}


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(
    "text",
    [
        f"Sure:\n<Plan>{GO}</Plan>",
        f"<?xml version='1.0'?><!DOCTYPE Plan><!-- c --><Plan name='n'>{GO}</Plan>",
        f"<Plan>{GO}</Plan><Plan/><Other/>",
        f"<Plan>{GO}</Plan></Plan> and then",
        f"<Plan>{GO}text<![CDATA[<]]><!-- c --></Plan>",
        f"\ufeff<Plan>{GO}</Plan>\0 not seen",
        '<Plan><Runner interface="A" provider="A"><Runner/>text</Runner></Plan>',
    ],
)
def test_texts_that_hold_the_same_plan(version: int, text: str) -> None:
    assert listed(version, text) == listed(version, f"<Plan>{GO}</Plan>")


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(
    "text", ["<Other/>", "<!-- c -->", "<?x?>", "<p:Plan/>", "<plan/>", "</a>"]
)
def test_without_a_plan_the_engine_crashes(version: int, text: str) -> None:
    assert listed(version, text) == CRASH


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("text", ["", "prose", "```xml\n<Plan/>\n```", "<Plan>", "<Plan/> after"])
def test_texts_that_are_not_read(version: int, text: str) -> None:
    assert listed(version, text) == UNREADABLE[version]


def test_an_element_before_the_plan() -> None:
    text = f"<Other/>\n<Plan>{GO}</Plan>"
    assert listed(2, text) == {"error": "No <Plan> element found.", "rejected": 0}
    assert listed(1, text) == CRASH


def test_a_crash_comes_before_what_is_wrong_later_and_after_what_was_wrong_earlier() -> None:
    crash = '<Control type="recovery"><!-- c --></Control>'
    assert "error" in listed(2, f"<Plan><Bad/>{crash}</Plan>")
    # A control whose children are bad does not end the check.
    bad = '<Control type="recovery"><Bad/></Control>'
    assert listed(2, f"<Plan>{bad}{crash}</Plan>") == CRASH
    assert listed(2, f"<Plan>{bad}{GO}{bad}</Plan>")["rejected"] == 2


@pytest.mark.parametrize(
    ("text", "at"),
    [
        ("<Plan>\n<Runner", "\n<Runner"),
        ('<Plan>\n<Control type="recovery">t</Control></Plan>', "<Control"),
        ("<Plan><Runner/></Plan>", "<Runner"),
        ("<!-- c --><Other/>", "<Other"),
    ],
)
def test_places(text: str, at: str) -> None:
    result = compile_document(parse_document(text), PROFILES["fabric-v2"])
    assert isinstance(result, Rejected | Crashed)
    # A text that ends too early is wrong at its end.
    assert result.offset == (len(text) if at[0] == "\n" else text.index(at))
    assert result.reason


def test_what_connections_come_from() -> None:
    text = f'<Plan>{GO}<Control type="recovery">{GO}</Control></Plan>'
    document = parse_document(text)
    result = compile_document(document, PROFILES["fabric-v2"], plan_id="7")
    assert isinstance(result, EnginePlan)
    assert document.nodes[result.root].tag == "Plan"  # type: ignore[union-attr]
    sources = [(each.source.element, each.control, each.completion) for each in result.connections]
    assert sources == [(1, None, False), (3, None, False), (None, 2, False), (None, None, True)]
    (plan_id,) = result.connections[-1].source.parameters
    assert (plan_id.value, plan_id.type) == ("7", OptionType.STRING)
    assert all(each.on_stop is None for each in result.connections)


def test_parameters_of_both_versions() -> None:
    text = '<Plan><Runner interface="A" id="x" z="1.5" a="2" provider="A"/></Plan>'
    seen = {}
    for version, name in NAMES.items():
        result = compile_document(parse_document(text), PROFILES[name])
        assert isinstance(result, EnginePlan)
        parameters = result.connections[0].source.parameters
        seen[version] = [(each.name, each.text, each.type.name) for each in parameters]
    # The first version keeps texts, and writes the instance over the plan's own id.
    assert seen[1] == [(n, t, "UNCONVERTED") for n, t in (("id", "0"), ("z", "1.5"), ("a", "2"))]
    assert seen[2] == [("id", "x", "STRING"), ("z", "1.500000", "DOUBLE"), ("a", "2", "INT")]
