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
"""

from __future__ import annotations

from bisect import bisect_right, insort
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from gpsfsm.picture.shapes import Box

if TYPE_CHECKING:
    from collections.abc import Collection, Hashable, Sequence

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
        targets: list[list[int]] = [[] for _ in range(self.count)]
        waiting = [0] * self.count
        for source, target in self._arrows():
            targets[source].append(target)
            waiting[target] += 1
        starts = [node for node in range(self.count) if not waiting[node]]
        order = list(starts)
        layer = [0] * self.count
        for node in order:
            for target in targets[node]:
                layer[target] = max(layer[target], layer[node] + 1)
                waiting[target] -= 1
                if not waiting[target]:
                    order.append(target)
        assert len(order) == self.count, "what was turned round leaves no cycle"
        for node in starts:
            layer[node] = min((layer[target] for target in targets[node]), default=1) - 1
        return layer

    def _chain(self, number: int) -> list[int]:
        """The places of an edge from above to below."""
        source, target = self.edges[number]
        if source == target:
            return []
        if number in self.turned:
            source, target = target, source
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
        best, fewest = self.rows, self._crossings()
        for sweep in range(_SWEEPS):
            if not fewest:
                break
            down = sweep % 2 == 0
            rows = list(self.rows)
            for at in range(1, len(rows)) if down else range(len(rows) - 2, -1, -1):
                near = self.above if down else self.below
                place = {it: number for number, it in enumerate(rows[at - 1 if down else at + 1])}
                rows[at] = _by_means(rows[at], near, place)
            self.rows = rows
            crossings = self._crossings()
            if crossings < fewest:
                best, fewest = rows, crossings
        self.rows = best

    def _crossings(self) -> int:
        """The number of pairs of lines between neighbouring layers that cross."""
        count = 0
        for upper, lower in pairwise(self.rows):
            place = {it: number for number, it in enumerate(lower)}
            ends: list[int] = []
            for it in upper:
                here = sorted(place[other] for other, _ in self.below[it])
                count += sum(len(ends) - bisect_right(ends, end) for end in here)
                for end in here:
                    insort(ends, end)
        return count

    # -- coordinates -----------------------------------------------------------------------------

    def _set_x(self) -> None:
        for row in self.rows:
            self._place(row, [0.0] * len(row))
        for sweep in range(_SWEEPS):
            down = sweep % 2 == 0
            near = self.above if down else self.below
            for row in self.rows if down else reversed(self.rows):
                self._place(row, [self._mean(it, near[it]) for it in row])

        self._close_up()

    def _close_up(self) -> None:
        """Move what is not connected to the rest to the left, as far as there is room."""
        parts = self._parts()
        for _ in range(2):
            leftmost = sorted(set(parts), key=lambda part: self._left_of(parts, part))
            for part in leftmost[1:]:
                room = min(
                    (
                        self.x[other] - self.x[it] - self._gap(it, other)
                        for row in self.rows
                        for it, other in pairwise(row)
                        if parts[other] == part != parts[it]
                    ),
                    default=self._left_of(parts, part) - self._left_of(parts, leftmost[0]),
                )
                for it, other in enumerate(parts):
                    self.x[it] -= room if other == part else 0.0

    def _left_of(self, parts: Sequence[int], part: int) -> float:
        return min(
            self.x[it] - self.width[it] / 2 for it, other in enumerate(parts) if other == part
        )

    def _parts(self) -> list[int]:
        """Per place the lowest place that it is connected to, whatever the directions."""
        part = [-1] * len(self.width)
        for first in range(len(part)):
            stack = [first] if part[first] < 0 else []
            while stack:
                it = stack.pop()
                if part[it] < 0:
                    part[it] = first
                    stack += [other for other, _ in (*self.above[it], *self.below[it])]
        return part

    def _gap(self, one: int, other: int) -> float:
        """The least distance between the middles of two neighbours in a layer."""
        line = one >= self.count or other >= self.count
        return (self.width[one] + self.width[other]) / 2 + (_LINE_GAP if line else _NODE_GAP)

    def _mean(self, place: int, near: Sequence[tuple[int, float]]) -> float:
        total = sum(weight for _, weight in near)
        if not total:
            return self.x[place]
        return sum(self.x[other] * weight for other, weight in near) / total

    def _place(self, row: Sequence[int], wanted: Sequence[float]) -> None:
        """As near to the wanted places as the order and the gaps allow: least squares, exactly.

        Gaps taken out, x must not fall along the row: neighbours that would are pooled at their
        mean, until none are left that would.
        """
        offsets = [0.0]
        for one, other in pairwise(row):
            offsets.append(offsets[-1] + self._gap(one, other))
        pools: list[tuple[float, float, int]] = []  # mean, weight, number of places
        for it, want, offset in zip(row, wanted, offsets, strict=True):
            mean, weight, count = want - offset, _STRAIGHT if it >= self.count else 1.0, 1
            while pools and pools[-1][0] >= mean:
                before, heavy, many = pools.pop()
                mean = (mean * weight + before * heavy) / (weight + heavy)
                weight, count = weight + heavy, count + many
            pools.append((mean, weight, count))
        means = [mean for mean, _, count in pools for _ in range(count)]
        for it, mean, offset in zip(row, means, offsets, strict=True):
            self.x[it] = mean + offset

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


def _by_means(
    row: Sequence[int], near: Sequence[Sequence[tuple[int, float]]], place: dict[int, int]
) -> list[int]:
    """A layer in the order of the means of its neighbours; what has none stays where it is."""
    means = []
    for number, it in enumerate(row):
        others = [place[other] for other, _ in near[it]]
        means.append(sum(others) / len(others) if others else float(number))
    return [it for _, _, it in sorted(zip(means, range(len(row)), row, strict=True))]


def _loop(box: Box) -> tuple[Point, ...]:
    """The line of a node that leads to itself: at its right side."""
    x, y, half = box.right, box.middle[1], min(6.0, box.height / 2)
    return ((x, y + half), (x + _LOOP, y + half), (x + _LOOP, y - half), (x, y - half))
