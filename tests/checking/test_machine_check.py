"""What is said about machines: findings, their scenarios, and why some are not decided."""

from __future__ import annotations

from typing import Any

import pytest

import gpsfsm
from tests.analysis.machines.random_machines import machine

Said = list[tuple[str, str, list[str]]]


def said(*connections: str, options: dict[str, Any] | None = None, **needs: int) -> Said:
    """Rule, message and story of each finding, without those about names."""
    (report,) = gpsfsm.check(machine(*connections, **needs), **(options or {})).plans
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
        ("error GP301 /machine/b", "no run of the machine triggers b at line 1", [])
    ]


def test_a_machine_that_always_gives_up() -> None:
    found = said("start SUCCEEDED a", "a SUCCEEDED lost", "a FAILED lost")
    assert found[0] == (
        "error GP305 /machine",
        "this machine gives up in every run",
        ["a at line 1 succeeds"],
    )
    assert [rule for rule, _, _ in found] == ["error GP305 /machine"]


def test_a_machine_that_never_completes() -> None:
    found = said("start SUCCEEDED a", "a SUCCEEDED a", "a FAILED lost")
    assert found[1][:2] == (
        "error GP304 /machine",
        "this machine never completes, whatever happens: every run gives up, is stuck or goes on "
        "for ever",
    )


def test_a_machine_that_is_stuck() -> None:
    stuck = "it neither completes nor gives up, and nothing more can happen"
    end = "nothing more can happen: the machine is stuck"
    sometimes = said("start SUCCEEDED a", "a SUCCEEDED end")
    assert sometimes == [
        (
            "warning GP302 /machine/a",
            "if a at line 1 fails, nothing handles that: the machine is stuck",
            ["a at line 1 fails"],
        ),
        ("error GP306 /machine", f"this machine can be stuck: {stuck}", ["a at line 1 fails", end]),
    ]
    always = said("start SUCCEEDED a")
    assert [rule for rule, _, _ in always[:2]] == ["error GP304 /machine", "error GP306 /machine"]
    assert always[1][1] == f"this machine is stuck in every run: {stuck}"


def test_a_hanging_runner_leaves_a_machine_stuck() -> None:
    complete = ("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED end")
    assert said(*complete) == []
    (found,) = said(*complete, options={"faults": ["hang"]})
    assert found[0] == "error GP306 /machine"
    assert found[2][0] == "a at line 1 starts and never ends"


def test_events_that_end_the_run() -> None:
    found = said(
        "start SUCCEEDED a", "a SUCCEEDED b", "a FAILED end", "b SUCCEEDED lost", "b FAILED end"
    )
    assert found == [
        (
            "warning GP302 /machine/b",
            "if b at line 1 succeeds, nothing handles that: the machine gives up",
            ["a at line 1 succeeds", "b at line 1 succeeds"],
        )
    ]


def test_what_is_still_active_at_completion() -> None:
    (found,) = said(
        *("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED end", "a FAILED end"),
        *("b SUCCEEDED end", "b FAILED end"),
    )[:1]
    assert found == (
        "warning GP311 /machine/a",
        "the machine can complete while a at line 1 is still active",
        [
            "b at line 1 succeeds",
            "the machine completes while a at line 1 is still running",
        ],
    )


FORK = ("start SUCCEEDED a", "start SUCCEEDED b", "a SUCCEEDED j", "b SUCCEEDED j")


@pytest.mark.parametrize(
    ("more", "severity", "then"),
    [
        (("j SUCCEEDED end",), "error", "nothing more can happen then, and the machine is stuck"),
        (("j SUCCEEDED end", "a FAILED lost", "b FAILED lost"), "warning", "the machine gives up"),
        (
            ("j SUCCEEDED end", "a FAILED a", "b FAILED b"),
            "warning",
            "the machine runs on for ever",
        ),
        (
            ("j SUCCEEDED end", "a FAILED end", "b FAILED end"),
            "info",
            "the machine completes without it",
        ),
    ],
)
def test_joins_that_wait_for_ever(more: tuple[str, ...], severity: str, then: str) -> None:
    (found,) = [each for each in said(*FORK, *more, j=2) if "GP303" in each[0]]
    assert found[0] == f"{severity} GP303 /machine/j"
    assert found[1] == (
        f"the join j can have some of its inputs and wait for the others for ever: {then}"
    )
    assert found[2][0] in ("a at line 1 succeeds", "b at line 1 succeeds", "a at line 1 fails")


def test_long_stories_leave_out_their_middle() -> None:
    steps = [
        f"r{number} {event} r{number + 1}"
        for number in range(20)
        for event in ("SUCCEEDED", "FAILED")
    ]
    (found,) = [each for each in said("start SUCCEEDED r0", *steps) if "GP306" in each[0]]
    story = found[2]
    assert len(story) == 14
    assert story[6] == "… 9 more steps …"
    assert story[-1] == "nothing more can happen: the machine is stuck"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"faults": ["no-start"]}, "a machine is not decided under --faults no-start"),
        ({"consistent": True}, "a machine is not decided under --consistent"),
        ({"engine": "fabric-v2"}, "a machine is not checked for fabric-v2"),
        (
            {"assume": ["a fails or b succeeds"]},
            "a machine is not decided under assumptions that tie runners together",
        ),
    ],
)
def test_what_is_not_decided(options: dict[str, Any], reason: str) -> None:
    graph = machine("start SUCCEEDED a", "a SUCCEEDED b", "a FAILED end", "b FAILED end")
    if options.get("consistent"):
        graph.nodes["b"]["interface"] = "a"
    (report,) = gpsfsm.check(graph, **options).plans
    assert report.verdict.value == "error"
    assert report.facts is None
    assert [(each.rule, each.message) for each in report.findings] == [("GP904", reason)]


def test_a_machine_with_too_many_configurations_is_undecided() -> None:
    wide = [f"start SUCCEEDED r{number}" for number in range(16)]
    (report,) = gpsfsm.check(machine(*wide)).plans
    assert report.verdict.value == "error"
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
