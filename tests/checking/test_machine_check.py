"""What is said about machines: findings, their scenarios, and why some are not decided."""

from __future__ import annotations

from typing import Any

import pytest

import gpsfsm
from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.options import DEFAULT_RLIMIT, AnalysisOptions, InconclusiveError
from gpsfsm.checking import machine_check
from gpsfsm.checking.machine_check import ANALYSES, DecidedMachine, decide_machine
from gpsfsm.compile import compile_plan
from gpsfsm.compile.instants import Instants
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.report import Frequency, JoinDeadlock
from tests.analysis.machines.random_machines import machine
from tests.compile.test_trees import tree

UNDESCRIBED = ["GP210"]
"""No file describes the runners of these machines."""

Said = list[tuple[str, str, list[str]]]


def said(*connections: str, options: dict[str, Any] | None = None, **needs: int) -> Said:
    """Rule, message and story of each finding, without those about names."""
    (report,) = gpsfsm.check(
        machine(*connections, **needs), ignore=UNDESCRIBED, **(options or {})
    ).plans
    return [
        (
            f"{finding.severity} {finding.rule} {finding.location.element}",
            finding.message,
            [*(finding.scenario.story if finding.scenario else ())],
        )
        for finding in report.findings
    ]


def test_a_runner_that_nothing_triggers() -> None:
    assert said("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED end", "b SUCCEEDED end") == [
        ("error GP301 /machine/b", "no run of the machine triggers b at node 'b'", [])
    ]


def test_what_an_outcome_that_cannot_occur_would_lead_to_may_be_too_much() -> None:
    """The search is only a second opinion then: z3 has decided."""
    after = [f"a SUCCEEDED {each}" for each in "bcdefghijk"]
    lines = ("start SUCCEEDED a", *after, "b SUCCEEDED end")
    (report,) = gpsfsm.check(machine(*lines), assume=["never succeeds: a"]).plans
    assert report.verdict == "rejected"
    assert {"GP304", "GP306"} <= {finding.rule for finding in report.findings}


def test_a_machine_that_always_gives_up() -> None:
    message = said("start SUCCEEDED a", "a SUCCEEDED lost", "a FAILED lost")
    assert message[0] == (
        "error GP305 /machine",
        "this machine gives up in every run",
        ["a at node 'a' succeeds"],
    )
    assert [rule for rule, _, _ in message] == ["error GP305 /machine"]


def test_a_machine_that_never_completes() -> None:
    message = said("start SUCCEEDED a", "a SUCCEEDED a", "a FAILED lost")
    assert message[1][:2] == (
        "error GP304 /machine",
        "this machine never completes, whatever happens: every run gives up, "
        "gets stuck or runs for ever",
    )


def test_a_machine_that_is_stuck() -> None:
    stuck = "it neither completes nor gives up, and nothing more can happen"
    end = "nothing more can happen: the machine is stuck"
    sometimes = said("start SUCCEEDED a", "a SUCCEEDED end")
    assert sometimes == [
        (
            "warning GP302 /machine/a",
            "if a at node 'a' fails, nothing handles that: the machine is stuck",
            ["a at node 'a' fails"],
        ),
        (
            "error GP306 /machine",
            f"this machine can get stuck: {stuck}",
            ["a at node 'a' fails", end],
        ),
    ]
    always = said("start SUCCEEDED a")
    assert [rule for rule, _, _ in always[:2]] == ["error GP304 /machine", "error GP306 /machine"]
    assert always[1][1] == f"this machine gets stuck in every run: {stuck}"


def test_a_hanging_runner_leaves_a_machine_stuck() -> None:
    complete = ("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED end")
    assert said(*complete) == []
    (message,) = said(*complete, options={"faults": ["hang"]})
    assert message[0] == "error GP306 /machine"
    assert message[2][0] == "a at node 'a' starts and never ends"


def test_events_that_end_the_run() -> None:
    message = said(
        "start SUCCEEDED a", "a SUCCEEDED b", "a FAILED end", "b SUCCEEDED lost", "b FAILED end"
    )
    assert message == [
        (
            "info GP302 /machine/b",
            "1 outcome ends the machine (node 'b': nothing handles it); no failure is needed",
            ["a at node 'a' succeeds", "b at node 'b' succeeds"],
        )
    ]


