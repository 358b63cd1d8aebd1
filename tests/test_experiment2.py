"""Seven plans that a model wrote for a real robot, and what became of them.

Six of the seven runs went wrong. What the records state as the cause must be found before the
plan is dispatched; the plan that did its task must not be rejected for anything untrue.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm import Finding, Severity
from gpsfsm.cli import main
from tests.conftest import REPO

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    Findings = Callable[[str], Sequence[Finding]]


@pytest.fixture(name="findings")
def fixture_findings(shared_corpus: Path) -> Findings:
    """What is found in the answer of the model."""
    folder = shared_corpus / "experiment2"
    return lambda name: gpsfsm.check(folder / f"{name}__llm_response_1.xml").plans[0].findings


def only(findings: Sequence[Finding], rule: str, line: int) -> Finding:
    """The one finding of this rule on this line."""
    (finding,) = [one for one in findings if (one.rule, one.location.line) == (rule, line)]
    return finding


@pytest.mark.parametrize(
    ("name", "goal"),
    [("it1_experiment_1", 4), ("it1_experiment_2", 5), ("it1_experiment_3", 6)],
)
def test_a_goal_that_fails_and_that_nothing_handles(
    findings: Findings, name: str, goal: int
) -> None:
    """All three robots hung: the first goal was aborted, and no connection led on from there."""
    finding = only(findings(name), "GP302", goal)
    assert finding.severity is Severity.INFO  # by the paper that is a give-up
    assert finding.message.endswith("1 failure is enough")
    assert finding.scenario is not None
    assert finding.scenario.ends is gpsfsm.End.GAVE_UP
    assert [outcome.value for _, outcome in finding.scenario.outcomes] == ["FAILED"]


@pytest.mark.parametrize(
    ("name", "block"),
    [("it1_experiment_1", 5), ("it1_experiment_2", 8), ("it1_experiment_3", 9)],
)
def test_a_parallel_block_that_waits_for_ever(findings: Findings, name: str, block: int) -> None:
    """Behind that goal they would have hung again, in a parallel block."""
    assert "can never succeed once" in only(findings(name), "GP303", block).message


@pytest.mark.parametrize(
    ("name", "line", "where"),
    [
        ("it1_experiment_1", 9, "the parallel_all 'perceive_and_transcribe' at line 5"),
        ("it1_experiment_3", 16, "the parallel_all 'perception_at_A' at line 9"),
    ],
)
def test_a_summary_that_gets_nothing_to_summarise(
    findings: Findings, name: str, line: int, where: str
) -> None:
    finding = only(findings(name), "GP401", line)
    assert finding.severity is Severity.ERROR
    assert finding.message.endswith(f"no value passes the end of {where}")


def test_the_good_run_is_rejected_for_its_one_flaw_only(findings: Findings) -> None:
    """It did its task; then it set an empty plan, which the server refused, as the log shows."""
    reported = findings("it2_plan_5")
    (error,) = [finding for finding in reported if finding.severity is Severity.ERROR]
    assert (error.rule, error.location.line) == ("GP414", 9)
    assert "sets an empty plan" in error.message
    assert "ImageAnalysisRunner" in only(reported, "GP403", 6).message


def test_a_name_that_never_gets_to_the_speech(findings: Findings) -> None:
    """The robot said "Your name is ${prompt_capabilities/PromptSpeechRunner.text}."."""
    finding = only(findings("it2_plan_6"), "GP402", 9)
    assert finding.severity is Severity.ERROR
    assert "${prompt_capabilities/PromptSpeechRunner.text}" in finding.message
    assert "at line 7 does not reach this step" in finding.message
    assert "here WaypointRunner" in finding.message
    assert only(findings("it2_plan_6"), "GP403", 6).severity is Severity.WARNING


def test_the_readme_shows_it_as_it_is_printed(
    shared_corpus: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The file has a shorter name there, and lines are broken to fit."""
    path = shared_corpus / "experiment2" / "it2_plan_6__fabric_parsed_2.xml"
    assert main(["check", "--isolated", str(path)]) == 1
    printed = " ".join(capsys.readouterr().out.replace(str(path), "plan.xml").split())
    readme = (REPO / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```text\n(plan\.xml:.*?)\n```", readme, re.DOTALL)
    message, hint = (" ".join(part.split()) for part in block.split("= hint:"))
    assert message in printed
    assert f"= hint: {hint}" in printed


def test_a_condition_that_is_written_as_a_recovery(findings: Findings) -> None:
    """The robot never went to B: the recovery waits for a prompt to fail, which never happens."""
    reported = findings("it2_plan_7")
    finding = only(reported, "GP312", 13)
    assert "does not depend on what PromptTextRunner" in finding.message
    assert "at line 10 says: this prompt never fails" in finding.message
    assert [place.location.line for place in finding.related] == [10]
    assert only(reported, "GP403", 10).severity is Severity.WARNING
    assert any(one.rule == "GP101" and "&lt" in one.message for one in reported)


def test_a_decision_that_is_left_to_a_prompt_that_is_never_sent(findings: Findings) -> None:
    """The robot stayed where it was: the model was never asked."""
    reported = findings("it2_plan_7a")
    prompt = only(reported, "GP414", 6)
    assert prompt.severity is Severity.ERROR
    assert "only buffers its prompt and does not ask the model" in prompt.message
    assert [place.location.line for place in prompt.related] == [8]
    context = only(reported, "GP411", 5)
    assert context.message.endswith("nothing flushes the buffer 'task_person_check'")


@pytest.mark.parametrize(
    "name",
    [
        "it1_experiment_1",
        "it1_experiment_2",
        "it1_experiment_3",
        "it2_plan_5",
        "it2_plan_6",
        "it2_plan_7",
        "it2_plan_7a",
    ],
)
def test_every_continuation_is_found_to_be_empty(findings: Findings, name: str) -> None:
    """All seven end with a request for a new plan that the model never gets."""
    (finding,) = [one for one in findings(name) if one.rule == "GP414"]
    assert "sets an empty plan" in finding.message
