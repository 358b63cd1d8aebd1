"""The layout of an automaton's picture; linear, for any depth.

That of a plan follows the plan and not the graph: controls are boxes, what follows stands below
what it follows, alternatives stand beside what they recover, and units of a parallel beside each
other with their join below. So a picture looks as the plan reads, also with 10,000 runners. Rows
that would get too long are folded, like the columns of a newspaper.

Sizes are found from the innermost cells outwards, places from the outermost inwards:

    sequential A, B      A above B on one spine, the join of failures at the right of both
    parallel_any A, B    A beside B, both joins below

A machine has no controls, so it is laid out by its connections. The name of an event is a small
box of its own between the node that emits it and all that it leads to, so that names overlap
nothing, whatever the loops. What an event triggers and what it stops have names of their own. Open
ends are points. Start nodes and joins have one event and need no name for it, unless it stops
something.

    A SUCCEEDED → B, C      A ─ SUCCEEDED ─┬→ B
                                           └→ C
    A SUCCEEDED stops D     A ─ SUCCEEDED stops ─┤ D
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.drawing import STOPS, open_events
from gpsfsm.model.event import Event
from gpsfsm.model.labels import drawn_nodes
from gpsfsm.picture.cells import Cell, Flow, failing_joins, grow
from gpsfsm.picture.layered import layered
from gpsfsm.picture.shapes import Box, node_size, text_width

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.picture.routing import Point

PADDING = 14.0
"""Between a control's border and what is in it."""
CAPTION = 24.0
"""What the caption of a control takes."""
_MARGIN = 20.0
"""Around the whole picture."""
_ROW_GAP = 40.0
_UNIT_GAP = 16.0
_ALTERNATIVE_GAP = 12.0
_COLUMN_GAP = 48.0
_JOIN_GAP = 52.0
_GUARD_GAP = 40.0
_LEVEL_GAP = 28.0
_FAN = 16.0
"""Above units that are triggered together: the line that leads to them."""
_FAILURE, _NOTHING = 54.0, 92.0
"""Beside a runner: the name of the event, and on engines what it leads to."""
_CHANNEL = 10.0
"""Beside a column: the line that collects failures."""
_LONGEST = 1800.0
_WIDEST = 2600.0
_RATIO = 1.5
"""The width of a folded picture by its height."""


@dataclass(frozen=True, slots=True)
class Group:
    """The box of a control. ``element`` is its index in ``Plan.elements``, -1 for a part of a row.

    ``parent`` is the index of the group around it, -1 at the outermost level, whose ``depth`` is 0.
    ``spine`` is the x of the line on which it is entered.
    """

    element: int
    parent: int
    label: str
    box: Box
    depth: int
    spine: float


@dataclass(frozen=True, slots=True)
class Layout:
    """Boxes of all nodes, by index of the node, and of all controls inside the plan, in its order.

    ``group_of`` is per node the index of the innermost group around it, -1 for none. ``size`` is
    that of the whole picture. Boxes of nodes do not overlap, and what is in a group lies inside it.
    A node that is not drawn, which is give_up on an engine that does not give up, has an empty box.
    ``cells`` is what the edges are routed by.
    """

    nodes: tuple[Box, ...]
    groups: tuple[Group, ...]
    group_of: tuple[int, ...]
    size: tuple[float, float]
    cells: tuple[Cell, ...]


def layout(automaton: Automaton, *, parts: bool = False) -> Layout:
    """Lay out an automaton; the same for the same plan.

    With ``parts``, long rows of a large plan are divided into groups of their own.
    """
    cells = grow(automaton, parts=parts)
    arrange(automaton, cells)
    nodes = [Box(0.0, 0.0, 0.0, 0.0)] * len(automaton.nodes)
    group_of = [-1] * len(automaton.nodes)
    groups: list[Group] = []
    inner: list[int] = []  # per cell the innermost group that it is in, itself included
    for cell in cells:
        around = inner[cell.parent] if cell.parent >= 0 else -1
        if cell.flow is Flow.NODE:
            nodes[cell.node] = _node_box(cell)
            group_of[cell.node] = around
        elif _is_group(cell):
            depth = groups[around].depth + 1 if around >= 0 else 0
            groups.append(
                Group(cell.element, around, cell.label, _box(cell), depth, _round(cell.x))
            )
            around = len(groups) - 1
        inner.append(around)
    return Layout(
        nodes=tuple(nodes),
        groups=tuple(groups),
        group_of=tuple(group_of),
        size=_box(cells[0])[2:],
        cells=tuple(cells),
    )


