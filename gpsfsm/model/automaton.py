"""The automaton (PSFSM): a directed multigraph of runner instances, joins and ends (section 2).

The parts are kept in flat tuples, which the analyses read; ``graph`` is the same as a frozen
``networkx.MultiDiGraph``, made when it is first asked for.
"""

from __future__ import annotations

import hashlib
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.late import dataclass
from gpsfsm.model.event import EMITTED, Event, Outcome
from gpsfsm.model.plan import Kind
from gpsfsm.model.showing import shown

if TYPE_CHECKING:
    import networkx as nx

    from gpsfsm.model.plan import Plan

_LABELS = ("name", "id")


class NodeKind(StrEnum):
    """The kind of a node of the automaton."""

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


class Action(StrEnum):
    """The effect of a connection on the node that it leads to."""

    TRIGGER = "trigger"
    STOP = "stop"


class Edge(NamedTuple):
    """A connection: ``event`` of the node ``source`` triggers, or stops, the node ``target``."""

    source: int
    event: Event
    target: int


@dataclass(frozen=True, slots=True)
class Traits:
    """The run-time traits of an engine beyond semantics.md; the default is the paper's.

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
    """A compiled plan, or a machine that was handed in.

    ``nodes[0]`` is a start node; the runner instances follow in document order. ``edges`` trigger
    what they lead to, ``stops`` stop it; only machines have these. ``blocks`` tells, for each
    parallel_all of more than one unit, what the analyses must know about its join.
    """

    plan: Plan
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    complete: int
    give_up: int
    blocks: tuple[Block, ...] = ()
    traits: Traits = PAPER
    stops: tuple[Edge, ...] = ()

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """The start nodes, in order of creation."""
        return tuple(node.index for node in self.nodes if node.kind is NodeKind.START)

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
        """The events that a runner emits that is triggered and has this outcome, in order."""
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
        inputs: list[list[Signal]] = [[] for _ in self.nodes]
        for source, event, target in self.edges:
            inputs[target].append(Signal(source, event))
        return tuple(map(tuple, inputs))

    @cached_property
    def outputs(self) -> dict[Signal, tuple[int, ...]]:
        """For each signal with a connection the nodes that it leads to, in order of creation."""
        outputs: dict[Signal, list[int]] = {}
        for source, event, target in self.edges:
            outputs.setdefault(Signal(source, event), []).append(target)
        return {signal: tuple(targets) for signal, targets in outputs.items()}

    @cached_property
    def specified(self) -> frozenset[Signal]:
        """The signals that lead anywhere: that trigger or stop a node."""
        return frozenset(Signal(edge[0], edge[1]) for edge in (*self.edges, *self.stops))

    @cached_property
    def successors(self) -> tuple[tuple[int, ...], ...]:
        """For each node the nodes that its events trigger, one per connection."""
        successors: list[list[int]] = [[] for _ in self.nodes]
        for source, _, target in self.edges:
            successors[source].append(target)
        return tuple(map(tuple, successors))

    @cached_property
    def order(self) -> tuple[int, ...]:
        """All nodes in topological order: each after those that its inputs come from.

        A node is due when the last of its inputs is in the order; start and what nothing leads to
        come first. The loops of ``traits.looping`` are no edges, so that there is no cycle.

            edges 0→1, 0→2, 1→3, 2→3        missing inputs 0, 1, 1, 2
            order 0; then 1 and 2 miss none; then 3
        """
        missing = [len(inputs) for inputs in self.inputs]
        order = [node for node, count in enumerate(missing) if not count]
        for node in order:  # grows while it is read
            for target in self.successors[node]:
                missing[target] -= 1
                if not missing[target]:
                    order.append(target)
        assert len(order) == len(self.nodes), "an automaton has no cycles"
        return tuple(order)

    def name(self, node: int) -> str:
        """A stable name of a node: ``start``, ``complete``, ``join 7 (/Plan/…)``, a path."""
        at = self.nodes[node]
        if at.kind is NodeKind.RUNNER:
            return self.plan.path(at.origin)
        if at.kind is NodeKind.JOIN:
            return f"join {node} ({self.plan.path(at.origin)})"
        return at.kind.value

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
                f"{attribute.name}={attribute.text}"
                for attribute in element.attributes
                if (element.kind is Kind.RUNNER or element.tag) and attribute.name not in _LABELS
            )
            sized = "".join(f"{len(part)}:{part}" for part in parts)
            digest.update(f"{len(parts)}:{sized}".encode("utf-8", "surrogatepass"))
        return digest.hexdigest()

    @cached_property
    def graph(self) -> nx.MultiDiGraph[int]:
        """The automaton as a frozen ``networkx.MultiDiGraph``.

        Nodes are indices with the attributes ``kind``, ``name``, ``origin`` (element path) and
        ``need``, runners also ``interface``, ``provider`` and ``parameters``; edges have the
        attributes ``event`` and ``action``. ``gpsfsm.check`` takes it (docs/machines.md).
        """
        import networkx

        graph: nx.MultiDiGraph[int] = networkx.MultiDiGraph()
        for node in self.nodes:
            attributes: dict[str, Any] = {
                "kind": node.kind.value,
                "name": self.name(node.index),
                "origin": self.plan.path(node.origin),
                "need": node.need,
            }
            if node.kind is NodeKind.RUNNER:
                element = self.plan.elements[node.origin]
                attributes["interface"] = element.interface
                attributes["provider"] = element.provider
                attributes["parameters"] = element.parameters
            graph.add_node(node.index, **attributes)
        for action, edges in ((Action.TRIGGER, self.edges), (Action.STOP, self.stops)):
            for source, event, target in edges:
                graph.add_edge(source, target, event=event.value, action=action.value)
        networkx.freeze(graph)
        return graph

    def to_dot(self) -> str:
        """The automaton in Graphviz' language; the same bytes for the same plan."""
        from gpsfsm.model.drawing import automaton_to_dot

        return automaton_to_dot(self)

    def to_mermaid(self) -> str:
        """The automaton as a Mermaid flowchart."""
        from gpsfsm.model.drawing import automaton_to_mermaid

        return automaton_to_mermaid(self)

    def _repr_svg_(self) -> str | None:
        """Its picture, for notebooks."""
        return shown("automaton_svg", self)

    def to_json(self) -> str:
        """The automaton as JSON: ``nodes`` and ``edges``, in order of creation."""
        from gpsfsm.model.drawing import automaton_to_json

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
