"""Trees that are not read exactly: scripts that may throw, versions, leaves that are cut off."""

from __future__ import annotations

import pytest

import gpsfsm
from gpsfsm.compile.plan_text import forest_in
from gpsfsm.compile.tree_scripts import Scripts
from gpsfsm.model.finding import Confidence
from gpsfsm.model.report import Frequency, PlanReport, Precision


def checked(body: str) -> PlanReport:
    text = '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">'
    (report,) = gpsfsm.check(f"{text}{body}</BehaviorTree></root>").plans
    return report


def over(report: PlanReport) -> set[str]:
    return {each.construct for each in report.approximations}


@pytest.mark.parametrize(
    ("body", "construct"),
    [
        ('<SetBlackboard value="{given}" output_key="copy"/>', "SetBlackboard"),
        ("<Script code=\"err = 0\"/>", "Script"),
        ("<Script code='b := a + 1'/>", "Script"),
        ("<Sequence><Script code=\"m := 'A'\"/><Script code='m := 1'/></Sequence>", "Script"),
        ("<Sequence><Script code='m := 1'/><Script code='m := 2.5'/></Sequence>", "Script"),
        ("<AlwaysSuccess _post='x = 1'/>", "_post"),
        ("<AlwaysSuccess _onSuccess='x += 1'/>", "_onSuccess"),
        ("<AlwaysSuccess _skipIf='g'/>", "_skipIf"),
        ("<AlwaysSuccess _onHalted='x = 1'/>", "_onHalted"),
        ("<Precondition if='true' else='FAIL'><AlwaysSuccess/></Precondition>", "Precondition"),
    ],
)  # fmt: skip
def test_what_may_throw_is_no_proof_that_the_tree_completes(body: str, construct: str) -> None:
    report = checked(body)
    assert construct in over(report)
    facts = report.facts
    assert facts is not None
    assert facts.gives_up is Frequency.SOMETIMES  # an exception ends the tree, without a failure
    assert facts.fewest_failures_to_give_up == 0
    assert facts.precision["completes"] is facts.precision["gives_up"] is Precision.MAY
    assert facts.precision["fewest_failures_to_give_up"] is Precision.AT_LEAST


@pytest.mark.parametrize(
    "body",
    [
        "<Script code=\"tries := 0; name := 'a'\"/>",
        "<Sequence><Script code='n := 0'/><Script code='n := 3'/></Sequence>",
        "<SetBlackboard value='5' output_key='k'/>",
        "<AlwaysSuccess _onSuccess='done := true'/>",
    ],
)  # fmt: skip
def test_what_cannot_throw_is_exact(body: str) -> None:
    report = checked(body)
    assert report.approximations == ()
    assert report.facts is not None
    assert report.facts.completes is Frequency.ALWAYS


def test_a_key_that_something_else_may_write_is_not_sure() -> None:
    forest = forest_in(
        '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence>'
        "<Script code='a := 1; b := 1'/><Look to='{a}'/></Sequence></BehaviorTree></root>"
    )
    assert forest is not None
    scripts = Scripts.of(forest)
    assert [scripts.may_throw(text) for text in ("a := 2", "b := 2", "b := 2.0", "b = 2")] == [
        *(True, False, False, True)
    ]


def test_the_last_success_of_a_round_robin_depends_on_the_version() -> None:
    body = (
        "<RecoveryNode number_of_retries='1'><Go/><RoundRobin{}><Clear/></RoundRobin>"
        "</RecoveryNode>"
    )
    report = checked(body.format(""))
    assert report.facts is not None
    assert report.facts.fewest_failures_to_give_up == 1
    assert "RoundRobin" in over(report)
    wrapping = checked(body.format(" wrap_around='true'"))
    assert wrapping.facts is not None
    assert wrapping.facts.fewest_failures_to_give_up == 2
    assert wrapping.approximations == ()


@pytest.mark.parametrize(
    ("body", "lost", "cause"),
    [
        (
            "<ReactiveFallback><ForceSuccess><A/></ForceSuccess><Sequence><B/><C/></Sequence>"
            "</ReactiveFallback>",
            2,
            "ForceSuccess at line 1 never fails",
        ),
        ("<Fallback><AlwaysSuccess/><Nav/></Fallback>", 1, "AlwaysSuccess at line 1 never fails"),
        (
            "<Sequence><AlwaysFailure/><Nav/></Sequence>",
            1,
            "AlwaysFailure at line 1 never succeeds",
        ),
        (
            "<KeepRunningUntilFailure><Fallback><AlwaysSuccess/><Nav/></Fallback>"
            "</KeepRunningUntilFailure>",
            1,
            "AlwaysSuccess at line 1 never fails",
        ),
    ],
)
def test_what_nothing_enters_counts_and_is_told_with_its_cause(
    body: str, lost: int, cause: str
) -> None:
    report = checked(body)
    assert report.facts is not None
    assert len(report.facts.unreachable) == lost
    messages = [each.message for each in report.findings if each.rule == "GP301"]
    assert messages
    assert all(cause in message for message in messages)


def test_a_skipped_condition_throws() -> None:
    report = checked("<IfThenElse><C _skipIf='x'/><A/><B/></IfThenElse>")
    assert report.facts is not None
    assert report.facts.gives_up is Frequency.SOMETIMES


def test_an_attribute_that_no_version_reads_is_told() -> None:
    report = checked('<Go _onlyIf="{ok}"/>')
    assert {finding.rule for finding in report.findings} >= {"GP119"}


def test_a_bounded_loop_never_runs_for_ever_by_proof() -> None:
    report = checked("<Repeat num_cycles='30000'><Sequence><A/><B/><C/></Sequence></Repeat>")
    assert report.facts is not None
    assert report.facts.precision["endless"] is Precision.MAY
    loops = [each for each in report.findings if each.rule in ("GP313", "GP314")]
    assert all(each.confidence is Confidence.MAY for each in loops)
