"""Layered layout of any directed graph: cycles, several starts and parallel edges are welcome.

The usual four steps, each linear or nearly so per sweep: edges that close a cycle are turned
round, so that what is left has no cycle; every node gets the layer below the lowest of those that
lead to it; within layers the order is that with the fewest crossings that sweeps over the means of
the neighbours find; and x is as near to the neighbours as the order allows. An edge over several
layers has a place in each, which edges of one bundle with the same end share; one that was turned
round is drawn from its end back.

    edges 0→1, 1→2, 2→0, 0→2      turned round: 2→0
    layers {0}, {1}, {2}          0→2 and 2→0 pass the layer of 1 in places of their own
    route of 2→0                  from the top of 2, beside 1, to the bottom of 0

A graph whose edges would need too many such places is no picture anybody reads; its long edges
have none and are drawn straight, so that it takes seconds and not minutes.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

from gpsfsm.picture.shapes import Box

if TYPE_CHECKING:
    from collections.abc import Collection, Hashable, Iterable, MutableSequence, Sequence

    from gpsfsm.picture.routing import Point

_NODE_GAP = 36.0
_LINE_GAP = 14.0
_LAYER_GAP = 44.0
_MARGIN = 20.0
_SWEEPS = 8
_STRAIGHT = 4.0
"""How much more a place of a long edge pulls than a node does, so that such edges are straight."""
_PORTS = 0.6
"""The share of a node's side on which edges begin and end."""
_LOOP = 16.0
_MOST_PLACES = 60_000
"""Places of long edges in a graph whose edges go round nodes: some two seconds, 2 MB of routes."""


@dataclass(frozen=True, slots=True)
class LayeredLayout:
    """Boxes per node, which do not overlap; routes per edge, which end on the borders of nodes."""

    boxes: tuple[Box, ...]
    routes: tuple[tuple[Point, ...], ...]
    size: tuple[float, float]


def layered(
    sizes: Sequence[tuple[float, float]],
    edges: Sequence[tuple[int, int]],
    *,
    weights: Sequence[float] = (),
    bundles: Sequence[Hashable] = (),
    circles: Collection[int] = (),
) -> LayeredLayout:
    """Lay out a graph; the same for the same graph.

    ``sizes`` are width and height per node, ``weights`` tell per edge how much it wants to be
    straight, and ``bundles`` with which others it may share its line to their common end. Edges of
    ``circles`` end in the middle of their upper or lower side.
    """
    weights, bundles = weights or [1.0] * len(edges), bundles or range(len(edges))
    return _Layering(sizes, edges, weights, bundles, frozenset(circles)).laid_out()


