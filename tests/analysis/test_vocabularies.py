"""Findings about trees and about engines have their own terms, and the user's words stay."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.model.event import End
from gpsfsm.tasks.load import read_task

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding

SPEECH = "the plan is ready"  # short enough to stand in the name of a runner
GIVES_UP = "the plan gives up"


def tree(body: str) -> str:
    return (
        '<root BTCPP_format="4" main_tree_to_execute="A">\n<BehaviorTree ID="A">\n'
        f"{body}\n</BehaviorTree></root>"
    )


def dangling(text: str, engine: str = "paper") -> list[Finding]:
    report = check_text(text, "", CheckOptions(engine=engine))
    return [each for each in report.findings if each.rule == "GP302"]


def plan(*texts: str) -> str:
    runner = '<Runner interface="a/Say" provider="a/Say" text="{}"/>'
    return "<Plan>\n" + "\n".join(map(runner.format, texts)) + "\n</Plan>"


@pytest.mark.parametrize("words", [SPEECH, "this plan", "parallel_any"])
def test_the_speech_of_a_tree_is_not_reworded(words: str) -> None:
    body = f'<Sequence><Say text="{words}"/>\n<Say text="{words}"/></Sequence>'
    (finding,) = dangling(tree(body))
    assert finding.message == (
        "2 of 2 failures make the tree fail (lines 3 and 4: nothing handles it); 1 failure is "
        "enough"
    )
    assert finding.hint == "use --tolerate N to require that no N failures make the tree fail"
    assert finding.scenario is not None
    assert finding.scenario.story == (
        f"Say (text={words}) at line 3 fails",
        "nothing handles this failure: the tree fails",
    )


def test_a_tree_has_children_where_a_plan_has_recoveries() -> None:
    (last,) = dangling(tree('<Fallback><Say text="a"/>\n<Say text="the plan"/></Fallback>'))
    assert last.message == (
        "1 of 2 failures makes the tree fail (line 4: last child of a Fallback "
        "or Retry); this takes at least 2 failures in total"
    )
    assert last.scenario is not None
    assert last.scenario.story[-1] == "nothing handles this failure: the tree fails"


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
def test_on_an_engine_a_speech_is_not_reworded(engine: str) -> None:
    (last,) = dangling(plan(GIVES_UP, "a"), engine)
    assert last.message == (
        "2 of 2 failures hang the plan (lines 2 and 3: nothing handles it); 1 failure is enough; "
        f"{engine} cannot give up"
    )
    assert last.scenario is not None
    assert last.scenario.ends is End.HANG
    assert last.scenario.story == (
        f"Say (text={GIVES_UP}) at line 2 fails",
        "nothing handles this failure: the plan hangs",
    )


def test_by_the_paper_a_plan_gives_up() -> None:
    (only,) = dangling(plan(GIVES_UP))
    assert only.scenario is not None
    assert only.scenario.story[-1] == "nothing handles this failure: the plan gives up"


TASK = """
actions: {a: {interface: Go}, b: {interface: Say}}
steps: [{do: a}, {do: b}]
rules: [{precedence: [b, a]}]
"""


def test_hints_of_a_task_speak_of_trees() -> None:
    task = read_task(TASK.encode())
    text = tree("<Fallback><Go/>\n<Say/></Fallback>")
    report = check_text(text, "", CheckOptions(task=task))
    hints = {each.rule: each.hint for each in report.findings if each.rule in ("GP607", "GP608")}
    assert hints == {
        "GP607": (
            "remove what runs in its place and hides the failure, so that nothing handles it"
        ),
        "GP608": "change the tree so that the run in the scenario keeps the rule",
    }


@pytest.mark.parametrize(
    ("assumption", "rule", "faults"),
    [("Do always fails", "GP305", ()), ("Do never succeeds", "GP304", ("hang",))],
)
def test_a_tree_that_cannot_succeed_fails(
    assumption: str, rule: str, faults: tuple[str, ...]
) -> None:
    analysis = AnalysisOptions(assumptions=(assumption,), faults=faults)
    report = check_text(tree("<Do/>"), "", CheckOptions(analysis=analysis))
    (message,) = (each.message for each in report.findings if each.rule == rule)
    assert " fails " in message
    assert "gives up" not in message


def test_a_tree_has_to_fail_where_a_plan_has_to_give_up() -> None:
    task = read_task(b"actions: {a: {interface: Go}}\nsteps: [{do: a}]\n")
    hidden = '<Runner interface="{0}" provider="{0}"/>'.format
    recovery = f'<Control type="recovery">{hidden("generic_capabilities/WaitRunner")}</Control>'
    texts = {
        tree("<Fallback><Go/>\n<AlwaysSuccess/></Fallback>"): "the tree completes even if step 1 "
        "('a') fails: it must fail then",
        f"<Plan>{hidden('a/Go')}{recovery}</Plan>": "the plan completes even if step 1 ('a') "
        "fails: it must give up then",
    }
    for text, message in texts.items():
        report = check_text(text, "", CheckOptions(task=task))
        assert message in [each.message for each in report.findings if each.rule == "GP607"]
