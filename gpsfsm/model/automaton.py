"""The automaton (PSFSM): a directed multigraph of runner instances, joins and ends (section 2).

Its primary form is a graph of networkx (``model/graph.py``). The flat tuples that the analyses walk
are read off the graph once, when they are first asked for.
"""

from __future__ import annotations

import hashlib
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.late import collecting_rarely, dataclass
from gpsfsm.model.event import EMITTED, Event, Outcome
from gpsfsm.model.graph import (
    Action,
    Edge,
    Node,
    NodeKind,
    Signal,
    edges_of,
    graph_of,
    node_title,
    nodes_of,
)
from gpsfsm.model.plan import Kind
from gpsfsm.model.showing import shown

if TYPE_CHECKING:
    from collections.abc import Iterable

    import networkx as nx

    from gpsfsm.model.plan import Plan

__all__ = [
    "PAPER",
    "Action",
    "Automaton",
    "Block",
    "Edge",
    "Node",
    "NodeKind",
    "Reset",
    "Signal",
    "Tie",
    "Traits",
]

_LABELS = ("name", "id")


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


class Reset(NamedTuple):
    """An event after which a tie is free again.

    ``before``: the runners (numbers) that came before it where they start at its instant.
    """

    signal: Signal
    before: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Tie:
    """Runners that have one outcome, by their numbers: what the first has the others have, too.

    After one of the ``resets`` the next one may have another outcome. So it may while one of the
    ``writers`` is active, and afterwards. Where a runner starts at the instant of a reset, and came
    before it, its outcome does not count: none does until no runner of the tie is active.
    """

    runners: tuple[int, ...]
    writers: tuple[int, ...] = ()
    resets: tuple[Reset, ...] = ()


@dataclass(frozen=True, slots=False, eq=False)
class Automaton:
    """A compiled plan, or a machine that a user has passed in.

    ``graph`` holds everything that a graph can express. ``blocks`` describes, for each parallel_all
    of more than one unit, what the analyses must know about its join. ``traits`` describes what an
    engine does differently from the paper. To get the automaton of an edited graph, use
    ``dataclasses.replace(automaton, graph=…)``.
    """

    plan: Plan
    graph: nx.MultiDiGraph[int]
    blocks: tuple[Block, ...] = ()
    traits: Traits = PAPER

    @classmethod
    def of(
        cls,
        plan: Plan,
        nodes: Iterable[Node],
        edges: Iterable[Edge],
        *,
        stops: Iterable[Edge] = (),
        blocks: tuple[Block, ...] = (),
        traits: Traits = PAPER,
    ) -> Automaton:
        """The automaton of these parts."""
        return cls(plan, graph_of(plan, nodes, edges, stops), blocks, traits)

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """The nodes: the first is a start node, the runner instances follow in document order."""
        return nodes_of(self.graph)

    @cached_property
    @collecting_rarely()
    def edges(self) -> tuple[Edge, ...]:
        """The connections that trigger their target, in order of creation."""
        return edges_of(self.graph, Action.TRIGGER)

    @cached_property
    def stops(self) -> tuple[Edge, ...]:
        """The connections that stop their target, in order of creation; only machines have any."""
        return edges_of(self.graph, Action.STOP)

    @cached_property
    def complete(self) -> int:
        """The node that completes the plan."""
        return self._end(NodeKind.COMPLETE)

    @cached_property
    def give_up(self) -> int:
        """The node that gives the plan up."""
        return self._end(NodeKind.GIVE_UP)

    def _end(self, kind: NodeKind) -> int:
        """The one node of this kind, which is among the last."""
        return next(node.index for node in reversed(self.nodes) if node.kind is kind)

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
        """The events that a triggered runner emits for this outcome, in order."""
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
    @collecting_rarely()
    def inputs(self) -> tuple[tuple[Signal, ...], ...]:
        """For each node its incoming signals, one per connection, in order of creation."""
        inputs: list[list[Signal]] = [[] for _ in self.nodes]
        for source, event, target in self.edges:
            inputs[target].append(Signal(source, event))
        return tuple(map(tuple, inputs))

    @cached_property
    @collecting_rarely()
    def outputs(self) -> dict[Signal, tuple[int, ...]]:
        """For each signal with a connection its target nodes, in order of creation."""
        outputs: dict[Signal, list[int]] = {}
        for source, event, target in self.edges:
            outputs.setdefault(Signal(source, event), []).append(target)
        return {signal: tuple(targets) for signal, targets in outputs.items()}

    @cached_property
    def specified(self) -> frozenset[Signal]:
        """The signals that have a connection, which triggers or stops a node."""
        return frozenset(Signal(edge[0], edge[1]) for edge in (*self.edges, *self.stops))

    @cached_property
    def successors(self) -> tuple[tuple[int, ...], ...]:
        """For each node the nodes that its events trigger, one per connection."""
        successors: list[list[int]] = [[] for _ in self.nodes]
        for source, _, target in self.edges:
            successors[source].append(target)
        return tuple(map(tuple, successors))

    @cached_property
    @collecting_rarely()
    def order(self) -> tuple[int, ...]:
        """All nodes in topological order: each after the nodes of its inputs."""
        import networkx

        assert not self.stops, "only what triggers counts"
        return tuple(networkx.topological_sort(self.graph))

    def name(self, node: int) -> str:
        """A stable name of a node: ``start``, ``complete``, ``join 7 (/Plan/…)``, a path."""
        return node_title(self.plan, self.nodes[node])

    @cached_property
    def fingerprint(self) -> str:
        """A SHA-256 of the plan's content: its elements, with the parameters as written."""
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

    def to_dot(self) -> str:
        """The automaton in the language of Graphviz; the same bytes for the same plan."""
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
