"""The section ``ros`` of a provider file: what it means, and what is wrong with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.load import load_directories
from gpsfsm.capabilities.table import builtin, dump
from gpsfsm.capabilities.table import load as load_table
from gpsfsm.model.ros import (
    Comparison,
    Condition,
    Durability,
    OnResume,
    Quality,
    Reliability,
    RosCall,
    RosKind,
)

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.capabilities.load import Loaded

FILE = """name: demo/Go
spec_type: provider
spec_version: 1.2
implements: demo/Go
ros:
{section}
definition:
  configuration_parameters:
    - {{name: x, type: double}}
    - {{name: frame, type: string, optional: true}}
  runtime_parameters:
    input: []
    output:
      - {{name: text, type: string}}
"""
INTERFACE = "name: demo/Go\nspec_type: interface\nspec_version: 1.2\n"
TOPIC = "  topic: go\n  type: demo_msgs/msg/Go\n"
ACTION = "  action: go\n  type: demo_msgs/action/Go\n"


def loaded(folder: Path, section: str) -> Loaded:
    for kind, text in (("providers", FILE.format(section=section)), ("interfaces", INTERFACE)):
        file = folder / "demo" / kind / "Go.yaml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return load_directories([folder])


def call(folder: Path, section: str) -> RosCall:
    result = loaded(folder, section)
    assert [str(defect) for defect in result.defects] == []
    provider = result.library.provider("demo/Go")
    assert provider is not None
    assert provider.ros is not None
    return provider.ros


def test_an_action_with_everything(tmp_path: Path) -> None:
    described = call(
        tmp_path,
        ACTION
        + "  request: {pose.x: $x, frame: map, ready: true, 'a[].b': 1.5}\n"
        + "  optional: [frame]\n  feedback: {distance_left_m: left}\n  pose: at.pose\n"
        + "  outputs: {text: result.words}\n  success: {code: 0}\n  message: words\n"
        + "  deadline: 60\n  silence: 5\n  wait: 1\n  probe: 0.5\n  on_resume: continue\n",
    )
    assert described == RosCall(
        kind=RosKind.ACTION,
        name="go",
        types=("demo_msgs/action/Go",),
        request=(("pose.x", "$x"), ("frame", "map"), ("ready", True), ("a[].b", 1.5)),
        optional=("frame",),
        outputs=(("text", "result.words"),),
        feedback=(("distance_left_m", "left"),),
        pose="at.pose",
        success=((Condition("code", Comparison.IS, 0),),),
        message="words",
        deadline_s=60.0,
        silence_s=5.0,
        wait_s=1.0,
        probe_s=0.5,
        on_resume=OnResume.CONTINUE,
    )


@pytest.mark.parametrize(
    ("section", "kind", "deadline_s"),
    [
        (ACTION, RosKind.ACTION, 0.0),
        ("  service: go\n  type: [a_msgs/srv/Go, b_msgs/srv/Go]\n", RosKind.SERVICE, 30.0),
        ("  topic: /map\n  type: nav_msgs/msg/OccupancyGrid\n", RosKind.TOPIC, 30.0),
        ("  transform: [map, $frame]\n", RosKind.TRANSFORM, 5.0),
    ],
)
def test_deadlines_that_hold_without_one(
    tmp_path: Path, section: str, kind: RosKind, deadline_s: float
) -> None:
    described = call(tmp_path, section)
    assert (described.kind, described.deadline_s) == (kind, deadline_s)


def test_lists_and_conditions(tmp_path: Path) -> None:
    described = call(
        tmp_path,
        ACTION
        + "  request: {'a[].name': [left, $frame], 'a[].at': [[0, 1], [2, $x]]}\n"
        + "  outputs: {text: 'a[best by b[first].score].name'}\n"
        + "  success: [{reached: true, 'a[]': '>= 2'}, {effort: '<$x', left: '!= 0.5'}]\n",
    )
    assert described.request == (
        ("a[].name", ("left", "$frame")),
        ("a[].at", ((0, 1), (2, "$x"))),
    )
    assert described.outputs == (("text", "a[best by b[first].score].name"),)
    assert described.success == (
        (
            Condition("reached", Comparison.IS, True),
            Condition("a[]", Comparison.AT_LEAST, 2.0),
        ),
        (
            Condition("effort", Comparison.BELOW, "$x"),
            Condition("left", Comparison.IS_NOT, 0.5),
        ),
    )


def test_a_watch_of_a_topic(tmp_path: Path) -> None:
    described = call(
        tmp_path,
        TOPIC
        + "  until: [{data: true}, {level: '< $x'}]\n  feedback: {level: level}\n"
        + "  qos: {reliability: best_effort, durability: transient_local, depth: 5}\n"
        + "  max_age: 2.5\n  silence: 1\n",
    )
    assert described == RosCall(
        kind=RosKind.TOPIC,
        name="go",
        types=("demo_msgs/msg/Go",),
        feedback=(("level", "level"),),
        until=(
            (Condition("data", Comparison.IS, True),),
            (Condition("level", Comparison.BELOW, "$x"),),
        ),
        qos=Quality(Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL, 5),
        max_age_s=2.5,
        silence_s=1.0,
    )
    library = loaded(tmp_path, TOPIC + "  until: {a: 1}\n  qos: {depth: 3}\n").library
    assert load_table(dump(library)) == library


def test_frames(tmp_path: Path) -> None:
    one = call(tmp_path, "  transform: [map, $frame]\n")
    two = call(tmp_path, "  transform: [[map, $frame], [odom, base]]\n")
    assert one.frames == (("map", "$frame"),)
    assert two.frames == (("map", "$frame"), ("odom", "base"))


@pytest.mark.parametrize(
    ("section", "line", "message"),
    [
        ("  type: demo_msgs/action/Go\n", 5, "must have one of the keys action, service, topic"),
        (ACTION + "  service: go\n", 5, "must have one of the keys"),
        ("  action: go there\n  type: a_msgs/action/Go\n", 6, "'go there' is not a valid ROS name"),
        ("  action: go\n", 5, "the action has no 'type'"),
        ("  action: go\n  type: os/system\n", 7, "'os/system' is not a definition of an action"),
        ("  action: go\n  type: a_msgs/srv/Go\n", 7, "is not a definition of an action"),
        ("  action: go\n  type: {a: b}\n", 7, "'ros.type' must be the name of a definition"),
        (ACTION + "  request: {x: $y}\n", 8, "there is no parameter 'y'"),
        (ACTION + "  request: {x: [1, {a: 2}]}\n", 8, "it is not a value"),
        (ACTION + "  request: {x: [1, [$y]]}\n", 8, "there is no parameter 'y'"),
        (ACTION + "  request: {x: $y.qz}\n", 8, "there is no parameter 'y'"),
        (ACTION + "  request: {x: $x.yaw}\n", 8, "there is no parameter 'x.yaw'"),
        (ACTION + "  request:\n    x: []\n", 9, "the list is empty"),
        (ACTION + "  request: {'a[first].b': 1}\n", 8, "'a[first].b' is not a field"),
        (ACTION + "  success: {x: [1]}\n", 8, "it is not a value"),
        (ACTION + "  success: {x: '> far'}\n", 8, "'> far' is not a comparison"),
        (ACTION + "  success: {x: '< $y'}\n", 8, "there is no parameter 'y'"),
        (ACTION + "  success: [{x: 1}, 2]\n", 8, "must be what fields must be"),
        (ACTION + "  success: []\n", 8, "must be what fields must be"),
        (ACTION + "  success: {'a[].b': 1}\n", 8, "'a[].b' is not a field"),
        (ACTION + "  outputs: {text: 'a[best].b'}\n", 8, "'a[best].b' is not a field"),
        (ACTION + "  outputs: {text: 'a[best by b[].c].d'}\n", 8, "is not a field"),
        (ACTION + "  request: {__class__: 1}\n", 8, "'__class__' is not a field"),
        (ACTION + "  outputs: {words: x}\n", 8, "there is no output 'words'"),
        (ACTION + "  outputs: {text: a b}\n", 8, "'a b' is not a field"),
        (ACTION + "  qos: {depth: 5}\n", 8, "'qos' has no effect for an action"),
        (ACTION + "  until: {x: 1}\n", 8, "'until' has no effect for an action"),
        (TOPIC + "  latched: true\n", 8, "latched"),
        (TOPIC + "  qos: {reliability: relaible}\n", 8, "'relaible' is not a reliability"),
        (TOPIC + "  qos: {durability: kept}\n", 8, "'kept' is not a durability"),
        (TOPIC + "  qos: {history: keep_all}\n", 8, "history"),
        (TOPIC + "  qos: {depth: 0}\n", 8, "'depth' must be a whole number from 1"),
        (TOPIC + "  qos: {depth: 1.5}\n", 8, "'depth' must be a whole number from 1"),
        (TOPIC + "  qos: best_effort\n", 8, "qos"),
        (TOPIC + "  until: []\n", 8, "must be what fields must be"),
        (TOPIC + "  until: {data: '> $y'}\n", 8, "there is no parameter 'y'"),
        (TOPIC + "  until: {'a[].b': 1}\n", 8, "'a[].b' is not a field"),
        (TOPIC + "  max_age: 0\n", 8, "'max_age' must be more than 0"),
        (TOPIC + "  max_age: 1.0e+9\n", 8, "'max_age' must be from 0 to"),
        (TOPIC + "  feedback: {a: b}\n", 8, "'feedback' has no effect for a topic without 'until'"),
        (ACTION + "  probe: 0\n", 8, "'probe' must be more than 0"),
        (ACTION + "  deadline: -1\n", 8, "'deadline' must be from 0 to"),
        (ACTION + "  on_resume: cancle\n", 8, "'cancle' is not a choice"),
        (ACTION + "  goal: {x: 1}\n", 8, "goal"),
        ("  service: go\n  type: a_msgs/srv/Go\n  silence: 3\n", 8, "'silence' has no effect"),
        ("  transform: [map]\n", 6, "must be two frames in brackets"),
        ("  transform: [map, $robot]\n", 6, "there is no parameter 'robot'"),
        ("  transform: [map, base]\n  on_resume: continue\n", 7, "no effect for a transform"),
        ("  transform: [map, base]\n  outputs: {text: yaw}\n", 7, "a transform has no 'yaw'"),
    ],
)
def test_what_is_wrong_is_said_where_it_stands(
    tmp_path: Path, section: str, line: int, message: str
) -> None:
    texts = [str(defect) for defect in loaded(tmp_path, section).defects]
    assert any(f"Go.yaml:{line}:" in text and message in text for text in texts), texts


def test_the_built_in_runners_that_act_on_a_robot() -> None:
    named = {each.name: each.ros.name for each in builtin().providers if each.ros is not None}
    assert named == {
        "nav2_capabilities/OccupancyGridRunner": "map",
        "nav2_capabilities/RobotPoseRunner": "",
        "nav2_capabilities/WaypointRunner": "navigate_to_pose",
        "nav2_capabilities/WaypointYawRunner": "navigate_to_pose",
        "perception_capabilities/ImageAnalysisRunner": "perception/image_analysis",
        "perception_capabilities/SentimentRunner": "perception/sentiment_analysis",
        "perception_capabilities/SpeechRunner": "perception/speech",
        "perception_capabilities/TranscribeRunner": "perception/transcription",
    }
