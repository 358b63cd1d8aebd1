"""Shrinking: what is left fails, and nothing plainer does."""

from __future__ import annotations

from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.fuzzing import Act, Fate, TimedScenario
from gpsfsm.fuzzing.shrinking import shrink
from tests.fuzzing.support import go, subject

SUBJECT = subject(*(go(name) for name in "ABCDE"), faults=("failed",))
FATES = (Fate.SUCCEEDED, Fate.FAILED)


def every() -> list[TimedScenario]:
    """All plain scenarios, the plainest first: fewest failures, then the first ones."""
    actual = [
        TimedScenario(tuple(Act(fate) for fate in fates)) for fates in product(FATES, repeat=5)
    ]
    return sorted(actual, key=lambda each: (len(each.faults), each.faults))


@given(
    st.sets(st.sets(st.integers(0, 4), min_size=1).map(frozenset), min_size=1, max_size=4),
    st.lists(st.sampled_from([1_000, 2_000, 5_000]), min_size=5, max_size=5),
)
def test_the_plainest_of_all_scenarios_that_fail_is_found(
    causes: set[frozenset[int]], durations: list[int]
) -> None:
    """It fails if all of one of the causes fail, whatever the durations are."""

    def fails(scenario: TimedScenario) -> bool:
        return any(cause <= set(scenario.faults) for cause in causes)

    worst = TimedScenario(tuple(Act(Fate.FAILED, each) for each in durations))
    assert shrink(SUBJECT, worst, fails) == next(filter(fails, every()))


@given(st.lists(st.integers(1, 10), min_size=5, max_size=5), st.integers(0, 4))
def test_only_the_duration_that_matters_is_left_and_is_short(
    seconds: list[int], number: int
) -> None:
    def fails(scenario: TimedScenario) -> bool:
        return scenario.acts[number].duration_ms >= 4_000

    start = TimedScenario(tuple(Act(Fate.FAILED, each * 1_000) for each in seconds))
    if fails(start):
        wanted = SUBJECT.plain.with_act(number, Act(Fate.SUCCEEDED, 4_000))
        assert shrink(SUBJECT, start, fails) == wanted


@given(st.integers(1, 60))
def test_no_more_is_played_than_allowed(most: int) -> None:
    played = []

    def fails(scenario: TimedScenario) -> bool:
        played.append(scenario)
        return Fate.FAILED in {act.fate for act in scenario.acts[3:]}

    worst = TimedScenario(tuple(Act(Fate.FAILED, 3_000) for _ in range(5)))
    assert fails(shrink(SUBJECT, worst, fails, most=most))
    assert len(played) <= most + 1


def test_what_happens_by_itself_shrinks_to_the_plain_scenario() -> None:
    worst = TimedScenario(tuple(Act(Fate.FAILED, 3_000) for _ in range(5)))
    assert shrink(SUBJECT, worst, lambda _: True) == SUBJECT.plain
