"""The kind of a text: under every disguise the same; what is none of them is named by its cause."""

from __future__ import annotations

import codecs
import json
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from gpsfsm.checking.check import CheckOptions, check_text
from gpsfsm.cli import main
from gpsfsm.compile.formats.elements import Elements
from gpsfsm.compile.formats.scxml_writing import NAMESPACE
from gpsfsm.compile.plan_text import machine_in, read_plan_or_machine
from gpsfsm.syntax.source import DEFAULT_LIMITS
from gpsfsm.syntax.trees import is_trees
from tests.cli.support import ACCEPTED

if TYPE_CHECKING:
    from collections.abc import Callable

CASES = Path(__file__).parent / "recognised"
CORPUS = Path(__file__).parents[2] / "corpus" / "machines"
DOOR = Path(__file__).parents[2] / "docs" / "examples" / "door.json"
TREE = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Fallback><Drive/><Sequence><Ask/><Drive/></Sequence></Fallback>
  </BehaviorTree>
</root>
"""


GRAPHML = """<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
  <key id="kind" for="node" attr.name="kind" attr.type="string"/>
  <key id="interface" for="node" attr.name="interface" attr.type="string"/>
  <key id="event" for="edge" attr.name="event" attr.type="string"/>
  <graph edgedefault="directed">
    <node id="begin"><data key="kind">start</data></node>
    <node id="go"><data key="kind">runner</data><data key="interface">a/Go</data></node>
    <node id="end"><data key="kind">complete</data></node>
    <edge source="begin" target="go"><data key="event">SUCCEEDED</data></edge>
    <edge source="go" target="end"><data key="event">SUCCEEDED</data></edge>
  </graph>
</graphml>
"""


def _read(name: str) -> str:
    return (CORPUS / name).read_text(encoding="utf-8")


KINDS: dict[str, tuple[str, Callable[[], str]]] = {
    "plan": ("plan.xml", lambda: ACCEPTED),
    "tree": ("tree.xml", lambda: TREE),
    "scxml": ("door.scxml", lambda: _read("door.scxml")),
    "yasmin": ("delivery.xml", lambda: _read("delivery.yasmin.xml")),
    "langgraph": (
        "agent.json",
        lambda: _read("agent.langgraph.json").replace('"planner"', '"plan"'),
    ),
    "json": ("door.json", lambda: DOOR.read_text(encoding="utf-8")),
    "graphml": ("graph.graphml", lambda: GRAPHML),
    "flexbe": ("inspection_sm.py", lambda: _read("inspection_flexbe.py")),
    "smach": ("patrol.py", lambda: _read("patrol_smach.py")),
}
_DECLARED = re.compile(r"<\?xml[^>]*\?>\s*")
_LICENCE = "Licence of <Plan>, <root>, <BehaviorTree>, <scxml> and {smach}; no warranty.\n"


def _headed(text: str, name: str, *, lines: int) -> str:
    """The text behind a licence, in a comment where there are comments."""
    if name.endswith(".py"):
        return f"#!/usr/bin/env python\n{('# ' + _LICENCE) * lines}{text}"
    if text.lstrip().startswith("{"):
        return " \n" * len(_LICENCE) * lines + text
    declared = _DECLARED.match(text)
    end = declared.end() if declared else 0
    comments = "".join(f"<!--\n{_LICENCE * (lines // 2)}-->\n" for _ in range(2))
    return f"{text[:end]}{comments}{text[end:]}"


def _blank(text: str, _: str) -> bytes:
    """Empty lines before the text; an XML declaration must not stand behind any."""
    return b"\n\n  \n" * (not text.startswith(("#", '"""'))) + _DECLARED.sub("", text).encode()


DISGUISES: dict[str, Callable[[str, str], bytes]] = {
    "bom": lambda text, _: codecs.BOM_UTF8 + text.encode(),
    "utf-16-le": lambda text, _: codecs.BOM_UTF16_LE + text.encode("utf-16-le"),
    "utf-16-be": lambda text, _: codecs.BOM_UTF16_BE + text.encode("utf-16-be"),
    "licence": lambda text, name: _headed(text, name, lines=4).encode(),
    "long header": lambda text, name: _headed(text, name, lines=60).encode(),
    "huge header": lambda text, name: _headed(text, name, lines=8_000).encode(),
    "header behind a bom": lambda text, name: (
        codecs.BOM_UTF8 + _headed(text, name, lines=60).encode()
    ),
    "blank lines": _blank,
    "crlf": lambda text, _: text.replace("\n", "\r\n").encode(),
}


