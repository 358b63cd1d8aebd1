"""Random machines, for comparisons: a few runners and joins, with loops and stops."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import networkx as nx
from hypothesis import strategies as st

from gpsfsm.compile.machines import machine_of
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn

    from gpsfsm.model.automaton import Automaton

EVENTS = ("SUCCEEDED", "FAILED", "SUCCEEDED", "FAILED", "STARTED", "STOPPED")
PLAIN = frozenset({Outcome.SUCCEEDED, Outcome.FAILED})


def machine(*connections: str, **needs: int) -> nx.MultiDiGraph[Any]:
    """A machine of lines such as ``a FAILED b`` or ``a FAILED stop b``.

    Nodes are runners, but for ``start…``, ``end``, ``lost`` and the joins, which ``needs`` names.
    """
    graph: nx.MultiDiGraph[Any] = nx.MultiDiGraph()
    for connection in connections:
        source, event, *action, target = connection.split()
        for name in (source, target):
            if name in needs:
                graph.add_node(name, kind="join", need=needs[name])
            elif name.startswith("start"):
                graph.add_node(name, kind="start")
            elif name in ("end", "lost"):
                graph.add_node(name, kind="complete" if name == "end" else "give_up")
            else:
                graph.add_node(name, kind="runner", interface=name)
        graph.add_edge(source, target, event=event, action=(action or ["trigger"])[0])
    return graph


def automaton_of(graph: nx.MultiDiGraph[Any]) -> Automaton:
    """The automaton of a machine that is well-formed."""
    plan, problems = machine_of(graph)
    assert plan is not None, problems
    return plan.automaton


@st.composite
def machines(draw: DrawFn, *, most_runners: int = 4) -> nx.MultiDiGraph[Any]:
    """A machine, well-formed or not, with up to two joins and two connections that stop."""
    runners = [f"r{number}" for number in range(draw(st.integers(1, most_runners)))]
    joins = {f"j{number}": draw(st.integers(1, 3)) for number in range(draw(st.integers(0, 2)))}
    lines = [f"start SUCCEEDED {runners[0]}"]
    if draw(st.booleans()):
        lines.append(f"start2 SUCCEEDED {draw(st.sampled_from(runners))}")
    sources = [*runners, *joins]
    for most, action, targets in (
        (10, "trigger", [*runners, *joins, "end", "lost"]),
        (2, "stop", [*runners, *joins]),
    ):
        for _ in range(draw(st.integers(0, most))):
            source = draw(st.sampled_from(sources))
            event = "SUCCEEDED" if source in joins else draw(st.sampled_from(EVENTS))
            lines.append(f"{source} {event} {action} {draw(st.sampled_from(targets))}")
    return machine(*lines, **joins)


def outcomes(runners: int) -> st.SearchStrategy[list[frozenset[Outcome]]]:
    """The outcomes that each runner can have."""
    choices = [PLAIN, PLAIN, PLAIN | {Outcome.HANG}, frozenset({Outcome.SUCCEEDED})]
    return st.lists(st.sampled_from(choices), min_size=runners, max_size=runners)