class _Layering:
    """The places of a graph: its nodes, then one per edge and layer that the edge passes."""

    def __init__(
        self,
        sizes: Sequence[tuple[float, float]],
        edges: Sequence[tuple[int, int]],
        weights: Sequence[float],
        bundles: Sequence[Hashable],
        circles: frozenset[int],
    ) -> None:
        self.count = len(sizes)
        self.edges = edges
        self.circles = circles
        self.width = [width for width, _ in sizes]
        self.height = [height for _, height in sizes]
        self.bundles = bundles
        self.turned = _turned_edges(self.count, edges)
        self.layer = self._layers()
        self.straight = self._passed() > _MOST_PLACES
        self.shared: dict[Hashable, int] = {}
        self.chains = [self._chain(number) for number in range(len(edges))]
        self.above: list[list[tuple[int, float]]] = [[] for _ in self.width]
        self.below: list[list[tuple[int, float]]] = [[] for _ in self.width]
        met: set[tuple[int, int]] = set()
        for chain, weight in zip(self.chains, weights, strict=True):
            for upper, lower in pairwise(chain):
                if upper < self.count or (upper, lower) not in met:
                    met.add((upper, lower))
                    self.below[upper].append((lower, weight))
                    self.above[lower].append((upper, weight))
        self.rows: list[list[int]] = [[] for _ in range(max(self.layer, default=-1) + 1)]
        for place, layer in enumerate(self.layer):
            self.rows[layer].append(place)
        self.x = [0.0] * len(self.width)

    def laid_out(self) -> LayeredLayout:
        self._order()
        self._set_x()
        tops, whole = self._tops()
        left = min((self.x[it] - self.width[it] / 2 for it in range(len(self.x))), default=0.0)
        self.x = [x - left + _MARGIN for x in self.x]
        boxes = tuple(self._box(node, tops) for node in range(self.count))
        self._assert_apart(boxes)
        routes = tuple(self._routes(boxes, tops))
        right = max((x for route in routes for x, _ in route), default=0.0)
        right = max([right, *(box.right for box in boxes)])
        return LayeredLayout(boxes, routes, (right + _MARGIN, whole))

    # -- layers ----------------------------------------------------------------------------------

    def _arrows(self) -> list[tuple[int, int]]:
        """The edges as they lead down, without loops."""
        return [
            (target, source) if number in self.turned else (source, target)
            for number, (source, target) in enumerate(self.edges)
            if source != target
        ]

    def _layers(self) -> list[int]:
        """The longest path from a start; starts stand right above what they lead to."""
        import networkx

        graph: networkx.DiGraph[int] = networkx.DiGraph()
        graph.add_nodes_from(range(self.count))
        graph.add_edges_from(self._arrows())
        layer = [0] * self.count
        starts: list[int] = []
        # What was turned round leaves no cycle; a generation is the longest path to its nodes.
        for depth, generation in enumerate(networkx.topological_generations(graph)):
            starts = starts or generation
            for node in generation:
                layer[node] = depth
        for node in starts:
            layer[node] = min((layer[target] for target in graph[node]), default=1) - 1
        return layer

    def _passed(self) -> int:
        """The number of places that all edges would need in the layers that they pass."""
        longest: dict[tuple[int, Hashable], int] = {}
        for number, ends in enumerate(self.edges):
            source, target = ends[::-1] if number in self.turned else ends
            shared = target, self.bundles[number]
            layers = self.layer[target] - self.layer[source] - 1
            longest[shared] = max(layers, longest.get(shared, 0))
        return sum(longest.values())

    def _chain(self, number: int) -> list[int]:
        """The places of an edge from above to below."""
        source, target = self.edges[number]
        if source == target:
            return []
        if number in self.turned:
            source, target = target, source
        if self.straight:
            return [source, target]
        chain = [source]
        for layer in range(self.layer[source] + 1, self.layer[target]):
            place = self.shared.setdefault((target, self.bundles[number], layer), len(self.width))
            chain.append(place)
            if place == len(self.width):
                self.width.append(0.0)
                self.height.append(0.0)
                self.layer.append(layer)
        return [*chain, target]

    # -- the order in layers ---------------------------------------------------------------------

    def _order(self) -> None:
        above = [[other for other, _ in near] for near in self.above]
        below = [[other for other, _ in near] for near in self.below]
        rank = [0] * len(self.width)
        for row in self.rows:
            for number, it in enumerate(row):
                rank[it] = number
        best, fewest = self.rows, _crossings(self.rows, below, rank)
        rows, before = list(self.rows), self.rows
        for sweep in range(_SWEEPS):
            down = sweep % 2 == 0
            if not fewest or (down and sweep and rows == before):
                break
            before = list(rows) if down else before
            near = above if down else below
            for at in range(1, len(rows)) if down else range(len(rows) - 2, -1, -1):
                rows[at] = _by_means(rows[at], near, rank)
            crossings = _crossings(rows, below, rank, fewest)
            if crossings < fewest:
                best, fewest = list(rows), crossings
        self.rows = best

    # -- coordinates -----------------------------------------------------------------------------

    def _set_x(self) -> None:
        rows = [(row, self._offsets(row)) for row in self.rows]
        for row, offsets in rows:
            self._place(row, offsets, [0.0] * len(row))
        for sweep in range(_SWEEPS):
            down = sweep % 2 == 0
            near = self.above if down else self.below
            for row, offsets in rows if down else reversed(rows):
                self._place(row, offsets, [self._mean(it, near[it]) for it in row])
        self._close_up()

    def _close_up(self) -> None:
        """Move what is not connected to the rest to the left, as far as there is room."""
        parts = self._parts()
        members: dict[int, list[int]] = {}
        for it, part in enumerate(parts):
            members.setdefault(part, []).append(it)
        gaps: dict[int, list[tuple[int, int]]] = {}  # per part: its places beside another part
        for it, other in (pair for row in self.rows for pair in pairwise(row)):
            if parts[other] != parts[it]:
                gaps.setdefault(parts[other], []).append((it, other))
        for _ in range(2):
            leftmost = sorted(members, key=lambda part: self._left_of(members[part]))
            for part in leftmost[1:]:
                room = min(
                    (
                        self.x[other] - self.x[it] - self._gap(it, other)
                        for it, other in gaps.get(part, ())
                    ),
                    default=self._left_of(members[part]) - self._left_of(members[leftmost[0]]),
                )
                for it in members[part]:
                    self.x[it] -= room

    def _left_of(self, places: Iterable[int]) -> float:
        return min(self.x[it] - self.width[it] / 2 for it in places)

    def _parts(self) -> list[int]:
        """Per place the lowest place that it is connected to, whatever the directions."""
        import networkx

        graph: networkx.Graph[int] = networkx.Graph()
        graph.add_nodes_from(range(len(self.width)))
        graph.add_edges_from(
            (it, other) for it, below in enumerate(self.below) for other, _ in below
        )
        part = [-1] * len(self.width)
        for members in networkx.connected_components(graph):
            lowest = min(members)
            for it in members:
                part[it] = lowest
        return part

    def _gap(self, one: int, other: int) -> float:
        """The least distance between the middles of two neighbours in a layer."""
        line = one >= self.count or other >= self.count
        return (self.width[one] + self.width[other]) / 2 + (_LINE_GAP if line else _NODE_GAP)

    def _offsets(self, row: Sequence[int]) -> list[float]:
        """The least distance of every place in a layer to the first one."""
        gaps = (self._gap(one, other) for one, other in pairwise(row))
        return list(accumulate(gaps, initial=0.0))

    def _mean(self, place: int, near: Sequence[tuple[int, float]]) -> float:
        x, total = 0.0, 0.0
        for other, weight in near:
            x += self.x[other] * weight
            total += weight
        return x / total if total else self.x[place]

    def _place(self, row: Sequence[int], offsets: Sequence[float], wanted: Sequence[float]) -> None:
        """As near to the wanted places as the order and the gaps allow: least squares, exactly.

        Gaps taken out, x must not fall along the row: neighbours that would are pooled at their
        mean, until none are left that would.
        """
        means: list[float] = []
        weights: list[float] = []
        counts: list[int] = []  # places per pool
        for it, want, offset in zip(row, wanted, offsets, strict=True):
            mean, weight, count = want - offset, _STRAIGHT if it >= self.count else 1.0, 1
            while means and means[-1] >= mean:
                heavy = weights.pop()
                mean = (mean * weight + means.pop() * heavy) / (weight + heavy)
                weight += heavy
                count += counts.pop()
            means.append(mean)
            weights.append(weight)
            counts.append(count)
        at = 0
        for mean, count in zip(means, counts, strict=True):
            for it in range(at, at + count):
                self.x[row[it]] = mean + offsets[it]
            at += count

    def _tops(self) -> tuple[list[tuple[float, float]], float]:
        """Top and bottom of every layer, and the height of it all."""
        tops: list[tuple[float, float]] = []
        y = _MARGIN
        for row in self.rows:
            height = max(self.height[it] for it in row)
            tops.append((y, y + height))
            y += height + _LAYER_GAP
        return tops, (tops[-1][1] if tops else _MARGIN) + _MARGIN

    def _box(self, node: int, tops: Sequence[tuple[float, float]]) -> Box:
        top, bottom = tops[self.layer[node]]
        width, height = self.width[node], self.height[node]
        y = (top + bottom - height) / 2
        return Box(round(self.x[node] - width / 2, 1), round(y, 1), width, height)

    def _assert_apart(self, boxes: Sequence[Box]) -> None:
        for row in self.rows:
            nodes = [boxes[it] for it in row if it < self.count]
            assert all(one.right < other.x for one, other in pairwise(nodes)), "boxes overlap"

    # -- routes ------------------------------------------------------------------------------------

    def _routes(
        self, boxes: Sequence[Box], tops: Sequence[tuple[float, float]]
    ) -> list[tuple[Point, ...]]:
        leaving = self._ports(boxes, upper=True)
        entering = self._ports(boxes, upper=False)
        routes = []
        for number, (source, target) in enumerate(self.edges):
            if source == target:
                routes.append(_loop(boxes[source]))
                continue
            chain = self.chains[number]
            route = [(leaving[number], boxes[chain[0]].bottom)]
            for it in chain[1:-1]:
                top, bottom = tops[self.layer[it]]
                route += [(self.x[it], top), (self.x[it], bottom)]
            route.append((entering[number], boxes[chain[-1]].y))
            points = [(round(x, 1), round(y, 1)) for x, y in route]
            routes.append(tuple(points[::-1] if number in self.turned else points))
        return routes

    def _ports(self, boxes: Sequence[Box], *, upper: bool) -> dict[int, float]:
        """The x per edge at which it leaves the upper node of its chain, or enters the lower one.

        Edges of a node share its side in the order of where they go.
        """
        at: dict[int, list[tuple[float, int]]] = {}
        for number, chain in enumerate(self.chains):
            if chain:
                node, beyond = (chain[0], chain[1]) if upper else (chain[-1], chain[-2])
                at.setdefault(node, []).append((self.x[beyond], number))
        ports = {}
        for node, ends in at.items():
            box = boxes[node]
            room = 0.0 if node in self.circles else box.width * _PORTS
            for place, (_, number) in enumerate(sorted(ends), 1):
                ports[number] = box.middle[0] + room * (place / (len(ends) + 1) - 0.5)
        return ports


