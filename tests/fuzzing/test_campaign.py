"""Campaigns: planted defects are found, and shrunk to the plainest case there is."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution import kernel
from gpsfsm.fuzzing import Breach, Failure, Fate, Property, run_campaign, subject_of
from gpsfsm.fuzzing.campaign import MOST_BREACHES
from gpsfsm.fuzzing.own_properties import property_of, property_of_function
from gpsfsm.fuzzing.properties import default_properties, find_property
from tests.cases import many
from tests.cli.support import environment
from tests.fuzzing.support import FREE, control, go, library, messages, strange, subject
from tests.oracle import System, to_xml
from tests.strategies import plans

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.fuzzing.runs import Run

SIX = [go(name) for name in "ABCDEF"]


def failure_of(function, *children: str, runs: int = 150, seed: int = 0, **options):
    """The one breach of a user's property, in its plainest form."""
    target = subject(*children, **options)
    campaign = run_campaign(target, [property_of_function(function)], runs=runs, seed=seed)
    (failure,) = campaign.failures
    return failure


@pytest.mark.parametrize("seed", [0, 1])
def test_the_two_failures_that_matter_are_what_is_left(seed: int) -> None:
    def never_both(run: Run) -> str | None:
        failed = {event.interface for event in run.events if event.kind == "FAILED"}
        return "C and F fail" if {"a/C", "a/F"} <= failed else None

    guarded = [part for each in SIX for part in (each, control("recovery", go("Other")))]
    failure = failure_of(never_both, *guarded, seed=seed)
    assert strange(failure) == {4: ("FAILED", 1_000), 10: ("FAILED", 1_000)}


@pytest.mark.parametrize("seed", [0, 1])
def test_of_equally_many_failures_the_first_in_document_order_are_left(seed: int) -> None:
    def at_most_one(run: Run) -> bool:
        return sum(event.kind == "FAILED" for event in run.events) < 2

    guarded = [part for each in SIX for part in (each, control("recovery", go("Other")))]
    failure = failure_of(at_most_one, *guarded, seed=seed)
    assert strange(failure) == {0: ("FAILED", 1_000), 1: ("FAILED", 1_000)}


@pytest.mark.parametrize("seed", [0, 1])
def test_of_durations_only_those_that_matter_are_left(seed: int) -> None:
    def third_is_not_last(run: Run) -> bool:
        return run.ended.get(2, 0) <= max((at for n, at in run.ended.items() if n != 2), default=0)

    failure = failure_of(third_is_not_last, control("parallel_all", *SIX), seed=seed)
    assert strange(failure) == {2: ("SUCCEEDED", 2_000)}


@pytest.mark.parametrize("seed", [0, 1])
def test_the_plainest_fault_is_left_and_a_strange_one_where_it_matters(seed: int) -> None:
    def all_start(run: Run) -> bool:
        started = {event.number for event in run.events if event.kind == "STARTED"}
        return set(run.triggered) <= started

    def none_late(run: Run) -> None:
        late = [event for event in run.events if event.kind == "LATE"]
        assert not late, f"{late[0].element} answers too late"

    failure = failure_of(all_start, *SIX[:3], seed=seed)
    assert strange(failure) == {0: ("NO_START", 1_000)}
    failure = failure_of(none_late, *SIX[:2], control("recovery", *SIX[3:]), seed=seed)
    assert strange(failure)[1][0] == "LATE"
    assert len(strange(failure)) <= 2
    assert failure.breach.message == "/Plan/Runner[2] answers too late"


def test_a_plan_without_defects_holds_all_properties() -> None:
    target = subject(*SIX[:3])
    campaign = run_campaign(target, default_properties(), runs=200)
    assert campaign.failures == []
    assert campaign.held == ("ends", "no-orphan", "no-overlap", "replays")
    assert campaign.runs == 200


def test_an_orphan_is_found_in_its_plainest_run() -> None:
    target = subject(control("parallel_any", go("A"), go("B")))
    campaign = run_campaign(target, [find_property("no-orphan")], runs=100)
    assert [strange(failure) for failure in campaign.failures] == [
        {failure.breach.numbers[0]: ("SUCCEEDED", 2_000)}  # together with the other it is none
        for failure in campaign.failures
    ]
    assert messages(campaign) == [
        ("no-orphan", "A at line 1 column 36 is still active when the plan completes"),
        ("no-orphan", "B at line 1 column 76 is still active when the plan completes"),
    ]


