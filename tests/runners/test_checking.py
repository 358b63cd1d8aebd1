"""Checks of what was perceived, by a model: for real, and in a world."""

from __future__ import annotations

import pytest

from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import RunnerError
from gpsfsm.runners import perception
from gpsfsm.runners.perception import verdict_word
from tests.generation.scripted import Scripted
from tests.runners.acting import act, fails
from tests.runners.prompting import messages, run_real, service
from tests.simulation.support import control, field_of, plan, run, runner

CHECK = runner("Check", prompt="Is there a person?", text="I see a woman.")
INSTEAD = control("recovery", runner("Wait", seconds="0.01"))


@pytest.mark.parametrize(
    ("said", "word"),
    [
        ("yes", "yes"),
        ("Yes.", "yes"),
        (" **YES** ", "yes"),
        ("yes, a woman", "yes"),
        ("No", "no"),
        ("no; nobody", "no"),
        ("unclear", "unclear"),
        ("yes and no", "unclear"),
        ("No idea", "unclear"),
        ("yesterday", "unclear"),
        ("", "unclear"),
    ],
)
def test_only_a_clear_yes_is_one(said: str, word: str) -> None:
    assert verdict_word(said) == word


@pytest.mark.parametrize(
    ("said", "answer", "message", "steps"),
    [
        ("Yes.", "yes", "", 1),
        ("no", "no", "the answer is no: no", 2),
        ("I cannot say", "unclear", "neither yes nor no: I cannot say", 2),
    ],
)
def test_a_model_decides_for_real(said: str, answer: str, message: str, steps: int) -> None:
    model = Scripted([said])
    ran = run_real(plan(CHECK, INSTEAD), model)
    assert ran.kernel.status is Status.COMPLETED
    assert len(ran.outputs) == steps
    assert ran.outputs[0] == {"answer": answer, "said": said}
    assert ran.messages[0] == message
    (request,) = model.requests
    assert request.task == "Is there a person?"
    assert "<perceived>\nI see a woman.\n</perceived>\n" in messages(request)


def test_a_text_that_arrives_is_checked() -> None:
    model = Scripted(["A dog sleeps.", "yes"])
    words = runner("PromptSpeech", task="Say what is there.", flush="true")
    ran = run_real(plan(words, runner("Check", prompt="Is there a dog?")), model)
    assert ran.outputs[1] == {"answer": "yes", "said": "yes"}
    assert "A dog sleeps." in messages(model.requests[1])


def test_nothing_to_check_is_a_failure() -> None:
    services = {"model": service(Scripted([]))}
    why = str(fails(perception.CheckRunner(), services, prompt="Is it?"))
    assert "the camera of the robot cannot be used: this run has no robot" in why
    assert why.endswith("right before this one")
    nothing = fails(perception.CheckRunner(), services, text="a")
    assert str(nothing) == "there is no question: 'prompt' is empty"
    with pytest.raises(RunnerError, match="--model"):
        act(perception.CheckRunner(), {}, prompt="Is it?", text="a")


@pytest.mark.parametrize(
    ("text", "answer"),
    [("Yes please.", "yes"), ("No, thanks.", "no"), ("Well.", "unclear")],
)
def test_a_text_in_a_world(text: str, answer: str) -> None:
    ran = run(plan(runner("Check", prompt="Is it so?", text=text), INSTEAD), field_of())
    assert ran.outputs[0]["answer"] == answer
    assert (1 in ran.outputs) is (answer != "yes")
