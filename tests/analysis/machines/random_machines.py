"""Random machines, for comparisons: a few runners and joins, with loops and stops."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import networkx as nx
from hypothesis import strategies as st

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.automaton import NodeKind, Reset, Signal, Tie
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hypothesis.strategies import DrawFn

    from gpsfsm.model.automaton import Automaton

EVENTS = ("SUCCEEDED", "FAILED", "STARTED", "STARTED", "STOPPED")
_NEEDS = st.sampled_from((1, 2, 2, 2, 3))
_OFTEN = st.sampled_from((True, True, True, False))
_SELDOM = st.sampled_from((False, False, True))
_OUTCOME = st.sampled_from(("SUCCEEDED", "FAILED"))
PLAIN = frozenset({Outcome.SUCCEEDED, Outcome.FAILED})
_NODES = (NodeKind.RUNNER, NodeKind.JOIN)


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
    """A well-formed machine with up to two joins, with loops, stops and several starts.

    Events that come at the instant of their cause lead to nodes of a higher rank only, so that none
    causes itself. Outcomes of runners lead anywhere.
    """
    runners = [f"r{number}" for number in range(draw(st.integers(1, most_runners)))]
    joins = {f"j{number}": draw(_NEEDS) for number in range(draw(st.sampled_from((0, 1, 1, 2))))}
    rank = {name: 2 * place for place, name in enumerate(runners)}
    rank |= {name: 2 * draw(st.integers(0, len(runners))) - 1 for name in joins}
    rank["j1"] = rank.get("j1", 0) + 0.5
    nodes = [*runners, *joins]
    anything = [*nodes, *nodes, "end", "end", "lost"]

    def later(name: str) -> list[str]:
        return [each for each in nodes if rank[each] > rank[name]]

    lines = [f"start SUCCEEDED {runners[0]}"]
    lines += draw(_beginnings(runners, nodes, anything))
    for name in runners:
        for event, counts in (("SUCCEEDED", (0, 1, 1, 2)), ("FAILED", (0, 0, 1, 1))):
            for _ in range(draw(st.sampled_from(counts))):
                lines.append(f"{name} {event} {draw(st.sampled_from(anything))}")
    for name in joins:
        for _ in range(draw(st.integers(1, 3))):
            lines.append(f"{draw(st.sampled_from(runners))} {draw(_OUTCOME)} {name}")
        for _ in range(draw(st.sampled_from((0, 1, 1, 2)))):
            target = draw(st.sampled_from([*later(name), "end", "lost"]))
            lines.append(f"{name} SUCCEEDED {target}")
    for action, counts in (("trigger", (0, 0, 1, 2)), ("stop", (0, 0, 1, 1, 2))):
        for _ in range(draw(st.sampled_from(counts))):
            name, event = draw(st.sampled_from(nodes)), draw(st.sampled_from(EVENTS))
            event = "SUCCEEDED" if name in joins else event
            targets = nodes if name in runners and event in EVENTS[:2] else later(name)
            if targets:
                lines.append(f"{name} {event} {action} {draw(st.sampled_from(targets))}")
    return machine(*lines, **joins)


@st.composite
def _beginnings(
    draw: DrawFn, runners: list[str], nodes: list[str], anything: list[str]
) -> list[str]:
    """Connections by which most runners are triggered: what never is makes dull machines."""
    lines: list[str] = []
    for place, name in enumerate(runners[1:], start=1):
        if draw(_OFTEN):
            event = draw(st.sampled_from(EVENTS[:3]))
            lines.append(f"{runners[draw(st.integers(0, place - 1))]} {event} {name}")
    if draw(_SELDOM):
        lines.append(f"start SUCCEEDED {draw(st.sampled_from(nodes))}")
    if draw(_SELDOM):
        lines.append(f"start2 SUCCEEDED {draw(st.sampled_from(anything))}")
    return lines


@st.composite
def order_free_machines(draw: DrawFn, *, most_runners: int = 4) -> nx.MultiDiGraph[Any]:
    """A machine without loops and stops in which every runner is triggered once at most.

    The automata of plans are such machines; these have several starts and joins of k of n besides.
    """
    signals = ["start SUCCEEDED", "start2 SUCCEEDED"]
    lines = ["start SUCCEEDED r0", "start2 SUCCEEDED r0"][draw(st.integers(0, 1)) :][:1]
    joins: dict[str, int] = {}
    for number in range(draw(st.integers(1, most_runners))):
        name = f"r{number}"
        if number and draw(_OFTEN):
            lines.append(f"{draw(st.sampled_from(signals))} {name}")
        signals += [f"{name} {event}" for event in ("SUCCEEDED", "FAILED", "FAILED", "STARTED")]
        if draw(_SELDOM):
            join = f"j{number}"
            joins[join] = draw(_NEEDS)
            for _ in range(draw(st.integers(1, 4))):
                lines.append(f"{draw(st.sampled_from(signals))} {join}")
            signals += [f"{join} SUCCEEDED"] * 3
    for end in ("end", "lost"):
        for _ in range(draw(st.integers(0, 2))):
            lines.append(f"{draw(st.sampled_from(signals))} {end}")
    named = {line.split()[0] for line in lines} | {line.split()[-1] for line in lines}
    graph = machine(*lines, **{name: need for name, need in joins.items() if name in named})
    if not any(kind == "runner" for _, kind in graph.nodes(data="kind")):
        graph.add_node("r0", kind="runner", interface="r0")
    return graph


def outcomes(runners: int) -> st.SearchStrategy[list[frozenset[Outcome]]]:
    """The outcomes that each runner can have."""
    choices = [PLAIN, PLAIN, PLAIN | {Outcome.HANG}, frozenset({Outcome.SUCCEEDED})]
    return st.lists(st.sampled_from(choices), min_size=runners, max_size=runners)


def options_of(names: Sequence[str], allowed: Sequence[frozenset[Outcome]]) -> AnalysisOptions:
    """The options under which the runners of these names have these outcomes."""
    hang = any(Outcome.HANG in each for each in allowed)
    words = {Outcome.HANG: "hangs"} if hang else {}
    words |= {Outcome.SUCCEEDED: "succeeds", Outcome.FAILED: "fails"}
    assumptions = [
        f'name "{name}" never {word}'
        for name, each in zip(names, allowed, strict=True)
        for outcome, word in words.items()
        if outcome not in each
    ]
    return AnalysisOptions(faults=("hang",) * hang, assumptions=tuple(assumptions))


@st.composite
def ties(draw: DrawFn, automaton: Automaton) -> list[Tie]:
    """Disjoint ties; writers and resets are any runners and events."""
    numbers = st.sampled_from(range(len(automaton.runners)))
    left = draw(st.permutations(range(len(automaton.runners))))
    events = [
        Signal(node.index, event)
        for node in automaton.nodes
        if node.kind in _NODES
        for event in ([Event.SUCCEEDED] if node.kind is NodeKind.JOIN else list(Event))
    ]
    result = []
    while len(left) > 1 and len(result) < 2:
        size = draw(st.integers(2, 3))
        members, left = left[:size], left[size:]
        result.append(
            Tie(
                tuple(sorted(members)),
                tuple(sorted(draw(st.sets(numbers, max_size=1)))),
                tuple(
                    Reset(signal, tuple(sorted(draw(st.sets(st.sampled_from(sorted(members)))))))
                    for signal in sorted(draw(st.sets(st.sampled_from(events), max_size=2)))
                ),
            )
        )
    return result
