"""Where nodes and controls stand."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings

from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.model.automaton import NodeKind
from gpsfsm.picture import Box, Layout, layout
from gpsfsm.syntax import Limits, parse
from tests.cases import many
from tests.picture.support import (
    automaton_of,
    control,
    engine_automaton,
    runner,
    trees,
    well_placed,
)
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from tests.oracle import P

LAYOUT = import_module("gpsfsm.picture.layout")  # the package has a function of that name


def laid_out(*children: str) -> Layout:
    return layout(automaton_of(f"<Plan>{''.join(children)}</Plan>"))


def whole(actual: Layout) -> Box:
    return Box(0.0, 0.0, *actual.size)


def centre(box: Box) -> float:
    return box.middle[0]


@given(plans(max_runners=12))
@settings(max_examples=many(30))
def test_boxes_of_plans(plan: P) -> None:
    drawing = layout(compile_plan(plan_of(plan)).automaton)
    well_placed(drawing, whole(drawing))


@given(plans(max_runners=14))
@settings(max_examples=many(30))
def test_boxes_of_folded_plans(plan: P) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LAYOUT, "_LONGEST", 300.0)
        patch.setattr(LAYOUT, "_WIDEST", 500.0)
        drawing = layout(compile_plan(plan_of(plan)).automaton)
    well_placed(drawing, whole(drawing))


@given(trees())
@settings(max_examples=many(30))
def test_boxes_of_behaviour_trees(text: str) -> None:
    plan = read_plan(text).plan
    if plan is not None:
        drawing = layout(compile_plan(plan).automaton)
        well_placed(drawing, whole(drawing))


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
def test_boxes_on_engines(engine: str) -> None:
    text = (
        "<Plan>"
        + control("parallel_all", runner(x=1), runner(x=2))
        + control("recovery", runner(x=3))
        + runner(x=4)
        + "</Plan>"
    )
    automaton = engine_automaton(text, engine)
    drawing = layout(automaton)
    well_placed(drawing, whole(drawing))
    assert drawing.nodes[automaton.give_up].width == 0
    assert all(drawing.nodes[node.index].width for node in automaton.runners)


def test_a_sequence_goes_down() -> None:
    drawing = laid_out(runner(), runner(), runner())
    start, *runners, _, complete, _ = drawing.nodes
    column = [start, *runners, complete]
    assert {centre(box) for box in column} == {centre(start)}
    assert [box.y for box in column] == sorted(box.y for box in column)


def test_alternatives_stand_beside_what_they_recover() -> None:
    drawing = laid_out(runner(), control("recovery", runner(), runner()))
    _, first, *alternatives, join, complete, _ = drawing.nodes
    assert {box.middle[1] for box in alternatives} == {first.middle[1]}
    assert first.right < alternatives[0].x < alternatives[1].x
    assert centre(join) == centre(first) == centre(complete)
    assert join.y > max(group.box.bottom for group in drawing.groups)


def test_units_of_a_parallel_stand_side_by_side_above_their_joins() -> None:
    drawing = laid_out(control("parallel_all", *[runner()] * 3))
    _, *units, success, failure, _, _ = drawing.nodes
    assert len({box.y for box in units}) == 1
    assert centre(success) == centre(units[1])
    assert min(success.y, failure.y) > units[0].bottom
    assert centre(failure) > units[2].right


def test_groups_are_the_controls_of_the_plan() -> None:
    drawing = laid_out(
        runner(),
        control("recovery", control("parallel_any", runner(), control("sequential"))),
        control("sequential"),
    )
    placed = [(each.element, each.parent, each.depth) for each in drawing.groups]
    assert placed == [(2, -1, 0), (3, 0, 1), (5, 1, 2), (6, -1, 0)]
    assert drawing.groups[0].label.startswith("recovery (line ")


@pytest.mark.parametrize("shape", ["sequential", "parallel_all", "recovery"])
def test_long_rows_are_folded(shape: str) -> None:
    drawing = laid_out(runner(), control(shape, *[runner(x=number) for number in range(300)]))
    width, height = drawing.size
    assert 0.4 < width / height < 4


def test_nesting_needs_no_stack() -> None:
    depth = 3_000
    inner = '<Control type="sequential">' * depth + runner() + "</Control>" * depth
    plan = parse(f"<Plan>{inner}</Plan>", limits=Limits(max_depth=2 * depth)).plan
    assert plan is not None
    drawing = layout(compile_plan(plan).automaton)
    assert drawing.groups[drawing.group_of[1]].depth == depth - 1


def test_ten_thousand_runners() -> None:
    automaton = automaton_of(f"<Plan>{runner(x=1) * 10_000}</Plan>")
    drawing = layout(automaton)
    assert len({box[:2] for box in drawing.nodes}) == len(automaton.nodes)
    assert 0.4 < drawing.size[0] / drawing.size[1] < 4


def test_every_node_has_a_place() -> None:
    automaton = automaton_of(f"<Plan>{control('parallel_any', runner(), runner())}</Plan>")
    drawing = layout(automaton)
    for node, box, group in zip(automaton.nodes, drawing.nodes, drawing.group_of, strict=True):
        assert box.width > 0
        assert (group == 0) == (node.kind in (NodeKind.RUNNER, NodeKind.JOIN))
