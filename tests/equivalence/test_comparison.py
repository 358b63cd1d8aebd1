"""Equivalence of plans: the search, z3 and the brute force agree; rewrites change nothing."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gpsfsm.compile import compile_plan
from gpsfsm.equivalence import Difference, Pair, Step, UndecidedError, compare, comparison
from gpsfsm.equivalence.alignment import sides_of
from gpsfsm.equivalence.pairs import Behaviour
from gpsfsm.equivalence.proof import NotProvedError, prove
from gpsfsm.equivalence.set_observer import difference_of_late_pairs, difference_of_sets
from gpsfsm.errors import AssumptionError, GpsfsmError, UsageError
from gpsfsm.model.automaton import Traits
from gpsfsm.model.event import End, Event
from tests.equivalence import rewriting
from tests.equivalence.brute import Assumed, distance
from tests.equivalence.pairs import differs, last_reactions, seeded, wide
from tests.oracle import P, par_all, par_any, plan, rec, runner_paths, seq
from tests.strategies import constraints, plans
from tests.support import plan_of

if TYPE_CHECKING:
    from tests.oracle import Constraint

RLIMIT = 20_000_000


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
    difference = differs(whole, other, consistent=consistent)
    wanted = distance(whole, other, consistent=consistent)
    assert (None if difference is None else len(difference.steps)) == wanted
    back = differs(other, whole, consistent=consistent)
    assert (None if back is None else len(back.steps)) == wanted


@st.composite
def assumed(draw: st.DrawFn) -> tuple[P, P, Constraint]:
    """A plan, a change of it, and a constraint that speaks of instances that both have."""
    whole = draw(plans(min_runners=1, max_runners=4).filter(runner_paths))
    other = rewriting.mutated(seeded(draw(st.integers(0, 2**32))), whole)
    common = set(runner_paths(whole)) & set(runner_paths(other))
    constraint = draw(constraints(whole))
    assume(set(re.findall(r"/Plan\S*\]", str(constraint))) <= common)
    return whole, other, constraint


@given(assumed(), st.booleans())
def test_assumptions_are_judged_as_by_brute_force(
    drawn: tuple[P, P, Constraint], consistent: bool
) -> None:
    one, other, constraint = drawn
    both = (constraint, constraint)
    if all(Assumed(each, constraint, consistent=consistent).scenarios for each in (one, other)):
        difference = differs(one, other, assumptions=(str(constraint),), consistent=consistent)
        wanted = distance(one, other, consistent=consistent, assumed=both)
        assert (None if difference is None else len(difference.steps)) == wanted
        return
    with pytest.raises(GpsfsmError, match="admit no scenario"):
        differs(one, other, assumptions=(str(constraint),), consistent=consistent)


@given(assumed(), st.booleans())
def test_z3_keeps_to_assumptions_as_the_search_does(
    drawn: tuple[P, P, Constraint], consistent: bool
) -> None:
    one, other, constraint = drawn
    options: dict[str, Any] = {"assumptions": (str(constraint),), "consistent": consistent}
    try:
        proved = differs(one, other, decider="z3", **options)
    except GpsfsmError:
        return  # no scenario; or equal actions side by side, where the search alone decides
    assert proved == differs(one, other, decider="lockstep", **options)


@given(plans(max_runners=5), st.integers(0, 2**32), st.booleans())
def test_differences_that_no_pairing_hides_are_differences(
    whole: P, seed: int, consistent: bool
) -> None:
    other = rewriting.mutated(seeded(seed), whole)
    wanted = distance(whole, other, consistent=consistent)
    behaviours = [Behaviour(compile_plan(plan_of(each))) for each in (whole, other)]
    sides = sides_of(*behaviours, consistent=consistent)
    for search in (difference_of_sets, difference_of_late_pairs):
        match = search(sides, max_work=20_000)
        if match is not None:
            assert wanted is not None
            assert len(match.steps) >= wanted
            assert last_reactions(behaviours, match) == (match.first, match.second)


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
    difference = by_z3(one, other)
    assert difference is not None
    assert [step.event for step in difference.steps] == [Event.FAILED]


def test_the_difference_is_told_with_both_reactions() -> None:
    difference = differs(plan("a", rec("b")), plan("a"))
    assert difference is not None
    assert difference.steps == (Step(Pair(0, 0), Event.FAILED),)
    assert (difference.first.triggered, difference.first.end) == ((1,), None)
    assert (difference.second.triggered, difference.second.end) == ((), End.GAVE_UP)


def test_a_difference_at_the_beginning_needs_no_outcome() -> None:
    difference = differs(plan("a"), plan("b"))
    assert difference is not None
    assert difference.steps == ()
    assert difference == by_z3(plan("a"), plan("b"))


def test_typed_values_count_and_not_their_spelling() -> None:
    assert differs(plan("a x=1"), plan("a x=1.0")) is None
    assert differs(plan("a x=1"), plan("a x=true")) is not None


@pytest.mark.parametrize(
    ("value", "tolerance", "equal"),
    [("1.005", 0.01, True), ("1.02", 0.01, False), ("1.005", 0.0, False), ("one", 5.0, False)],
)
def test_tolerance(value: str, tolerance: float, equal: bool) -> None:
    difference = differs(plan("a x=1"), plan(f"a x={value}"), tolerance=tolerance)
    assert (difference is None) is equal


def test_tolerance_links_chains_and_leaves_booleans_alone() -> None:
    one = plan("a x=1", "a x=1.05", "a x=true")
    other = plan("a x=1.1", "a x=1", "a x=true")
    assert differs(one, other, tolerance=0.06) is None
    assert differs(plan("a x=1"), plan("a x=true"), tolerance=3.0) is not None


def test_many_equal_actions_side_by_side() -> None:
    one = plan(par_all(*["a"] * 40), "b")
    verdict = compare(plan_of(one), plan_of(plan(par_all(*["a"] * 39), "b")))
    assert verdict is not None
    assert verdict.steps == ()
    assert compare(plan_of(plan(par_all(*["a"] * 6), "b")), plan_of(plan("c"))) is not None


@pytest.fixture
def little_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search ends early, as it does in larger plans."""
    monkeypatch.setattr(comparison, "_WORK", 20_000)


