"""Equivalence of machines: renamed, edited, made of plans, and against a brute force."""

from __future__ import annotations

import json
import random
from math import inf
from typing import TYPE_CHECKING, Any

import networkx as nx
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.compile import compile_plan
from gpsfsm.compile.machines import machine_of
from gpsfsm.equivalence import Difference, UndecidedError, compare, comparison
from gpsfsm.equivalence import machines as under_test
from gpsfsm.equivalence.difference_text import difference_lines
from gpsfsm.equivalence.machines import machine_sides
from gpsfsm.errors import GpsfsmError
from gpsfsm.model.event import End
from tests.analysis.machines.random_machines import machine, machines
from tests.cases import many
from tests.equivalence import rewriting
from tests.equivalence.machine_brute import Played, distance
from tests.equivalence.pairs import differs, seeded
from tests.oracle import P, par_all, plan, rec
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.compile import MachinePlan

Graph = Any
LOOP = ("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")


def read(graph: Graph) -> MachinePlan:
    """The machine of a graph."""
    plan_read, problems = machine_of(graph)
    assert plan_read is not None, problems
    return plan_read


def diff(one: Graph, other: Graph, **options: Any) -> Difference | None:
    """The difference between two graphs."""
    return compare(read(one), read(other), **options)


def shuffled(graph: Graph, source: random.Random) -> Graph:
    """The same machine with other names, in another order."""
    names = dict(zip(graph, source.sample(range(10_000), len(graph)), strict=True))
    other = nx.MultiDiGraph()
    for name, data in source.sample(list(graph.nodes(data=True)), len(graph)):
        other.add_node(f"n{names[name]}", **data)
    edges = list(graph.edges(data=True))
    for one, two, data in source.sample(edges, len(edges)):
        other.add_edge(f"n{names[one]}", f"n{names[two]}", **data)
    return other


def edited(graph: Graph, source: random.Random) -> Graph:
    """The machine with one small change."""
    other = graph.copy()
    edges = [edge for edge in other.edges(keys=True) if other.nodes[edge[0]]["kind"] == "runner"]
    joins = [name for name, data in other.nodes(data=True) if data["kind"] == "join"]
    runners = [name for name, data in other.nodes(data=True) if data["kind"] == "runner"]
    change = source.choice(("drop", "event", "target", "need", "action", "add"))
    if change == "need" and joins:
        join = source.choice(joins)
        other.nodes[join]["need"] = source.randint(1, 3)
    elif change == "action":
        other.nodes[source.choice(runners)]["interface"] = source.choice("ab")
    elif change == "add" or not edges:
        event = source.choice(("SUCCEEDED", "FAILED", "STARTED"))
        other.add_edge(source.choice(runners), source.choice([*runners, *joins]), event=event)
    else:
        one, two, key = source.choice(edges)
        data = dict(other.edges[one, two, key])
        other.remove_edge(one, two, key)
        if change == "event":
            data["event"] = source.choice(("SUCCEEDED", "FAILED"))
            other.add_edge(one, two, **data)
        elif change == "target":
            other.add_edge(one, source.choice([*runners, *joins]), **data)
    return other


@st.composite
def acting(draw: st.DrawFn, *, most_runners: int = 3) -> Graph:
    """A machine whose runners have few different actions."""
    graph = draw(machines(most_runners=most_runners))
    for _, data in graph.nodes(data=True):
        if data["kind"] == "runner":
            data["interface"] = draw(st.sampled_from("ab"))
    assume(machine_of(graph)[0] is not None)
    return graph


@given(acting(most_runners=5), st.integers(0, 2**32))
def test_names_and_order_make_no_difference(graph: Graph, seed: int) -> None:
    assert diff(graph, shuffled(graph, seeded(seed))) is None


@given(acting(), st.integers(0, 2**32))
def test_the_search_finds_renamed_machines_equal(graph: Graph, seed: int) -> None:
    sides = machine_sides(
        *(compile_plan(read(each)) for each in (graph, shuffled(graph, seeded(seed))))
    )
    assert sides.same_form
    assert comparison.lockstep(sides, max_work=1_000_000) is None


@settings(max_examples=many(150))
@given(acting(), st.integers(0, 2**32), st.integers(1, 3))
def test_edits_are_judged_as_by_brute_force(graph: Graph, seed: int, times: int) -> None:
    source = seeded(seed)
    other = graph
    for _ in range(times):
        other = edited(other, source)
    assume(machine_of(other)[0] is not None)
    wanted = distance(graph, other)
    assume(wanted is not None)
    difference = diff(graph, other)
    assert (inf if difference is None else len(difference.steps)) == wanted
    if difference is not None:
        assert difference.shortest
        separates(graph, other, difference)


