"""Drawing scenarios."""

from __future__ import annotations

from collections import Counter

from gpsfsm.fuzzing import Fate
from gpsfsm.fuzzing.subject import draw
from gpsfsm.model.capability import Outcomes, Span
from tests.fuzzing.support import go, library, subject

DESCRIBED = library(
    Free={},
    Sure={"outcomes": Outcomes(never_fails=True)},
    Slow={"duration": Span(4.0, 6.5)},
    Fixed={"duration": Span(30.0, 30.0)},
)
SUBJECT = subject(go("Free"), go("Sure"), go("Slow"), go("Fixed"), described=DESCRIBED)


def test_nothing_goes_wrong_at_first_and_then_each_fault_comes_alone() -> None:
    scenarios = [draw(SUBJECT, 0, index) for index in range(40)]
    assert scenarios[0] == SUBJECT.plain
    alone = [(number, fate) for number, fates in enumerate(SUBJECT.fates) for fate in fates[1:]]
    assert [
        (scenario.faults[0], scenario.acts[scenario.faults[0]].fate)
        for scenario in scenarios[1 : len(alone) + 1]
    ] == alone
    assert {len(scenario.faults) for scenario in scenarios[len(alone) + 1 :]} >= {0, 1, 2}


def test_draws_depend_on_seed_and_index_alone_and_differ() -> None:
    again = [draw(SUBJECT, 7, index) for index in (9, 20, 21)]
    assert again == [draw(SUBJECT, 7, index) for index in (9, 20, 21)]
    assert len({draw(SUBJECT, seed, 30) for seed in range(10)}) > 5


def test_declared_durations_are_kept() -> None:
    seen: dict[int, Counter[int]] = {number: Counter() for number in range(4)}
    for index in range(200):
        for number, act in enumerate(draw(SUBJECT, 1, index).acts):
            if act.fate in (Fate.SUCCEEDED, Fate.FAILED):
                seen[number][act.duration_ms] += 1
    assert all(4_000 <= each <= 6_500 for each in seen[2])
    assert {4_000, 6_500} <= set(seen[2])
    assert set(seen[3]) == {30_000}
    assert len(seen[0]) > 3
