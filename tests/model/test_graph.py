"""The graph of an automaton is what is read: there and back, frozen, edited."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import networkx as nx
import pytest
from hypothesis import given

import gpsfsm
from gpsfsm.analysis.constraints import constraints_under
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.compile import Compiled, compile_plan
from gpsfsm.compile.machine_files import automaton_to_graphml, graph_from_json, read_machine
from gpsfsm.compile.machines import machine_of
from gpsfsm.errors import InputError, InternalError
from gpsfsm.model.graph import SCHEMA, graph_of
from tests.analysis.machines.random_machines import machines
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton
    from tests.oracle import P

LINE = (
    '<Plan><Runner interface="a/A" provider="p/A" x="1.5"/>'
    '<Control type="parallel_all"><Runner interface="b/B" provider="p/B"/>'
    '<Runner interface="c/C" provider="p/C"/></Control></Plan>'
)


def same(one: nx.MultiDiGraph[Any], other: nx.MultiDiGraph[Any]) -> bool:
    """Nodes, connections with their keys, and all attributes."""
    listed = list(one.nodes) == list(other.nodes)
    return listed and nx.utils.graphs_equal(one, other)  # type: ignore[no-untyped-call]


def there_and_back(automaton: Automaton) -> None:
    graph = automaton.graph
    assert same(graph_of(automaton.plan, automaton.nodes, automaton.edges, automaton.stops), graph)
    assert same(graph_from_json(automaton.to_json()), graph)
    edited = replace(automaton, graph=graph.copy())
    assert same(edited.graph, graph)
    assert (edited.edges, edited.stops) == (automaton.edges, automaton.stops)
    parts = [(node.kind, node.origin, node.need) for node in automaton.nodes]
    assert [(node.kind, node.origin, node.need) for node in edited.nodes] == parts


@given(plans())
def test_plans_there_and_back(whole: P) -> None:
    there_and_back(compile_plan(plan_of(whole)).automaton)


@given(machines())
def test_machines_there_and_back(graph: nx.MultiDiGraph[Any]) -> None:
    machine, _ = machine_of(graph)
    if machine is not None:
        there_and_back(machine.automaton)


@given(plans())
def test_the_graph_of_a_plan_is_a_machine_in_the_same_order(whole: P) -> None:
    automaton = compile_plan(plan_of(whole)).automaton
    texts = (automaton.to_json(), automaton_to_graphml(automaton))
    for read in (machine_of(automaton.graph)[0], *(read_machine(text) for text in texts)):
        assert read is not None
        machine = read if not hasattr(read, "plan") else read.plan
        again = compile_plan(machine).automaton
        assert sorted(again.edges) == sorted(automaton.edges)
        assert [node.kind for node in again.nodes] == [node.kind for node in automaton.nodes]
    machine, _ = machine_of(automaton.graph)
    assert machine is not None
    assert machine.edges == automaton.edges


def test_documented_attributes() -> None:
    graph = compile_plan(plan_of(LINE)).graph
    assert graph.graph == {"version": SCHEMA}
    assert dict(graph.nodes[1]) == {
        "kind": "runner",
        "name": "/Plan/Runner[1]",
        "origin": "/Plan/Runner[1]",
        "element": 1,
        "need": 0,
        "line": 1,
        "column": 7,
        "interface": "a/A",
        "provider": "p/A",
        "parameters": {"x": 1.5},
    }
    assert {len(data) for _, data in graph.nodes(data=True)} == {5, 10}
    assert graph.edges[0, 1, 0] == {"event": "SUCCEEDED", "action": "trigger"}
    keys = sorted(key for _, _, key in graph.edges(keys=True))
    assert keys == list(range(len(keys)))


def test_a_compiled_graph_cannot_be_changed_and_its_copies_can() -> None:
    graph: Any = compile_plan(plan_of(LINE)).graph
    with pytest.raises(nx.NetworkXError, match=r"[Ff]rozen"):
        graph.remove_edge(0, 1)
    with pytest.raises(TypeError):
        graph.nodes[1]["kind"] = "join"
    with pytest.raises(TypeError, match=r"graph\.copy"):
        graph.edges[0, 1, 0]["event"] = "FAILED"
    with pytest.raises(TypeError, match=r"graph\.copy"):
        graph.edges[0, 1, 0].update(event="FAILED")
    relabelled = nx.relabel_nodes(graph, {0: "first"})
    for one in (graph.copy(), copy.deepcopy(graph), nx.MultiDiGraph(graph), relabelled):
        one.nodes[1]["kind"] = "join"
        assert graph.nodes[1]["kind"] == "runner"
    again = pickle.loads(pickle.dumps(graph))  # noqa: S301
    assert same(again, graph)


# --- what is read -------------------------------------------------------------------------------


def rewired() -> tuple[Compiled, Compiled]:
    """A compiled plan, and the same where the failure of the first runner leads on."""
    compiled = compile_plan(plan_of('<Plan><Runner interface="a/A" provider="a/A"/></Plan>'))
    graph = compiled.graph.copy()
    automaton = compiled.automaton
    graph.remove_edge(1, automaton.give_up)
    graph.add_edge(1, automaton.complete, event="FAILED", action="trigger")
    return compiled, replace(compiled, automaton=replace(automaton, graph=graph))


def facts_of(compiled: Compiled, solver: Any) -> Any:
    options = AnalysisOptions(solver=solver)
    facts = decide(compiled, constraints_under(options, compiled), options).facts()
    assert facts is not None
    return facts


def test_a_changed_edge_of_a_compiled_plan_changes_the_verdict() -> None:
    compiled, changed = rewired()
    assert facts_of(compiled, "z3").completes.value == "sometimes"
    assert facts_of(changed, "z3").completes.value == "always"
    (before,) = gpsfsm.check(compiled.graph.copy()).plans
    (after,) = gpsfsm.check(changed.graph).plans
    assert before.facts is not None
    assert after.facts is not None
    assert before.facts.gives_up.value == "sometimes"
    assert after.facts.gives_up.value == "never"
    assert gpsfsm.check(compiled.graph.copy()) == gpsfsm.check(compiled.graph)


def test_the_units_of_another_graph_are_a_contradiction_and_no_answer() -> None:
    _, changed = rewired()
    with pytest.raises(InternalError, match="a run does not show"):
        facts_of(changed, "auto")


def test_an_edge_that_leads_nowhere_makes_a_plan_a_rejected_machine() -> None:
    graph = compile_plan(plan_of(LINE)).graph.copy()
    assert gpsfsm.check(graph).ok
    join = next(node for node, data in graph.nodes(data=True) if data["need"] == 2)
    graph.remove_edge(2, join)
    assert not gpsfsm.check(graph).ok


def test_what_is_no_json_of_a_graph_is_an_error() -> None:
    for text in ("", "[]", "{}", '{"version": 2, "nodes": [], "edges": []}'):
        with pytest.raises(InputError):
            graph_from_json(text)