@given(acting(), acting())
def test_other_machines_are_judged_as_by_brute_force(one: Graph, other: Graph) -> None:
    wanted = distance(one, other)
    assume(wanted is not None)
    difference = diff(one, other)
    assert (inf if difference is None else len(difference.steps)) == wanted
    if difference is not None:
        separates(one, other, difference)


def separates(one: Graph, other: Graph, difference: Difference) -> None:
    """The run really ends in what is said, by a step function of its own."""
    sides = [(Played(graph), read(graph)) for graph in (one, other)]
    states = [played.begin() for played, _ in sides]
    names = [
        [plan_read.path(runner).removeprefix("/machine/") for runner in plan_read.runners]
        for _, plan_read in sides
    ]
    for pair, event in difference.steps:
        assert not states[0][1].end
        assert not states[1][1].end
        states = [
            played.after(state, names[side][pair[side]], event.value)
            for side, ((played, _), (state, _)) in enumerate(zip(sides, states, strict=True))
        ]
    ends = {"": None, "complete": End.COMPLETED, "give_up": End.GAVE_UP}
    for side, reaction in enumerate((difference.first, difference.second)):
        _, seen = states[side]
        assert {names[side][number] for number in reaction.triggered} == seen.started
        assert ends[seen.end] is reaction.end
        if reaction.end is None:
            assert {names[side][number] for number in reaction.stopped} == seen.stopped


@settings(max_examples=many(60))
@given(plans(max_runners=6), st.integers(0, 2**32))
def test_machines_of_plans_differ_as_the_plans_do(whole: P, seed: int) -> None:
    other = rewriting.mutated(seeded(seed), whole)
    wanted = differs(whole, other)
    machine_plans = [read(compile_plan(plan_of(each)).automaton.graph) for each in (whole, other)]
    for second in (machine_plans[1], plan_of(other)):
        try:
            verdict = compare(machine_plans[0], second)
        except UndecidedError:
            continue
        assert (verdict is None) == (wanted is None)
        if verdict is not None and wanted is not None and verdict.shortest and wanted.shortest:
            assert len(verdict.steps) == len(wanted.steps)
    same = rewriting.same(seeded(seed), whole)
    assert compare(machine_plans[0], plan_of(same)) is None


def test_a_loop_unrolled_once_does_the_same() -> None:
    twice = machine(*LOOP[:1], "a FAILED b", "b FAILED a", "a SUCCEEDED end", "b SUCCEEDED end")
    twice.nodes["b"]["interface"] = "a"
    assert diff(machine(*LOOP), twice) is None


def test_a_difference_deep_in_a_loop() -> None:
    def counting(rounds: int) -> Graph:
        lines = [f"r{n} FAILED r{n + 1}" for n in range(rounds)]
        ends = [f"r{n} SUCCEEDED end" for n in range(rounds)]
        graph = machine("start SUCCEEDED r0", *lines, *ends, f"r{rounds} SUCCEEDED end")
        for _, data in graph.nodes(data=True):
            if data["kind"] == "runner":
                data["interface"] = "a"
        return graph

    difference = diff(machine(*LOOP), counting(7))
    assert difference is not None
    assert len(difference.steps) == 8
    assert (difference.first.triggered, difference.second.triggered) == ((0,), ())


def test_what_is_stopped_is_seen_and_orphans_are_not() -> None:
    beside = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED c")
    difference = diff(machine(*beside, "a SUCCEEDED stop b"), machine(*beside, "b SUCCEEDED c"))
    assert difference is not None
    assert difference.first.stopped == (1,)
    assert difference.second.stopped == ()
    # at the instant of the end everything is stopped in either
    ending = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED end", "b FAILED b")
    assert diff(machine(*ending, "a SUCCEEDED stop b"), machine(*ending)) is None


def test_who_is_stopped_and_starts_again_is_seen() -> None:
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "a FAILED b", "b SUCCEEDED end")
    difference = diff(machine(*lines, "a FAILED stop b"), machine(*lines))
    assert difference is not None
    assert (difference.first.triggered, difference.first.stopped) == ((1,), (1,))
    assert (difference.second.triggered, difference.second.stopped) == ((), ())


def test_the_difference_is_told_with_the_names_of_the_nodes() -> None:
    beside = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED c")
    one, other = read(machine(*beside, "a SUCCEEDED stop b")), read(machine(*beside, "c FAILED c"))
    verdict = compare(one, other)
    assert verdict is not None
    assert list(difference_lines(one, other, verdict)) == [
        "  1. a succeeds (<graph>:a, <graph>:a)",
        "  then <graph> stops b (b)",
        "       <graph> starts nothing else and stops nothing",
    ]


def test_assumptions_about_single_runners() -> None:
    other = machine("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED lost")
    assert diff(machine(*LOOP), other) is not None
    assert diff(machine(*LOOP), other, assumptions=("never fails: a",)) is None
    two = machine(*LOOP, "a FAILED b")
    with pytest.raises(UndecidedError, match="tie runners together"):
        diff(two, two, assumptions=("a fails or b fails",))
    with pytest.raises(GpsfsmError, match="admit no scenario"):
        diff(machine(*LOOP), other, assumptions=("never fails: a", "never succeeds: a"))


