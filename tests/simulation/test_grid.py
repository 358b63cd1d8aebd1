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
    found = grid(areas, radius)
    mask = found.blocked(found.present(0.0))
    for cell, blocked in enumerate(mask):
        x, y = found.centre(cell)
        gaps = [distance((x, y), area) for area in areas]
        gaps += [x - AREA.x0, AREA.x1 - x, y - AREA.y0, AREA.y1 - y]
        assert bool(blocked) is (min(gaps) < radius - 1e-9)


@given(AREAS, RADII, st.data())
def test_the_way_is_a_shortest_one(areas, radius, data):
    found = grid(areas, radius)
    mask = found.blocked(found.present(0.0))
    free = [cell for cell, blocked in enumerate(mask) if not blocked]
    if not free:
        return
    first, last = data.draw(st.sampled_from(free)), data.draw(st.sampled_from(free))
    graph = cells(found, mask)
    way = found.route(found.centre(first), found.centre(last), found.present(0.0))
    if not networkx.has_path(graph, first, last):
        assert way is None
        return
    assert way is not None
    assert way[0] == found.centre(first)
    assert way[-1] == found.centre(last)
    best = networkx.shortest_path_length(graph, first, last, weight="cost")
    assert sum(cost(a, b) for a, b in pairwise(way)) == best


def cells(found, mask):
    """The free cells as a graph, written from the definition."""
    graph = networkx.Graph()
    free = {divmod(cell, found.width) for cell, blocked in enumerate(mask) if not blocked}
    for row, column in free:
        graph.add_node(row * found.width + column)
        for up, along in ((0, 1), (1, 0), (1, 1), (1, -1)):
            around = {(row + up, column), (row, column + along), (row + up, column + along)}
            if around <= free:
                there = (row + up) * found.width + column + along
                price = DIAGONAL if up and along else STRAIGHT
                graph.add_edge(row * found.width + column, there, cost=price)
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
    found = grid([], 0.1)
    assert found.route((0.5, 0.5), (3.0, 0.5), ()) is None
    assert found.route((0.5, 0.5), (1.5, 0.5), ()) == [(0.5, 0.5), (1.5, 0.5)]


def test_a_robot_that_stands_too_near_to_a_wall_can_leave_but_not_pass_it():
    wall = Rectangle(0.9, 0.0, 1.0, 1.6)
    found = grid([wall], 0.25)
    near = (0.75, 0.8)
    assert found.blocked((0,))[found.cell(*near)]
    assert found.route(near, (0.4, 0.8), (0,)) is not None
    assert found.route(near, (1.5, 0.8), (0,)) is None


def test_obstacles_come_and_go():
    door = Obstacle(Rectangle(0.9, 0.0, 1.0, 1.6), window=Window(10.0, 20.0))
    found = Grid(Map(AREA, 0.2, (door,)), 0.1)
    there = [found.route((0.3, 0.8), (1.7, 0.8), found.present(t)) for t in (9.9, 10.0, 19.9, 20.0)]
    assert [way is not None for way in there] == [True, False, False, True]


@given(AREAS, RADII, st.tuples(TENTHS, TENTHS), st.data())
def test_no_way_ends_in_an_obstacle(areas, radius, goal, data):
    found = grid(areas, radius)
    present = found.present(0.0)
    free = [cell for cell, blocked in enumerate(found.blocked(present)) if not blocked]
    if not free:
        return
    start = found.centre(data.draw(st.sampled_from(free)))
    way = found.route(start, goal, present)
    if any(area.x0 < goal[0] < area.x1 and area.y0 < goal[1] < area.y1 for area in areas):
        assert way is None
    elif way is not None:
        assert (way[0], way[-1]) == (start, goal)