@pytest.mark.usefixtures("little_work")
def test_what_comes_late_behind_many_equal_actions_is_found() -> None:
    branches = [seq("a", f"b x={number}") for number in range(12)]
    difference = differs(plan(par_all(*branches)), plan(par_all(*branches[::-1]), "c"))
    assert difference is not None
    assert len(difference.steps) == 24


def test_what_is_not_decided_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "_WORK", 100)
    monkeypatch.setattr(comparison, "_WORK_PER_RUNNER", 1)
    branches = [seq("a", f"b x={number}") for number in range(12)]
    # they do the same: nothing is seen after the end
    one = plan(par_all(*branches), par_any(seq(), "a"))
    other = plan(par_all(*branches[::-1]), par_any(seq(), seq("a", "b")))
    with pytest.raises(UndecidedError, match="within the limits"):
        differs(one, other, rlimit=1000)
    with pytest.raises(UndecidedError, match="z3 may decide it"):
        differs(one, other, decider="lockstep")


def test_plans_too_large_for_the_search_are_proved_by_z3() -> None:
    whole = wide(120)
    other = rewriting.same(seeded(3), whole)
    assert compare(plan_of(whole), plan_of(other)) is None
    changed = plan(*whole.children[:1], "x", *whole.children[1:])
    verdict = compare(plan_of(whole), plan_of(changed), decider="z3")
    assert verdict is not None
    assert len(verdict.steps) == 40
    assert verdict.shortest


def test_a_long_plan_is_searched_state_by_state() -> None:
    long = plan(*(node for n in range(1000) for node in (f"a n={n}", rec(f"b n={n}"))))
    assert (
        compare(plan_of(long), plan_of(plan(seq(*long.children[:900]), *long.children[900:])))
        is None
    )
    difference = differs(long, plan(*long.children[:-1]))
    assert difference is not None
    assert len(difference.steps) == 1000


# -- more than the search can visit ------------------------------------------------------------


def crowd(size: int, **more: str) -> P:
    """Many units that begin with equal actions, all at once."""
    units = [seq("a", f"b x={number % 3}", rec("a")) for number in range(size)]
    return plan(par_all(*units, *more.values()))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        # a set of equal actions tells them apart
        (
            plan(par_all(*["a", seq("a", "b")] * 8)),
            plan(par_all(*["a", seq("a", "b")] * 7, "a", "a")),
        ),
        # one of the second plan does, whichever of the first it is taken for
        (
            plan(par_all(*["a"] * 9, par_any(par_all("a", "b"), "c"))),
            plan(par_all(*["a"] * 9, par_any(seq(par_all("a", "b"), rec("d")), "c"))),
        ),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("little_work")
def test_many_equal_actions_do_not_hide_a_difference(one: P, other: P) -> None:
    difference = differs(one, other)
    assert difference is not None
    behaviours = [Behaviour(compile_plan(plan_of(each))) for each in (one, other)]
    assert last_reactions(behaviours, difference) == (difference.first, difference.second)


def test_units_that_begin_alike_can_be_exchanged() -> None:
    one, other = crowd(30), crowd(30, last="c")
    sides = sides_of(*(Behaviour(compile_plan(plan_of(each))) for each in (one, other)))
    heads = sides.twins[0][::3]
    assert len(set(heads)) == 3
    difference = differs(one, other)
    assert difference is not None
    assert difference.steps == ()


# -- assumptions -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("one", "other", "assumption"),
    [
        (plan("x/A", rec("x/B")), plan("x/A"), "never fails: A"),
        (plan("x/A", "x/B", rec("x/C")), plan("x/A", "x/B"), "any A succeeds implies B succeeds"),
        (plan("x/A", rec("x/A", "x/A")), plan("x/A", rec("x/A")), "at most one of A fails"),
        (plan("x/A", "x/B"), plan("x/A"), "always fails: A"),
    ],
)
def test_plans_that_do_the_same_under_an_assumption(one: P, other: P, assumption: str) -> None:
    assert differs(one, other) is not None
    assert differs(one, other, assumptions=(assumption,), second_opinion=True) is None
    assert differs(one, other, assumptions=(assumption,), decider="z3") is None


def test_an_assumption_about_one_plan_counts_there() -> None:
    one, other = plan("x/A", rec("x/B")), plan(seq("x/A"), rec("x/B", "x/C"))
    difference = differs(one, other, assumptions=("never fails: C", "any B succeeds"))
    assert difference is None  # so C never comes
    assert differs(one, other, assumptions=("never fails: C",)) is not None


def test_an_assumption_names_the_plan_that_it_does_not_fit() -> None:
    with pytest.raises(AssumptionError, match="line 9 contains no runner"):
        differs(plan("a"), plan("a"), assumptions=("line 9 fails",))


def test_engines_are_not_compared() -> None:
    compiled = compile_plan(plan_of(plan("a")))
    engine = replace(compiled.automaton, traits=Traits("another"))
    with pytest.raises(UsageError, match="not by those of an engine"):
        compare(replace(compiled, automaton=engine), compiled)