def test_what_is_still_active_at_completion() -> None:
    (message,) = said(
        *("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED end", "a FAILED end"),
        *("b SUCCEEDED end", "b FAILED end"),
    )[:1]
    assert message == (
        "warning GP311 /machine/a",
        "the machine can complete while a at node 'a' is still active",
        [
            "b at node 'b' succeeds",
            "the machine completes while a at node 'a' is still running",
        ],
    )


FORK = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED j", "b SUCCEEDED j")


@pytest.mark.parametrize(
    ("more", "severity", "then"),
    [
        (("j SUCCEEDED end",), "error", "nothing more can happen then, and the machine is stuck"),
        (("j SUCCEEDED end", "a FAILED lost", "b FAILED lost"), "info", "the machine gives up"),
        (("j SUCCEEDED end", "a FAILED a", "b FAILED b"), "info", "the machine runs for ever"),
        (  # whatever comes then, the join waits on
            ("j SUCCEEDED end", "a FAILED a", "b FAILED c", "c SUCCEEDED c", "c FAILED c"),
            "warning",
            "the machine runs for ever",
        ),
        (
            ("j SUCCEEDED end", "a FAILED end", "b FAILED end"),
            "info",
            "the machine completes without it",
        ),
    ],
)
def test_joins_that_wait_for_ever(more: tuple[str, ...], severity: str, then: str) -> None:
    (actual,) = [each for each in said(*FORK, *more, j=2) if "GP303" in each[0]]
    assert actual[0] == f"{severity} GP303 /machine/j"
    assert actual[1] == (
        f"the join j can receive some of its inputs and wait for the others for ever: {then}"
    )
    assert actual[2][0] in (
        "a at node 'a' succeeds",
        "b at node 'b' succeeds",
        "a at node 'a' fails",
    )


def test_long_stories_leave_out_their_middle() -> None:
    steps = [
        f"r{number} {event} r{number + 1}"
        for number in range(20)
        for event in ("SUCCEEDED", "FAILED")
    ]
    (actual,) = [each for each in said("start SUCCEEDED r0", *steps) if "GP306" in each[0]]
    story = actual[2]
    assert len(story) == 14
    assert story[6] == "… 9 more steps …"
    assert story[-1] == "nothing more can happen: the machine is stuck"


IDLE = "has no effect on a graph"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (
            {"faults": ["no-start"]},
            f"--faults no-start {IDLE}: a runner that does not start is not decided",
        ),
        (
            {"consistent": True, "faults": ["hang"]},
            "a machine whose runs depend on the order cannot be decided under --consistent "
            "together with runners that may hang",
        ),
        ({"engine": "fabric-v2"}, f"--engine {IDLE}: original engines run plans"),
        (
            {"assume": ["a fails or b succeeds"]},
            "a machine whose runs depend on the order cannot be decided under assumptions that tie "
            "runners together",
        ),
    ],
)
def test_what_is_not_decided(options: dict[str, Any], reason: str) -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED b", "a FAILED a", "b FAILED end")
    (report,) = gpsfsm.check(graph, ignore=UNDESCRIBED, **options).plans
    assert report.verdict.value == "undecided"
    assert report.facts is None
    code = "GP908" if IDLE in reason else "GP904"
    assert [(each.rule, each.message) for each in report.findings] == [(code, reason)]


def test_an_action_always_ends_the_same_under_consistent() -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED b", "a FAILED a", "b FAILED end")
    free, tied = (
        gpsfsm.check(graph, ignore=UNDESCRIBED, consistent=each).plans[0].facts
        for each in (False, True)
    )
    assert free is not None
    assert tied is not None
    assert free.machine is not None
    assert tied.machine is not None
    assert (free.completes.value, free.machine.completes_if_fair.value) == ("sometimes",) * 2
    # If a fails at first, it fails for ever.
    assert (tied.completes.value, tied.machine.completes_if_fair.value) == ("sometimes",) * 2
    assert [loop.trap for loop in free.machine.loops] == [False]
    assert [loop.trap for loop in tied.machine.loops] == [True]
    graph.nodes["b"]["interface"] = "a"  # a and b do the same
    both = gpsfsm.check(graph, ignore=UNDESCRIBED, consistent=True).plans[0].facts
    assert both is not None
    assert (both.completes.value, both.stuck.value) == ("never", "sometimes")