def test_an_overlap_is_found() -> None:
    target = subject(
        control("parallel_all", control("sequential", go("Wait"), go("Drive")), go("Turn")),
        described=library(Wait={}, Drive={"resources": ("base",)}, Turn={"resources": ("base",)}),
        faults=("failed",),
    )
    campaign = run_campaign(target, [find_property("no-overlap")], runs=100)
    (failure,) = campaign.failures
    assert strange(failure) == {2: ("SUCCEEDED", 2_000)}
    assert failure.breach.numbers == (2, 1)
    assert "both hold the resource 'base'" in failure.breach.message


def test_a_runner_that_begins_when_another_ends_does_not_overlap() -> None:
    target = subject(
        go("Drive"),
        go("Turn"),
        described=library(Drive={"resources": ("base",)}, Turn={"resources": ("base",)}),
    )
    assert run_campaign(target, [find_property("no-overlap")], runs=100).failures == []


def test_a_plan_that_waits_for_what_did_not_start_is_found() -> None:
    target = subject(control("parallel_any", *SIX[:3]), faults=("no-start",))
    (failure,) = run_campaign(target, [find_property("ends")], runs=100).failures
    assert strange(failure) == {0: ("NO_START", 1_000)}
    assert str(failure.run.status) == "STUCK"


def test_an_action_without_a_time_limit_that_hangs_is_found() -> None:
    target = subject(*SIX[:3], faults=("hang",), limit_s=None)
    (failure,) = run_campaign(target, [find_property("ends")], runs=100).failures
    assert [act.fate for act in failure.run.scenario.acts].count(Fate.HANG) == 1
    assert failure.breach.message == "the plan waits for ever for A at line 1 column 7"


