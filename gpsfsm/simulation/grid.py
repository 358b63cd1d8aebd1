"""The map as cells: where the robot fits, and the shortest way.

Costs are whole numbers, 70 for a step and 99 for a diagonal one (99/70 is nearly the square root
of 2), so that ties are broken alike everywhere.
"""

from __future__ import annotations

import heapq
import math
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.simulation.world import Map, Rectangle

STRAIGHT, DIAGONAL = 70, 99
_TOUCH = 1e-9  # what only touches the robot does not block it
_KEPT = 64  # ways that are remembered

Point = tuple[float, float]


class Grid:
    """The cells of a map for a robot of some radius.

    A cell is free if the robot fits with its centre in the middle of the cell. ``present`` below
    are the numbers of what is there: obstacles, then zones, which are there while they are closed.
    """

    def __init__(self, world_map: Map, radius: float) -> None:
        self.map = world_map
        self.radius = radius
        area, edge = world_map.area, world_map.resolution
        self.width = max(1, round((area.x1 - area.x0) / edge))
        self.height = max(1, round((area.y1 - area.y0) / edge))
        of_obstacles = (each.area for each in world_map.obstacles)
        self.areas = (*of_obstacles, *(each.area for each in world_map.zones))
        self._masks: dict[tuple[tuple[int, ...], float], bytearray] = {}
        self._ways: dict[tuple[int, int, tuple[int, ...]], tuple[int, ...] | None] = {}

    def present(self, now_s: float) -> tuple[int, ...]:
        """The obstacles that are there at a time, by number."""
        obstacles = self.map.obstacles
        return tuple(n for n, obstacle in enumerate(obstacles) if obstacle.window.holds(now_s))

    def cell(self, x: float, y: float) -> int | None:
        """The number of the cell that a point is in; None outside of the map."""
        area, edge = self.map.area, self.map.resolution
        if not area.holds(x, y):
            return None
        column = min(int((x - area.x0) / edge), self.width - 1)
        row = min(int((y - area.y0) / edge), self.height - 1)
        return row * self.width + column

    def centre(self, cell: int) -> Point:
        """The middle of a cell."""
        row, column = divmod(cell, self.width)
        area, edge = self.map.area, self.map.resolution
        return area.x0 + (column + 0.5) * edge, area.y0 + (row + 0.5) * edge

    def blocked(self, present: tuple[int, ...], radius: float | None = None) -> bytearray:
        """For each cell whether a robot of the radius does not fit: row by row from the south."""
        wide = self.radius if radius is None else radius
        key = (present, wide)
        if key not in self._masks:
            if len(self._masks) >= _KEPT:
                self._masks.clear()
            mask = bytearray(self.width * self.height)
            for number in present:
                self._block(mask, self.areas[number], wide)
            self._block_edge(mask, wide)
            self._masks[key] = mask
        return self._masks[key]

    def route(self, start: Point, goal: Point, present: tuple[int, ...]) -> list[Point] | None:
        """The shortest way from start to goal, both included; None if there is none."""
        first, last = self.cell(*start), self.cell(*goal)
        if first is None or last is None:
            return None
        if start == goal:
            return [start]
        if any(self.areas[number].encloses(*goal) for number in present):
            return None  # also if the middle of the cell is just outside of it
        key = (first, last, present)
        if key not in self._ways:
            if len(self._ways) >= _KEPT:
                self._ways.clear()
            self._ways[key] = self._search(first, last, present)
        cells = self._ways[key]
        if cells is None:
            return None
        between = [self.centre(cell) for cell in cells[1:-1]]
        return _without_straight([start, *between, goal])

    def _search(self, first: int, last: int, present: tuple[int, ...]) -> tuple[int, ...] | None:
        """A*; equal costs are taken in the order of the cells."""
        soft = self.blocked(present)
        hard = self.blocked(present, min(self.radius, 0.75 * self.map.resolution))
        if soft[last]:
            return (first,) if first == last else None
        came: dict[int, int] = {first: first}
        costs = {first: 0}
        waiting = [(self._estimate(first, last), first)]
        done = bytearray(len(soft))
        while waiting:
            _, cell = heapq.heappop(waiting)
            if cell == last:
                return _back(came, cell)
            if done[cell]:
                continue
            done[cell] = 1
            mask = hard if soft[cell] else soft  # who stands too near to a wall may move away
            for target, cost in self._steps(cell, mask):
                total = costs[cell] + cost
                if not done[target] and total < costs.get(target, total + 1):
                    costs[target], came[target] = total, cell
                    heapq.heappush(waiting, (total + self._estimate(target, last), target))
        return None

    def _steps(self, cell: int, mask: bytearray) -> Iterator[tuple[int, int]]:
        """The free cells next to a cell. A diagonal step does not cut a corner."""
        row, column = divmod(cell, self.width)
        west = column > 0 and not mask[cell - 1]
        east = column + 1 < self.width and not mask[cell + 1]
        sides = ((-1, west), (1, east))
        for step, inside in ((-self.width, row > 0), (self.width, row + 1 < self.height)):
            if not inside:
                continue
            if not mask[cell + step]:
                yield cell + step, STRAIGHT
                for side, free in sides:
                    if free and not mask[cell + step + side]:
                        yield cell + step + side, DIAGONAL
        for side, free in sides:
            if free:
                yield cell + side, STRAIGHT

    def _estimate(self, cell: int, last: int) -> int:
        row, column = divmod(cell, self.width)
        last_row, last_column = divmod(last, self.width)
        up, along = abs(row - last_row), abs(column - last_column)
        return STRAIGHT * abs(up - along) + DIAGONAL * min(up, along)

    def _block(self, mask: bytearray, area: Rectangle, radius: float) -> None:
        """Block the cells whose middle is nearer to a rectangle than the radius."""
        reach = radius - _TOUCH
        x0, y0 = self.map.area.x0, self.map.area.y0
        edge = self.map.resolution
        low = max(0, math.ceil((area.y0 - reach - y0) / edge - 0.5))
        high = min(self.height - 1, math.floor((area.y1 + reach - y0) / edge - 0.5))
        for row in range(low, high + 1):
            y = y0 + (row + 0.5) * edge
            away = max(area.y0 - y, 0.0, y - area.y1)
            wide = math.sqrt(max(reach * reach - away * away, 0.0)) if reach > 0 else reach
            west = max(0, math.ceil((area.x0 - wide - x0) / edge - 0.5))
            east = min(self.width - 1, math.floor((area.x1 + wide - x0) / edge - 0.5))
            if west <= east:
                begin = row * self.width + west
                mask[begin : begin + east - west + 1] = b"\x01" * (east - west + 1)

    def _block_edge(self, mask: bytearray, radius: float) -> None:
        """Block the cells that are too near to the edge of the map."""
        cells = max(0, math.ceil((radius - _TOUCH) / self.map.resolution - 0.5))
        tall, wide = min(cells, self.height), min(cells, self.width)
        full = b"\x01" * self.width
        for row in range(self.height):
            begin, end = row * self.width, (row + 1) * self.width
            if row < tall or row >= self.height - tall:
                mask[begin:end] = full
            else:
                mask[begin : begin + wide] = full[:wide]
                mask[end - wide : end] = full[:wide]