@pytest.mark.parametrize(
    ("options", "name"),
    [({"deadline_s": 5.0}, "--deadline"), ({"energy_limit_j": 5.0}, "--energy-limit")],
)
def test_time_and_energy_are_not_decided(options: dict[str, Any], name: str) -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED end")
    (report,) = gpsfsm.check(graph, ignore=UNDESCRIBED, **options).plans
    assert report.verdict.value == "undecided"
    ((code, message),) = [(each.rule, each.message) for each in report.findings]
    assert (code, message.partition(":")[0]) == ("GP908", f"{name} {IDLE}")


def test_a_machine_with_too_many_configurations_is_undecided() -> None:
    wide = [f"start SUCCEEDED r{number}" for number in range(16)]
    wide += ["r0 SUCCEEDED r0"]
    (report,) = gpsfsm.check(machine(*wide), ignore=UNDESCRIBED).plans
    assert report.verdict.value == "undecided"
    (finding,) = report.findings
    assert finding.message == "the runs of the machine reach more than 50,000 configurations"


def test_assumptions_that_leave_nothing_are_contradictory() -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED end")
    options: dict[str, Any] = {"assume": ["never fails: a", "never succeeds: a"]}
    (report,) = gpsfsm.check(graph, **options).plans
    assert [finding.rule for finding in report.findings] == ["GP902"]


def test_scenarios_are_bounded() -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED end")
    (report,) = gpsfsm.check(graph, max_scenarios=0).plans
    assert report.findings
    assert all(finding.scenario is None for finding in report.findings)


def decided(*connections: str, options: AnalysisOptions | None = None) -> DecidedMachine:
    """What the check of a machine says, and how it knows."""
    plan, problems = machine_of(machine(*connections))
    assert plan is not None, problems
    compiled = compile_plan(plan)
    return decide_machine(compiled, constraints_of(plan), options or AnalysisOptions())


def test_z3_proves_what_never_happens() -> None:
    loop = ("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED a")
    said = decided(*loop)
    assert not said.proof.unproved
    assert said.decided_by == dict.fromkeys(ANALYSES, "z3")
    assert said.unproved == ""
    straight = decided("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED lost")
    assert not straight.proof.unproved


def test_a_proof_that_meets_its_limit_leaves_the_search() -> None:
    loop = ("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED a")
    said = decided(*loop, options=AnalysisOptions(rlimit=100))
    assert said.proof.unproved
    assert said.decided_by == dict.fromkeys(ANALYSES, "search")
    assert said.unproved == "--rlimit"
    assert said.facts is not None
    assert said.facts.completes is Frequency.SOMETIMES


def test_a_limit_above_the_default_lets_a_proof_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_check, "SECOND_OPINION", 100)
    loop = ("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED a")
    assert decided(*loop).unproved == "--rlimit"
    raised = decided(*loop, options=AnalysisOptions(rlimit=DEFAULT_RLIMIT + 1))
    assert raised.decided_by == dict.fromkeys(ANALYSES, "z3")


def test_large_explorations_are_not_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_check, "MAX_PROVED", 1)
    said = decided("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED a")
    assert said.unproved == "1 configurations"
    assert said.proof.unproved


def test_a_disagreement_is_a_defect_of_gpsfsm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Instants, "after", lambda self, at, number, _: _after(self, at, number, 1))
    graph = machine("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED a")
    (report,) = gpsfsm.check(graph, ignore=UNDESCRIBED).plans
    assert report.facts is None
    assert [finding.rule for finding in report.findings] == ["GP903"]


_after = Instants.after