def _without_places(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_places(each) for key, each in value.items() if key != "line"}
    return [_without_places(each) for each in value] if isinstance(value, list) else value


def _gist(plan: dict[str, Any]) -> tuple[Any, ...]:
    """All that a report in JSON says about a text, but for places."""
    findings = sorted(
        (each["rule"], each["severity"], re.sub(r"\d+", "", each["message"]))
        for each in plan["findings"]
        if each["rule"] != "GP119"
    )
    return plan["verdict"], _without_places(plan["facts"]), findings


def _skipped(text: str) -> list[str]:
    (report,) = gpsfsm.check(text).plans
    assert ("GP119" in [each.rule for each in report.findings]) == bool(report.approximations)
    return [each.construct for each in report.approximations]


def _checked(text: str | bytes | Path) -> tuple[Any, ...]:
    return _gist(gpsfsm.check(text).plans[0].to_dict())


@cache
def _plain(kind: str) -> tuple[Any, ...]:
    name, text = KINDS[kind][0], KINDS[kind][1]()
    report = check_text(text.encode(), name, CheckOptions())
    assert report.facts is not None or kind == "smach"
    return _gist(report.to_dict())


@pytest.mark.parametrize("disguise", DISGUISES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_disguise_changes_nothing(
    kind: str, disguise: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, text = KINDS[kind][0], KINDS[kind][1]()
    path = tmp_path / name
    path.write_bytes(DISGUISES[disguise](text, name))
    plain = _plain(kind)
    assert _checked(path if name.endswith(".py") else path.read_bytes()) == plain
    assert main(["check", str(path), "--format", "json"]) == (plain[0] != "accepted")
    (plan,) = json.loads(capsys.readouterr().out)["plans"]
    assert _gist(plan) == plain


@pytest.mark.parametrize("kind", ["scxml", "graphml"])
def test_any_prefix_may_stand_for_a_namespace(kind: str) -> None:
    prefixed = re.sub(r"(</?)(?=[a-z])", r"\1w3:", KINDS[kind][1]()).replace(
        "xmlns=", "xmlns:w3=", 1
    )
    assert "<w3:" in prefixed
    assert _checked(prefixed) == _plain(kind)


@pytest.mark.parametrize(
    ("name", "verdict", "words"),
    [
        ("scxml_bom.scxml", "accepted", []),
        ("scxml_foreign_namespace.scxml", "accepted", []),
        ("flexbe_long_header.py", "accepted", []),
        ("yasmin_long_header.xml", "accepted", []),
        ("bt_text_before_root.xml", "accepted", ["GP108 BehaviorTree.CPP reads it"]),
        ("bt_raw_amp.xml", "accepted", ["GP101 BehaviorTree.CPP reads it"] * 3),
        ("groot_root_wrapper.xml", "rejected", ["GP805 <Root> is what old Groot wrote"]),
    ],
)
def test_inputs_of_other_people(name: str, verdict: str, words: list[str]) -> None:
    (report,) = gpsfsm.check(CASES / name).plans
    assert report.facts is not None
    assert report.facts.completes != "never"
    assert report.verdict == verdict
    loud = [each for each in report.findings if each.severity != "info"]
    for finding, word in zip(loud, words, strict=True):
        rule, _, message = word.partition(" ")
        assert finding.rule == rule
        assert message in finding.message


# -- namespaces ------------------------------------------------------------------------------------

CHART = (
    f'<scxml xmlns="{NAMESPACE}" xmlns:x="urn:x"{{}} initial="a"><state id="a">{{}}'
    '<transition event="go" target="end"/></state>{}<final id="end"/></scxml>'
)


@pytest.mark.parametrize(
    ("holes", "skipped"),
    [
        (
            ("", '<x:transition event="go" target="b"/>', '<x:state id="b"/>'),
            ["x:transition", "x:state"],
        ),
        (("", "<x:a><state id='b'/></x:a>", "<state xmlns='urn:y' id='b'/>"), ["x:a", "state"]),
        (("", '<invoke xmlns="" x:y="1"/>', ""), ["invoke"]),
        ((' x:initial="b"', "", '<w:final xmlns:w="urn:w"/>'), ["attribute x:initial", "w:final"]),
    ],
)
def test_other_languages_are_skipped_by_namespace_and_reported(
    holes: tuple[str, str, str], skipped: list[str]
) -> None:
    plain, other = CHART.format("", "", ""), CHART.format(*holes)
    assert _checked(other) == _checked(plain)
    assert _skipped(other) == skipped
    elements = Elements(other, DEFAULT_LIMITS, NAMESPACE)
    assert [each.construct for each in elements.skipped] == skipped
    assert [each.tag for each in elements.nodes] == ["scxml", "state", "transition", "final"]
    assert [each.parent for each in elements.nodes] == [-1, 0, 1, 0]


def test_a_prefix_ends_with_its_element() -> None:
    text = f'<s:scxml xmlns:s="{NAMESPACE}"><s:state xmlns:s="urn:x"/><s:state id="a"/></s:scxml>'
    elements = Elements(text, DEFAULT_LIMITS, NAMESPACE)
    assert [(each.tag, each.text("id")) for each in elements.nodes] == [
        ("scxml", ""),
        ("state", "a"),
    ]
    assert len(elements.skipped) == 1


def test_graphml_skips_what_is_of_another_language() -> None:
    other = GRAPHML.replace("xmlns=", 'xmlns:y="urn:y" xmlns=', 1)
    other = other.replace("<node id=", '<y:node id="go"/><node y:color="red" id=', 1)
    assert _checked(other) == _plain("graphml")
    assert _skipped(other) == ["y:node", "attribute y:color"]
    where = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:schemaLocation="a b" xmlns='
    assert _skipped(GRAPHML.replace("xmlns=", where, 1)) == []


def test_yasmin_skips_what_has_a_prefix() -> None:
    text = _read("delivery.yasmin.xml")
    other = text.replace("<FinalOutcome", '<e:State xmlns:e="urn:e" name="x"/><FinalOutcome', 1)
    assert other != text
    assert _checked(other) == _plain("yasmin")
    assert _skipped(other) == ["e:State"]


# -- what is none ----------------------------------------------------------------------------------

BEHAVIOUR = '<BehaviorTree ID="M"><Go/></BehaviorTree>'


@pytest.mark.parametrize(
    ("name", "text", "words", "hint"),
    [
        ("a.scxml", "<SCXML/>", "<SCXML>, but must be <scxml>", "write <scxml>"),
        ("a.scxml", f"go <scxml xmlns='{NAMESPACE}'/>", "text outside of <scxml>: go", "remove"),
        ("a.scxml", "<scxml xmlns='urn:a'/>", f"not in the namespace '{NAMESPACE}'", "xmlns="),
        ("a.scxml", "<s:scxml/>", "the prefix 's' is not declared", "add xmlns:s"),
        ("a.xml", "<Statemachine/>", "but must be <StateMachine>", "write <StateMachine>"),
        ("a.xml", "go <StateMachine/>", "text outside of <StateMachine>: go", "remove it"),
        ("a.xml", "<y:StateMachine xmlns:y='u'/>", "but must be <StateMachine>", "remove the pre"),
        ("a.xml", f"<Root>{BEHAVIOUR}</Root>", "<Root>, but must be <root>", "write <root>"),
        ("a.xml", f"<b:root xmlns:b='u'>{BEHAVIOUR}</b:root>", "must be <root>", "prefix"),
        (
            "a.py",
            "from langgraph.graph import StateGraph",
            "LangGraph",
            "graph.get_graph().to_json",
        ),
        ("a.py", "#" * 5_000 + "\nimport yasmin", "YASMIN", "XML"),
        ("a.py", "try:\n    import py_trees\nexcept E: ...", "py_trees", "BehaviorTree.CPP"),
        ("a.py", "# flexbe_core, smach\nimport os", "neither flexbe_core nor smach", "docs/"),
        ("a.ipynb", '{"cells": []}', "this is a notebook", "docs/"),
        ("a.yaml", "a: 1", "this is YAML", "docs/"),
        ("a.mdl", "Model {", "Simulink", "docs/"),
        ("a.json", '{"a": 1}', 'lacks "nodes" or "edges"', "docs/"),
    ],
)
def test_what_is_read_by_nothing_is_named_by_its_cause(
    name: str, text: str, words: str, hint: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_text(text)
    (report,) = gpsfsm.check(path).plans
    assert report.verdict == "rejected"
    assert words in report.findings[0].message
    assert hint in report.findings[0].hint
    assert main(["check", str(path), "--quiet"]) == 1


def test_of_other_files_nothing_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "keys.py"
    path.write_text("import os\nKEY = 'secret'\n")
    (report,) = gpsfsm.check(path).plans
    assert report.source is None


def test_a_plan_in_another_file_is_still_a_plan(tmp_path: Path) -> None:
    for name, text in (("a.yaml", ACCEPTED), ("a.json", '{"content": "<Plan>"}')):
        path = tmp_path / name
        path.write_text(text)
        assert read_plan_or_machine(text, file=str(path)).foreign is False


# -- trees as their engine loads them --------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "severity"),
    [
        (f"see: {TREE}", "warning"),
        (f'\n<?xml version="1.0"?>{TREE}', "warning"),
        (TREE.replace("<Ask/>", "<Ask of='a & b'/>"), "warning"),
        (TREE.replace("<Ask/>", "<!-- a -- b --><Ask/>"), "warning"),
        (f"{TREE} and so on", "error"),
        (f'see: <?xml version="1.0"?>{TREE}', "error"),
        (TREE.replace("<Ask/>", "<Ask of='&lt; & b'/>"), "error"),  # it reads another text there
        (TREE.replace("<Ask/>", "<Ask of=a/>"), "error"),
        (f"a < b {TREE}", "error"),
    ],
)
def test_what_the_parser_of_the_engine_tolerates_is_a_warning(text: str, severity: str) -> None:
    (report,) = gpsfsm.check(text).plans
    faults = [each for each in report.findings if each.rule in ("GP101", "GP108")]
    assert {each.severity for each in faults} == {severity}
    assert report.verdict == ("accepted" if severity == "warning" else "rejected")


def test_text_before_a_tree_is_no_tree_in_an_answer_but_cut_off() -> None:
    text = f"Here it is:\n{TREE}"
    assert is_trees(text)
    assert not is_trees(text, alone=True)
    parsed = read_plan_or_machine(text, from_response=True)
    assert [each.rule for each in parsed.problems if each.rule != "GP816"] == ["GP115"]


def test_a_misspelt_model_is_named() -> None:
    text = TREE.replace("</root>", "<TreeNodeModel/></root>")
    hints = [each.hint for each in read_plan_or_machine(text).problems if each.rule == "GP814"]
    assert hints[0].startswith("did you mean <TreeNodesModel>?")


def test_a_leaf_may_be_called_root() -> None:
    text = TREE.replace("<Ask/>", "<Root/>")
    assert "GP805" not in [each.rule for each in read_plan_or_machine(text).problems]


# -- hostile texts ---------------------------------------------------------------------------------

PIECES = ("<!--", "<!-", "<?", "<!", "<!DOCTYPE [", "-->", " ", "\n", "<", "{", '"id" ', "import ")
PIECES += (
    '"id":\t',
    "from x\n",
    "\ufeff",
    "<?xml ?>",
    "<!---->",
    "]]>",
    "&",
    "\0",
    "a",
    "<" + " " * 75_000,
)


@pytest.mark.parametrize("name", ["a.xml", "a.py"])
@pytest.mark.parametrize("lead", ["", "{", "<?xml version='1.0'?>", "import "])
def test_the_kind_of_a_hostile_text_is_told_in_linear_time(name: str, lead: str) -> None:
    """So long that a pass of quadratic time would take hours: then this does not end."""
    for piece in PIECES:
        text = lead + piece * (150_000 // len(piece))
        parsed = machine_in(text, file=name)
        assert parsed is None or parsed.plan is None
        assert not is_trees(text)
