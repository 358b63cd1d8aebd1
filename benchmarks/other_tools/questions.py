"""The questions that are put to other tools, and the part of an automaton that they depend on."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

from gpsfsm.model.automaton import Automaton, Edge, Node, NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Set


@dataclass(frozen=True, slots=True)
class CanTrigger:
    """Is there a run that triggers ``node`` (in which the join ``node`` fires)?"""

    node: int


@dataclass(frozen=True, slots=True)
class CanMiss:
    """Is there a maximal run in which ``after`` comes, but ``node`` is never triggered?

    Without ``after``: a maximal run that never triggers ``node``.
    """

    node: int
    after: Signal | None = None


Question: TypeAlias = CanTrigger | CanMiss

Style: TypeAlias = Literal["natural", "expert"]
"""How a model is written: as one would at first, or by somebody who knows the tool well."""


def completes(automaton: Automaton) -> Question:
    """Can the plan complete?"""
    return CanTrigger(automaton.complete)


def gives_up(automaton: Automaton) -> Question:
    """Can the plan give up?"""
    return CanTrigger(automaton.give_up)


def join_waits(automaton: Automaton, block: int = 0) -> Question:
    """Can the join of this parallel_all wait for ever, once its units were triggered?"""
    blocked = automaton.blocks[block]
    if blocked.trigger is None:
        raise ValueError("nothing ever triggers this parallel_all")
    return CanMiss(blocked.join, blocked.trigger)


@dataclass(frozen=True, slots=True)
class Cone:
    """What a question depends on: nodes in an order in which sources come before targets.

    ``into`` and ``out`` are the connections (by their place in ``edges``) into a node and out of
    a signal. A runner in ``never_fails`` has no connections at its FAILED.
    """

    automaton: Automaton
    question: Question | None
    nodes: tuple[int, ...]
    edges: tuple[Edge, ...]
    never_fails: Set[int]
    into: dict[int, list[int]] = field(default_factory=dict)
    out: dict[Signal, list[int]] = field(default_factory=dict)

    def node(self, number: int) -> Node:
        """The node itself."""
        return self.automaton.nodes[number]

    def collects(self, number: int) -> bool:
        """Whether the node is a join that needs several inputs."""
        return self.node(number).need > 1

    def targets(self, signal: Signal) -> list[int]:
        """The connections that start from a signal."""
        return self.out.get(signal, [])

    def events(self, number: int) -> list[Event]:
        """How a node can end: the outcomes of a runner, SUCCEEDED of any other."""
        if self.node(number).kind is NodeKind.RUNNER and number not in self.never_fails:
            return [Event.SUCCEEDED, Event.FAILED]
        return [Event.SUCCEEDED]


def cone_of(automaton: Automaton, question: Question | None, never_fails: Set[int]) -> Cone:
    """Leave out what nothing ever triggers, and what the question, if any, does not depend on."""
    edges = [
        edge
        for edge in automaton.edges
        if not (edge.event is Event.FAILED and edge.source in never_fails)
    ]
    forwards, backwards = defaultdict(list), defaultdict(list)
    for source, _, target in edges:
        forwards[source].append(target)
        backwards[target].append(source)
    nodes = [] if question is None else [question.node]
    if isinstance(question, CanMiss) and question.after is not None:
        nodes.append(question.after.node)
    kept = _closure([0], forwards)
    if question is not None:
        kept = kept & _closure(nodes, backwards) | {0, *nodes}
    edges = [edge for edge in edges if edge.source in kept and edge.target in kept]
    into: dict[int, list[int]] = {node: [] for node in kept}
    out: dict[Signal, list[int]] = {}
    for number, edge in enumerate(edges):
        into[edge.target].append(number)
        out.setdefault(Signal(edge.source, edge.event), []).append(number)
    order = tuple(_sorted(kept, edges))
    return Cone(automaton, question, order, tuple(edges), never_fails, into, out)


def threads(cone: Cone, *, apart: int | None = None) -> dict[int, int]:
    """The thread of each node: the first of the nodes that happen one after the other.

    A node continues the thread of its sources if they are all in one, and if nothing else starts
    from the signals that lead to it. Nodes of one thread never happen at the same time, and of
    several signals of one thread that lead to one node only one can come. The node ``apart``
    gets a thread of its own.
    """
    numbers: dict[int, int] = {}
    for node in cone.nodes:
        inputs = [cone.edges[number] for number in cone.into[node]]
        heads = {numbers[edge.source] for edge in inputs}
        alone = all(
            edge.event is not Event.STARTED
            and len(cone.targets(Signal(edge.source, edge.event))) == 1
            for edge in inputs
        )
        continues = len(heads) == 1 and alone and not cone.collects(node) and node != apart
        numbers[node] = heads.pop() if continues else node
    return numbers


def _closure(start: list[int], step: dict[int, list[int]]) -> set[int]:
    reached, pending = set(start), list(start)
    while pending:
        fresh = [node for node in step[pending.pop()] if node not in reached]
        reached.update(fresh)
        pending += fresh
    return reached


def _sorted(nodes: set[int], edges: list[Edge]) -> list[int]:
    """Every node after the sources of its connections (the automaton has no cycles)."""
    waiting = dict.fromkeys(sorted(nodes), 0)
    successors = defaultdict(list)
    for source, _, target in edges:
        waiting[target] += 1
        successors[source].append(target)
    order = [node for node, number in waiting.items() if number == 0]
    for node in order:  # grows while we walk
        for target in successors[node]:
            waiting[target] -= 1
            if waiting[target] == 0:
                order.append(target)
    return order
