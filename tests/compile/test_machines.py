"""Machines that are handed in: what is read, and what is wrong with the others."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import networkx as nx
import pytest

import gpsfsm
from gpsfsm.compile import compile_plan
from gpsfsm.compile.machine_files import automaton_to_graphml, read_machine
from gpsfsm.compile.machines import machine_of
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.compile.units import MachinePlan
from gpsfsm.syntax import Limits
from tests.analysis.machines.random_machines import automaton_of, machine
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton

DOOR = (
    *("start SUCCEEDED drive", "drive STARTED watch", "watch FAILED watch"),
    *("watch SUCCEEDED stop drive", "drive STOPPED ask", "ask SUCCEEDED drive"),
    *("drive SUCCEEDED stop watch", "drive SUCCEEDED end", "watch FAILED j", "ask FAILED j"),
    "j SUCCEEDED lost",
)


def problems_of(graph: nx.Graph[Any]) -> list[str]:
    """The messages about a graph that is no machine."""
    plan, problems = machine_of(graph)
    assert plan is None
    assert {problem.rule for problem in problems} == {"GP117"}
    assert all(problem.hint for problem in problems)
    return [problem.message for problem in problems]


def parts(automaton: Automaton) -> list[Any]:
    """What two readings of one machine have in common."""
    kinds = [(node.kind, node.need) for node in automaton.nodes]
    actions = [(each.interface, each.parameters) for each in automaton.plan.runners]
    return [kinds, automaton.edges, automaton.stops, actions]


def test_nodes_are_numbered_starts_runners_others() -> None:
    automaton = automaton_of(machine(*DOOR, j=2))
    names = [automaton.plan.path(node.origin) for node in automaton.nodes]
    assert names == [
        *("/machine/start", "/machine/drive", "/machine/watch", "/machine/ask"),
        *("/machine/end", "/machine/j", "/machine/lost"),
    ]
    assert len(automaton.stops) == 2
    assert automaton.nodes[5].need == 2


def test_ends_that_are_not_there_are_added() -> None:
    automaton = automaton_of(machine("start SUCCEEDED a"))
    names = [automaton.plan.path(node.origin) for node in automaton.nodes]
    assert names == ["/machine/start", "/machine/a", "/machine/complete", "/machine/give_up"]
    assert not automaton.inputs[automaton.complete]


def test_the_graph_of_an_automaton_is_a_machine() -> None:
    automaton = compile_plan(
        plan_of(
            '<Plan><Control type="parallel_all"><Runner interface="a/A" provider="b/B" x="1"/>'
            '<Runner interface="c/C" provider="c/C" y="a text"/></Control></Plan>'
        )
    ).automaton
    again = automaton_of(automaton.graph)
    assert sorted(again.edges) == sorted(automaton.edges)
    assert [each.provider for each in again.plan.runners] == ["b/B", "c/C"]
    assert [each.parameters for each in again.plan.runners] == [{"x": 1}, {"y": "a text"}]


@pytest.mark.parametrize(
    ("graph", "message"),
    [
        (nx.Graph(), "the graph is not directed"),
        (nx.MultiDiGraph(), "there is no start node"),
        (machine("start SUCCEEDED a", "a SUCCEEDED start"), "but nothing may lead to a start node"),
        (machine("start FAILED a"), "but a start node emits only SUCCEEDED"),
        (machine("start SUCCEEDED j", "j FAILED a", j=1), "but a join node emits only SUCCEEDED"),
        (machine("start SUCCEEDED end", "end SUCCEEDED a"), "but nothing may follow complete"),
        (machine("start SUCCEEDED stop end"), "but only runners and joins can be stopped"),
        (machine("start SUCCEEDED a", "a DONE a"), "event or action: 'DONE'"),
        (machine("start SUCCEEDED a", "a FAILED halt a"), "'FAILED', 'halt'"),
        (machine("start SUCCEEDED j", j=0), "is a join with an invalid need: '0'"),
        (machine("start SUCCEEDED a", "a STARTED stop a"), "/machine/a"),
        (machine("start SUCCEEDED j", "j SUCCEEDED j", j=1), "cause each other's events"),
        (machine("start SUCCEEDED a", "a STARTED b", "b STARTED j", "j SUCCEEDED a", j=1), "cause"),
    ],
)
def test_what_is_not_well_formed_is_named(graph: nx.Graph[Any], message: str) -> None:
    (text,) = problems_of(graph)
    assert message in text


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({}, "has no kind"),
        ({"kind": "state"}, "an unknown one: 'state'"),
        ({"kind": ["runner"]}, "an unknown one"),
        ({"kind": "runner"}, "without an interface"),
        ({"kind": "runner", "interface": 3}, "without an interface"),
        ({"kind": "runner", "interface": "a", "provider": 3}, "of a wrong type"),
        ({"kind": "runner", "interface": "a", "parameters": "x=1"}, "of a wrong type"),
        ({"kind": "runner", "interface": "a", "parameters": {"x": [1]}}, "a value of a wrong type"),
        ({"kind": "runner", "interface": "a", "parameters": {"name": "n"}}, "parameter 'name'"),
        ({"kind": "join"}, "need: 'None'"),
        ({"kind": "join", "need": True}, "need: 'True'"),
        ({"kind": "join", "need": 1.5}, "need: '1.5'"),
        ({"kind": "complete"}, "is a second complete node"),
    ],
)
def test_nodes_that_are_none(attributes: dict[str, Any], message: str) -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED end")
    graph.add_node("odd", **attributes)
    (text,) = problems_of(graph)
    assert text.startswith("the node 'odd'")
    assert message in text


def test_names_that_are_written_alike() -> None:
    graph = machine("start SUCCEEDED 1")
    graph.add_node(1, kind="runner", interface="a")
    assert problems_of(graph) == ["the node '1' has the same name as another node"]


def test_a_graph_that_is_no_machine_is_a_report_and_no_exception() -> None:
    graph = machine("start SUCCEEDED a")
    graph.nodes["a"]["kind"] = "\ud800\x1b[31m" * 200
    (report,) = gpsfsm.check(graph).plans
    assert report.verdict.value == "rejected"
    (finding,) = report.findings
    assert "\x1b" not in finding.message
    assert finding.location.element == "/machine/a"


# --- files --------------------------------------------------------------------------------------


def as_json(graph: nx.MultiDiGraph[Any]) -> str:
    """A machine as JSON."""
    nodes = [{"id": name, **data} for name, data in graph.nodes(data=True)]
    edges = [
        {"source": source, "target": target, **data}
        for source, target, data in graph.edges(data=True)
    ]
    return json.dumps({"nodes": nodes, "edges": edges}, indent=1)


def test_json_and_graphml_say_the_same() -> None:
    graph = machine(*DOOR, j=2)
    graph.nodes["drive"]["parameters"] = {"x": 1.5, "up": True, "n": 3, "text": "a < b & 'c'"}
    plain = automaton_of(graph)
    for text in (as_json(graph), automaton_to_graphml(plain)):
        parsed = read_machine(text)
        assert parsed is not None
        assert parsed.problems == ()
        assert parsed.plan is not None
        again = compile_plan(parsed.plan).automaton
        assert parts(again)[3] == parts(plain)[3]
        assert sorted(again.edges) == sorted(plain.edges)
        assert sorted(again.stops) == sorted(plain.stops)


def test_findings_point_to_the_nodes_of_a_file() -> None:
    text = as_json(machine("start SUCCEEDED a", "a SUCCEEDED end", "b SUCCEEDED end"))
    (report,) = gpsfsm.check(text).plans
    (finding,) = [each for each in report.findings if each.rule == "GP301"]
    line = text.splitlines()[finding.location.line - 1 :][:2]
    assert line[0].strip() == "{"
    assert '"id": "b"' in line[1]
    written = automaton_to_graphml(automaton_of(machine("start SUCCEEDED a", "b FAILED a")))
    (report,) = gpsfsm.check(written).plans
    (finding,) = [each for each in report.findings if each.rule == "GP301"]
    assert '<node id="b"' in written.splitlines()[finding.location.line - 1]


def test_nodes_that_share_a_line_of_a_file_are_told_apart() -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED end", "b SUCCEEDED end")
    text = json.dumps(json.loads(as_json(graph)))
    (report,) = gpsfsm.check(text).plans
    (finding,) = [each for each in report.findings if each.rule == "GP301"]
    assert finding.message == "no run of the machine triggers b at node 'b'"
    assert (finding.location.line, finding.location.column) == (1, text.index('{"id": "b"') + 1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"nodes": [], "edges": []', "the text is not valid JSON"),
        ('{"nodes": [], "edges": [], "edges": []}', "twice"),
        ('{"nodes": {}, "edges": []}', "'nodes' must be a list of objects"),
        ('{"nodes": [1], "edges": []}', "'nodes' must be a list of objects"),
        ('{"version": 2, "nodes": [], "edges": []}', "has version '2'"),
        ('{"nodes": [{"id": null}], "edges": []}', "the name of a node must be a text"),
        ('{"nodes": [{"id": "a"}, {"id": "a"}], "edges": []}', "two nodes have the name 'a'"),
        ('{"nodes": [], "edges": [{"source": "a", "target": "b"}]}', "names the node 'a'"),
        ('{"nodes": ' + "[" * 100_000 + ', "edges": 1', "JSON"),
        ('<!DOCTYPE a [<!ENTITY x "y">]><graphml/>', ""),
        ('<?xml version="1.0"?><graphml><!DOCTYPE a></graphml>', "DOCTYPE"),
        ("<graphml><graph></graphml>", "not well-formed"),
        ("<graphml><graph edgedefault='directed'><node/></graph></graphml>", "has no kind"),
        ("<graphml><graph edgedefault='directed'><edge/></graph></graphml>", "the node 'None'"),
    ],
)
def test_files_that_are_no_machines(text: str, message: str) -> None:
    (report,) = gpsfsm.check(text + "\n").plans
    assert report.verdict.value == "rejected"
    assert message in report.findings[0].message


_HEAD = "<graphml><key id='k' for='node' attr.name='kind' attr.type='string'>{}</key>"
_START_NODE = "<node id='s'><data key='k'>start</data>{}</node>"


@pytest.mark.parametrize(
    ("key", "inner", "after", "message"),
    [
        ("<default>start</default>", "", "", "<default> in <key> is not read"),
        ("", "<port name='p'/>", "", "<port> in <node> is not read"),
        ("", "<graph edgedefault='directed'/>", "", "<graph> in <node> is not read"),
        ("", "", "<graph edgedefault='directed'/>", "there is a second graph"),
        ("", "<data key='k'>runner</data>", "", "there is a second <data> of this name"),
    ],
)
def test_graphml_that_networkx_passes_over_is_refused(
    key: str, inner: str, after: str, message: str
) -> None:
    graph = f"<graph edgedefault='directed'>{_START_NODE.format(inner)}</graph>"
    (report,) = gpsfsm.check(f"{_HEAD.format(key)}{graph}{after}</graphml>").plans
    assert report.facts is None
    assert message in report.findings[0].message


@pytest.mark.parametrize(
    ("node", "edge", "more", "construct"),
    [
        ({"paramters": {"x": 1}}, {}, {}, "attribute 'paramters'"),
        ({"need": 2}, {}, {}, "attribute 'need'"),
        ({"name": "b"}, {}, {}, "attribute 'name'"),
        ({}, {"evnt": "FAILED"}, {}, "attribute of a connection 'evnt'"),
        ({}, {}, {"edge": [{"source": "a"}]}, "key 'edge'"),
        ({}, {}, {"complete": 0}, "key 'complete'"),
    ],
)
def test_keys_of_json_without_a_meaning_are_reported(
    node: dict[str, Any], edge: dict[str, Any], more: dict[str, Any], construct: str
) -> None:
    whole = json.loads(as_json(machine("start SUCCEEDED a", "a SUCCEEDED end")))
    next(each for each in whole["nodes"] if each["id"] == "a").update(node)
    whole["edges"][0].update(edge)
    (report,) = gpsfsm.check(json.dumps(whole | more)).plans
    assert [each.construct for each in report.approximations] == [construct]
    assert "GP119" in {each.rule for each in report.findings}


def test_a_graph_without_directions_is_refused() -> None:
    whole = json.loads(as_json(machine("start SUCCEEDED a", "a SUCCEEDED end")))
    (report,) = gpsfsm.check(json.dumps(whole | {"directed": False})).plans
    assert "the graph is not directed" in report.findings[0].message


def test_a_machine_beyond_the_limits_is_not_read() -> None:
    parsed = read_machine(as_json(machine(*DOOR, j=2)), limits=Limits(max_elements=3))
    assert parsed is not None
    assert parsed.over_limit
    assert [problem.rule for problem in parsed.problems] == ["GP103"]


def test_other_texts_are_no_machines() -> None:
    for text in ("<Plan/>", "{}", '{"nodes": 1}', "", "[]", "<root/>", b"\xff"):
        assert read_machine(text) is None


@pytest.mark.parametrize("lead", ["", "\ufeff", "\n\n"])
@pytest.mark.parametrize("word", ["<Plan>", "<root", "<BehaviorTree"])
def test_a_parameter_of_a_machine_may_hold_a_plan(word: str, lead: str) -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED end")
    graph.nodes["a"]["parameters"] = {"text": word}
    for text in (as_json(graph), automaton_to_graphml(automaton_of(graph))):
        parsed = read_plan_or_machine(lead + text)
        assert isinstance(parsed.plan, MachinePlan), parsed.problems
        assert [each.parameters["text"] for each in parsed.plan.runners] == [word]