def test_tolerance() -> None:
    one, other = machine(*LOOP), machine(*LOOP)
    one.nodes["a"]["parameters"] = {"x": 1.0}
    other.nodes["a"]["parameters"] = {"x": 1.004}
    assert diff(one, other) is not None
    assert diff(one, other, tolerance=0.01) is None


def test_beyond_the_limits_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def wide(last: str) -> Graph:
        lines = [f"start SUCCEEDED r{n}" for n in range(9)]
        rounds = [f"r{n} FAILED r{n}" for n in range(9)]
        joined = [f"r{n} SUCCEEDED j" for n in range(9)]
        return machine(*lines, *rounds, *joined, f"j SUCCEEDED {last}", j=9)

    monkeypatch.setattr(comparison, "_WORK", 300)
    monkeypatch.setattr(comparison, "_WORK_PER_RUNNER", 1)
    assert diff(wide("end"), wide("end")) is None  # by their graphs
    with pytest.raises(UndecidedError, match="too many configurations"):
        diff(wide("end"), wide("lost"))
    with pytest.raises(UndecidedError, match="--consistent"):
        diff(wide("end"), wide("end"), consistent=True)


def test_the_search_for_an_isomorphism_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(under_test, "_MOST_TRIED", 2)
    assert diff(machine(*LOOP), shuffled(machine(*LOOP), seeded(1))) is None  # by the search


def test_parallel_connections_count_as_often_as_they_are_there() -> None:
    one = machine("start SUCCEEDED a", "a SUCCEEDED j", "a SUCCEEDED j", "j SUCCEEDED end", j=2)
    other = machine("start SUCCEEDED a", "a SUCCEEDED j", "j SUCCEEDED end", j=2)
    assert diff(one, other) is not None
    assert diff(one, shuffled(one, seeded(3))) is None


def test_graphs_and_texts_in_python() -> None:
    assert gpsfsm.diff(machine(*LOOP), machine(*LOOP))
    text = json.dumps(
        {
            "nodes": [
                {"id": "s", "kind": "start"},
                {"id": "x", "kind": "runner", "interface": "a"},
                {"id": "e", "kind": "complete"},
            ],
            "edges": [
                {"source": "s", "target": "x", "event": "SUCCEEDED"},
                {"source": "x", "target": "x", "event": "FAILED"},
                {"source": "x", "target": "e", "event": "SUCCEEDED"},
            ],
        }
    )
    assert gpsfsm.diff(text, machine(*LOOP))
    compared = gpsfsm.diff('<Plan><Runner interface="a" provider="a"/></Plan>', machine(*LOOP))
    assert not compared
    data = compared.to_dict()["difference"]
    assert data["first"] == {"starts": [], "end": "GAVE_UP"}
    assert data["second"]["stops"] == []
    graph = machine(*LOOP)
    graph.add_node("odd")
    with pytest.raises(GpsfsmError, match="the node 'odd' has no kind"):
        gpsfsm.diff(graph, graph)


def test_equal_actions_that_start_together_are_paired_in_the_way_that_fits() -> None:
    lines = ("start SUCCEEDED a1", "start SUCCEEDED a2")
    one = machine(*lines, "a1 SUCCEEDED end", "a2 SUCCEEDED lost")
    other = machine(*lines, "a2 SUCCEEDED end", "a1 SUCCEEDED lost")
    same = machine(*lines, "a1 SUCCEEDED end", "a2 SUCCEEDED end")
    for graph in (one, other, same):
        for name in ("a1", "a2"):
            graph.nodes[name]["interface"] = "a"
    assert diff(one, other) is None
    difference = diff(one, same)
    assert difference is not None
    assert len(difference.steps) == distance(one, same) == 1


def test_a_plan_and_a_machine_that_says_the_same() -> None:
    whole = plan(par_all("a", "b"), rec("c"))
    graph = machine(
        *("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED j", "b SUCCEEDED j"),
        *("a FAILED k", "b FAILED k", "k SUCCEEDED c", "j SUCCEEDED end", "c SUCCEEDED end"),
        "c FAILED lost",
        j=2,
        k=1,
    )
    for name, interface in {
        "a": plan_of(whole).runners[0].interface,
        "b": plan_of(whole).runners[1].interface,
        "c": plan_of(whole).runners[2].interface,
    }.items():
        graph.nodes[name]["interface"] = interface
        runner = next(each for each in plan_of(whole).runners if each.interface == interface)
        graph.nodes[name]["parameters"] = dict(runner.parameters)
    assert compare(plan_of(whole), read(graph)) is None
