"""Equivalence of plans: the search, z3 and the brute force agree; rewrites change nothing."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.compile import compile_plan
from gpsfsm.model.event import End, Event
from gpsfsm.tasks.behaviour import Behaviour
from gpsfsm.tasks.equivalence import Difference, Pair, Step, UndecidedError, compare
from gpsfsm.tasks.likeness import sides_of
from gpsfsm.tasks.proof import NotProvedError, prove
from tests.oracle import P, par_all, par_any, plan, rec, seq
from tests.strategies import plans
from tests.support import plan_of
from tests.tasks import rewriting
from tests.tasks.brute import distance

RLIMIT = 20_000_000


def seeded(seed: int) -> random.Random:
    return random.Random(seed)  # noqa: S311  (no secrets here)


def differs(one: P, other: P, **options: bool | float) -> Difference | None:
    return compare(plan_of(one), plan_of(other), **options)  # type: ignore[arg-type]


def by_z3(one: P, other: P, *, consistent: bool = False) -> Difference | None:
    behaviours = [Behaviour(compile_plan(plan_of(whole))) for whole in (one, other)]
    return prove(sides_of(*behaviours, consistent=consistent), rlimit=RLIMIT)


@given(plans(max_runners=12), st.integers(0, 2**32))
def test_rewrites_change_nothing(whole: P, seed: int) -> None:
    other = rewriting.same(seeded(seed), whole)
    assert differs(whole, other) is None


@given(plans(max_runners=5), st.integers(0, 2**32), st.booleans())
def test_mutations_are_judged_as_by_brute_force(whole: P, seed: int, consistent: bool) -> None:
    other = rewriting.mutated(seeded(seed), whole)
    found = differs(whole, other, consistent=consistent)
    wanted = distance(whole, other, consistent=consistent)
    assert (None if found is None else len(found.steps)) == wanted
    back = differs(other, whole, consistent=consistent)
    assert (None if back is None else len(back.steps)) == wanted


@given(plans(max_runners=8), st.integers(0, 2**32), st.booleans())
def test_z3_and_the_search_find_the_same(whole: P, seed: int, consistent: bool) -> None:
    other = rewriting.mutated(seeded(seed), whole)
    try:
        proved = by_z3(whole, other, consistent=consistent)
    except NotProvedError:
        return  # equal actions side by side: the search alone decides
    assert proved == differs(whole, other, consistent=consistent)


def test_z3_decides_most_plans_without_equal_actions() -> None:
    for seed in range(20):
        source = seeded(seed)
        names = [f"demo/Runner{number} x={number}" for number in range(12)]
        children = [par_all(*names[:4], par_any(*names[4:8])), rec(*names[8:10]), *names[10:]]
        whole = plan(*children)
        assert by_z3(whole, rewriting.same(source, whole)) is None


@pytest.mark.parametrize(
    ("one", "other", "consistent"),
    [
        # what follows on success and on failure alike may be said once or twice
        (plan("a", rec("b", "c")), plan(seq("a"), rec(seq("b")), rec("c")), False),
        # what has succeeded once cannot fail the second time
        (plan("a", "a", rec("b")), plan("a", "a"), True),
        # instances of one action in branches that exclude each other
        (plan(seq(par_any("a", "b"), "c")), plan(par_any("b", "a"), "c"), False),
        (plan(par_all(seq("a", "b"), seq("a", "c"))), plan(par_all(seq("a", "c"), seq("a", "b"))),
         False),
        (plan(par_all("a", "a", "b")), plan(par_all("a", "b", "a")), False),
        (plan(), plan(seq()), False),
        # nothing is seen after the end
        (plan(par_any(seq(), seq("a", "b"))), plan(par_any(seq(), "a")), False),
    ],
)  # fmt: skip
def test_equal(one: P, other: P, consistent: bool) -> None:
    assert differs(one, other, consistent=consistent) is None
    assert distance(one, other, consistent=consistent) is None


def test_exclusive_branches_are_merged_by_z3() -> None:
    one = plan(seq("a", rec("x")), "b", "c")
    other = plan(seq("a", seq("b", "c")))  # without the recovery: not the same
    assert by_z3(one, one) is None
    found = by_z3(one, other)
    assert found is not None
    assert [step.event for step in found.steps] == [Event.FAILED]


def test_the_difference_is_told_with_both_reactions() -> None:
    found = differs(plan("a", rec("b")), plan("a"))
    assert found is not None
    assert found.steps == (Step(Pair(0, 0), Event.FAILED),)
    assert (found.first.triggered, found.first.end) == ((1,), None)
    assert (found.second.triggered, found.second.end) == ((), End.GAVE_UP)


def test_a_difference_at_the_beginning_needs_no_outcome() -> None:
    found = differs(plan("a"), plan("b"))
    assert found is not None
    assert found.steps == ()
    assert found == by_z3(plan("a"), plan("b"))


def test_typed_values_count_and_not_their_spelling() -> None:
    assert differs(plan("a x=1"), plan("a x=1.0")) is None
    assert differs(plan("a x=1"), plan("a x=true")) is not None


@pytest.mark.parametrize(
    ("value", "tolerance", "equal"),
    [("1.005", 0.01, True), ("1.02", 0.01, False), ("1.005", 0.0, False), ("one", 5.0, False)],
)
def test_tolerance(value: str, tolerance: float, equal: bool) -> None:
    found = differs(plan("a x=1"), plan(f"a x={value}"), tolerance=tolerance)
    assert (found is None) is equal


def test_tolerance_links_chains_and_leaves_booleans_alone() -> None:
    one = plan("a x=1", "a x=1.05", "a x=true")
    other = plan("a x=1.1", "a x=1", "a x=true")
    assert differs(one, other, tolerance=0.06) is None
    assert differs(plan("a x=1"), plan("a x=true"), tolerance=3.0) is not None


def test_many_equal_actions_side_by_side() -> None:
    one = plan(par_all(*["a"] * 40), "b")
    found = compare(plan_of(one), plan_of(plan(par_all(*["a"] * 39), "b")))
    assert found is not None
    assert found.steps == ()
    assert compare(plan_of(plan(par_all(*["a"] * 6), "b")), plan_of(plan("c"))) is not None


def test_what_is_not_decided_is_said() -> None:
    branches = [seq("a", f"b x={number}") for number in range(12)]
    one, other = plan(par_all(*branches)), plan(par_all(*branches[::-1]), "c")
    with pytest.raises(UndecidedError):
        compare(plan_of(one), plan_of(other), rlimit=1000)


def wide(size: int) -> P:
    units = [
        par_all(*(seq(*(f"r n={place + k + 10 * j}" for k in range(10))) for j in range(4)))
        for place in range(0, size, 40)
    ]
    return plan(*units)


def test_plans_too_large_for_the_search_are_proved_by_z3() -> None:
    whole = wide(120)
    other = rewriting.same(seeded(3), whole)
    assert compare(plan_of(whole), plan_of(other)) is None
    changed = plan(*whole.children[:1], "x", *whole.children[1:])
    found = compare(plan_of(whole), plan_of(changed), decider="z3")
    assert found is not None
    assert len(found.steps) == 40
    assert found.shortest


def test_a_long_plan_is_searched_state_by_state() -> None:
    long = plan(*(node for n in range(1000) for node in (f"a n={n}", rec(f"b n={n}"))))
    assert (
        compare(plan_of(long), plan_of(plan(seq(*long.children[:900]), *long.children[900:])))
        is None
    )
    found = differs(long, plan(*long.children[:-1]))
    assert found is not None
    assert len(found.steps) == 1000
