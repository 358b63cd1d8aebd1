"""Routes of edges: right-angled, and beside the boxes wherever the plan's own edges lead.

A success leaves a node at the bottom, everything else at its right. From there it goes to the
border of the cell that it leaves, along a channel that the layout keeps free, and down the spine of
the cell that it enters. Edges that end in one line are drawn up to where they meet (Merging): drawn
on top of each other, broken lines would fill each other's gaps.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

from gpsfsm.model.event import Event
from gpsfsm.picture.cells import Cell, Flow

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    from gpsfsm.picture.layout import Layout
    from gpsfsm.picture.shapes import Box

Point = tuple[float, float]

_BUS = 12.0
"""Above what is entered: the line on which an edge gets there."""
_GOOD_BUS = 24.0
"""The same above joins, for successes, so that these do not share the line of the failures."""
_CROSSING = 34.0
"""The same for what passes by."""
_CHANNEL = 10.0
_NARROW = 7.0
_INNER, _OUTER = 5.0, 11.0
_BELOW = 19.0
_RETURN = 28.0
_STUB = 20.0
_PORTS = {Event.STARTED: 0.22, Event.FAILED: 0.5, Event.STOPPED: 0.78}


def dangling(layout: Layout, node: int, event: Event, length: float) -> tuple[Point, Point]:
    """The short line of an event that leads nowhere."""
    x, y = event_port(layout, node, event)
    return (x, y), (x, y + _STUB) if event is Event.SUCCEEDED else (x + length, y)


def event_port(layout: Layout, node: int, event: Event, *, is_round: bool = False) -> Point:
    """The point at which the lines of an event begin."""
    box = layout.nodes[node]
    if event is Event.SUCCEEDED:
        return box.middle[0], box.bottom
    return _right_port(box, _PORTS[event], is_round=is_round)


class Router:
    """Routes one edge after the other."""

    def __init__(self, layout: Layout, failing: frozenset[int]) -> None:
        self.layout = layout
        self.cells = layout.cells
        self.failing = failing
        self.cell_of = [0] * len(layout.nodes)
        self.place: list[tuple[bool, int]] = [(False, 0)] * len(self.cells)
        self.depth = [0] * len(self.cells)
        self.filled = [cell.node >= 0 for cell in self.cells]
        for index in range(len(self.cells) - 1, 0, -1):
            self.filled[self.cells[index].parent] |= self.filled[index]
        for index, cell in enumerate(self.cells):
            if index:
                self.depth[index] = self.depth[cell.parent] + 1
            if cell.node >= 0:
                self.cell_of[cell.node] = index
            for number, child in enumerate(cell.children):
                self.place[child] = (False, number)
            for number, child in enumerate(cell.joins):
                self.place[child] = (True, number)

    def route(self, source: int, event: Event, target: int) -> list[Point]:
        """The corners of an edge, from the source's border to the target's."""
        start, end = self.cell_of[source], self.cell_of[target]
        around, leaving, entering = self._meet(start, end)
        down = self._leaves_down(source, event, leaving, entering)
        points = self._leave(start, leaving, event, down=down)
        sharing = self.cells[around]
        if self.place[entering][0]:
            points += self._to_join(sharing, leaving, entering, points[-1], down=down)
        elif self._follows_right(sharing, leaving, entering) and not down:
            points += self._to_the_right(leaving, entering, end, points[-1], event)
        else:
            points += self._to_below(sharing, leaving, entering, end, points[-1], down=down)
        return _straightened(points)

    def _meet(self, start: int, end: int) -> tuple[int, int, int]:
        """The innermost cell around both, and its children that they are in."""
        leaving, entering = start, end
        one, other = start, end
        while one != other:
            if self.depth[one] >= self.depth[other]:
                leaving, one = one, self.cells[one].parent
            else:
                entering, other = other, self.cells[other].parent
        return one, leaving, entering

    def _leaves_down(self, source: int, event: Event, leaving: int, entering: int) -> bool:
        if event is not Event.SUCCEEDED:
            return False
        if source not in self.failing:
            return True
        return self.place[leaving][0] and self.place[entering][0]

    # -- from the source to the border of the cell that is left ----------------------------------

    def _leave(self, start: int, leaving: int, event: Event, *, down: bool) -> list[Point]:
        cell = self.cells[start]
        box = self.layout.nodes[cell.node]
        if down:
            points = [(cell.x, box.bottom)]
        else:
            share = _PORTS.get(event, 0.5)
            points = [_right_port(box, share, is_round=self._is_join(cell))]
        while start != leaving:
            around = self.cells[cell.parent]
            points += self._past(around, start, points[-1], down=down)
            start, cell = cell.parent, around
        return points

    def _past(self, around: Cell, inside: int, point: Point, *, down: bool) -> list[Point]:
        """Around the siblings that stand between a cell and the border."""
        cell = self.cells[inside]
        join, number = self.place[inside]
        if join:
            return []
        last = number == len(around.children) - 1
        if down:
            return self._aside(around, cell, point) if not last else []
        if around.flow in (Flow.DOWN, Flow.PLAN):
            blocked = cell.track < len(around.tracks) - 1
        else:
            blocked = not last and not self._ends_row(around, number)
        if not blocked:
            return []
        x = self._channel(around, cell)
        if around.flow in (Flow.GUARD, Flow.ACROSS):
            y = around.y + around.tracks[cell.track][1] + _NARROW
        elif around.joins:
            y = self.cells[around.joins[0]].y - _CROSSING
        else:
            y = around.y + around.height - _NARROW
        return [(x, point[1]), (x, y)]

    def _ends_row(self, around: Cell, number: int) -> bool:
        one, following = (self.cells[each] for each in around.children[number : number + 2])
        return around.flow is Flow.ACROSS and following.track != one.track

    def _aside(self, around: Cell, cell: Cell, point: Point) -> list[Point]:
        """To the free side of a folded cell, from which the way down is free."""
        y = cell.y + cell.height + _NARROW
        if around.flow is Flow.ACROSS and cell.track < len(around.tracks) - 1:
            y = around.y + around.tracks[cell.track][1] + _BELOW
            x = around.x - around.left + _NARROW
        elif around.flow is Flow.BESIDE and self._is_folded(around):
            x = around.x + around.tracks[cell.track][0] - _OUTER
        elif around.flow in (Flow.DOWN, Flow.PLAN):
            x = around.x - around.left + _NARROW
        else:
            return []
        return [(point[0], y), (x, y)]

    def _is_folded(self, cell: Cell) -> bool:
        return len(cell.tracks) < len(cell.children)

    def _channel(self, around: Cell, cell: Cell) -> float:
        """The x of the line at the right of a cell on which its failures leave."""
        join = self._is_join(cell)
        if not join and (
            around.flow in (Flow.DOWN, Flow.PLAN)
            or (around.flow is Flow.BESIDE and self._is_folded(around))
        ):
            return around.x + around.tracks[cell.track][1] + _CHANNEL
        return cell.x + cell.right + _NARROW

    def _is_join(self, cell: Cell) -> bool:
        return cell.node >= 0 and self.place[self.cell_of[cell.node]][0]

    # -- to the target ---------------------------------------------------------------------------

    def _to_join(
        self, around: Cell, leaving: int, entering: int, point: Point, *, down: bool
    ) -> list[Point]:
        join, cell = self.cells[entering], self.cells[leaving]
        box = self.layout.nodes[join.node]
        beside = around.flow in (Flow.GUARD, Flow.ACROSS)
        points: list[Point] = []
        if down:
            if not self.place[leaving][0]:
                points = self._aside_in(around, leaving, point)
        else:
            points = [(self._channel(around, cell), point[1])]
        x = points[-1][0] if points else point[0]
        if beside and x > join.x + join.left:
            return [*points, (x, box.middle[1]), (box.right, box.middle[1])]
        bus = box.y - (_GOOD_BUS if down and join.node not in self.failing else _BUS)
        return [*points, (x, bus), (join.x, bus), (join.x, box.y)]

    def _aside_in(self, around: Cell, inside: int, point: Point) -> list[Point]:
        """To where the way down to a join is free."""
        cell = self.cells[inside]
        if around.flow in (Flow.DOWN, Flow.PLAN):
            following = around.children[self.place[inside][1] + 1 :]
            if not any(self.filled[each] for each in following):
                return []
            y = cell.y + cell.height + _NARROW
            return [(point[0], y), (self._channel(around, cell), y)]
        folded = self._is_folded(around) and around.flow is Flow.BESIDE
        rows = around.flow is Flow.ACROSS and len(around.tracks) > 1
        return self._aside(around, cell, point) if folded or rows else []

    def _follows_right(self, around: Cell, leaving: int, entering: int) -> bool:
        """True if the one stands beside the other, in the same row."""
        if self.place[leaving][0]:  # a join, which stands below them all
            return around.flow is Flow.GUARD and self.place[entering][1] > 0
        if around.flow is Flow.BESIDE:
            near = not self._is_folded(around)
        else:
            near = around.flow in (Flow.GUARD, Flow.ACROSS)
            near = near and self.cells[leaving].track == self.cells[entering].track
        return near and self.place[entering][1] == self.place[leaving][1] + 1

    def _to_the_right(
        self, leaving: int, entering: int, end: int, point: Point, event: Event
    ) -> list[Point]:
        """Into the left side of the next one, or on the line above the units it begins with."""
        cell = self.cells[leaving]
        x = cell.x + cell.right + _NARROW
        if self.place[leaving][0]:
            x = self.cells[entering].x - self.cells[entering].left - _INNER
        fan = self._fan(entering, end)
        if fan is not None:
            approach = self._approach(fan, end)
            y = approach[0][1]
            if self.cells[fan].flow is Flow.BESIDE:
                y = self.cells[self.cells[fan].children[0]].y - _BUS
            return [(x, point[1]), (x, y), (approach[0][0], y), *approach]
        box = self.layout.nodes[self.cells[end].node]
        y = box.y + box.height * _PORTS.get(event, 0.5)
        return [(x, point[1]), (x, y), (box.x, y)]

    def _fan(self, entering: int, end: int) -> int | None:
        """The outermost cell around a node that cannot be entered from the left."""
        fan = None
        while end != entering:
            parent = self.cells[end].parent
            join, number = self.place[end]
            around = self.cells[parent]
            if around.flow is Flow.BESIDE and not join:
                fan = parent
            elif around.flow in (Flow.ACROSS, Flow.GUARD) and not join:
                fan = parent if any(self.filled[it] for it in around.children[:number]) else fan
            end = parent
        return fan

    def _to_below(
        self, around: Cell, leaving: int, entering: int, end: int, point: Point, *, down: bool
    ) -> list[Point]:
        """On the line above the cell that is entered, then down its spine."""
        cell, into = self.cells[leaving], self.cells[entering]
        top = into.y
        if around.flow in (Flow.GUARD, Flow.ACROSS):  # above all that stand in that row
            top = around.y + around.tracks[into.track][0]
        bus = top - _BUS
        points: list[Point] = []
        x = point[0]
        if not down:
            x = self._beside(around, leaving, entering)
            points = [(x, point[1])]
        elif around.flow in (Flow.DOWN, Flow.PLAN) and cell.track != into.track:
            x = self._channel(around, cell) + _RETURN - _CHANNEL
            below = cell.y + cell.height + _BUS
            points = [(point[0], below), (x, below)]
        elif self._nodes_between(around, leaving, entering) or bus < point[1]:
            x = around.x + around.tracks[cell.track][0] - _NARROW
            below = cell.y + cell.height + _NARROW
            points = [(point[0], below), (x, below)]
        return [*points, (x, bus), (into.x, bus), *self._approach(entering, end)]

    def _nodes_between(self, around: Cell, leaving: int, entering: int) -> bool:
        """True if there are nodes in between: those of a recovery that guards nothing."""
        join, number = self.place[leaving]
        between = around.children[number + 1 : self.place[entering][1]]
        return not join and any(self.filled[each] for each in between)

    def _beside(self, around: Cell, leaving: int, entering: int) -> float:
        """The x of a free line down: right beside the cell, if the very next one is entered."""
        cell = self.cells[leaving]
        near = around.flow in (Flow.DOWN, Flow.PLAN) and not self.place[leaving][0]
        near = near and self.place[entering][1] == self.place[leaving][1] + 1
        if near and cell.track == self.cells[entering].track:
            return cell.x + cell.right - (_NARROW if cell.node >= 0 else -_NARROW)
        return self._channel(around, cell)

    def _approach(self, entering: int, end: int) -> list[Point]:
        """From the spine of a cell to a node in it."""
        cell = self.cells[end]
        points: list[Point] = [(cell.x, self.layout.nodes[cell.node].y)]
        index = end
        while index != entering:
            around = self.cells[cell.parent]
            points += self._into(around, index)
            index, cell = cell.parent, around
        return points[::-1]

    def _into(self, around: Cell, index: int) -> Sequence[Point]:
        """Backwards from the top of a cell to the spine of the one around it."""
        cell = self.cells[index]
        join, number = self.place[index]
        bus = cell.y - _BUS
        if around.flow in (Flow.GUARD, Flow.ACROSS) and not join:
            bus = around.y + around.tracks[cell.track][0] - _BUS
        if around.flow is Flow.BESIDE and self._is_folded(around):
            x = around.x + around.tracks[cell.track][0] - _INNER
            top = self.cells[around.children[0]].y - _BUS
            return [(cell.x, bus), (x, bus), (x, top), (around.x, top)]
        above = around.children if join else around.children[:number]
        stacked = join or around.flow in (Flow.DOWN, Flow.PLAN)
        if stacked and any(self.filled[each] for each in above):
            x = around.x - around.left
            x += -_NARROW if around.flow is Flow.GUARD else _NARROW
            top = self.cells[around.children[0]].y - _BUS
            return [(cell.x, bus), (x, bus), (x, top), (around.x, top)]
        return [(cell.x, bus), (around.x, bus)] if cell.x != around.x else []


def _right_port(box: Box, share: float, *, is_round: bool) -> Point:
    y = box.y + box.height * share
    if not is_round:
        return box.right, y
    radius = box.width / 2
    return box.x + radius * (1 + math.sqrt(1 - (1 - 2 * share) ** 2)), y


def _straightened(points: Sequence[Point]) -> list[Point]:
    """Without kept that are none."""
    kept: list[Point] = []
    for x, y in points:
        point = (round(x, 1), round(y, 1))
        if kept and kept[-1] == point:
            continue
        if len(kept) > 1 and (
            kept[-2][0] == kept[-1][0] == point[0] or kept[-2][1] == kept[-1][1] == point[1]
        ):
            kept[-1] = point
        else:
            kept.append(point)
    return kept


class Merging:
    """Remembers the lines of all edges by what they lead to; later ones flow into them."""

    def __init__(self) -> None:
        self.lines: dict[Hashable, tuple[float, Sequence[Point]]] = {}

    def cut(self, key: Hashable, route: Sequence[Point]) -> tuple[Sequence[Point], bool]:
        """A route up to where it meets one with the same key, and whether it does."""
        for number, (start, end) in enumerate(pairwise(route)):
            axis = 0 if start[0] == end[0] else 1  # the coordinate that stays
            line = (key, axis, end, start[1 - axis] < end[1 - axis])
            met = self.lines.get(line)
            if met is None:
                self.lines[line] = (start[1 - axis], route[number + 1 :])
                continue
            begin, rest = met
            if rest != route[number + 1 :]:
                continue
            if abs(begin - end[1 - axis]) >= abs(start[1 - axis] - end[1 - axis]):
                return route[: number + 1], number > 0
            self.lines[line] = (start[1 - axis], rest)
            meeting = (end[0], begin) if axis == 0 else (begin, end[1])
            return [*route[: number + 1], meeting], True
        return route, False
