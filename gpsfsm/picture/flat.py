"""The layout of a machine's picture: it has no controls, so it is laid out by its connections.

The name of an event is a small box of its own between the node that emits it and all that it leads
to, so that names overlap nothing, whatever the loops. What an event triggers and what it stops
have names of their own. Open ends are points. Start nodes and joins have one event and need no
name for it, unless it stops something.

    A SUCCEEDED → B, C      A ─ SUCCEEDED ─┬→ B
                                           └→ C
    A SUCCEEDED stops D     A ─ SUCCEEDED stops ─┤ D
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.drawing import STOPS, open_events
from gpsfsm.model.event import Event
from gpsfsm.model.labels import drawn_nodes
from gpsfsm.picture.layered import layered
from gpsfsm.picture.layout import Layout
from gpsfsm.picture.shapes import Box, node_size, text_width

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.picture.routing import Point

_NAME_HEIGHT = 12.0
_NAME_SHARE = 0.8
"""The size of an event's name by that of other text."""
_OPEN_END = (10.0, 10.0)
_STRAIGHT = 3.0
"""How much straighter than others the line of a success is to be."""
_HIDDEN = Box(0.0, 0.0, 0.0, 0.0)


class FlatEdge(NamedTuple):
    """A connection, or an open end, whose ``target`` is -1; ``stops``: it stops its target.

    ``route`` leads from the source's border to the target's. ``named`` is the middle of the
    event's name, which the route passes; None where the event needs no name.
    """

    source: int
    event: Event
    target: int
    stops: bool
    route: tuple[Point, ...]
    named: Point | None

    @property
    def name(self) -> str:
        """The words at the connection."""
        return self.event.value + (STOPS if self.stops else "")


@dataclass(frozen=True, slots=True)
class FlatLayout:
    """Boxes of all nodes, by index, empty for those that are not drawn; and all connections."""

    layout: Layout
    edges: tuple[FlatEdge, ...]


def flat_layout(automaton: Automaton) -> FlatLayout:
    """Lay out a machine; the same for the same machine."""
    return _Flat(automaton).laid_out()


class _Flat:
    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self.place: dict[int, int] = {}  # the vertex of a node
        self.sizes: list[tuple[float, float]] = []
        for node in drawn_nodes(automaton):
            self.place[node.index] = self._vertex(node_size(automaton, node))
        self.pairs: list[tuple[int, int]] = []
        self.weights: list[float] = []
        self.names: dict[tuple[int, Event, bool], tuple[int, int]] = {}

    def _vertex(self, size: tuple[float, float]) -> int:
        self.sizes.append(size)
        return len(self.sizes) - 1

    def _line(self, source: int, target: int, weight: float) -> int:
        self.pairs.append((source, target))
        self.weights.append(weight)
        return len(self.pairs) - 1

    def laid_out(self) -> FlatLayout:
        automaton = self.automaton
        arrows = [(edge, stops) for stops in (False, True) for edge in self._edges(stops)]
        rows = [(*edge, stops, self._lines(*edge, stops)) for edge, stops in arrows]
        circles = {self.place[node.index] for node in automaton.nodes if node.kind is NodeKind.JOIN}
        graph = layered(self.sizes, self.pairs, weights=self.weights, circles=circles)
        boxes = [_HIDDEN] * len(automaton.nodes)
        for node, vertex in self.place.items():
            boxes[node] = graph.boxes[vertex]
        edges = []
        for source, event, target, stops, (name, lines) in rows:
            route = tuple(point for line in lines for point in graph.routes[line])
            middle = graph.boxes[name].middle if name >= 0 else None
            edges.append(FlatEdge(source, event, target, stops, route, middle))
        nowhere = (-1,) * len(boxes)
        return FlatLayout(Layout(tuple(boxes), (), nowhere, graph.size, ()), tuple(edges))

    def _edges(self, stops: bool) -> Sequence[tuple[int, Event, int]]:
        automaton = self.automaton
        if stops:
            return automaton.stops
        nodes = automaton.nodes
        ends = [(node.index, each, -1) for node in nodes for each in open_events(automaton, node)]
        return [*automaton.edges, *ends]

    def _lines(
        self,
        source: int,
        event: Event,
        target: int,
        stops: bool,
    ) -> tuple[int, list[int]]:
        """The vertex of the event's name, -1 for none, and the lines of the edge."""
        weight = _STRAIGHT if event is Event.SUCCEEDED and not stops else 1.0
        end = self.place[target] if target >= 0 else self._vertex(_OPEN_END)
        if not stops and self.automaton.nodes[source].kind is not NodeKind.RUNNER:
            return -1, [self._line(self.place[source], end, weight)]
        key = (source, event, stops)
        if key not in self.names:
            words = event.value + (STOPS if stops else "")
            name = self._vertex((round(text_width(words) * _NAME_SHARE + 6, 1), _NAME_HEIGHT))
            self.names[key] = name, self._line(self.place[source], name, weight)
        name, first = self.names[key]
        return name, [first, self._line(name, end, weight)]
