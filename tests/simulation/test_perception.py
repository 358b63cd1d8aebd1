"""Seeing, hearing and speaking in a world."""

from __future__ import annotations

import math

import pytest

from gpsfsm.execution.records import Status
from gpsfsm.simulation.world import (
    Answer,
    Obstacle,
    Person,
    Rectangle,
    Reply,
    Settings,
    Sound,
    Stay,
    Window,
    WorldObject,
)
from tests.simulation.support import control, field_of, plan, run, runner

ADA = Person(
    "Ada",
    looks="a woman",
    stays=(Stay(3.0, 0.0, Window(0.0, 100.0)),),
    replies=(Reply(("name",), "I am Ada."), Reply((), "Pardon?")),
)
CUP = WorldObject("red cup", 2.0, 0.5)


def sees(prompt, *, wait=0, **world):
    steps = [runner("Wait", seconds=wait)] if wait else []
    ran = run(plan(*steps, runner("ImageAnalysis", prompt=prompt)), field_of(**world))
    return ran.outputs[len(steps)]["text"]


@pytest.mark.parametrize(
    ("prompt", "text"),
    [
        ("Describe it.", "I see a woman and a red cup."),
        ("Is there a person?", "Yes, I see a woman."),
        ("Can you find the red cup?", "Yes, I see a red cup."),
    ],
)
def test_people_and_things_in_view(prompt, text):
    assert sees(prompt, people=(ADA,), things=(CUP,)) == text


def test_nothing_in_view():
    assert sees("Describe it.") == "I see nothing special."
    assert sees("Is there a person?", wait=100, people=(ADA,)) == "No, I see nobody."
    away = WorldObject("red cup", -2.0, 0.5)  # behind the robot
    assert sees("Where is the red cup?", things=(away,)) == "No, I see none."
    assert "cup" in sees("Describe it.", things=(away,), robot={"view": math.tau})


@pytest.mark.parametrize(
    ("obstacle", "seen"),
    [
        (Obstacle(Rectangle(1.0, -1.0, 1.2, 1.0)), False),
        (Obstacle(Rectangle(1.0, -1.0, 1.2, 1.0), low=True), True),
        (Obstacle(Rectangle(1.0, -1.0, 1.2, 1.0), window=Window(50.0, 60.0)), True),
        (Obstacle(Rectangle(1.0, 1.0, 1.2, 2.0)), True),
    ],
)
def test_walls_hide_what_is_behind_them(obstacle, seen):
    ran = run(
        plan(runner("ImageAnalysis", prompt="Is a person here?")), field_of(obstacle, people=(ADA,))
    )
    assert ran.outputs[0]["text"].startswith("Yes") is seen


def test_the_file_answers_before_the_eyes():
    shelf = Answer(
        "ImageAnalysisRunner", ("SHELF",), "Two slots are empty.", area=Rectangle(0, 0, 1, 1)
    )
    assert sees("Is the shelf full?", answers=(shelf,)) == "Two slots are empty."
    elsewhere = Answer("ImageAnalysisRunner", text="A beach.", area=Rectangle(4, 4, 5, 5))
    assert sees("Describe it.", answers=(elsewhere,)) == "I see nothing special."


def test_somebody_who_is_asked_replies():
    ran = run(
        plan(
            runner("Speech", text="What is your NAME?"),
            runner("Transcribe", audio_request_window=5),
        ),
        field_of(people=(ADA,)),
    )
    assert ran.status is Status.COMPLETED
    assert ran.outputs[1] == {"text": "I am Ada.", "success": True}
    assert ran.said == ["What is your NAME?"]


def test_the_first_reply_that_fits_counts():
    ran = run(
        plan(runner("Speech", text="Hello"), runner("Transcribe", audio_request_window=5)),
        field_of(people=(ADA,)),
    )
    assert ran.outputs[1]["text"] == "Pardon?"


@pytest.mark.parametrize("change", [{"robot": {"hears_within": 2.0}}, {"people": ()}])
def test_silence_is_a_failure(change):
    world = field_of(**{"people": (ADA,), **change})
    ran = run(
        plan(runner("Speech", text="name?"), runner("Transcribe", audio_request_window=5)), world
    )
    assert ran.status is Status.GAVE_UP
    assert ran.messages[1] == "nothing was heard"


