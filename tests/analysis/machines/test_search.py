"""The exploration of machines, against one that plays every instant; and its algorithms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import networkx as nx
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from gpsfsm.analysis.machines.search import Exploration, strongly_connected
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile import instants as module
from gpsfsm.compile.instants import Instants
from gpsfsm.model.automaton import Reset, Signal, Tie
from gpsfsm.model.event import Event, Outcome
from tests.analysis.machines.played import Played
from tests.analysis.machines.random_machines import (
    PLAIN,
    automaton_of,
    machine,
    machines,
    outcomes,
    ties,
)
from tests.cases import many

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.model.automaton import Automaton


def require_same(
    automaton: Automaton, allowed: Sequence[frozenset[Outcome]], rows: Sequence[Tie] = ()
) -> None:
    """Explore a machine, and compare all with what comes of playing every instant."""
    played = Played(automaton, allowed, rows)
    count = len(played.configurations)
    explored = Exploration(automaton, allowed, ties=rows, limit=count)  # so many and no more
    assert explored.configurations == played.configurations
    assert explored.steps == played.steps
    assert explored.origins == played.origins
    if count > 1:
        with pytest.raises(InconclusiveError):
            Exploration(automaton, allowed, ties=rows, limit=count - 1)


@pytest.mark.parametrize("tied", [False, True])
@settings(max_examples=many(200))
@given(graph=machines(most_runners=6), most_changes=st.sampled_from((1, 50_000)), data=st.data())
def test_an_exploration_is_that_which_plays_every_instant(
    tied: bool, graph: Any, most_changes: int, data: st.DataObject
) -> None:
    automaton = automaton_of(graph)
    rows = data.draw(ties(automaton)) if tied else []
    allowed = data.draw(outcomes(len(automaton.runners)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "MOST_CHANGES", most_changes)
        try:
            require_same(automaton, allowed, rows)
        except InconclusiveError:
            reject()


@pytest.mark.parametrize("event", [Event.STARTED, Event.STOPPED])
def test_a_tie_listens_to_a_runner_to_which_nobody_else_does(event: Event) -> None:
    beside = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED b", "b SUCCEEDED a")
    automaton = automaton_of(machine(*beside, "a FAILED r", "b FAILED r", "a SUCCEEDED stop r"))
    tie = Tie((0, 1), resets=(Reset(Signal(automaton.runner_node(2), event)),))
    require_same(automaton, [PLAIN] * 3, [tie])


def test_a_runner_that_hangs_is_not_triggered_again_until_it_is_stopped() -> None:
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "a FAILED a", "a FAILED b", "a SUCCEEDED c")
    automaton = automaton_of(machine(*lines, "c FAILED stop b", "c FAILED b", "c FAILED a"))
    require_same(automaton, [PLAIN, PLAIN | {Outcome.HANG}, PLAIN])


def test_the_instant_of_an_outcome_to_which_nobody_listens_is_played_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    after, played = Instants.after, []

    def counted(self: Instants, *step: Any) -> Any:
        played.append(step)
        return after(self, *step)

    monkeypatch.setattr(Instants, "after", counted)
    beside = [f"start SUCCEEDED r{number}" for number in range(9)]
    again = [f"r{number} FAILED r{(number + 1) % 9}" for number in range(9)]
    stops = [f"r{number} FAILED stop r{(number + 2) % 9}" for number in range(9)]
    explored = Exploration(automaton_of(machine(*beside, *again, *stops)), [PLAIN] * 9)
    assert len(explored.configurations) == 2**9
    assert len(played) == 2 * 9


@given(st.lists(st.lists(st.integers(0, 7), max_size=3), min_size=8, max_size=8))
def test_strong_components_are_those_of_networkx(rows: list[list[int]]) -> None:
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_nodes_from(range(8))
    graph.add_edges_from((at, target) for at, row in enumerate(rows) for target in row)
    components = [frozenset(each) for each in strongly_connected(dict(enumerate(rows)))]
    assert len(components) == len(set(components))
    assert set(components) == set(map(frozenset, nx.strongly_connected_components(graph)))


def test_a_long_path_needs_no_recursion() -> None:
    length = 20_000
    targets = {at: [at + 1] for at in range(length)} | {length: [0]}
    (component,) = strongly_connected(targets)
    assert sorted(component) == sorted(targets)
