"""The layered layout of graphs: cycles, several starts, loops and parallel edges."""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import TYPE_CHECKING

from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.picture.layered import layered
from tests.cases import many

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.picture.layered import LayeredLayout
    from gpsfsm.picture.shapes import Box

SIZE = (100.0, 40.0)


def check(actual: LayeredLayout, edges: Sequence[tuple[int, int]]) -> None:
    """Every node has a place of its own, and every edge leads from its source to its target."""
    width, height = actual.size
    for box in actual.boxes:
        assert box.x >= 0
        assert box.y >= 0
        assert box.right <= width + 0.1
        assert box.bottom <= height + 0.1
    for one, other in combinations(actual.boxes, 2):
        apart = one.right < other.x or other.right < one.x
        assert apart or one.bottom < other.y or other.bottom < one.y
    for (source, target), route in zip(edges, actual.routes, strict=True):
        assert on_border(route[0], actual.boxes[source])
        assert on_border(route[-1], actual.boxes[target])
        assert all(0 <= x <= width and 0 <= y <= height for x, y in route)
        if source != target:
            down = actual.boxes[target].y > actual.boxes[source].y
            assert all(
                (one[1] <= other[1]) == down for one, other in pairwise(route) if one != other
            )


def on_border(point: tuple[float, float], box: Box) -> bool:
    x, y = point
    if not (box.x - 0.1 <= x <= box.right + 0.1 and box.y - 0.1 <= y <= box.bottom + 0.1):
        return False
    return min(abs(x - box.x), abs(x - box.right), abs(y - box.y), abs(y - box.bottom)) < 0.2


@st.composite
def graphs(draw: st.DrawFn) -> tuple[list[tuple[float, float]], list[tuple[int, int]]]:
    count = draw(st.integers(1, 25))
    node = st.integers(0, count - 1)
    sides = st.sampled_from([10.0, 34.0, 55.0, 180.0])
    sizes = draw(st.lists(st.tuples(sides, sides), min_size=count, max_size=count))
    return sizes, draw(st.lists(st.tuples(node, node), max_size=3 * count))


@given(graphs(), st.booleans())
@settings(max_examples=many(150))
def test_any_graph(
    graph: tuple[list[tuple[float, float]], list[tuple[int, int]]], bundled: bool
) -> None:
    sizes, edges = graph
    bundles = ["one"] * len(edges) if bundled else ()
    drawing = layered(sizes, edges, bundles=bundles)
    check(drawing, edges)
    assert layered(sizes, edges, bundles=bundles) == drawing


def test_nothing() -> None:
    assert layered([], []).boxes == ()


def test_a_chain_is_straight() -> None:
    edges = [(0, 1), (1, 2)]
    drawing = layered([SIZE] * 3, edges)
    check(drawing, edges)
    assert len({box.x for box in drawing.boxes}) == 1
    assert [box.y for box in drawing.boxes] == sorted(box.y for box in drawing.boxes)
    assert all(len({x for x, _ in route}) == 1 for route in drawing.routes)


def test_a_back_edge_is_drawn_back_beside_what_it_passes() -> None:
    edges = [(0, 1), (1, 2), (2, 0)]
    drawing = layered([SIZE] * 3, edges)
    check(drawing, edges)
    assert [box.y for box in drawing.boxes] == sorted(box.y for box in drawing.boxes)
    back = drawing.routes[2]
    assert back[0][1] > back[-1][1]
    passed = [x for x, y in back if drawing.boxes[1].y <= y <= drawing.boxes[1].bottom]
    assert passed
    assert all(x < drawing.boxes[1].x or x > drawing.boxes[1].right for x in passed)


def test_several_starts_stand_above_what_they_lead_to() -> None:
    edges = [(0, 1), (1, 2), (3, 2), (4, 4)]
    drawing = layered([SIZE] * 5, edges)
    check(drawing, edges)
    assert drawing.boxes[3].y == drawing.boxes[1].y  # right above, and not at the very top


def test_two_cycles_with_one_way_between_them() -> None:
    edges = [(1, 0), (0, 1), (1, 2), (2, 3), (3, 2)]
    drawing = layered([SIZE] * 4, edges)
    check(drawing, edges)
    assert max(drawing.boxes[0].y, drawing.boxes[1].y) < min(drawing.boxes[2].y, drawing.boxes[3].y)


def test_parts_that_are_not_connected_stand_close_to_each_other() -> None:
    chain = [(number, number + 1) for number in range(9)]
    edges = [*chain, *((number, 9) for number in range(8)), (10, 11)]
    drawing = layered([SIZE] * 12, edges)
    check(drawing, edges)
    others = max(box.right for box in drawing.boxes[:10])
    assert drawing.boxes[10].x < others + 3 * SIZE[0]


def test_edges_of_a_bundle_share_their_line_to_a_common_end() -> None:
    edges = [(0, 1), (1, 2), (2, 3), (0, 3), (1, 3)]
    alone, shared = layered([SIZE] * 4, edges), layered([SIZE] * 4, edges, bundles=["a"] * 5)
    check(shared, edges)
    assert shared.routes[3][-2:-1] == shared.routes[4][-2:-1]
    assert alone.routes[3][-2:-1] != alone.routes[4][-2:-1]


def test_edges_of_circles_end_in_the_middle() -> None:
    edges = [(0, 2), (1, 2)]
    drawing = layered([SIZE] * 3, edges, circles=[2])
    assert {route[-1] for route in drawing.routes} == {
        (drawing.boxes[2].middle[0], drawing.boxes[2].y)
    }


def test_a_loop_stands_beside_its_node() -> None:
    drawing = layered([SIZE], [(0, 0)])
    check(drawing, [(0, 0)])
    assert max(x for x, _ in drawing.routes[0]) > drawing.boxes[0].right


def test_hundreds_of_nodes_that_lead_to_one() -> None:
    count = 300
    chain = [(number, number + 1) for number in range(count - 1)]
    edges = [*chain, *((number, count - 1) for number in range(count - 1))]
    bundles = ["on"] * (count - 1) + ["out"] * (count - 1)
    check(layered([SIZE] * count, edges, bundles=bundles), edges)


def test_long_edges_of_a_graph_beyond_reading_are_straight_and_soon_drawn() -> None:
    chain = 800
    edges = [*pairwise(range(chain)), *((node, node // 2) for node in range(2, chain))]
    drawn = layered([SIZE] * chain, edges)  # places in all layers would be 160,000
    assert [len(route) for route in drawn.routes] == [2] * len(edges)
    route = drawn.routes[edges.index((700, 350))]
    assert on_border(route[0], drawn.boxes[700])
    assert on_border(route[-1], drawn.boxes[350])
    assert drawn == layered([SIZE] * chain, edges)