def test_only_the_words_that_fall_into_the_window_are_heard():
    sounds = (Sound("one two three four", 2.0, 6.0), Sound("never", 500.0, 501.0))
    ran = run(plan(runner("Transcribe", audio_request_window=4)), field_of(sounds=sounds))
    assert ran.outputs[0]["text"] == "one two"  # their middles are at 2.5 and 3.5 s


def test_sounds_with_a_place_are_heard_nearby_only():
    near, far = Sound("near", 0.0, 1.0, 2.0, 0.0), Sound("far", 0.0, 1.0, 4.0, 4.0)
    ran = run(plan(runner("Transcribe", audio_request_window=4)), field_of(sounds=(far, near)))
    assert ran.outputs[0]["text"] == "near"


def test_speaking_takes_as_long_as_the_words():
    world = field_of(settings={"SpeechRunner": Settings(duration_s=(0.0, 0.0))})
    ran = run(plan(runner("Speech", text="one two three four five")), world)
    assert ran.seconds == pytest.approx(2.0, abs=0.01)


def test_an_empty_text_cannot_be_said():
    ran = run(plan(runner("Speech", text=" ")), field_of())
    assert "empty" in ran.messages[0]
    assert ran.said == []


@pytest.mark.parametrize(
    ("text", "mood"),
    [
        ("I am very happy, thanks!", "positive"),
        ("This is terrible.", "negative"),
        ("The box is blue.", "neutral"),
        ("good and bad", "neutral"),
    ],
)
def test_moods(text, mood):
    ran = run(plan(runner("Sentiment", text=text)), field_of())
    assert ran.outputs[0]["text"] == mood
    assert ran.outputs[0]["analyzed_text"] == text
    assert 0.5 <= ran.outputs[0]["score"] <= 1.0


def test_without_a_text_the_mood_of_what_is_heard_counts():
    sounds = (Sound("I hate this", 1.0, 2.0),)
    listening = plan(runner("Sentiment", audio_request_window=3))
    assert run(listening, field_of(sounds=sounds)).outputs[0]["text"] == "negative"
    assert run(listening, field_of()).status is Status.GAVE_UP


def test_what_is_heard_flows_on():
    sounds = (Sound("thank you", 1.0, 2.0),)
    text = plan(runner("Transcribe", audio_request_window=3), runner("Sentiment"))
    assert run(text, field_of(sounds=sounds)).outputs[1]["text"] == "positive"


def checked(prompt, **world):
    instead = control("recovery", runner("Wait", seconds="1"))
    ran = run(plan(runner("Check", prompt=prompt), instead), field_of(**world))
    return ran.outputs.get(0, {}).get("answer"), ran.messages[0]


@pytest.mark.parametrize(
    ("prompt", "answer"),
    [
        ("Is there a person?", "yes"),
        ("Is there a red cup?", "yes"),
        ("Is there a bear?", "unclear"),
    ],
)
def test_a_check_sees_what_an_analysis_sees(prompt, answer):
    assert checked(prompt, people=(ADA,), things=(CUP,))[0] == answer
    said = sees(prompt, people=(ADA,), things=(CUP,))
    assert said.startswith("Yes") is (answer == "yes")


def test_a_check_of_nothing_in_view_fails():
    assert checked("Is there a person?") == ("no", "the answer is no: No, I see nobody.")


def test_answers_of_the_file_decide_a_check():
    analysis = Answer("ImageAnalysisRunner", words=("door",), text="Yes, it is open.")
    assert checked("Is the door open?", answers=(analysis,))[0] == "yes"
    assert checked("Is the lamp on?", answers=(analysis,))[0] == "unclear"
    own = Answer("CheckRunner", words=("door",), text="no")
    assert checked("Is the door open?", answers=(analysis, own))[0] == "no"
    broken = Answer("ImageAnalysisRunner", fails="The camera is off.")
    assert checked("Is the door open?", answers=(broken,))[1] == "The camera is off."
