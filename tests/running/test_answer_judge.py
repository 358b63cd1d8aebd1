from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.api import check
from gpsfsm.checking import CheckOptions
from gpsfsm.model.finding import Severity
from gpsfsm.running.answer_judge import PlanJudge
from gpsfsm.syntax import Limits
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, WARNED

UNQUOTED = ACCEPTED.replace('y="2"', "y=2")


def test_a_plan_among_prose_is_taken_out() -> None:
    actual = PlanJudge()(f"Here it is:\n```xml\n{ACCEPTED}```\nGood luck!")
    assert actual.accepted
    assert actual.plan == ACCEPTED.strip()
    assert actual.repairs == ()
    assert check(actual.plan).ok


def test_a_safe_repair_is_made_and_named() -> None:
    assert not check(UNQUOTED).ok
    actual = PlanJudge()(UNQUOTED)
    assert actual.accepted
    assert actual.plan == ACCEPTED.strip()
    assert [repair.partition(":")[0] for repair in actual.repairs] == ["GP101"]
    strict = PlanJudge(mend=False)(UNQUOTED)
    assert not strict.accepted
    assert strict.repairs == ()
    assert "GP101" in strict.feedback


def test_a_plan_that_is_rejected_tells_why() -> None:
    actual = PlanJudge()(REJECTED)
    assert not actual.accepted
    assert actual.errors == 1
    assert actual.plan == REJECTED.strip()
    assert actual.feedback.startswith("Your plan was rejected: 1 error")
    assert actual.findings[0][0] == "GP307"


def test_after_repairs_the_findings_are_about_the_plan_that_was_mended() -> None:
    unquoted = REJECTED.replace('y="2"', "y=2")
    answer = f"\n\nSure.\n\n{unquoted}"
    actual = PlanJudge()(answer)
    assert not actual.accepted
    assert actual.feedback.startswith("These mistakes were fixed for you:\n- GP101: ")
    assert actual.plan == REJECTED.strip()
    assert "1. Error GP307 at line 2:" in actual.feedback


def test_lines_are_those_of_the_answer_as_a_model_sees_it_again() -> None:
    actual = PlanJudge()(f"\n\n  Sure.\n{REJECTED}")
    assert "1. Error GP307 at line 3:" in actual.feedback


def test_warnings_can_be_too_much() -> None:
    actual = PlanJudge(fail_on=Severity.WARNING)(WARNED)
    assert not actual.accepted
    assert actual.feedback.startswith("The plan is not good enough yet. 1 warning:")


@pytest.mark.parametrize("answer", ["", "I cannot do that.", "<Plan", BROKEN])
def test_no_plan(answer: str) -> None:
    actual = PlanJudge()(answer)
    assert not actual.accepted
    assert actual.feedback.startswith("Your plan ")


def test_what_cannot_be_decided_is_not_accepted() -> None:
    options = replace(CheckOptions(), limits=Limits(max_elements=1))
    actual = PlanJudge(options)(ACCEPTED)
    assert not actual.accepted
    assert not actual.decided


@given(
    st.lists(
        st.sampled_from(
            ["<Plan>", "</Plan>", ACCEPTED, REJECTED, BROKEN, "```", "x", "<", '"', "&"]
        )
    )
)
def test_what_is_accepted_passes_the_check_as_it_is(parts: list[str]) -> None:
    actual = PlanJudge()("\n".join(parts))
    if actual.accepted:
        assert check(actual.plan).ok
    assert actual.accepted == (actual.errors == 0 and actual.decided and actual.plan != "")


IGNORED = "<Plan>\n  <!-- gpsfsm: ignore GP307 because the model says so -->\n"


def test_a_model_cannot_excuse_its_own_mistakes() -> None:
    excused = REJECTED.replace("<Plan>\n", IGNORED)
    assert excused != REJECTED
    (checked,) = check(excused).plans
    assert [each.rule for each in checked.findings if each.severity is Severity.ERROR] == []
    actual = PlanJudge()(excused)
    assert not actual.accepted
    assert actual.errors == 1
    assert actual.findings[0][0] == "GP307"
    assert "1. Error GP307 at line 3:" in actual.feedback


def test_a_plan_that_was_mended_excuses_nothing_either() -> None:
    actual = PlanJudge()(REJECTED.replace("<Plan>\n", IGNORED).replace('y="2"', "y=2"))
    assert actual.repairs
    assert not actual.accepted
    assert actual.findings[0][0] == "GP307"


@pytest.mark.parametrize(
    "answer", ["<Plan/>", '<Plan>\n<Control type="sequential"></Control>\n</Plan>']
)
def test_a_plan_that_does_nothing_is_none(answer: str) -> None:
    assert check(answer).ok
    actual = PlanJudge()(answer)
    assert not actual.accepted
    assert (actual.errors, actual.findings[0][0]) == (1, "GP109")
    assert actual.feedback.startswith("Your plan was rejected: 1 error.")


def test_an_empty_control_beside_a_step_is_no_error() -> None:
    actual = PlanJudge()(ACCEPTED.replace("</Plan>", '<Control type="sequential"/></Plan>'))
    assert actual.accepted
    assert "GP109" in [rule for rule, _ in actual.findings]
