"""Automata to draw, and what must hold of every layout."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.capabilities.library import Library
from gpsfsm.compile import compile_plan
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.compile.plan_text import read_plan

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.picture import Box, Layout

HALF = 0.11
"""Boxes are rounded to a tenth."""


def runner(name: str = "nav/GoRunner", **parameters: object) -> str:
    attributes = "".join(f' {key}="{value}"' for key, value in parameters.items())
    return f'<Runner interface="{name}" provider="x/Y"{attributes}/>'


def control(control_type: str, *children: str) -> str:
    return f'<Control type="{control_type}">{"".join(children)}</Control>'


def automaton_of(text: str) -> Automaton:
    plan = read_plan(text).plan
    assert plan is not None
    return compile_plan(plan).automaton


def engine_automaton(text: str, engine: str) -> Automaton:
    reading = read_for_engine(text.encode(), engine, "a.xml", Library())
    assert isinstance(reading, EngineReading)
    return reading.compiled.automaton


def tree(body: str) -> str:
    return f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'


def trees() -> st.SearchStrategy[str]:
    """Behaviour trees with every shape that is laid out in a way of its own."""
    leaves = st.sampled_from(["<A/>", "<B/>", "<AlwaysSuccess/>", "<AlwaysFailure/>"])

    def more(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        some = st.lists(inner, min_size=1, max_size=3).map("".join)
        return st.one_of(
            some.map("<Sequence>{}</Sequence>".format),
            some.map("<Fallback>{}</Fallback>".format),
            some.map("<ParallelAll>{}</ParallelAll>".format),
            inner.map("<Inverter>{}</Inverter>".format),
            inner.map("<ForceSuccess>{}</ForceSuccess>".format),
            inner.map("<ForceFailure>{}</ForceFailure>".format),
            inner.map('<RetryUntilSuccessful num_attempts="2">{}</RetryUntilSuccessful>'.format),
            st.lists(inner, min_size=2, max_size=3)
            .map("".join)
            .map("<IfThenElse>{}</IfThenElse>".format),
            st.lists(inner, min_size=3, max_size=3)
            .map("".join)
            .map('<Parallel success_count="2" failure_count="2">{}</Parallel>'.format),
        )

    return st.recursive(leaves, more, max_leaves=7).map(tree)


def overlap(one: Box, other: Box) -> bool:
    return (
        one.x < other.right - HALF
        and other.x < one.right - HALF
        and one.y < other.bottom - HALF
        and other.y < one.bottom - HALF
    )


def inside(inner: Box, outer: Box) -> bool:
    return (
        outer.x <= inner.x + HALF
        and outer.y <= inner.y + HALF
        and inner.right <= outer.right + HALF
        and inner.bottom <= outer.bottom + HALF
    )


def well_placed(layout: Layout, whole: Box) -> None:
    """No boxes overlap, and everything lies inside what it belongs to."""
    for one, other in combinations([box for box in layout.nodes if box.width], 2):
        assert not overlap(one, other)
    for one, other in combinations(layout.groups, 2):
        if one.parent == other.parent:
            assert not overlap(one.box, other.box)
    for box, group_of in zip(layout.nodes, layout.group_of, strict=True):
        assert inside(box, layout.groups[group_of].box if group_of >= 0 else whole) or not box.width
        outer = around(layout, group_of)
        for number, group in enumerate(layout.groups):
            assert number in outer or not overlap(box, group.box)
    for group in layout.groups:
        outer = layout.groups[group.parent].box if group.parent >= 0 else whole
        assert inside(group.box, outer)


def around(layout: Layout, group: int) -> list[int]:
    """A group and all groups that it is in."""
    groups = []
    while group >= 0:
        groups.append(group)
        group = layout.groups[group].parent
    return groups
