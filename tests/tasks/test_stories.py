"""How it is told where a plan leaves its task."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking.selection import Selection
from gpsfsm.model.report import Verdict
from gpsfsm.tasks.load import read_task
from tests.oracle import P, par_all, par_any, plan, rec, seq, to_xml

TASK = """
interface: [GoRunner]
places: {A: {x: 1}, B: {x: 2}, C: {x: 3}, D: {x: 4}}
actions: {say: {interface: SayRunner}}
steps:
  - do: A
  - do: B
    else: [C, D]
  - do: D
allow: say
"""
A, B, C, D, E = (f"demo/GoRunner x={x}" for x in range(1, 6))
SAY = "demo/SayRunner"
GO = "GoRunner (x={}) at line {}".format

Story = tuple[str, int, str, list[str]]


def stories_of(whole: P, text: str = TASK) -> list[Story]:
    """Rule, line, message and story of the findings about a task."""
    options = CheckOptions(task=read_task(text.encode()), selection=Selection.of(["GP6", "GP9"]))
    report = check_text(to_xml(whole), "plan.xml", options)
    assert (report.verdict is Verdict.ACCEPTED) == (not report.findings)
    return [
        (each.rule, each.location.line, each.message, list(each.scenario.story))
        for each in report.findings
        if each.scenario is not None
    ]


def test_a_plan_that_fulfils_its_task_has_no_finding() -> None:
    assert stories_of(plan(A, SAY, rec(SAY), B, rec(C, D), D)) == []


def test_a_plan_may_give_up_when_what_was_not_asked_for_fails() -> None:
    assert stories_of(plan(A, B, rec(C, D), SAY, D)) == []


AFTER_A = f"{GO(1, 2)} succeeds"
CASES = {
    "missing": (
        plan(A, D),
        *("GP601", 3, "step 2 ('B') is missing: no runner of the plan does it"),
        [AFTER_A, f"{GO(4, 3)} starts although step 2 ('B') is due"],
    ),
    "nothing done": (
        plan(SAY),
        *("GP601", 1, "step 1 ('A') is missing: no runner of the plan does it"),
        ["SayRunner at line 2 succeeds", "the plan completes although step 1 ('A') is due"],
    ),
    "extra": (
        plan(A, B, rec(C, D), E, D),
        *("GP602", 8, f"the task does not ask for {GO(5, 8)}"),
        [AFTER_A, f"{GO(2, 3)} succeeds", f"{GO(5, 8)} starts, which the task does not ask for"],
    ),
    "repeated": (
        plan(A, A, B, rec(C, D), D),
        *("GP603", 3, f"{GO(1, 3)} does step 1 of the task again"),
        [AFTER_A, f"{GO(1, 3)} starts again"],
    ),
    "misordered": (
        plan(B, A, D),
        *("GP604", 2, f"{GO(2, 2)} comes before step 1 ('A'), which the task requires first"),
        [f"{GO(2, 2)} starts although step 1 ('A') is due"],
    ),
    "skipped, and given up": (
        plan(A, B, D),
        *("GP605", 1, "when 'B' fails, the plan does not try 'C'"),
        [AFTER_A, f"{GO(2, 3)} fails", "the plan gives up without trying 'C'"],
    ),
    "skipped, and gone on": (
        plan(A, B, rec(D), D),
        *("GP605", 5, "when 'B' fails, the plan does not try 'C'"),
        [AFTER_A, f"{GO(2, 3)} fails", f"the plan continues with {GO(4, 5)} without trying 'C'"],
    ),
    "the second alternative skipped": (
        plan(A, B, rec(C), D),
        *("GP605", 1, "when 'C' fails, the plan does not try 'D'"),
        [
            *(AFTER_A, f"{GO(2, 3)} fails", f"{GO(3, 5)} fails"),
            "the plan gives up without trying 'D'",
        ],
    ),
    "wrong alternative": (
        plan(A, B, rec(E, D), D),
        "GP606",
        5,
        f"when 'B' fails, the plan tries {GO(5, 5)} instead of an alternative in step 2 ('C')",
        [
            *(AFTER_A, f"{GO(2, 3)} fails"),
            f"the plan tries {GO(5, 5)} instead of an alternative in step 2 ('C')",
        ],
    ),
    "alternative afterwards": (
        plan(A, B, rec(C, D), C, D),
        "GP606",
        8,
        (f"{GO(3, 8)} is for when step 2 ('B') fails, but the plan does it after the step is done"),
        [AFTER_A, f"{GO(2, 3)} succeeds", f"{GO(3, 8)} starts although step 2 ('B') is done"],
    ),
    "alternative without need": (
        plan(A, C, B, D),
        "GP606",
        3,
        (f"{GO(3, 3)} is for when step 2 ('B') fails, but the plan does it without such a failure"),
        [AFTER_A, f"{GO(3, 3)} starts although step 2 ('B') has not failed"],
    ),
}


@pytest.mark.parametrize(("whole", "rule", "line", "message", "story"), CASES.values(), ids=CASES)
def test_the_ways_to_leave_a_task_are_told_apart(
    whole: P, rule: str, line: int, message: str, story: list[str]
) -> None:
    assert stories_of(whole)[0] == (rule, line, message, story)


def test_two_steps_at_once_are_told_in_both_orders() -> None:
    during = f"{GO(2, 4)} can start while step 1 ('A') is still running"
    before = f"{GO(2, 4)} comes before step 1 ('A'), which the task requires first"
    pairs = [(rule, message) for rule, _, message, _ in stories_of(plan(par_all(A, B), rec(), D))]
    assert sorted(pairs) == [("GP604", during), ("GP604", before)]


def test_a_plan_that_completes_beside_its_steps() -> None:
    stories = stories_of(plan(par_any(seq(A, B, rec(C, D), D), SAY)))
    assert [rule for rule, *_ in stories] == ["GP607"] * 6
    assert stories[1][2] == (
        "the plan completes even if step 2 ('B') and its alternatives fail: it must give up then"
    )
    assert stories[4][3] == [
        "GoRunner (x=1) at line 4 succeeds",
        "GoRunner (x=2) at line 5 is running",
        "SayRunner at line 12 succeeds",
        "the plan completes while step 2 ('B') is still running",
    ]


def test_a_broken_rule_is_told_with_its_name() -> None:
    rules = "rules:\n  - {response: [B, say], name: report the end, runs: completed}\n"
    stories = stories_of(plan(A, B, rec(C, D), D), TASK + rules)
    assert stories == [
        (
            "GP608",
            1,
            "a run breaks a rule of the task 'report the end': response of 'B' and 'say'",
            [
                *(f"{GO(1, 2)} succeeds", f"{GO(2, 3)} succeeds", f"{GO(4, 8)} succeeds"),
                "the plan completes, but the rule is not fulfilled",
            ],
        )
    ]


def test_a_rule_that_an_event_breaks_names_it() -> None:
    stories = stories_of(plan(SAY, A, B, rec(C, D), D), TASK + "rules:\n  - precedence: [B, say]\n")
    assert [(rule, line, story) for rule, line, _, story in stories] == [
        ("GP608", 2, ["SayRunner at line 2 starts, which breaks the rule"])
    ]


def test_an_action_that_does_not_start_was_attempted() -> None:
    analysis = AnalysisOptions(faults=("no-start",))
    options = CheckOptions(analysis=analysis, task=read_task(TASK.encode()))
    options = replace(options, selection=Selection.of(["GP6"]))
    assert check_text(to_xml(plan(A, B, rec(C, D), D)), "plan.xml", options).findings == ()
    (finding,) = check_text(to_xml(plan(A, B, rec(C), D)), "plan.xml", options).findings
    assert finding.rule == "GP605"
    (wrong,) = check_text(to_xml(plan(E, A, B, rec(C, D), D)), "plan.xml", options).findings
    assert (wrong.rule, wrong.location.line) == ("GP602", 2)


def test_what_cannot_be_decided_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gpsfsm.tasks.deciding.DEFAULT_MOVES", 10)
    monkeypatch.setattr("gpsfsm.tasks.symbolic._MAX_SIZE", 10)
    options = CheckOptions(task=read_task(TASK.encode()))
    whole = plan(A, par_all(*[SAY] * 4), B, rec(C, D), D)
    report = check_text(to_xml(whole), "plan.xml", options)
    (finding,) = (each for each in report.findings if each.rule == "GP904")
    assert report.verdict is Verdict.UNDECIDED
    assert finding.message.endswith("before these were decided: the steps of the task")