def sees(start: Point, goal: Point, areas: list[Rectangle]) -> bool:
    """True if nothing stands between two points. What holds one of the points is no hindrance."""
    return not any(
        _crosses(start, goal, area)
        for area in areas
        if not area.holds(*start) and not area.holds(*goal)
    )


def passes(route: Sequence[Point], area: Rectangle) -> bool:
    """True if no leg of a way meets a rectangle."""
    return not any(_crosses(start, end, area) for start, end in pairwise(route))


def _crosses(start: Point, goal: Point, area: Rectangle) -> bool:
    """True if a segment meets a rectangle (Liang and Barsky)."""
    enter, leave = 0.0, 1.0
    sides = ((start[0], goal[0], area.x0, area.x1), (start[1], goal[1], area.y0, area.y1))
    for begin, end, low, high in sides:
        step = end - begin
        if step == 0.0:
            if not low <= begin <= high:
                return False
            continue
        near, far = sorted(((low - begin) / step, (high - begin) / step))
        enter, leave = max(enter, near), min(leave, far)
        if enter > leave:
            return False
    return True


def _back(came: dict[int, int], cell: int) -> tuple[int, ...]:
    cells = [cell]
    while came[cell] != cell:
        cell = came[cell]
        cells.append(cell)
    return tuple(reversed(cells))


def _without_straight(points: list[Point]) -> list[Point]:
    """The same way without points at which it goes straight on."""
    kept: list[Point] = []
    for point in points:
        while len(kept) >= 2 and _straight(kept[-2], kept[-1], point):
            kept.pop()
        if not kept or point != kept[-1]:
            kept.append(point)
    return kept


def _straight(first: Point, second: Point, third: Point) -> bool:
    ax, ay = second[0] - first[0], second[1] - first[1]
    bx, by = third[0] - second[0], third[1] - second[1]
    return abs(ax * by - ay * bx) < _TOUCH and ax * bx + ay * by > 0