def test_many_runners_beside_each_other_need_no_exploration() -> None:
    wide = [f"start SUCCEEDED r{number}" for number in range(40)]
    ends = [f"r{number} SUCCEEDED all" for number in range(40)]
    failing = [f"r{number} FAILED lost" for number in range(40)]
    graph = machine(*wide, *ends, *failing, "all SUCCEEDED end", all=40)
    (report,) = gpsfsm.check(graph, ignore=UNDESCRIBED).plans
    facts = report.facts
    assert facts is not None
    assert (facts.completes, facts.gives_up) == (Frequency.SOMETIMES, Frequency.SOMETIMES)
    assert facts.fewest_failures_to_give_up == 1
    assert facts.join_deadlocks == (JoinDeadlock("/machine/all", "give_up"),)
    assert len(facts.dangling) == 40
    assert {finding.rule for finding in report.findings} == {"GP302", "GP303"}
    assert all(finding.scenario is not None for finding in report.findings)


def test_tied_runners_are_decided_where_the_scenario_fixes_the_run() -> None:
    lines = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED j", "b SUCCEEDED j")
    graph = machine(
        *lines, "j SUCCEEDED end", "a FAILED k", "b FAILED k", "k SUCCEEDED lost", j=2, k=2
    )
    (free,) = gpsfsm.check(graph).plans
    (tied,) = gpsfsm.check(graph, assume=["a fails iff b fails"]).plans
    assert free.facts is not None
    assert tied.facts is not None
    assert (free.facts.stuck, tied.facts.stuck) == (Frequency.SOMETIMES, Frequency.NEVER)
    both = ["a fails iff b fails", "a fails iff b succeeds"]
    (none,) = gpsfsm.check(graph, assume=both, ignore=UNDESCRIBED).plans
    assert [finding.rule for finding in none.findings] == ["GP902"]


# --- single runners -----------------------------------------------------------------------------

WAYPOINT = "nav2_capabilities/WaypointRunner"
SPEECH = "perception_capabilities/SpeechRunner"
LOOK = "perception_capabilities/ImageAnalysisRunner"
WAIT = "generic_capabilities/WaitRunner"


def rules_of(graph: Any, **runners: tuple[str, dict[str, Any]]) -> list[tuple[str, str]]:
    """Rule and node of each finding about single runners, of a machine with these runners."""
    for name, (interface, parameters) in runners.items():
        graph.nodes[name].update(interface=interface, parameters=parameters)
    (report,) = gpsfsm.check(graph, select=["GP2", "GP4", "GP5"]).plans
    return [
        (finding.rule, finding.location.element.removeprefix("/machine/"))
        for finding in report.findings
    ]


@pytest.mark.parametrize(
    ("interface", "parameters", "rules"),
    [
        (WAYPOINT, {"x": 1.0, "y": 2}, []),
        (WAYPOINT.replace("Runner", "Runer"), {"x": 1.0, "y": 2}, ["GP201"]),
        (WAYPOINT, {"x": 1.0, "y": 2, "speed": 1}, ["GP203"]),
        (WAIT, {}, ["GP204"]),
        (WAYPOINT, {"x": "far", "y": 2}, ["GP205"]),
        (WAYPOINT, {"x": float("nan"), "y": 2}, ["GP205"]),
        (WAIT, {"seconds": -1.0}, ["GP206"]),
        (SPEECH, {"text": "${name}"}, ["GP207"]),
        ("my/Own", {}, ["GP210"]),
    ],
)
def test_rules_about_single_runners(
    interface: str, parameters: dict[str, Any], rules: list[str]
) -> None:
    graph = machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")
    assert rules_of(graph, a=(interface, parameters)) == [(rule, "a") for rule in rules]


def test_a_provider_of_another_interface() -> None:
    graph = machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")
    graph.nodes["a"]["provider"] = SPEECH
    assert rules_of(graph, a=(WAYPOINT, {"x": 1, "y": 1})) == [("GP202", "a")]


