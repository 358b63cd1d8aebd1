"""The graph of an automaton: a frozen ``networkx.MultiDiGraph`` with documented attributes.

It is the automaton's primary form (docs/adr/0008). Nodes are 0, 1, 2, …; the key of a connection
is its number in order of creation, for a graph lists its edges by source. ``docs/machines.md`` has
the table of attributes. What a node is made of lies in the plan already, so that the attributes of
a node are read there when somebody asks; connections with equal attributes share them. Nobody can
change either: ``graph.copy()`` has plain dictionaries.

    <Plan><Runner interface="A" provider="A"/></Plan>
    nodes    0 start   1 runner   2 complete   3 give_up
    edges    (0, 1, 0) SUCCEEDED   (1, 2, 1) SUCCEEDED   (1, 3, 2) FAILED
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.late import dataclass
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import networkx as nx

    from gpsfsm.model.plan import Element, Plan

SCHEMA = 1
"""The version of the attributes: ``graph.graph["version"]``, and that of the JSON of machines."""


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


# --- attributes ---------------------------------------------------------------------------------


class NodeAttributes(Mapping[str, Any]):
    """The attributes of a node of a frozen graph, read from the plan when they are asked for."""

    __slots__ = ("node", "plan")

    def __init__(self, plan: Plan, node: Node) -> None:
        self.plan = plan
        self.node = node

    def __getitem__(self, name: str) -> Any:
        if name in _OF_ALL:
            return _OF_ALL[name](self.plan, self.node)
        if self.node.kind is not NodeKind.RUNNER:
            raise KeyError(name)
        return _OF_RUNNERS[name](self.plan.elements[self.node.origin])

    def __iter__(self) -> Iterator[str]:
        yield from _OF_ALL
        if self.node.kind is NodeKind.RUNNER:
            yield from _OF_RUNNERS

    def __len__(self) -> int:
        return len(_OF_ALL) + (len(_OF_RUNNERS) if self.node.kind is NodeKind.RUNNER else 0)

    def __repr__(self) -> str:
        return repr(self.copy())

    def copy(self) -> dict[str, Any]:
        """The attributes as a dictionary, which networkx asks for where it copies a graph."""
        return dict(self)

    def __deepcopy__(self, _: object) -> dict[str, Any]:
        return self.copy()


class EdgeAttributes(dict[str, str]):
    """The attributes of connections of a frozen graph. There are eight of them for all graphs."""

    __slots__ = ()

    def _refuse(self, *_: object, **__: object) -> Any:
        """Refuse a change."""
        raise TypeError("the attributes of an automaton cannot be changed; change a graph.copy()")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __deepcopy__(self, _: object) -> dict[str, str]:
        return dict(self)

    def __reduce__(self) -> tuple[type[dict[str, str]], tuple[dict[str, str]]]:
        return dict, (dict(self),)


def node_title(plan: Plan, node: Node) -> str:
    """A stable name of a node: ``start``, ``complete``, ``join 7 (/Plan/…)``, a path."""
    if node.kind is NodeKind.RUNNER:
        return plan.path(node.origin)
    if node.kind is NodeKind.JOIN:
        return f"join {node.index} ({plan.path(node.origin)})"
    return node.kind.value


_OF_ALL: dict[str, Callable[[Plan, Node], Any]] = {
    "kind": lambda _, node: node.kind.value,
    "name": node_title,
    "origin": lambda plan, node: plan.path(node.origin),
    "element": lambda _, node: node.origin,
    "need": lambda _, node: node.need,
}
_OF_RUNNERS: dict[str, Callable[[Element], Any]] = {
    "line": lambda element: element.line,
    "column": lambda element: element.column,
    "interface": lambda element: element.interface,
    "provider": lambda element: element.provider,
    "parameters": lambda element: element.parameters,
}
_OF_EDGES = {
    (event, action): EdgeAttributes(event=event.value, action=action.value)
    for event in Event
    for action in Action
}
_EVENTS = {event.value: event for event in Event}


# --- making -------------------------------------------------------------------------------------


class GraphBuilder:
    """A graph that is being made: nodes first, then connections between them."""

    def __init__(self, plan: Plan) -> None:
        import networkx

        self._plan = plan
        self._graph: nx.MultiDiGraph[int] = networkx.MultiDiGraph(version=SCHEMA)
        self._nodes, self._out, self._in = _dictionaries(self._graph)
        self.edges = 0

    def add(self, kind: NodeKind, origin: int, need: int = 0) -> int:
        """Add the next node; returns its number."""
        index = len(self._nodes)
        self._nodes[index] = NodeAttributes(self._plan, Node(index, kind, origin, need))
        self._out[index], self._in[index] = {}, {}
        return index

    def connect(
        self, source: int, event: Event, target: int, action: Action = Action.TRIGGER
    ) -> None:
        """Add the next connection."""
        attributes = _OF_EDGES[event, action]
        between = self._out[source].get(target)
        if between is None:
            self._out[source][target] = self._in[target][source] = {self.edges: attributes}
        else:
            between[self.edges] = attributes
        self.edges += 1

    def finished(self) -> nx.MultiDiGraph[int]:
        """The graph, which cannot be changed from now on."""
        import networkx

        networkx.freeze(self._graph)
        return self._graph


def _dictionaries(graph: Any) -> tuple[Any, Any, Any]:
    """The nodes, what follows them and what they follow, as networkx keeps them.

    ``add_node`` and ``add_edge`` would copy the attributes, 230 bytes for each connection, and take
    three times as long.
    """
    return graph._node, graph._succ, graph._pred


def graph_of(
    plan: Plan, nodes: Iterable[Node], edges: Iterable[Edge], stops: Iterable[Edge] = ()
) -> nx.MultiDiGraph[int]:
    """The graph of parts that are there already."""
    builder = GraphBuilder(plan)
    for node in nodes:
        index = builder.add(node.kind, node.origin, node.need)
        assert index == node.index, "nodes are numbered in their order"
    for action, connections in ((Action.TRIGGER, edges), (Action.STOP, stops)):
        for source, event, target in connections:
            builder.connect(source, event, target, action)
    return builder.finished()


# --- reading ------------------------------------------------------------------------------------


def nodes_of(graph: nx.MultiDiGraph[int]) -> tuple[Node, ...]:
    """The nodes of an automaton's graph, or of an edited copy of one."""
    nodes = tuple(
        data.node
        if isinstance(data, NodeAttributes)
        else Node(index, NodeKind(data["kind"]), data["element"], data["need"])
        for index, data in graph.nodes(data=True)
    )
    assert all(node.index == index for index, node in enumerate(nodes)), "nodes are 0, 1, 2, …"
    return nodes


def edges_of(graph: nx.MultiDiGraph[int], action: Action) -> tuple[Edge, ...]:
    """The connections with this action, in order of creation."""
    wanted = action.value
    rows = [
        (edge_number(key), Edge(source, _EVENTS[data["event"]], target))
        for source, target, key, data in graph.edges(keys=True, data=True)
        if data.get("action", _TRIGGER) == wanted
    ]
    rows.sort(key=_number)
    return tuple([edge for _, edge in rows])


def edge_number(key: object) -> float:
    """The place of a connection in the order of creation, by its key in the graph."""
    return key if isinstance(key, int) else inf


def _number(row: tuple[float, Edge]) -> float:
    return row[0]


_TRIGGER = Action.TRIGGER.value
