"""The routes of the edges: from border to border, right-angled, around the boxes."""

from __future__ import annotations

from importlib import import_module
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings

from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.model.event import Event
from gpsfsm.picture import layout
from gpsfsm.picture.cells import failing_joins
from gpsfsm.picture.routing import Merging, Router
from tests.cases import many
from tests.picture.support import automaton_of, control, engine_automaton, runner, tree, trees
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.picture import Box
    from gpsfsm.picture.routing import Point
    from tests.oracle import P

LAYOUT = import_module("gpsfsm.picture.layout")  # the package has a function of that name


def crosses(one: Point, other: Point, box: Box) -> bool:
    left, right = sorted((one[0], other[0]))
    top, bottom = sorted((one[1], other[1]))
    return (
        left < box.right - 0.5
        and right > box.x + 0.5
        and top < box.bottom - 0.5
        and bottom > box.y + 0.5
    )


def touches(point: Point, box: Box) -> bool:
    return (
        box.x - 0.2 <= point[0] <= box.right + 0.2 and box.y - 0.2 <= point[1] <= box.bottom + 0.2
    )


def routes(automaton: Automaton, *, around: bool) -> None:
    drawing = layout(automaton)
    router = Router(drawing, failing_joins(automaton))
    for source, event, target in automaton.edges:
        if not drawing.nodes[target].width:
            continue
        route = router.route(source, event, target)
        assert touches(route[0], drawing.nodes[source])
        assert touches(route[-1], drawing.nodes[target])
        assert all(0 <= x <= drawing.size[0] and 0 <= y <= drawing.size[1] for x, y in route)
        for one, other in pairwise(route):
            assert one[0] == other[0] or one[1] == other[1]
            for node, box in enumerate(drawing.nodes):
                if around and node not in (source, target):
                    assert not crosses(one, other, box), (source, event, target, node)


@given(plans(max_runners=12))
@settings(max_examples=many(30))
def test_no_edge_of_a_plan_runs_through_a_node(plan: P) -> None:
    for chain in (False, True):
        routes(compile_plan(plan_of(plan), start_chain=chain).automaton, around=True)


@given(plans(max_runners=14))
@settings(max_examples=many(30))
def test_nor_if_it_is_folded(plan: P) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LAYOUT, "_LONGEST", 500.0)
        patch.setattr(LAYOUT, "_WIDEST", 700.0)
        routes(compile_plan(plan_of(plan)).automaton, around=True)


@given(trees())
@settings(max_examples=many(30))
def test_edges_of_behaviour_trees(text: str) -> None:
    """Where nodes swap success and failure, an edge may have to cross what it does not concern."""
    plan = read_plan(text).plan
    if plan is not None:
        routes(compile_plan(plan).automaton, around=False)


@given(plans(max_runners=8))
@settings(max_examples=many(25))
def test_edges_on_engines(plan: P) -> None:
    """These engines connect what they like; every edge has a route all the same."""
    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile.engine_text import EngineReading, read_for_engine
    from tests.oracle import to_xml

    reading = read_for_engine(to_xml(plan).encode(), "fabric-v2", "a.xml", Library())
    if isinstance(reading, EngineReading):
        routes(reading.compiled.automaton, around=False)


def test_success_leads_down_and_failure_to_the_right() -> None:
    automaton = automaton_of(f"<Plan>{runner()}{control('recovery', runner())}</Plan>")
    router = Router(layout(automaton), failing_joins(automaton))
    down = router.route(1, Event.SUCCEEDED, 3)
    right = router.route(1, Event.FAILED, 2)
    assert len(down) == len(right) == 2
    assert down[0][1] < down[1][1]
    assert right[0][0] < right[1][0]


@pytest.mark.parametrize(
    "body",
    [
        "<Sequence><Inverter><A/></Inverter><B/><C/></Sequence>",
        "<Fallback><A/><Sequence><B/><C/></Sequence><Inverter><D/></Inverter></Fallback>",
        '<RetryUntilSuccessful num_attempts="3"><Sequence><A/></Sequence></RetryUntilSuccessful>',
        "<Sequence><IfThenElse><A/><B/><C/></IfThenElse><D/></Sequence>",
    ],
)
def test_common_trees_have_no_edge_through_a_node(body: str) -> None:
    routes(automaton_of(tree(body)), around=True)


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
def test_nor_has_what_engines_make_of_two_recoveries(engine: str) -> None:
    recoveries = control("recovery", runner(x=2)) + control("recovery", runner(x=3))
    text = f"<Plan>{runner(x=1)}{recoveries}{runner(x=4)}</Plan>"
    routes(engine_automaton(text, engine), around=True)


class TestFailingJoins:
    def test_of_a_parallel(self) -> None:
        automaton = automaton_of(
            f"<Plan>{control('parallel_any', runner(), runner())}{runner()}</Plan>"
        )
        assert [node.need for node in automaton.nodes if node.index in failing_joins(automaton)] \
            == [2, 1]  # fmt: skip

    def test_an_inverter_swaps(self) -> None:
        two = "<A/><Inverter><B/></Inverter>"
        body = f'<Parallel success_count="1" failure_count="2">{two}</Parallel>'
        automaton = automaton_of(tree(body))
        assert len(failing_joins(automaton)) == 1

    def test_on_an_engine(self) -> None:
        text = f"<Plan>{control('parallel_all', runner(x=1), runner(x=2))}</Plan>"
        assert not failing_joins(engine_automaton(text, "fabric-v2"))


class TestMerging:
    def test_a_way_ends_where_it_meets_another(self) -> None:
        merging = Merging()
        assert merging.cut("a", [(0, 0), (9, 0), (9, 30)]) == ([(0, 0), (9, 0), (9, 30)], False)
        assert merging.cut("a", [(0, 10), (9, 10), (9, 30)]) == ([(0, 10), (9, 10)], True)

    def test_a_longer_one_ends_where_the_other_begins(self) -> None:
        merging = Merging()
        merging.cut("a", [(0, 10), (9, 10), (9, 30)])
        assert merging.cut("a", [(0, 0), (9, 0), (9, 30)]) == ([(0, 0), (9, 0), (9, 10)], True)

    def test_ways_to_other_targets_are_left_alone(self) -> None:
        merging = Merging()
        merging.cut("a", [(0, 0), (9, 0), (9, 30)])
        assert merging.cut("b", [(0, 10), (9, 10), (9, 30)])[1] is False
        assert merging.cut("a", [(0, 10), (9, 10), (9, 40)])[1] is False