def test_what_arrives_is_unknown_where_triggers_disagree() -> None:
    look, say = (LOOK, {"prompt": "Who is there?"}), (SPEECH, {"text": "$text"})
    alone = machine("start SUCCEEDED a", "a SUCCEEDED b", "b SUCCEEDED end")
    (report,) = gpsfsm.check(alone, select=["GP207"]).plans
    assert rules_of(alone, a=look, b=say) == [("GP207", "b")]
    (report,) = gpsfsm.check(alone, select=["GP207"]).plans
    assert report.findings[0].severity == "info"  # the text of the look takes its place
    both = machine("start SUCCEEDED a", "a SUCCEEDED b", "a STARTED c", "c SUCCEEDED b")
    assert rules_of(both, a=look, b=say, c=(WAIT, {"seconds": 1.0})) == [("GP207", "b")]
    (report,) = gpsfsm.check(both, select=["GP207"]).plans
    assert report.findings[0].severity == "warning"  # it may, or may not


def test_a_need_is_missing_only_if_no_trigger_can_give_it() -> None:
    lines = ("start SUCCEEDED a", "a FAILED w", "w FAILED w", "w SUCCEEDED end")
    nothing = machine(*lines)
    go = (WAYPOINT, {"x": 1.0, "y": 1.0})
    assert rules_of(nothing, a=go, w=(WAIT, {})) == [("GP204", "w")]
    own = machine("start SUCCEEDED a", "a FAILED w", "w SUCCEEDED end", "u SUCCEEDED w")
    # nobody knows what the undescribed one gives
    assert rules_of(own, a=go, w=(WAIT, {}), u=("my/Own", {})) == [("GP210", "u")]


def test_an_input_that_nothing_gives() -> None:
    lines = ("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED j", "j SUCCEEDED b", "b FAILED b")
    graph = machine(*lines, "b SUCCEEDED end", j=1)
    takes = ("fabric_capabilities/FabricSetPlanRunner", {})
    assert sorted(rules_of(graph, a=takes, b=takes)) == [("GP401", "a"), ("GP401", "b")]


def test_what_nothing_triggers_lacks_nothing() -> None:
    graph = machine("start SUCCEEDED end", "w SUCCEEDED end")
    assert rules_of(graph, w=(WAIT, {})) == []


def test_undecided_machines_have_names_and_types_all_the_same() -> None:
    starts = (f"start SUCCEEDED r{number}" for number in range(16))
    wide = machine(*starts, "r0 SUCCEEDED r0")
    rules = rules_of(wide, r3=(WAYPOINT, {"x": "far", "y": 1.0}), r4=(WAIT, {}))
    assert ("GP205", "r3") in rules
    assert ("GP204", "r4") not in rules


def test_findings_about_runners_stand_at_their_nodes() -> None:
    rows = [
        '{"nodes": [{"id": "s", "kind": "start"},',
        f' {{"id": "a", "kind": "runner", "interface": "{WAYPOINT}",',
        ' "parameters": {"x": "far"}},',
        ' {"id": "e", "kind": "complete"}],',
        ' "edges": [{"source": "s", "target": "a", "event": "SUCCEEDED"}]}',
    ]
    (report,) = gpsfsm.check("\n".join(rows), select=["GP205"]).plans
    assert [(each.location.line, each.location.column) for each in report.findings] == [(2, 2)]


def test_two_that_hold_one_resource() -> None:
    go, on = (WAYPOINT, {"x": 1.0, "y": 1.0}), (WAYPOINT, {"x": 2.0, "y": 1.0})
    lines = ("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED end", "b FAILED b")
    assert rules_of(machine(*lines, "a STARTED b"), a=go, b=on) == [("GP501", "a")]
    # one after the other, and the one stopped by what starts the other
    assert rules_of(machine(*lines, "a FAILED b"), a=go, b=on) == []
    stopped = machine(
        *("start SUCCEEDED a", "start SUCCEEDED w", "w SUCCEEDED stop a", "w FAILED stop a"),
        *("a STOPPED b", "b SUCCEEDED end", "b FAILED end", "a SUCCEEDED end", "a FAILED end"),
    )
    assert rules_of(stopped, a=go, b=on, w=(WAIT, {"seconds": 1.0})) == []


