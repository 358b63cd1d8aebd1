"""Machines under fuzzing: runs against the step function of the brute force, cases, mutants."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.compile.machine_files import read_machine
from gpsfsm.compile.machines import machine_of
from gpsfsm.equivalence import compare
from gpsfsm.errors import UsageError
from gpsfsm.execution.records import Status
from gpsfsm.fuzzing import Act, Fate, Run, TimedScenario, play, run_campaign, subject_of
from gpsfsm.fuzzing.campaign_report import CampaignOptions, campaign_report, case_report
from gpsfsm.fuzzing.cases import case_text, read_case, scenario_in
from gpsfsm.fuzzing.mutation import MachineRows, Notice, machine_mutations, mutate
from gpsfsm.fuzzing.properties import default_properties, find_property
from gpsfsm.fuzzing.runs import MachineRun
from gpsfsm.fuzzing.subject import VISITS, draw
from gpsfsm.model.event import End
from tests.analysis.machines.random_machines import machine, machines
from tests.equivalence.machine_brute import Played

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.compile import MachinePlan
    from gpsfsm.fuzzing import Subject

Graph = Any
LOOP = ("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")
WAYPOINT = "nav2_capabilities/WaypointRunner"


def read(graph: Graph) -> MachinePlan:
    """The machine of a graph."""
    plan, problems = machine_of(graph)
    assert plan is not None, problems
    return plan


def subject(*connections: str, faults: tuple[str, ...] = ("failed",), **needs: int) -> Subject:
    """The subject of a machine."""
    return subject_of(read(machine(*connections, **needs)), faults=faults)


def scenario(each: Subject, **fates: list[Fate]) -> TimedScenario:
    """Fates of the first visits of runners, by name; all else is plain."""
    acts = list(each.plain.acts)
    for number, runner in enumerate(each.plan.runners):
        name = each.plan.path(runner).removeprefix("/machine/")
        for visit, fate in enumerate(fates.get(name, ())):
            acts[number + visit * len(each.plan.runners)] = Act(fate)
    return TimedScenario(tuple(acts))


F, S = Fate.FAILED, Fate.SUCCEEDED


def test_every_visit_has_an_act_of_its_own() -> None:
    each = subject(*LOOP)
    run = play(each, scenario(each, a=[F, F, S]))
    assert run.status is Status.COMPLETED
    assert [span.begin_us for span in run.spans] == [0, 1_000_000, 2_000_000]
    assert [outcome.value for _, outcome in run.choices] == ["FAILED", "FAILED", "SUCCEEDED"]
    assert run.at_s == 3


def test_later_visits_are_plain() -> None:
    each = subject(*LOOP)
    run = play(each, scenario(each, a=[F] * VISITS))
    assert len(run.spans) == VISITS + 1


def test_a_run_that_goes_on_is_cut_off_and_breaks_nothing() -> None:
    each = subject("start SUCCEEDED a", "a SUCCEEDED a", "a FAILED end")
    run = play(each, each.plain)
    assert run.status is Status.CANCELLED
    assert run.end is End.ENDLESS
    assert len(run.spans) == each.most_visits == 200
    names = ("ends", "completes", "no-orphan", "no-overlap", "replays")
    assert [[*find_property(name).check(run)] for name in names] == [[]] * 5
    campaign = run_campaign(each, default_properties(), runs=40)
    assert not campaign.failures
    assert 0 < campaign.unended < 40


@given(machines(most_runners=4), st.integers(0, 2**32), st.integers(0, 50))
def test_runs_do_what_the_definition_says(graph: Graph, seed: int, index: int) -> None:
    assume(machine_of(graph)[0] is not None)
    each = subject_of(read(graph), faults=("failed", "late"), most_visits=60)
    run = play(each, draw(each, seed, index))
    assert isinstance(run, MachineRun)
    names = [each.plan.path(runner).removeprefix("/machine/") for runner in each.plan.runners]
    played = Played(graph)
    at, seen = played.begin()
    begun = len(seen.started)
    for number, outcome in run.choices:
        assert not seen.end
        at, seen = played.after(at, names[number], outcome.value)
        # one that the instant of the end stops and starts again looks like one that goes on
        begun += len(seen.started - seen.stopped if seen.end else seen.started)
    ends = {"complete": End.COMPLETED, "give_up": End.GAVE_UP}
    if run.status is Status.CANCELLED:  # before what would have begun at the last instant
        assert not seen.end
        assert begun > 60
        return
    assert run.end is ends.get(seen.end, End.STUCK)
    assert {names[number] for number in run.active_at_end} == at.active
    assert len(run.spans) == begun
    assert run.end is not End.STUCK or not at.active


def test_what_a_stop_ends_holds_nothing_any_more() -> None:
    graph = machine(
        *("start SUCCEEDED a", "start SUCCEEDED w", "w SUCCEEDED stop a", "a STOPPED b"),
        *("b SUCCEEDED end", "b FAILED end", "a SUCCEEDED end", "a FAILED end", "w FAILED end"),
    )
    for name, x in (("a", 1.0), ("b", 2.0)):
        graph.nodes[name].update(interface=WAYPOINT, parameters={"x": x, "y": 0.0})
    each = subject_of(read(graph), faults=())
    acts = list(each.plain.acts)
    acts[0] = Act(S, 5_000)
    run = play(each, TimedScenario(tuple(acts)))
    assert run.status is Status.COMPLETED
    assert [(span.begin_us, span.end_us) for span in run.spans] == [
        (0, 1_000_000),
        (0, 1_000_000),
        (1_000_000, 2_000_000),
    ] or sorted(span.number for span in run.spans) == [0, 1, 2]
    assert not [*find_property("no-overlap").check(run)]
    graph.add_edge("a", "b", event="STARTED")
    together = play(subject_of(read(graph), faults=()), TimedScenario(tuple(acts)))
    assert [breach.numbers for breach in find_property("no-overlap").check(together)]


def test_orphans_are_those_of_the_configuration() -> None:
    each = subject("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED end", "b SUCCEEDED b")
    run = play(each, each.plain)
    assert run.active_at_end == (1,)
    (breach,) = find_property("no-orphan").check(run)
    assert breach.message == "b at node 'b' is still active when the machine completes"


def test_the_plainest_run_is_told_with_its_visits() -> None:
    each = subject("start SUCCEEDED a", "a FAILED b", "a SUCCEEDED end", "b SUCCEEDED a")
    report = campaign_report(
        each, [find_property("ends")], CampaignOptions(runs=200), name="m", source="{}"
    )
    story = report.findings[0].scenario
    assert story is not None
    assert story.story == (
        "0 s: a at node 'a' starts",
        "1 s: a at node 'a' fails",
        "1 s: b at node 'b' starts",
        "2 s: b at node 'b' fails",
        "2 s: nothing more can happen: the machine is stuck",
    )
    first = play(each, scenario(each, a=[F, F]))
    again = gpsfsm.fuzzing.runs.scenario_of(first).story
    assert "2 s: a at node 'a' starts: visit 2" in again


def test_hanging_and_late_runners() -> None:
    each = subject_of(read(machine(*LOOP)), faults=("late", "hang"), limit_s=None)
    run = play(each, scenario(each, a=[Fate.HANG]))
    assert run.status is Status.STUCK
    assert run.active_at_end == (0,)
    assert [outcome.value for _, outcome in run.choices] == ["HANG"]
    bounded = subject_of(read(machine(*LOOP)), faults=("late", "hang"), limit_s=10)
    for fate in (Fate.HANG, Fate.LATE):
        run = play(bounded, scenario(bounded, a=[fate]))
        assert run.status is Status.COMPLETED
        assert [outcome.value for _, outcome in run.choices] == ["FAILED", "SUCCEEDED"]


def test_assumptions_about_single_runners() -> None:
    plan = read(machine(*LOOP))
    assert subject_of(plan, assumptions=["never fails: a"], faults=["failed"]).fates[0] == (S,)
    for options in (
        {"assumptions": ["never fails: a", "never succeeds: a"]},
        {"assumptions": ["a fails or nobody succeeds"]},
        {"consistent": True},
        {"assumptions": ["never fails: nobody"]},
    ):
        with pytest.raises(UsageError):
            _ = subject_of(plan, faults=["failed"], **options).fates


def test_the_same_seed_gives_the_same_bytes_in_one_process_or_two() -> None:
    graph = machine(
        *("start SUCCEEDED a", "a FAILED b", "a SUCCEEDED end", "b SUCCEEDED a", "b FAILED c"),
        "c SUCCEEDED a",
    )
    reports = [gpsfsm.fuzz(graph, runs=300, seed=3, jobs=jobs).to_dict() for jobs in (1, 2)]
    assert reports[0] == reports[1]
    assert reports[0]["findings"]
    assert "unended" in reports[0]


def test_a_case_of_a_machine_is_played_again(tmp_path: Path) -> None:
    each = subject("start SUCCEEDED a", "a FAILED b", "a SUCCEEDED end", "b SUCCEEDED a")
    wanted = scenario(each, a=[F, F, S], b=[S, F])
    run = play(each, wanted)
    (breach,) = find_property("ends").check(run)
    failure = gpsfsm.fuzzing.Failure(find_property("ends"), breach, run)
    file = tmp_path / "case.json"
    file.write_text(case_text(failure, str(MachineRows(each.plan))))  # type: ignore[arg-type]
    case = read_case(str(file))
    assert scenario_in(case, each) == wanted
    assert [act["visit"] for act in json.loads(file.read_text())["acts"]] == [1, 2, 2]
    report = case_report(case, each, [find_property("ends")], name="m", source="")
    assert len(report.findings) == 1
    data = json.loads(file.read_text())
    data["acts"][0]["visit"] = VISITS + 1
    file.write_text(json.dumps(data))
    assert scenario_in(read_case(str(file)), each) is None


def test_properties_of_ones_own_see_every_visit() -> None:
    def three_visits(run: Run) -> bool:
        return len(run.spans) < 3

    report = gpsfsm.fuzz(machine(*LOOP), runs=100, faults=["failed"], properties=[three_visits])
    assert [finding.name for finding in report.findings] == ["three_visits"]
    (failure,) = report.campaign.failures
    assert [number for number, act in enumerate(failure.run.scenario.acts) if act.fate is F] == [
        0,
        1,
    ]


def test_machines_that_are_not_run() -> None:
    graph = machine(*LOOP)
    graph.add_node("odd", kind="state")
    with pytest.raises(gpsfsm.GpsfsmError, match="the node 'odd' has no kind"):
        gpsfsm.fuzz(graph)
    with pytest.raises(UsageError, match="no runner"):
        gpsfsm.fuzz(machine("start SUCCEEDED end"))
    with pytest.raises(UsageError, match="max_visits"):
        gpsfsm.fuzz(machine(*LOOP), max_visits=0)


# --- mutants ------------------------------------------------------------------------------------


@given(machines())
def test_a_machine_is_written_as_it_was_read(graph: Graph) -> None:
    assume(machine_of(graph)[0] is not None)
    plan = read(graph)
    parsed = read_machine(str(MachineRows(plan)))
    assert parsed is not None
    assert parsed.problems == ()
    assert parsed.plan is not None
    assert compare(plan, parsed.plan) is None
    lines = str(MachineRows(plan)).splitlines()  # the connections by their sources
    assert len(str(MachineRows(parsed.plan)).splitlines()) == len(lines)  # type: ignore[arg-type]


def test_each_mutation_changes_one_thing() -> None:
    plan = read(machine(*LOOP, "a FAILED j", "j SUCCEEDED stop a", j=2))
    before = str(MachineRows(plan)).splitlines()
    seen = set()
    for mutation in machine_mutations(plan):
        rows = MachineRows(plan)
        mutation.change(rows)
        after = str(rows).splitlines()
        seen.add(mutation.operator)
        changed = [line for line in before if line not in after]
        assert len(changed) == 1 or (mutation.operator == "drop" and len(after) == len(before) - 1)
    assert seen == {"drop", "event", "action", "need"}


def test_mutants_are_judged_by_what_they_do() -> None:
    # nobody sees whether the watch is stopped at the instant of the end
    plan = read(
        machine(
            *("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED end", "a FAILED a"),
            *("a SUCCEEDED stop b", "b SUCCEEDED b", "b FAILED b"),
        )
    )
    score = mutate(plan, gpsfsm.checking.CheckOptions(trees=False))
    by_summary = {each.mutation.summary: each.notice for each in score.mutants}
    assert by_summary["leaves out a SUCCEEDED stops → b"] is Notice.EQUAL
    assert by_summary["leaves out a SUCCEEDED → end"] is Notice.NOTICED
    assert by_summary["leaves out start SUCCEEDED → a"] is Notice.NOTICED
    assert score.count(Notice.UNDECIDED) == 0


def test_what_is_no_machine_any_more_is_no_mutant() -> None:
    plan = read(machine("start SUCCEEDED a", "a STOPPED b", "b STARTED c", "c FAILED a"))
    score = mutate(plan, gpsfsm.checking.CheckOptions(trees=False))
    summaries = [each.mutation.summary for each in score.mutants]
    # a start node that stops a runner is no fault; a stop of b by its own start would be
    assert score.count(Notice.UNDECIDED) == 0
    assert len(summaries) == len(set(summaries))
