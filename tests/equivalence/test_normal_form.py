"""The normal form: rewrites keep it, and plans of one form do the same."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.compile.units import TreeMachine
from gpsfsm.equivalence import compare
from gpsfsm.equivalence.alignment import sides_of
from gpsfsm.equivalence.pairs import Behaviour
from gpsfsm.syntax import Limits, parse
from tests.equivalence import rewriting
from tests.equivalence.brute import distance
from tests.oracle import P, par_all, par_any, plan, rec, seq
from tests.strategies import plans
from tests.support import plan_of

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from gpsfsm.model.plan import Plan


def one_form(first: Plan, second: Plan) -> bool:
    return sides_of(*(Behaviour(compile_plan(each)) for each in (first, second))).same_form


def seeded(seed: int) -> random.Random:
    return random.Random(seed)  # noqa: S311  (no secrets here)


@given(plans(max_runners=12, max_depth=6), st.integers(0, 2**32))
def test_rewrites_keep_the_form(whole: P, seed: int) -> None:
    source = seeded(seed)
    other = rewriting.same(source, rewriting.same(source, whole))
    assert one_form(plan_of(whole), plan_of(other))


@given(plans(max_runners=5), st.integers(0, 2**32))
def test_plans_of_one_form_do_the_same(whole: P, seed: int) -> None:
    source = seeded(seed)
    other = rewriting.mutated(source, rewriting.same(source, whole))
    if one_form(plan_of(whole), plan_of(other)):
        assert distance(whole, other) is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (plan(seq("a", seq("b", "c")), "d"), plan("a", seq(seq("b"), "c"), seq("d"))),
        (plan("a", rec("b", rec("c")), rec("d")), plan("a", rec("b", "c", "d"))),
        (plan(par_all("a", par_all("b", seq(), "c"))), plan(par_all("c", "b", "a"))),
        (plan(par_any("a", par_any("b", "c"))), plan(par_any(par_any("c", "a"), "b"))),
        (plan(par_any("a", par_any(seq(), "b"))), plan(par_any(par_all(), "b", "a", seq()))),
        # what cannot fail needs no recovery, and what stands behind it in a recovery never runs
        (plan("a", rec(seq(), "b"), rec("c")), plan("a", rec(seq()))),
        (plan(par_any(seq(), "a"), rec("b"), "c"), plan(par_any("a", seq()), "c")),
        (plan(rec("x"), "a"), plan("a")),
        (plan(), plan(par_all(seq(), par_any()))),
    ],
)
def test_one_form(one: P, other: P) -> None:
    assert one_form(plan_of(one), plan_of(other))
    assert distance(one, other) is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (plan("a", "b"), plan("b", "a")),
        (plan("a", rec("b")), plan("a", "b")),
        (plan(par_all("a", "b")), plan(par_any("a", "b"))),
        (plan(par_all("a", "a")), plan(par_all("a"))),
        (plan(par_any("a", seq())), plan("a")),
        (plan(par_all("a", "b"), "c"), plan(par_all("a", seq("b", "c")))),
        (plan("a", rec("b"), "c"), plan(seq("a", "c"), rec("b"))),
        (plan(par_all(par_any("a", "b"), "c")), plan(par_all(par_any("a", "c"), "b"))),
    ],
)
def test_different_forms(one: P, other: P) -> None:
    assert not one_form(plan_of(one), plan_of(other))
    assert distance(one, other) is not None


# -- behaviour trees, which can invert, count and branch ---------------------------------------


def trees() -> SearchStrategy[str]:
    leaves = st.sampled_from(["<A/>", "<B/>", "<C/>", "<AlwaysSuccess/>", "<AlwaysFailure/>"])

    def more(inner: SearchStrategy[str]) -> SearchStrategy[str]:
        some = st.lists(inner, min_size=1, max_size=3).map("".join)
        return st.one_of(
            some.map("<Sequence>{}</Sequence>".format),
            some.map("<Fallback>{}</Fallback>".format),
            inner.map("<Inverter>{}</Inverter>".format),
            inner.map("<ForceSuccess>{}</ForceSuccess>".format),
            st.lists(inner, min_size=2, max_size=3)
            .map("".join)
            .map("<IfThenElse>{}</IfThenElse>".format),
            st.lists(inner, min_size=3, max_size=3)
            .map("".join)
            .map('<Parallel success_count="2" failure_count="2">{}</Parallel>'.format),
        )

    return st.recursive(leaves, more, max_leaves=6)


def tree(body: str) -> Plan | None:
    """The plan that a tree is; None for one that is a machine."""
    plan = read_plan(
        f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'
    ).plan
    return None if isinstance(plan, TreeMachine) else plan


@given(trees(), trees())
def test_trees_of_one_form_do_the_same(one: str, other: str) -> None:
    first, second = tree(one), tree(other)
    if first is not None and second is not None and one_form(first, second):
        assert compare(first, second, decider="lockstep") is None


@given(trees())
def test_inverting_twice_keeps_the_form(body: str) -> None:
    first = tree(body)
    second = tree(f"<Inverter><Sequence><Inverter>{body}</Inverter></Sequence></Inverter>")
    if first is not None and second is not None:
        assert one_form(first, second)
        assert compare(first, second, decider="lockstep") is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (
            "<Inverter><Sequence><A/><B/></Sequence></Inverter>",
            "<Fallback><Inverter><A/></Inverter><Inverter><B/></Inverter></Fallback>",
        ),
        (
            '<Inverter><Parallel success_count="2" failure_count="2"><A/><B/><C/></Parallel>'
            "</Inverter>",
            '<Parallel success_count="2" failure_count="2"><Inverter><C/></Inverter><Inverter><A/>'
            "</Inverter><Inverter><B/></Inverter></Parallel>",
        ),
        ("<IfThenElse><A/><B/></IfThenElse>", "<Sequence><A/><B/></Sequence>"),
        (
            "<IfThenElse><Inverter><A/></Inverter><B/><C/></IfThenElse>",
            "<IfThenElse><A/><C/><B/></IfThenElse>",
        ),
        (
            "<IfThenElse><A/><AlwaysSuccess/><C/></IfThenElse>",
            "<Fallback><A/><C/></Fallback>",
        ),
        (
            "<Sequence><A/><AlwaysFailure/><B/></Sequence>",
            "<Sequence><A/><AlwaysFailure/></Sequence>",
        ),
    ],
)
def test_one_form_of_trees(one: str, other: str) -> None:
    first, second = tree(one), tree(other)
    assert first is not None
    assert second is not None
    assert one_form(first, second)
    assert compare(first, second, decider="lockstep") is None


def test_inversion_is_no_identity() -> None:
    first, second = tree("<Inverter><A/></Inverter>"), tree("<A/>")
    assert first is not None
    assert second is not None
    assert not one_form(first, second)


# -- large plans -------------------------------------------------------------------------------


def test_large_plans_of_equal_actions_have_the_form_of_their_rewrites() -> None:
    units = [
        par_all(seq("a", rec("a")), par_any("a", seq("a", "a")), *["a"] * 5) for _ in range(200)
    ]
    whole = plan(*units)
    other = rewriting.same(seeded(1), whole)
    assert compare(plan_of(whole), plan_of(other)) is None


def nested(depth: int, *, runner_last: bool) -> Plan:
    """A runner per level; in a parallel_all it does not matter on which side the rest stands."""
    before, behind = ["<Plan>"], ["</Plan>"]
    for number in range(depth):
        parallel = number % 3 != 0
        runner = f'<Runner interface="a/Go" provider="a/Go" x="{number}"/>'
        before.append(f'<Control type="{"parallel_all" if parallel else "sequential"}">')
        behind.append("</Control>")
        (behind if parallel and runner_last else before).append(runner)
    return plan_of_text("".join(before + behind[::-1]))


def plan_of_text(text: str) -> Plan:
    parsed = parse(text, limits=Limits(max_depth=10_000))
    assert parsed.plan is not None, parsed.problems
    return parsed.plan


def test_deep_nesting_is_no_matter() -> None:
    first, second = nested(3_000, runner_last=False), nested(3_000, runner_last=True)
    assert len(first.runners) == len(second.runners) == 3_000
    assert compare(first, second) is None