def _turned_edges(count: int, edges: Sequence[tuple[int, int]]) -> frozenset[int]:
    """The edges that lead back to a node on the path to them, in depth-first order of the starts.

    Nodes that nothing leads to come first; what cannot be reached from these is a cycle, which
    begins at its first node.
    """
    leaving: list[list[int]] = [[] for _ in range(count)]
    entered = [False] * count
    for number, (source, target) in enumerate(edges):
        if source != target:
            leaving[source].append(number)
            entered[target] = True
    for numbers in leaving:
        numbers.reverse()  # they are taken from the end
    turned: set[int] = set()
    unseen, open_, done = 0, 1, 2
    state = [unseen] * count
    for start in sorted(range(count), key=lambda node: entered[node]):
        if state[start] != unseen:
            continue
        state[start] = open_
        stack = [start]
        while stack:
            node = stack[-1]
            if not leaving[node]:
                state[node] = done
                stack.pop()
                continue
            following = leaving[node].pop()
            target = edges[following][1]
            if state[target] == open_:
                turned.add(following)
            elif state[target] == unseen:
                state[target] = open_
                stack.append(target)
    return frozenset(turned)


def _crossings(
    rows: Sequence[Sequence[int]],
    below: Sequence[Sequence[int]],
    rank: Sequence[int],
    enough: float = math.inf,
) -> int:
    """The number of pairs of lines between neighbouring layers that cross; counted up to enough."""
    count = 0
    for row in rows:
        ends: list[int] = []
        for it in row:
            for end in sorted([rank[other] for other in below[it]]):
                if ends and end < ends[-1]:
                    at = bisect_right(ends, end)
                    count += len(ends) - at
                    ends.insert(at, end)
                else:
                    ends.append(end)
        if count >= enough:
            break
    return count


def _by_means(
    row: Sequence[int], near: Sequence[Sequence[int]], rank: MutableSequence[int]
) -> list[int]:
    """A layer in the order of the means of its neighbours; what has none stays where it is."""
    means: dict[int, float] = {}
    for number, it in enumerate(row):
        others = near[it]
        if len(others) == 1:
            means[it] = rank[others[0]]
        else:
            means[it] = sum([rank[other] for other in others]) / len(others) if others else number
    ordered = sorted(row, key=means.__getitem__)
    for number, it in enumerate(ordered):
        rank[it] = number
    return ordered


def _loop(box: Box) -> tuple[Point, ...]:
    """The line of a node that leads to itself: at its right side."""
    x, y, half = box.right, box.middle[1], min(6.0, box.height / 2)
    return ((x, y + half), (x + _LOOP, y + half), (x + _LOOP, y - half), (x, y - half))