def _is_group(cell: Cell) -> bool:
    return cell.flow not in (Flow.NODE, Flow.PLAN, Flow.GUARD)


def _box(cell: Cell) -> Box:
    return Box(_round(cell.x - cell.left), _round(cell.y), *map(_round, _size(cell)))


def _size(cell: Cell) -> tuple[float, float]:
    return cell.left + cell.right, cell.height


def _node_box(cell: Cell) -> Box:
    """Without the place at its right that is kept for the name of an event."""
    return Box(
        _round(cell.x - cell.left), _round(cell.y), _round(2 * cell.left), _round(cell.height)
    )


def _round(value: float) -> float:
    return round(value, 1)


def arrange(automaton: Automaton, cells: list[Cell]) -> None:
    """Give every cell its size and its place."""
    arranging = _Arranging(automaton, cells)
    for cell in reversed(cells):
        arranging.size(cell)
    top = cells[0]
    top.x, top.y = top.left, 0.0
    for cell in cells[1:]:
        parent = cells[cell.parent]
        cell.x += parent.x
        cell.y += parent.y


class _Arranging:
    def __init__(self, automaton: Automaton, cells: list[Cell]) -> None:
        self.automaton = automaton
        self.cells = cells
        self.failing = failing_joins(automaton)

    def size(self, cell: Cell) -> None:
        if cell.flow is Flow.NODE:
            self._size_node(cell)
        elif cell.flow is Flow.GUARD:
            self._size_guard(cell)
        elif cell.flow is Flow.ACROSS:
            self._border(cell, *self._across(cell))
        elif cell.flow is Flow.BESIDE:
            self._border(cell, *self._beside(cell))
        else:
            self._border(cell, *self._down(cell))

    def _size_node(self, cell: Cell) -> None:
        node = self.automaton.nodes[cell.node]
        width, cell.height = node_size(self.automaton, node)
        cell.left = cell.right = width / 2
        cell.entry = cell.height / 2
        if node.kind is NodeKind.RUNNER:
            cell.right += _FAILURE if self.automaton.traits.gives_up else _NOTHING

    def _children(self, cell: Cell) -> list[Cell]:
        return [self.cells[child] for child in cell.children]

    # -- arrangements: each gives the left, right and lower side of the content ------------------

    def _down(self, cell: Cell) -> tuple[float, float, float]:
        """One below the other on one spine, in as many columns as it takes."""
        rows = self._children(cell)
        left, right, bottom = 0.0, 0.0, 0.0
        for number, column in enumerate(_columns(rows, _ROW_GAP)):
            spine = 0.0
            if number:
                spine = right + _COLUMN_GAP + max(row.left for row in column)
            bottom = max(bottom, self._stack(column, spine, number))
            left = max(left, column[0].left if number else max(row.left for row in column))
            right = spine + max(row.right for row in column)
            cell.tracks.append((spine - max(row.left for row in column), right))
        return left, right, bottom

    def _stack(self, column: Sequence[Cell], spine: float, number: int) -> float:
        """Put the cells of a column below each other; gives its lower side."""
        y = 0.0
        for row in column:
            row.x, row.y, row.track = spine, y, number
            y += row.height + _ROW_GAP
        return y - _ROW_GAP

    def _beside(self, cell: Cell) -> tuple[float, float, float]:
        """Side by side; the spine is in the middle."""
        units = self._children(cell)
        if not units:
            return 0.0, 0.0, 0.0
        columns = _columns(units, _ROW_GAP, side_by_side=True)
        gap = _COLUMN_GAP if len(columns) < len(units) else _UNIT_GAP
        x, bottom = 0.0, 0.0
        for number, column in enumerate(columns):
            start = x + (gap if number else 0.0)
            spine = start + max(unit.left for unit in column)
            bottom = max(bottom, self._stack(column, spine, number))
            x = spine + max(unit.right for unit in column)
            cell.tracks.append((start, x))
        middle = (units[0].x + units[-1].x) / 2
        for unit in units:
            unit.x -= middle
            unit.y += _FAN
        cell.tracks = [(one - middle, other - middle) for one, other in cell.tracks]
        return middle, x - middle, bottom + _FAN

    def _across(self, cell: Cell) -> tuple[float, float, float]:
        """Alternatives from left to right, in as many rows as it takes."""
        left, right, top = 0.0, 0.0, 0.0
        for number, row in enumerate(_rows(self._children(cell))):
            y = top + (_ROW_GAP if number else 0.0)
            right = max(right, self._row(row, y, number))
            left = max(left, row[0].left)
            top = max(each.y + each.height for each in row)
            cell.tracks.append((y, top))
        return left, right, top

    def _row(self, row: Sequence[Cell], top: float, number: int) -> float:
        """Put cells beside each other, their first nodes at one height; gives the right side."""
        entry = max(each.entry for each in row)
        x = 0.0
        for place, each in enumerate(row):
            x += (_ALTERNATIVE_GAP + each.left) if place else 0.0
            each.x, each.y, each.track = x, top + entry - each.entry, number
            x += each.right
        return x

    def _size_guard(self, cell: Cell) -> None:
        row = self._children(cell)
        cell.left = row[0].left
        cell.right = self._row(row, 0.0, 0)
        cell.entry = row[0].y + row[0].entry
        y = max(each.y + each.height for each in row)
        cell.tracks.append((0.0, y))
        for number, join in enumerate(self.cells[each] for each in cell.joins):
            join.y = y + (_LEVEL_GAP if number else _GUARD_GAP)
            y = join.y + join.height
        cell.height = y

    # -- joins and borders -----------------------------------------------------------------------

    def _border(self, cell: Cell, left: float, right: float, bottom: float) -> None:
        """Joins below the content, then a border around all."""
        plan = cell.flow is Flow.PLAN
        left, right, bottom = self._joins(cell, left, right, bottom)
        padding = _MARGIN if plan else PADDING
        top = padding + (0.0 if plan else CAPTION)
        cell.left = left + padding
        cell.right = right + padding
        cell.height = top + bottom + padding
        if not plan:
            cell.right = max(cell.right, text_width(cell.label) + 2 * PADDING - cell.left)
        inside = self._children(cell)
        cell.entry = top + inside[0].y + inside[0].entry if inside else cell.height / 2
        cell.tracks = [_lower(track, cell.flow, top) for track in cell.tracks]
        for each in inside + [self.cells[join] for join in cell.joins]:
            each.y += top

    def _joins(
        self, cell: Cell, left: float, right: float, bottom: float
    ) -> tuple[float, float, float]:
        """Those that collect successes on the spine, those that collect failures at the right."""
        if not cell.joins:
            return left, right, bottom
        channel = right + _CHANNEL
        for level, joins in enumerate(self._levels(cell)):
            top = bottom + (_LEVEL_GAP if level else _JOIN_GAP)
            good = [join for join in joins if not self._fails(join)]
            width = sum(2 * join.left + _UNIT_GAP for join in good) - _UNIT_GAP
            x = -width / 2
            left = max(left, -x)
            for join in good:
                join.x, join.y = x + join.left, top
                x += 2 * join.left + _UNIT_GAP
            right = max(right, x - _UNIT_GAP) if good else right
            x = max(channel, x + _UNIT_GAP) if good else channel
            for number, join in enumerate(join for join in joins if self._fails(join)):
                x += (_UNIT_GAP + join.left) if number else 0.0
                join.x, join.y = x, top
                x += join.right
                right = max(right, x)
            bottom = top + max(join.height for join in joins)
        return left, right, bottom

    def _fails(self, join: Cell) -> bool:
        return join.node in self.failing or join.node == self.automaton.give_up

    def _levels(self, cell: Cell) -> list[list[Cell]]:
        """The joins of a control, those that feed others above them."""
        level: dict[int, int] = {}
        levels: list[list[Cell]] = []
        for join in (self.cells[each] for each in cell.joins):
            inputs = self.automaton.inputs[join.node]
            above = [level[source] for source, _ in inputs if source in level]
            level[join.node] = max(above, default=-1) + 1
            while len(levels) <= level[join.node]:
                levels.append([])
            levels[level[join.node]].append(join)
        return [joins for joins in levels if joins]