def test_an_overlap_is_shown_by_a_run_that_is_played_to_its_end() -> None:
    go, on = (WAYPOINT, {"x": 1.0, "y": 1.0}), (WAYPOINT, {"x": 2.0, "y": 1.0})
    graph = machine(
        *("start SUCCEEDED w", "w FAILED a", "w FAILED b", "w SUCCEEDED end"),
        *("a SUCCEEDED end", "a FAILED lost"),
    )
    assert ("GP501", "a") in rules_of(graph, w=(LOOK, {"prompt": "?"}), a=go, b=on)
    (report,) = gpsfsm.check(graph, select=["GP501"]).plans
    scenario = report.findings[0].scenario
    assert scenario is not None
    assert scenario.ends == "COMPLETED"
    assert scenario.story[-1] == "both use the base at the same time"
    assert [outcome.value for _, outcome in scenario.outcomes] == ["FAILED", "SUCCEEDED"]


def test_overlaps_that_cannot_be_decided_are_said_to_be_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def beyond(*_: object) -> None:
        raise InconclusiveError

    monkeypatch.setattr("gpsfsm.checking.machine_check.overlap_findings", beyond)
    (report,) = gpsfsm.check(machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end")).plans
    assert report.verdict.value == "undecided"
    assert "resource-overlap" in next(
        each.message for each in report.findings if each.rule == "GP904"
    )


def test_what_runs_on_after_the_end_holds_nothing() -> None:
    go, on = (WAYPOINT, {"x": 1.0, "y": 1.0}), (WAYPOINT, {"x": 2.0, "y": 1.0})
    graph = machine(
        *("start SUCCEEDED w", "start SUCCEEDED a", "w SUCCEEDED end", "w FAILED end"),
        *("w SUCCEEDED v", "v SUCCEEDED b", "a FAILED a"),
    )
    rules = rules_of(graph, w=(LOOK, {"prompt": "?"}), v=(WAIT, {"seconds": 1.0}), a=go, b=on)
    assert rules == []
    graph.add_edge("w", "b", event="FAILED")  # it begins at the instant of the end
    assert ("GP501", "a") in rules_of(graph)


def test_a_tree_that_is_too_large_is_decided_without_counting_rounds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    body = (
        '<Repeat num_cycles="8"><Parallel success_count="3" failure_count="1"><A/><B/><C/>'
        "</Parallel></Repeat>"
    )
    text = tree(f"<KeepRunningUntilFailure>{body}</KeepRunningUntilFailure>")
    (whole,) = gpsfsm.check(text).plans
    assert [each.message for each in whole.findings if each.rule == "GP816"] == []
    monkeypatch.setattr(machine_check, "MAX_CONFIGURATIONS", 60)
    (report,) = gpsfsm.check(text).plans
    assert report.facts is not None
    assert whole.facts is not None
    assert (report.verdict, report.facts.completes) == (whole.verdict, whole.facts.completes)
    (finding,) = (each for each in report.findings if each.rule == "GP816")
    assert finding.message == (
        "the automaton allows more than this tree can do: Repeat at line 1 "
        "(its rounds are not counted)"
    )
    monkeypatch.setattr(machine_check, "MAX_CONFIGURATIONS", 5)
    (report,) = gpsfsm.check(text).plans
    assert report.facts is None
    assert "reach more than 5 configurations" in next(
        each.message for each in report.findings if each.rule == "GP904"
    )


def two_alike() -> Any:
    graph = machine("start SUCCEEDED first", "first SUCCEEDED second", "second SUCCEEDED end")
    for each in ("first", "second"):
        graph.nodes[each]["interface"] = "Go"
    return graph


@pytest.mark.parametrize("name", ["text", "llm", "markdown", "json", "sarif", "github"])
def test_a_graph_has_nodes_and_no_lines(name: str) -> None:
    report = gpsfsm.check(two_alike(), builtin_capabilities=False)
    assert {finding.location.line for finding in report.findings} == {0}
    shown = gpsfsm.render(report, name)
    assert "Go at node 'first' fails" in shown
    assert "Go at node 'second' fails" in shown
    assert "line 0" not in shown
    assert "line 1" not in shown
    assert ":1:1" not in shown
    text = str(report.findings[0])
    assert text.startswith("/machine/first: info GP210")
