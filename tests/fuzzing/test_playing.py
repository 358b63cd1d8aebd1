"""Playing scenarios: the executor does what they say."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import UsageError
from gpsfsm.fuzzing import Fate, TimedScenario, play, subject_of
from gpsfsm.model.capability import Outcomes, Span
from gpsfsm.model.event import Outcome
from gpsfsm.strategies import scenarios
from gpsfsm.syntax import Limits, parse
from tests.fuzzing.support import FREE, acts, control, go, library, plan, subject
from tests.oracle import FAILED, HANG, NO_START, SUCCEEDED, System, to_xml
from tests.strategies import plans

KINDS = {
    Fate.SUCCEEDED: SUCCEEDED,
    Fate.FAILED: FAILED,
    Fate.NO_START: NO_START,
    Fate.HANG: HANG,
}


@given(st.data(), plans(min_runners=1, max_runners=5))
def test_runs_end_as_the_brute_force_says(data: st.DataObject, whole) -> None:
    faults = data.draw(st.sampled_from([("failed",), ("failed", "hang"), ("no-start",), ()]))
    target = subject_of(to_xml(whole), faults=faults, limit_s=None, library=FREE)
    if not target.plan.runners:
        return  # nothing but a completion runner
    scenario = data.draw(scenarios(target))
    system = System(whole, frozenset(faults) - {"failed"})
    outcomes = tuple(KINDS[act.fate] for act in scenario.acts)
    run = play(target, scenario)
    assert run.status == system.run(outcomes).ends
    if run.status == "COMPLETED":
        orphans = {run.plan.path(run.runner(number)) for number in run.active_at_end}
        assert orphans <= system.run(outcomes).orphans()


@given(st.data(), plans(min_runners=1, max_runners=5))
def test_a_time_limit_makes_a_failure_of_what_hangs_or_is_late(data: st.DataObject, whole) -> None:
    target = subject_of(to_xml(whole), faults=("failed", "late", "hang"), library=FREE)
    if not target.plan.runners:
        return
    scenario = data.draw(scenarios(target))
    outcomes = tuple(SUCCEEDED if act.fate is Fate.SUCCEEDED else FAILED for act in scenario.acts)
    assert play(target, scenario).status == System(whole).run(outcomes).ends


def test_durations_are_kept_to_the_microsecond() -> None:
    target = subject(go("A"), control("parallel_all", go("B"), go("C")))
    run = play(target, acts(target, n0=(Fate.SUCCEEDED, 2_000), n2=(Fate.SUCCEEDED, 1_500)))
    assert run.triggered == {0: 0, 1: 2_000_000, 2: 2_000_000}
    assert run.ended == {0: 2_000_000, 1: 3_000_000, 2: 3_500_000}
    assert run.at_s == 3.5
    assert run.outcomes == dict.fromkeys(range(3), Outcome.SUCCEEDED)


def test_a_late_answer_comes_and_changes_nothing() -> None:
    target = subject(go("A"), control("recovery", go("B")), limit_s=5.0)
    scenario = acts(target, n0=(Fate.LATE, 500), n1=(Fate.SUCCEEDED, 3_000))
    run = play(target, scenario)
    kinds = [(event.at_s, event.kind) for event in run.events if event.number == 0]
    assert kinds[-3:] == [(5.0, "STOPPED"), (5.0, "FAILED"), (5.5, "LATE")]
    assert (run.status, run.at_s) == ("COMPLETED", 8.0)


def test_a_runner_that_does_not_start_fails_without_having_started() -> None:
    target = subject(go("A"), control("recovery", go("B")))
    run = play(target, acts(target, n0=(Fate.NO_START, 2_000)))
    assert [event.kind for event in run.events if event.number == 0] == ["TRIGGERED", "FAILED"]
    assert (run.status, run.at_s) == ("COMPLETED", 3.0)


def test_what_is_triggered_at_the_end_is_active_then() -> None:
    """The empty unit succeeds at once, and B is triggered at that very instant."""
    target = subject(go("A"), control("parallel_any", control("sequential"), go("B")))
    run = play(target, target.plain)
    assert run.status == "COMPLETED"
    assert run.active_at_end == (1,)
    assert run.triggered == {0: 0, 1: 1_000_000}


def test_events_tell_what_runners_were_given_and_gave() -> None:
    target = subject(go("A", x="1"))
    run = play(target, target.plain)
    (triggered,) = [event for event in run.events if event.kind == "TRIGGERED"]
    assert triggered.data == {"x": 1}
    assert (triggered.interface, triggered.element) == ("a/A", "/Plan/Runner[1]")
    assert triggered.line == 1


def test_the_same_scenario_gives_the_same_run() -> None:
    target = subject_of(
        '<Plan><Runner interface="perception_capabilities/TranscribeRunner" '
        'provider="perception_capabilities/TranscribeRunner"/></Plan>'
    )
    assert play(target, target.plain, seed=3).moments == play(target, target.plain, seed=3).moments


def test_a_scenario_of_another_plan_is_refused() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        play(subject(go("A")), TimedScenario(()))


def test_declared_outcomes_and_durations_are_kept() -> None:
    target = subject(
        go("Sure"),
        go("Never"),
        go("Slow"),
        described=library(
            Sure={"outcomes": Outcomes(never_fails=True)},
            Never={"outcomes": Outcomes(never_succeeds=True)},
            Slow={"duration": Span(4.0, 6.0)},
        ),
        faults=("failed", "late", "no-start"),
    )
    assert target.fates[0] == (Fate.SUCCEEDED,)
    assert target.fates[1] == (Fate.FAILED, Fate.NO_START)
    assert target.act(2, Fate.SUCCEEDED, 1_000).duration_ms == 4_000
    assert target.act(2, Fate.FAILED, 9_000).duration_ms == 6_000


def test_a_plan_nested_thousands_deep_is_played() -> None:
    depth = 3_000
    start, end = '<Control type="sequential">' * depth, "</Control>" * depth
    parsed = parse(plan(start, go("A"), end), limits=Limits(max_depth=depth + 10))
    assert parsed.plan is not None
    target = subject_of(parsed.plan)
    assert play(target, target.plain).status == "COMPLETED"


def test_the_usual_time_limit_is_longer_than_what_is_declared() -> None:
    def limit_of(**span: Span) -> int | None:
        described = library(A={"duration": span["span"]} if span else {})
        return subject(go("A"), described=described).limit_ms

    assert limit_of() == 60_000
    assert limit_of(span=Span(5.0, 30.0)) == 60_000
    assert limit_of(span=Span(5.0, 120.0)) == 240_000
    assert limit_of(span=Span(90.0, None)) == 180_000
    slow = subject(go("A"), described=library(A={"duration": Span(300.0, 300.0)}))
    assert play(slow, slow.plain).status == "COMPLETED"
    assert play(slow, slow.plain).at_s == 300.0


@pytest.mark.parametrize("limit_s", [0, -1.0, float("nan"), 1e7])
def test_a_time_limit_that_makes_no_sense_is_refused(limit_s: float) -> None:
    with pytest.raises(UsageError, match="the time limit must be a positive number"):
        subject(go("A"), limit_s=limit_s)