def _lower(track: tuple[float, float], flow: Flow, top: float) -> tuple[float, float]:
    """Rows go down with the content; columns are kept by their left and right side."""
    return (track[0] + top, track[1] + top) if flow is Flow.ACROSS else track


def _columns(
    cells: Sequence[Cell], gap: float, *, side_by_side: bool = False
) -> list[Sequence[Cell]]:
    """Cells in columns: all in one, or each in one of its own, unless that would get too long."""
    if not cells:
        return []
    sizes = [cell.height + gap for cell in cells]
    height = sum(sizes)
    if side_by_side:
        if sum(cell.left + cell.right + _UNIT_GAP for cell in cells) <= _WIDEST:
            return [[cell] for cell in cells]
    elif height <= _LONGEST:
        return [cells]
    width = max(cell.left + cell.right for cell in cells) + _COLUMN_GAP
    even = max(1, round(math.sqrt(_RATIO * height / width)))
    # One that is much larger than the others may do better with these beside it than above it.
    choices = [_filled(cells, sizes, height / count) for count in sorted({1, 2, even})]
    return min(choices, key=lambda columns: _extent(columns, gap))


def _extent(columns: Sequence[Sequence[Cell]], gap: float) -> float:
    """The size of columns beside each other, in the direction that counts more."""
    height = max(sum(cell.height + gap for cell in column) for column in columns)
    widths = (
        max(cell.left for cell in column) + max(cell.right for cell in column) for column in columns
    )
    return max(height, (sum(widths) + _COLUMN_GAP * len(columns)) / _RATIO)


