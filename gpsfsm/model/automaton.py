"""The automaton (PSFSM): a directed multigraph of runner instances, joins and ends (section 2).

The parts are kept in flat tuples, which the analyses read; ``graph`` is the same as a frozen
``networkx.MultiDiGraph``, made when it is first asked for.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.model.event import EMITTED, Event, Outcome
from gpsfsm.model.plan import Kind
from gpsfsm.model.showing import shown

if TYPE_CHECKING:
    import networkx as nx

    from gpsfsm.model.plan import Plan

__all__ = ["PAPER", "Automaton", "Block", "Edge", "Node", "NodeKind", "Signal", "Traits"]

_LABELS = ("name", "id")


class NodeKind(StrEnum):
    """What a node of the automaton is."""

    START = "start"
    RUNNER = "runner"
    JOIN = "join"
    COMPLETE = "complete"
    GIVE_UP = "give_up"


class Signal(NamedTuple):
    """One event of one node: what a connection starts from. ``node`` is a node's index."""

    node: int
    event: Event


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A node. ``origin`` is the index of the element it comes from (in ``Plan.elements``).

    ``need`` is the number of inputs after which a join emits SUCCEEDED; 0 for other nodes.
    """

    index: int
    kind: NodeKind
    origin: int
    need: int = 0


class Edge(NamedTuple):
    """A connection: ``event`` of the node ``source`` triggers the node ``target``."""

    source: int
    event: Event
    target: int


@dataclass(frozen=True, slots=True)
class Traits:
    """What an engine does at run time that semantics.md does not say; the default is the paper's.

    ``engine``: the name of its profile. ``gives_up``: an unhandled failure ends the run; without
    it, the run hangs. ``silent``: the nodes of runners that emit no STARTED. ``refusals_hang``: an
    instance that does not start emits nothing at all. ``breaking``: the joins at which a second
    input aborts the engine. ``looping``: the joins that are wired to themselves, which is no edge
    of the automaton: it would be their second input.
    """

    engine: str = "paper"
    gives_up: bool = True
    refusals_hang: bool = False
    silent: frozenset[int] = frozenset()
    breaking: frozenset[int] = frozenset()
    looping: frozenset[int] = frozenset()


PAPER = Traits()


@dataclass(frozen=True, slots=False, eq=False)
class Automaton:
    """A compiled plan.

    ``nodes[0]`` is start; the runner instances follow in document order. ``blocks`` tells, for each
    parallel_all of more than one unit, what the analyses must know about its join.
    """

    plan: Plan
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    complete: int
    give_up: int
    blocks: tuple[Block, ...] = ()
    traits: Traits = PAPER

    @cached_property
    def deadly(self) -> tuple[int, ...]:
        """The joins at which a second input aborts the engine before the plan has completed.

        An input of any other one in ``traits.breaking`` that is its second comes after completion:
        the first has completed the plan at that very instant.
        """
        ending = {
            source for source, _, target in self.edges if target == self.complete
        } & self.traits.breaking
        return tuple(
            sorted(
                node
                for node in self.traits.breaking
                if node not in ending or self.nodes[node].need != 1
            )
        )

    def emitted(self, node: int, outcome: Outcome) -> tuple[Event, ...]:
        """What a runner emits that is triggered and has this outcome, in order."""
        events = EMITTED[outcome]
        if outcome is Outcome.NO_START and self.traits.refusals_hang:
            return ()
        if node in self.traits.silent:
            return tuple(event for event in events if event is not Event.STARTED)
        return events

    @cached_property
    def runners(self) -> tuple[Node, ...]:
        """The runner instances, in document order."""
        return tuple(node for node in self.nodes if node.kind is NodeKind.RUNNER)

    def runner_number(self, node: int) -> int:
        """The number of a runner node in document order, from 0; start is node 0."""
        return node - 1

    def runner_node(self, number: int) -> int:
        """The node of the runner instance with this number."""
        return number + 1

    @cached_property
    def inputs(self) -> tuple[tuple[Signal, ...], ...]:
        """For each node the signals that lead to it, one per connection, in order of creation."""
        found: list[list[Signal]] = [[] for _ in self.nodes]
        for source, event, target in self.edges:
            found[target].append(Signal(source, event))
        return tuple(map(tuple, found))

    @cached_property
    def outputs(self) -> dict[Signal, tuple[int, ...]]:
        """For each signal with a connection the nodes that it leads to, in order of creation."""
        found: dict[Signal, list[int]] = {}
        for source, event, target in self.edges:
            found.setdefault(Signal(source, event), []).append(target)
        return {signal: tuple(targets) for signal, targets in found.items()}

    @cached_property
    def successors(self) -> tuple[tuple[int, ...], ...]:
        """For each node the nodes that its events trigger, one per connection."""
        found: list[list[int]] = [[] for _ in self.nodes]
        for source, _, target in self.edges:
            found[source].append(target)
        return tuple(map(tuple, found))

    def name(self, node: int) -> str:
        """A stable name of a node: ``start``, ``complete``, ``join 7 (/Plan/…)``, a path."""
        found = self.nodes[node]
        if found.kind is NodeKind.RUNNER:
            return self.plan.path(found.origin)
        if found.kind is NodeKind.JOIN:
            return f"join {node} ({self.plan.path(found.origin)})"
        return found.kind.value

    @cached_property
    def fingerprint(self) -> str:
        """A SHA-256 of what the plan asks for: its elements and the parameters as they are written.

        Layout, comments, labels and the order of attributes make no difference.
        """
        digest = hashlib.sha256()
        for element in self.plan.elements:
            parts = [
                element.kind.value,
                str(element.parent),
                element.tag or element.control_type or "",
            ]
            parts += sorted(
                f"{found.name}={found.text}"
                for found in element.attributes
                if (element.kind is Kind.RUNNER or element.tag) and found.name not in _LABELS
            )
            told = "".join(f"{len(part)}:{part}" for part in parts)
            digest.update(f"{len(parts)}:{told}".encode("utf-8", "surrogatepass"))
        return digest.hexdigest()

    @cached_property
    def graph(self) -> nx.MultiDiGraph[int]:
        """The automaton as a frozen ``networkx.MultiDiGraph``.

        Nodes are indices with the attributes ``kind``, ``name``, ``origin`` (element path) and
        ``need``; edges have the attribute ``event``.
        """
        import networkx  # noqa: PLC0415  (slow to import, and most checks need no graph)

        graph: nx.MultiDiGraph[int] = networkx.MultiDiGraph()
        for node in self.nodes:
            attributes: dict[str, Any] = {
                "kind": node.kind.value,
                "name": self.name(node.index),
                "origin": self.plan.path(node.origin),
                "need": node.need,
            }
            graph.add_node(node.index, **attributes)
        for source, event, target in self.edges:
            graph.add_edge(source, target, event=event.value)
        networkx.freeze(graph)
        return graph

    def to_dot(self) -> str:
        """The automaton in Graphviz' language; the same bytes for the same plan."""
        from gpsfsm.model.drawing import automaton_to_dot  # noqa: PLC0415

        return automaton_to_dot(self)

    def to_mermaid(self) -> str:
        """The automaton as a Mermaid flowchart."""
        from gpsfsm.model.drawing import automaton_to_mermaid  # noqa: PLC0415

        return automaton_to_mermaid(self)

    def _repr_svg_(self) -> str | None:
        """Its picture, for notebooks."""
        return shown("automaton_svg", self)

    def to_json(self) -> str:
        """The automaton as JSON: ``nodes`` and ``edges``, in order of creation."""
        from gpsfsm.model.drawing_json import automaton_to_json  # noqa: PLC0415

        return automaton_to_json(self)


@dataclass(frozen=True, slots=True)
class Block:
    """A parallel_all of n > 1 units.

    ``element`` is its index in ``Plan.elements``; ``trigger`` the signal that triggers its units;
    ``join`` its join node; ``failure`` its failure signal (None if it cannot fail);
    ``units`` per unit its (success, failure) signals.
    """

    element: int
    trigger: Signal | None
    join: int
    failure: Signal | None
    units: tuple[tuple[Signal | None, Signal | None], ...]
