"""The path search against brute force."""

from __future__ import annotations

import math
from itertools import pairwise

import networkx
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.simulation.grid import DIAGONAL, STRAIGHT, Grid, sees
from gpsfsm.simulation.world import Map, Obstacle, Rectangle, Window

TENTHS = st.integers(-3, 23).map(lambda tenth: tenth / 10)
AREA = Rectangle(0.0, 0.0, 2.0, 1.6)


@st.composite
def rectangles(draw):
    x0, x1 = sorted((draw(TENTHS), draw(TENTHS)))
    y0, y1 = sorted((draw(TENTHS), draw(TENTHS)))
    return Rectangle(x0, y0, x1, y1)


AREAS = st.lists(rectangles(), max_size=5)
RADII = st.sampled_from([0.1, 0.15, 0.25])


def grid(areas, radius):
    return Grid(Map(AREA, 0.2, tuple(Obstacle(area) for area in areas)), radius)


def distance(point, area):
    x, y = point
    return math.hypot(max(area.x0 - x, 0, x - area.x1), max(area.y0 - y, 0, y - area.y1))


@given(AREAS, RADII)
def test_a_cell_is_blocked_if_the_robot_would_touch_something(areas, radius):
    rows = grid(areas, radius)
    mask = rows.blocked(rows.present(0.0))
    for cell, blocked in enumerate(mask):
        x, y = rows.centre(cell)
        gaps = [distance((x, y), area) for area in areas]
        gaps += [x - AREA.x0, AREA.x1 - x, y - AREA.y0, AREA.y1 - y]
        assert bool(blocked) is (min(gaps) < radius - 1e-9)


@given(AREAS, RADII, st.data())
def test_the_way_is_a_shortest_one(areas, radius, data):
    rows = grid(areas, radius)
    mask = rows.blocked(rows.present(0.0))
    free = [cell for cell, blocked in enumerate(mask) if not blocked]
    if not free:
        return
    first, last = data.draw(st.sampled_from(free)), data.draw(st.sampled_from(free))
    graph = cells(rows, mask)
    way = rows.route(rows.centre(first), rows.centre(last), rows.present(0.0))
    if not networkx.has_path(graph, first, last):
        assert way is None
        return
    assert way is not None
    assert way[0] == rows.centre(first)
    assert way[-1] == rows.centre(last)
    best = networkx.shortest_path_length(graph, first, last, weight="cost")
    assert sum(cost(a, b) for a, b in pairwise(way)) == best


def cells(actual, mask):
    """The free cells as a graph, written from the definition."""
    graph = networkx.Graph()
    free = {divmod(cell, actual.width) for cell, blocked in enumerate(mask) if not blocked}
    for row, column in free:
        graph.add_node(row * actual.width + column)
        for up, along in ((0, 1), (1, 0), (1, 1), (1, -1)):
            around = {(row + up, column), (row, column + along), (row + up, column + along)}
            if around <= free:
                there = (row + up) * actual.width + column + along
                price = DIAGONAL if up and along else STRAIGHT
                graph.add_edge(row * actual.width + column, there, cost=price)
    return graph


def cost(a, b):
    wide, tall = (round(abs(b[axis] - a[axis]) / 0.2) for axis in (0, 1))
    assert wide == tall or not (wide and tall)
    return max(wide, tall) * (DIAGONAL if wide and tall else STRAIGHT)


@given(rectangles(), st.tuples(TENTHS, TENTHS), st.tuples(TENTHS, TENTHS))
def test_sight_is_blocked_by_what_is_between(area, start, goal):
    blocked = not sees(start, goal, [area])
    inside = area.holds(*start) or area.holds(*goal)
    points = [
        (start[0] + (goal[0] - start[0]) * n / 400, start[1] + (goal[1] - start[1]) * n / 400)
        for n in range(401)
    ]
    if inside:
        assert not blocked
    elif any(area.holds(*point) for point in points):
        assert blocked
    elif all(distance(point, area) > 0.02 for point in points):
        assert not blocked


def test_outside_of_the_map_there_is_no_way():
    rows = grid([], 0.1)
    assert rows.route((0.5, 0.5), (3.0, 0.5), ()) is None
    assert rows.route((0.5, 0.5), (1.5, 0.5), ()) == [(0.5, 0.5), (1.5, 0.5)]


def test_a_robot_that_stands_too_near_to_a_wall_can_leave_but_not_pass_it():
    wall = Rectangle(0.9, 0.0, 1.0, 1.6)
    rows = grid([wall], 0.25)
    near = (0.75, 0.8)
    assert rows.blocked((0,))[rows.cell(*near)]
    assert rows.route(near, (0.4, 0.8), (0,)) is not None
    assert rows.route(near, (1.5, 0.8), (0,)) is None


def test_obstacles_come_and_go():
    door = Obstacle(Rectangle(0.9, 0.0, 1.0, 1.6), window=Window(10.0, 20.0))
    actual = Grid(Map(AREA, 0.2, (door,)), 0.1)
    there = [
        actual.route((0.3, 0.8), (1.7, 0.8), actual.present(t)) for t in (9.9, 10.0, 19.9, 20.0)
    ]
    assert [way is not None for way in there] == [True, False, False, True]


@given(AREAS, RADII, st.tuples(TENTHS, TENTHS), st.data())
def test_no_way_ends_in_an_obstacle(areas, radius, goal, data):
    rows = grid(areas, radius)
    present = rows.present(0.0)
    free = [cell for cell, blocked in enumerate(rows.blocked(present)) if not blocked]
    if not free:
        return
    start = rows.centre(data.draw(st.sampled_from(free)))
    way = rows.route(start, goal, present)
    if any(area.x0 < goal[0] < area.x1 and area.y0 < goal[1] < area.y1 for area in areas):
        assert way is None
    elif way is not None:
        assert (way[0], way[-1]) == (start, goal)