def _rows(cells: Sequence[Cell]) -> list[Sequence[Cell]]:
    sizes = [cell.left + cell.right + _ALTERNATIVE_GAP for cell in cells]
    width = sum(sizes)
    if width <= _WIDEST:
        return [cells] if cells else []
    height = max(cell.height for cell in cells) + _ROW_GAP
    count = max(1, round(math.sqrt(width / (_RATIO * height))))
    return _filled(cells, sizes, width / count)


def _filled(cells: Sequence[Cell], sizes: Sequence[float], most: float) -> list[Sequence[Cell]]:
    """The cells in order, in parts of about the same size."""
    parts: list[list[Cell]] = []
    total = 0.0
    for cell, size in zip(cells, sizes, strict=True):
        if not parts or int((total + size / 2) / most) >= len(parts):
            parts.append([])
        parts[-1].append(cell)
        total += size
    return list(parts)


# --- machines -----------------------------------------------------------------------------------

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


def draws_stops(automaton: Automaton) -> bool:
    """True unless connections that stop their target are more than half as many as all others.

    In a reactive tree nearly every condition stops nearly every action: drawn, these connections
    hide what leads to what.
    """
    return 2 * len(automaton.stops) <= len(automaton.edges)


def flat_layout(automaton: Automaton, *, stops: bool = True) -> FlatLayout:
    """Lay out a machine; the same for the same machine.

    ``stops``: with the connections that stop their target.
    """
    return _Flat(automaton).laid_out((False, True) if stops else (False,))


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

    def laid_out(self, actions: Iterable[bool]) -> FlatLayout:
        automaton = self.automaton
        arrows = [(edge, stops) for stops in actions for edge in self._edges(stops)]
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
