"""Connections, rejections and crashes of random plans: the package against a plain recursion."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.cases import many
from tests.compile.fabric.brute import CONTROL, RUNNER, Node, comment, engine, text, to_xml
from tests.compile.fabric.support import listed

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

TYPES = ("sequential", "parallel_any", "parallel_all", "recovery")


def runner(name: str) -> Node:
    return Node(RUNNER, (("interface", name), ("provider", name)))


def control(kind: str, *children: Node, name: str | None = None) -> Node:
    attributes = (("type", kind), *((("name", name),) if name is not None else ()))
    return Node(CONTROL, attributes, children)


runners = st.sampled_from("ABC").map(runner)
names = st.sampled_from([None, "", "n1", "n2 & <n3>"])


def controls(inside: SearchStrategy[Node]) -> SearchStrategy[Node]:
    return st.builds(
        lambda kind, children, name: control(kind, *children, name=name),
        st.sampled_from(TYPES),
        st.lists(inside, max_size=4),
        names,
    )


good = st.recursive(runners, controls, max_leaves=12)
bad = st.sampled_from(
    [
        runner(""),
        Node(RUNNER, (("interface", "A"),)),
        Node(RUNNER, (("provider", "A"), ("x", "'&\""))),
        Node(RUNNER, (("interface", "A"), ("provider", "A")), (Node("Bogus"), comment("c"))),
        Node("Event", (("interface", "A"),), (runner("B"), Node("x"))),
        Node("Plan", (), (runner("B"),)),
        Node("runner"),
        control("Sequential", runner("B")),
        control(""),
        Node(CONTROL, (("name", "n"),), (comment(" c "), control("recovery", runner("B")))),
        control("recovery", comment("c")),
        control("sequential", text("some text")),
        comment("between"),
    ]
)
any_children = st.lists(st.recursive(st.one_of(runners, bad), controls, max_leaves=10), max_size=5)


def compare(children: tuple[Node, ...]) -> None:
    written = to_xml(Node("Plan", (("name", "p"),), children))
    for version in (1, 2):
        assert listed(version, written) == engine(version, children)


@given(st.lists(good, max_size=6).map(tuple))
@example(())
@settings(max_examples=many(200))
def test_plans(children: tuple[Node, ...]) -> None:
    compare(children)


@given(any_children.map(tuple))
@settings(max_examples=many(200))
def test_plans_with_faults(children: tuple[Node, ...]) -> None:
    compare(children)


@pytest.mark.parametrize(("outer", "inner"), list(product(TYPES, TYPES)))
def test_nestings(outer: str, inner: str) -> None:
    a, b, c, d, p, z = map(runner, "ABCDPZ")
    compare((control("sequential", p, control(outer, a, control(inner, b, c), d), z),))
    compare((p, control(outer, control(inner, a, b), control(inner, c, d)), z))
    compare((control(outer, a), control(inner, b), z))
    compare((p, control(outer, control(inner), a), z))
    compare((p, control(outer, a, control(inner)), control(outer), z))


@pytest.mark.parametrize("kind", TYPES)
def test_a_follower_without_a_name_leaves_its_predecessor_open(kind: str) -> None:
    # The engine asks for the name of what follows: a runner with an empty one counts as nothing,
    # so the next join takes its place, and counts its predecessor as open.
    p, nameless, a, z = runner("P"), runner(""), runner("A"), runner("Z")
    compare((p, nameless, control(kind, a), z))
    compare((p, control("recovery", a), nameless, control(kind, a), z))
    compare((p, control(kind, nameless, a), z))


def test_deep_and_wide_plans() -> None:
    deep = 490
    text = "<Plan>" + "<Control type='recovery'>" * deep
    text += "<Runner interface='A' provider='A'/>" + "</Control>" * deep + "</Plan>"
    rows = listed(2, text)
    assert len(rows) == 1 + deep + 1
    # The innermost join takes the success; those around it find nothing open but themselves.
    assert [row["success"] for row in rows] == [1, *range(1, deep), deep + 1, None]
    wide = "<Runner interface='A' provider='A'/>" * 20_000
    assert len(listed(1, f"<Plan>{wide}</Plan>")) == 20_001
    joins = "<Control type='parallel_all'><Runner interface='A' provider='A'/></Control>" * 5_000
    assert len(listed(2, f"<Plan>{joins}</Plan>")) == 10_001
