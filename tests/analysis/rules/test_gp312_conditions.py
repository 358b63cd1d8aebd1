"""GP312: recoveries that wait in vain for a prompt to fail."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.model.capability import Effects, Outcomes, Output, Parameter
from gpsfsm.model.finding import Confidence
from tests.analysis.rules.prompting import DRIVE, FILL, FLUSH, FLUSH_B, LIBRARY, lines, only
from tests.analysis.rules.support import (
    control,
    findings,
    library,
    messages,
    places,
    provider,
    runner,
)

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Library

SURE = provider("robot/Wait", outcomes=Outcomes(never_fails=True))
WAIT, STRANGER = runner("robot/Wait"), runner("lift/Go")
PLAN = runner("model/Plan", 'uuid="a"')  # it fills, and may fail
SENT = runner("model/Note", 'uuid="a" flush="true"')
RECOVERY = control('recovery" name="if_nobody_is_there', DRIVE)
PLAIN = control("recovery", DRIVE)
LOG = runner("model/Note", 'uuid="a" text="log: arrived"')


def test_a_condition_as_recovery() -> None:
    steps = control("sequential", DRIVE, FILL), RECOVERY
    assert messages("GP312", *steps, library=LIBRARY) == [
        (
            6,
            "warning",
            "this recovery does not depend on what Note (uuid=a) at line 4 says: this prompt never "
            "fails, so the recovery runs only if Drive at line 3 fails",
            "let the model decide (flush the prompt with a runner that asks for "
            "a plan, and set that plan), or guard the step whose failure you mean",
        )
    ]
    finding = only("GP312", *steps)
    assert finding.location.element == "/Plan/Control[2]"
    assert places(finding) == [(4, "never fails, whatever it says")]
    assert (finding.confidence, finding.scenario) == (Confidence.HEURISTIC, None)


@pytest.mark.parametrize(
    ("steps", "causes"),
    [
        ([DRIVE, DRIVE, FILL], "Drive at line 3 or Drive at line 4"),
        ([DRIVE, control("sequential", PLAN, FILL)], "Drive at line 3 or Plan (uuid=a) at line 5"),
        ([control("parallel_all", STRANGER, FILL), FILL], "Go at line 4"),
        ([control("parallel_all", DRIVE, FILL), FILL], "Drive at line 4"),
    ],
)
def test_the_recovery_runs_for_other_reasons(steps: list[str], causes: str) -> None:
    finding = only("GP312", control("sequential", *steps), RECOVERY)
    assert finding.message.endswith(f", so the recovery runs only if {causes} fails")


def test_nothing_is_said_of_a_prompt_that_may_get_another_flush() -> None:
    """A runner that no file describes may hand anything over, also ``flush="true"``."""
    assert lines("GP312", control("sequential", FILL, STRANGER, FILL), RECOVERY) == []


def test_recoveries_are_told_from_the_outside_in_and_in_order() -> None:
    inner = control("sequential", control("sequential", DRIVE, FILL), RECOVERY, FILL)
    assert lines("GP312", inner, RECOVERY) == [7, 12]
    later = control("sequential", DRIVE, FILL)
    assert lines("GP312", later, RECOVERY, later, RECOVERY) == [6, 13]


@pytest.mark.parametrize(
    "guarded",
    [
        FILL,  # GP308
        control("sequential", FILL),  # GP308
        control("sequential", DRIVE, PLAN),
        control("sequential", DRIVE, SENT),
        control("sequential", DRIVE, FLUSH),
        control("sequential", FILL, DRIVE),
        control("sequential", DRIVE, WAIT),
        control("sequential", DRIVE, STRANGER),
        control("parallel_all", DRIVE, FILL),
        control("sequential", DRIVE, control("parallel_all", DRIVE, FILL)),
        control("sequential", FILL, FILL),  # GP308
    ],
)
def test_a_recovery_that_may_be_meant(guarded: str) -> None:
    capabilities = library(*LIBRARY.providers, SURE)
    assert findings("GP312", guarded, RECOVERY, library=capabilities) == []


def test_a_note_of_what_was_done_is_no_condition() -> None:
    """Nothing in the recovery reads it, and nothing asks anything."""
    steps = control("sequential", DRIVE, LOG)
    assert lines("GP312", steps, PLAIN, FLUSH) == []
    logged = control("recovery", runner("model/Note", 'uuid="a" text="log: lost"'), DRIVE)
    assert lines("GP312", steps, logged, FLUSH) == []


@pytest.mark.parametrize(
    "words",
    [
        'text="Is anybody there?"',
        'text="If nobody is there, say NOBODY."',
        'text="Determine who speaks."',
        'task="tell whether the door is open"',
        'name="checkTheDoor"',
    ],
)
def test_a_prompt_that_asks_is_a_condition(words: str) -> None:
    asking = control("sequential", DRIVE, runner("model/Note", f'uuid="a" {words}'))
    assert lines("GP312", asking, PLAIN) == [6]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("IF_NO_PERSON", True),
        ("door open?", True),
        ("ifNobodyAnswers", True),
        ("otherwise go back", True),
        ("go_back", False),
        ("gifts", False),
        ("if_navigation_failed", False),
        ("check_error", False),
    ],
)
def test_a_recovery_whose_name_asks_is_a_condition(name: str, expected: bool) -> None:
    recovery = control(f'recovery" name="{name}', DRIVE)
    assert bool(lines("GP312", control("sequential", DRIVE, LOG), recovery)) is expected


def test_a_recovery_that_sends_the_prompt_is_a_condition() -> None:
    steps = control("sequential", DRIVE, LOG)
    assert lines("GP312", steps, control("recovery", FLUSH)) == [6]
    assert lines("GP312", steps, control("recovery", control("sequential", DRIVE, FLUSH))) == [6]
    assert lines("GP312", steps, control("recovery", FLUSH_B)) == []
    nameless = control("sequential", DRIVE, runner("model/Note"))
    assert lines("GP312", nameless, control("recovery", runner("model/Plan", 'flush="true"'))) == []


def test_the_buffers_names_are_no_text() -> None:
    asking = control("sequential", DRIVE, runner("model/Note", 'uuid="check_door?"'))
    assert lines("GP312", asking, PLAIN) == []


def test_a_recovery_that_never_runs_is_left_to_others() -> None:
    dead = control("recovery", control("sequential", DRIVE, FILL), RECOVERY)
    assert lines("GP312", dead) == []
    steps = control("sequential", DRIVE, FILL), RECOVERY
    assert lines("GP312", *steps, assumptions=("never fails: line 3",)) == []


def test_what_cannot_fail_depends_on_the_assumptions() -> None:
    steps = control("sequential", DRIVE, PLAN), RECOVERY
    assert lines("GP312", *steps) == []
    assert lines("GP312", *steps, assumptions=("never fails: Plan",)) == [6]
    # A prompt that is declared never to fail does start.
    kept = control("sequential", DRIVE, FILL), RECOVERY
    assert lines("GP312", *kept, faults=("no-start",)) == [6]


LOOKS = provider(
    "eye/Look",
    configuration=(Parameter("ask"),),
    outputs=(Output("text"),),
    effects=Effects(answers="text", question="ask"),
)
CHECKS = provider(
    "eye/Check", configuration=(Parameter("prompt"),), effects=Effects(checks="prompt")
)
EYES = library(*LIBRARY.providers, LOOKS)
LOOK = runner("eye/Look", 'ask="Is the door open?"')


def seen(*steps: str, described: Library = EYES, **options: Any) -> list[int]:
    return [each.location.line for each in findings("GP312", *steps, library=described, **options)]


def test_a_question_that_is_answered_in_words() -> None:
    (actual,) = messages("GP312", LOOK, PLAIN, library=EYES)
    assert actual[:3] == (
        3,
        "warning",
        "Look (ask=Is the door open?) at line 2 succeeds whatever the answer is, "
        "so this recovery runs only if there is no answer at all",
    )
    assert actual[3].startswith("let the model decide")  # this robot has no runner that checks
    (actual,) = messages("GP312", LOOK, PLAIN, library=library(*EYES.providers, CHECKS))
    assert actual[3] == (
        "ask with a Check, which fails if the answer is no, and put the recovery after it"
    )
    only_checks = library(*LIBRARY.providers, CHECKS)
    step = runner("eye/Check", 'prompt="Is the door open?"')
    assert seen(step, PLAIN, described=only_checks) == []


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("Is there a person?", True),
        ("Look well. Is it empty?", True),
        ("Anybody there?", True),
        ("Tell whether it rains", True),
        ("Isn't it red?", True),
        ("Who is there?", False),
        ("Which of the slots are empty?", False),
        ("Describe the room.", False),
        ("", False),
    ],
)
def test_only_questions_for_yes_or_no(question: str, expected: bool) -> None:
    asking = runner("eye/Look", f'ask="{question}"')
    assert bool(seen(asking, PLAIN)) is expected
    named = control('recovery" name="if_nobody_is_there', DRIVE)
    assert seen(asking, named) == [3]


@pytest.mark.parametrize(
    "recovery",
    [
        control("recovery", LOOK, DRIVE),
        control('recovery" name="look_again', DRIVE),
        control('recovery" name="too_dark', DRIVE),
        control('recovery" name="if_the_camera_is_not_ready', DRIVE),
        control('recovery" name="on_error', DRIVE),
        control("recovery", runner("robot/Say", 'text="I cannot see the door."')),
        control("recovery", DRIVE, runner("robot/Say", 'text="It is too dark."')),
    ],
)
def test_a_recovery_for_trouble_with_the_camera(recovery: str) -> None:
    assert seen(LOOK, recovery) == []


def test_an_answer_in_the_recovery_is_no_trouble() -> None:
    said = runner("robot/Say", 'text="The door is shut, nobody is there."')
    assert seen(LOOK, control("recovery", said)) == [3]


def test_a_question_before_other_steps_counts_if_the_recovery_is_named_after_it() -> None:
    block = control("sequential", LOOK, DRIVE)
    assert seen(block, PLAIN) == []
    (actual,) = messages("GP312", block, control('recovery" name="not_open', DRIVE), library=EYES)
    assert actual[2].endswith("if there is no answer at all, or Drive at line 4 fails")
    failed = control('recovery" name="if_not_failed', DRIVE)
    other = control("sequential", DRIVE, LOOK)
    assert seen(other, PLAIN) == [6]
    assert seen(block, failed) == []


def test_what_is_no_answer_is_left_alone() -> None:
    assert seen(DRIVE, RECOVERY) == []
    assert seen(STRANGER, RECOVERY) == []
    sure = ("never fails: line 2",)
    assert seen(LOOK, PLAIN, assumptions=sure) == []  # GP308


@pytest.mark.parametrize("solver", ["z3", "structural"])
def test_whoever_decides(solver: str) -> None:
    steps = control("sequential", DRIVE, FILL), RECOVERY
    assert lines("GP312", *steps, solver=solver) == [6]
