"""The runners that a world file speaks of, and the capabilities that are chosen."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gpsfsm.capabilities.library import Library
from gpsfsm.errors import ConfigError
from gpsfsm.model.capability import Interface, Output, Provider, SemanticInterface
from gpsfsm.simulation.load import load_world, read_world
from tests.simulation.support import LIBRARY

SMALL = Library(
    (Interface("p/Grasp", formerly=("old/Grasp",)), Interface("p/Look")),
    (
        Provider("p/gripper", "p/Grasp", described=True, outputs=(Output("width"),)),
        Provider("p/Look", "p/Look"),
    ),
    (SemanticInterface("p/Carefully", "p/Grasp"),),
)


def complaint(text, library=LIBRARY):
    """What is said about a file, without its name."""
    with pytest.raises(ConfigError) as caught:
        read_world(f"world: w\n{text}".encode(), file="w", library=library)
    return str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "runners: {SpeechRunner: {fails: 1}, perception_capabilities/SpeechRunner: {fails: 0}}",
        "runners: {my_robot/GraspRunner: {fails: 1}}",
        "answers: [{to: HttpRunner, outputs: {status_code: 404}, fails: no}]",
        "answers: [{to: my_robot/GraspRunner, outputs: {anything: 1}}]",
    ],
)
def test_names_that_are_known_or_that_nobody_describes(text):
    world = read_world(f"world: w\n{text}".encode(), library=LIBRARY)
    assert world.settings or world.answers


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        (
            "runners: {SpeachRunner: {fails: 1}}",
            "w:2:11: error: no interface is called 'SpeachRunner'",
            "did you mean 'SpeechRunner'? Else give the folder of its capability file",
        ),
        (
            "runners: {perception_capabilities/SpeachRunner: {fails: 1}}",
            "w:2:11: error: no interface is called 'perception_capabilities/SpeachRunner'",
            "did you mean 'perception_capabilities/SpeechRunner'?",
        ),
        (
            "answers: [{text: b, to: HtpRunner}]",
            "w:2:21: error: no interface is called 'HtpRunner'",
            "did you mean 'HttpRunner'?",
        ),
        (
            "runners: {Xyz: {fails: 1}}",
            "no interface is called 'Xyz'",
            "    give the folder of its capability file with --capabilities, or write it with its",
        ),
        (
            "answers: [{to: HttpRunner, outputs: {statuscode: 4}}]",
            "w:2:38: error: 'HttpRunner' has no output 'statuscode' when it succeeds",
            "did you mean 'status_code'?",
        ),
    ],
)
def test_names_that_no_run_looks_up(text, message, hint):
    said = complaint(text)
    assert message in said
    assert hint in said


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("old/Grasp", "it is called 'p/Grasp' here"),
        ("p/Carefully", "write 'p/Grasp', which it redefines"),
        ("p/gripper", "that is a provider; write its interface, 'p/Grasp'"),
        ("p/Zzzzzzzzz", "give the folder of its capability file with --capabilities"),
    ],
)
def test_other_names_of_what_is_meant(name, hint):
    assert hint in complaint(f"runners: {{{name}: {{fails: 1}}}}", SMALL)


def test_outputs_are_judged_where_they_are_declared():
    assert "the outputs are width" in complaint("answers: [{to: Grasp, outputs: {zzz: 1}}]", SMALL)
    assert "no output 'width' when it fails" in complaint(
        "answers: [{to: Grasp, fails: no, outputs: {width: 1}}]", SMALL
    )
    read = read_world(b"world: w\nanswers: [{to: Look, outputs: {zzz: 1}}]", library=SMALL)
    assert read.answers[0].outputs == {"zzz": 1}


def test_in_a_complete_library_nothing_is_taken_on_trust():
    text = "runners: {my_robot/GraspRunner: {fails: 1}}"
    assert "no interface is called" in complaint(text, replace(SMALL, complete=True))


def test_a_file_is_judged_like_its_content(tmp_path):
    file = tmp_path / "w.yaml"
    file.write_text("world: w\nrunners: {SpeachRunner: {fails: 1}}\n")
    assert load_world(file).settings
    with pytest.raises(ConfigError, match="did you mean 'SpeechRunner'"):
        load_world(file, library=LIBRARY)
