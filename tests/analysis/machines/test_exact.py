"""Exact runs and mays: what only runs through inexact nodes show is never proved."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.machines.decide import Answers, Judge
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile.instants import COMPLETED, GAVE_UP, GOING, Instants
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.report import Frequency
from tests.analysis.machines.random_machines import PLAIN, automaton_of, machine, machines
from tests.cases import many
from tests.oracle.machine_exact import exact_facts
from tests.oracle.machines import TooLargeError

if TYPE_CHECKING:
    import networkx as nx

    from gpsfsm.model.automaton import Automaton

ENDS = {COMPLETED: "COMPLETED", GAVE_UP: "GAVE_UP", GOING: "STUCK"}


def judged(graph: nx.MultiDiGraph[Any], *inexact: str) -> tuple[Automaton, Answers]:
    """The answers about a machine with these inexact nodes."""
    automaton = automaton_of(graph)
    nodes = [node.index for node in automaton.nodes if name_of(automaton, node.index) in inexact]
    exploration = Exploration(automaton, [PLAIN] * len(automaton.runners), limit=2_000)
    return automaton, Judge(exploration, frozenset(nodes)).facts()


def name_of(automaton: Automaton, node: int) -> str:
    return automaton.plan.path(automaton.nodes[node].origin).removeprefix("/machine/")


def test_the_exact_run_is_shown_even_if_another_one_is_shorter() -> None:
    graph = machine(
        *("start SUCCEEDED a", "a SUCCEEDED lost", "a FAILED b", "b FAILED c", "c FAILED lost"),
        *("b SUCCEEDED end", "c SUCCEEDED end", "a SUCCEEDED choice"),
    )
    _, plain = judged(graph)
    assert len(plain.shown[GAVE_UP]) == 1
    _, answers = judged(graph, "choice")
    assert answers.shown[GAVE_UP] == ((0, 2), (1, 2), (2, 2))
    assert ("end", GAVE_UP) not in answers.may


def test_what_comes_after_an_inexact_node_is_a_may_even_once_it_has_ended() -> None:
    graph = machine(
        "start SUCCEEDED choice", "choice SUCCEEDED a", "a FAILED lost", "a SUCCEEDED end"
    )
    _, answers = judged(graph, "choice")
    assert answers.may >= {("end", GAVE_UP), ("end", COMPLETED), ("end", GOING), ("fewest",)}


def test_always_and_never_are_proved_all_the_same() -> None:
    graph = machine("start SUCCEEDED choice", "choice SUCCEEDED end", "choice FAILED end")
    _, answers = judged(graph, "choice")
    assert (answers.completes, answers.gives_up) == (Frequency.ALWAYS, Frequency.NEVER)


def test_no_fairness_is_demanded_of_a_choice() -> None:
    graph = machine("start SUCCEEDED choice", "choice SUCCEEDED choice", "choice FAILED end")
    assert judged(graph)[1].completes_if_fair is Frequency.ALWAYS
    assert judged(graph, "choice")[1].completes_if_fair is Frequency.SOMETIMES


def enters(automaton: Automaton, run: tuple[tuple[int, int], ...], inexact: frozenset[str]) -> bool:
    """True if a run enters one of these nodes, played event by event."""
    instants = Instants(automaton)
    instant = instants.first()
    entered: set[str] = set()
    for step in (None, *run):
        if step is not None:
            instant = instants.after(instant.configuration, *step)
        numbers = range(len(automaton.runners))
        entered |= {
            name_of(automaton, automaton.runner_node(number))
            for number in numbers
            if instant.triggered >> number & 1
        }
        for node in automaton.nodes:
            if node.kind is NodeKind.JOIN:
                place = instants.place[node.index]
                arrived = instant.configuration.arrived & instants.inputs_of[place]
                if arrived or instant.joined >> place & 1:
                    entered.add(name_of(automaton, node.index))
    return bool(entered & inexact)


@settings(max_examples=many(800), deadline=None)
@given(machines(), st.data())
def test_exact_runs_and_mays_are_those_of_the_definition(
    graph: nx.MultiDiGraph[Any], data: st.DataObject
) -> None:
    names = sorted(name for name, row in graph.nodes(data=True) if row["kind"] != "start")
    inexact = frozenset(data.draw(st.sets(st.sampled_from(names), min_size=1, max_size=2)))
    try:
        automaton, answers = judged(graph, *inexact)
        ends, orphans, fewest = exact_facts(graph, inexact, most=2_000)
    except (InconclusiveError, TooLargeError):
        return
    for end in answers.shown:
        assert (("end", end) in answers.may) is (ENDS[end] not in ends)
        if ("end", end) not in answers.may:
            assert not enters(automaton, answers.shown[end], inexact)
    if answers.endless is not Frequency.NEVER:
        assert (("endless",) in answers.may) is ("ENDLESS" not in ends)
    if answers.fewest_failures is not None:
        assert (("fewest",) in answers.may) is (fewest != answers.fewest_failures)
    for number, run in answers.orphans:
        doubted = ("orphan", number) in answers.may
        assert doubted is (name_of(automaton, automaton.runner_node(number)) not in orphans)
        assert doubted or not enters(automaton, run, inexact)
    for waiting in answers.waiting:
        if ("waiting", waiting.node) not in answers.may:
            assert not enters(automaton, (*waiting.shown, *waiting.loop), inexact)
    for each in answers.dangling:
        if each.shown is not None and ("dangling", each.signal) not in answers.may:
            assert not enters(automaton, each.shown, inexact)
    for loop in answers.loops:
        if ("loop", loop.trap, frozenset(loop.runners)) not in answers.may:
            assert not enters(automaton, (*loop.lasso.prefix, *loop.lasso.loop), inexact)