def test_an_executor_that_remembers_earlier_runs_does_not_replay(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A planted defect of the kernel: the third failure that any kernel sees goes unheard."""
    seen = [0]
    emit = kernel.Kernel._emit_outcome

    def forgetful(self, node: int, succeeded: bool) -> None:
        seen[0] += not succeeded
        if succeeded or seen[0] % 3:
            emit(self, node, succeeded)

    monkeypatch.setattr(kernel.Kernel, "_emit_outcome", forgetful)
    target = subject(*SIX[:2], control("recovery", go("Other")), faults=("failed",))
    campaign = run_campaign(target, [find_property("replays")], runs=50)
    assert campaign.failures
    assert "replay" in campaign.failures[0].breach.message


@settings(max_examples=many(15))
@given(plans(min_runners=1, max_runners=4))
def test_the_fewest_failures_are_those_of_the_brute_force(whole) -> None:
    target = subject_of(to_xml(whole), faults=("failed",), library=FREE)
    if not target.plan.runners:
        return
    campaign = run_campaign(target, [find_property("completes")], runs=120)
    runs = System(whole).allowed(consistent=False, constraint=None)
    gives_up = [
        (len(bad), bad)
        for run in runs
        if run.gave_up
        for bad in (tuple(n for n, each in enumerate(run.outcomes) if each != "SUCCEEDED"),)
    ]
    assert [failure.run.scenario.faults for failure in campaign.failures] == (
        [min(gives_up)[1]] if gives_up else []
    )


@settings(max_examples=many(15))
@given(plans(min_runners=1, max_runners=4))
def test_what_is_stuck_and_what_is_an_orphan_is_so_by_brute_force(whole) -> None:
    target = subject_of(to_xml(whole), faults=("failed", "no-start"), library=FREE)
    if not target.plan.runners:
        return
    wanted = [find_property("ends"), find_property("no-orphan")]
    campaign = run_campaign(target, wanted, runs=60)
    system = System(whole, frozenset({"no-start"}))
    runs = list(system.allowed(consistent=False, constraint=None))
    orphans = {path for run in runs for path in run.orphans()}
    for failure in campaign.failures:
        if failure.broken.name == "ends":
            assert any(run.stuck for run in runs)
        else:
            assert set(failure.breach.about) <= orphans


def test_the_same_seed_finds_the_same_and_runs_are_counted() -> None:
    target = subject(control("parallel_any", *SIX), go("G"))
    ticks: list[int] = []
    one = run_campaign(
        target, default_properties(), runs=60, seed=5, progress=lambda done, _: ticks.append(done)
    )
    other = run_campaign(target, default_properties(), runs=60, seed=5)
    assert [(f.breach, f.run.scenario) for f in one.failures] == [
        (f.breach, f.run.scenario) for f in other.failures
    ]
    assert ticks == list(range(1, 61))


def test_the_bytes_do_not_depend_on_the_hash_seed(tmp_path: Path) -> None:
    text = (
        f"<Plan>\n{control('parallel_any', *SIX[:3])}\n{control('parallel_all', *SIX[:2])}</Plan>\n"
    )
    (tmp_path / "plan.xml").write_text(text)
    program = (
        "from gpsfsm.cli import main\n"
        "for how in ('json', 'text'):\n"
        "    print(main(['fuzz', 'plan.xml', '--runs', '25', '--format', how]))\n"
    )
    one, other = (
        subprocess.run(
            [sys.executable, "-c", program],
            cwd=tmp_path,
            env=environment(PYTHONHASHSEED=seed),
            capture_output=True,
            check=False,
            timeout=120,
        )
        for seed in ("1", "4242")
    )
    assert one.stdout == other.stdout
    assert (one.returncode, one.stdout.splitlines().count(b"1")) == (0, 2)  # both exit codes
    assert [file.name for file in tmp_path.iterdir()] == ["plan.xml"]


def test_a_time_budget_ends_the_campaign() -> None:
    now = iter(range(1_000))
    target = subject(*SIX[:2])
    campaign = run_campaign(
        target, default_properties(), runs=10**9, time_s=20.0, clock=lambda: float(next(now))
    )
    assert campaign.cut_off
    assert campaign.runs == 19


def test_two_processes_find_the_same_as_one() -> None:
    target = subject(control("parallel_any", *SIX[:3]), go("D"))
    wanted = [*default_properties(), find_property("completes")]
    ticks: list[int] = []
    kept: list[Failure] = []
    actual = [
        run_campaign(
            target,
            wanted,
            runs=150,
            jobs=jobs,
            progress=lambda done, _: ticks.append(done),
            keep=kept.append,
        )
        for jobs in (1, 2)
    ]

    def summaries(several: list[Failure]) -> list[object]:
        return [(one.broken.name, one.breach, one.run.scenario) for one in several]

    assert actual[0].failures
    assert summaries(actual[0].failures) == summaries(actual[1].failures)
    half = len(kept) // 2
    assert summaries(kept[:half]) == summaries(kept[half:])
    assert half == len(actual[0].failures)
    assert [each.runs for each in actual] == [150, 150]
    assert ticks == [*range(1, 151), *range(1, 151)]


def test_a_time_budget_ends_the_campaign_of_several_processes() -> None:
    now = iter(range(1_000))
    campaign = run_campaign(
        subject(*SIX[:2]), [find_property("completes")], runs=10**9, time_s=5.0, jobs=2,
        clock=lambda: float(next(now)),
    )  # fmt: skip
    assert campaign.cut_off
    assert campaign.runs == 4 * 32  # so many chunks were begun
    assert len(campaign.failures) == 1


def test_a_property_that_no_other_process_can_know_is_refused() -> None:
    broken = property_of_function(lambda run: True, "mine")
    with pytest.raises(UsageError, match="the property mine cannot be handed to other processes"):
        run_campaign(subject(go("A")), [broken], runs=9, jobs=2)


def test_a_process_that_dies_ends_the_campaign_with_a_message(tmp_path: Path) -> None:
    """What it played is not known to hold."""
    file = tmp_path / "deadly.py"
    file.write_text("import os\n\ndef dies(run):\n    os._exit(3) if run.scenario.faults else 0\n")
    with pytest.raises(GpsfsmError, match=r"the process that played .* runs was ended with code 3"):
        run_campaign(subject(*SIX), [property_of(f"{file}:dies")], runs=90, jobs=2)


def test_of_very_many_kinds_of_breaches_the_first_are_told() -> None:
    def check(run: Run) -> list[Breach]:
        return [Breach("told", (), (str(number),)) for number in range(30)]

    campaign = run_campaign(subject(go("A")), [Property("many", "few", check)], runs=2)
    assert len(campaign.failures) == MOST_BREACHES
    assert campaign.more == {"many": 30 - MOST_BREACHES}


@pytest.mark.parametrize("answer", [7, ["no breach"], {}])
def test_a_property_that_answers_nonsense_is_refused(answer: object) -> None:
    with pytest.raises(UsageError, match="should answer None or True"):
        run_campaign(subject(go("A")), [property_of_function(lambda run: answer, "odd")], runs=1)


def test_a_property_that_fails_is_refused() -> None:
    def broken(run: Run) -> None:
        raise KeyError("x")

    with pytest.raises(UsageError, match="the property broken cannot be checked: KeyError"):
        run_campaign(subject(go("A")), [property_of_function(broken)], runs=1)
