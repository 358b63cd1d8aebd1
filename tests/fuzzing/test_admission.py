"""Assumptions in campaigns: what is drawn and what is left in the end is admitted."""

from __future__ import annotations

import pickle
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.errors import UsageError
from gpsfsm.fuzzing import Fate, Run, run_campaign
from gpsfsm.fuzzing.own_properties import property_of_function
from gpsfsm.fuzzing.subject import draw
from tests.cases import many
from tests.fuzzing.support import acts, control, go, strange, subject

SIX = [go(name) for name in "ABCDEF"]
TOGETHER = [
    "never fails: A",
    "if any A fails then B fails",
    "exactly 2 of (any A fails, B fails, C fails, D fails)",
    "at most 3 of * fails",
    "any A hangs iff any F hangs",
    "same: D, E",
    "any * fails",
    "no * hangs",
]
"""There is a scenario for all of them."""


@settings(max_examples=many(25), deadline=None)
@given(
    st.lists(st.sampled_from(TOGETHER), max_size=3, unique=True),
    st.booleans(),
    st.integers(0, 10_000),
)
def test_what_is_drawn_is_admitted_and_else_as_without_assumptions(
    assumptions: list[str], consistent: bool, index: int
) -> None:
    children = [*SIX, go("A"), go("F")]
    free = subject(*children)
    target = subject(*children, assumptions=assumptions, consistent=consistent)
    drawn = draw(target, 3, index)
    assert target.admits(drawn)
    if target.admits(draw(free, 3, index)) and not consistent:
        assert drawn == draw(free, 3, index)
    if consistent:
        outcomes = [act.fate.outcome for act in drawn.acts]
        assert (outcomes[0], outcomes[5]) == (outcomes[6], outcomes[7])
    again = pickle.loads(pickle.dumps(target))  # noqa: S301  (our own)
    assert draw(again, 3, index) == drawn


def test_of_what_was_drawn_as_much_as_possible_stays() -> None:
    target = subject(*SIX, assumptions=["A fails implies B fails"])
    wanted = acts(target, n0=Fate.FAILED, n3=Fate.HANG, n4=(Fate.FAILED, 7_000))
    seen = {target.mended(wanted, random.Random(seed)) for seed in range(20)}  # noqa: S311
    changed = [{n for n, act in enumerate(each.acts) if act != wanted.acts[n]} for each in seen]
    assert sorted(map(sorted, changed)) == [[0], [1]]


def test_all_kinds_of_scenarios_that_are_admitted_come() -> None:
    target = subject(
        *SIX[:3], faults=("failed",), assumptions=["exactly 2 of (A fails, B fails, C fails)"]
    )
    assert {draw(target, 0, index).faults for index in range(80)} == {(0, 1), (0, 2), (1, 2)}


def test_what_is_left_in_the_end_is_admitted() -> None:
    def two_fail(run: Run) -> bool:
        return sum(event.kind == "FAILED" for event in run.events) < 2

    guarded = [part for each in SIX for part in (each, control("recovery", go("Other")))]
    target = subject(*guarded, assumptions=["E fails iff B fails", "A never fails"])
    (failure,) = run_campaign(target, [property_of_function(two_fail)], runs=100).failures
    assert strange(failure) == {2: ("FAILED", 1_000), 8: ("FAILED", 1_000)} or strange(failure) == {
        4: ("FAILED", 1_000), 6: ("FAILED", 1_000),
    }  # fmt: skip
    assert target.admits(failure.run.scenario)


def test_equal_actions_are_made_plainer_together() -> None:
    def first_succeeds(run: Run) -> bool:
        return 0 not in run.outcomes or run.outcomes[0] == "SUCCEEDED"

    target = subject(*SIX, *SIX, consistent=True)
    (failure,) = run_campaign(target, [property_of_function(first_succeeds)], runs=60).failures
    assert strange(failure) == {0: ("FAILED", 1_000), 6: ("FAILED", 1_000)}


@pytest.mark.parametrize(
    ("assumptions", "message"),
    [
        (["A fails", "A succeeds"], "admit no scenario"),
        (["A fails iff B fails", "A fails iff not B fails"], "admit no scenario"),
        (["A does"], "A does"),
    ],
)
def test_assumptions_that_make_no_sense(assumptions: list[str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        subject(*SIX, assumptions=assumptions)
