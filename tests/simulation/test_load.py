"""World files: what they mean, and what is said about those that are wrong."""

from __future__ import annotations

import hashlib
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import ConfigError
from gpsfsm.simulation import schema
from gpsfsm.simulation.load import load_world, read_world
from gpsfsm.simulation.state import WorldState
from gpsfsm.simulation.world import (
    Answer,
    Map,
    Obstacle,
    Person,
    Place,
    Rectangle,
    Reply,
    Robot,
    Settings,
    Sound,
    Stay,
    Thing,
    Window,
    World,
)
from tests.conftest import REPO

WHOLE = b"""
world: test
description: everything once
map:
  x: [0, 4]
  y: [0, 2]
  resolution: 0.5
  obstacles:
    - {name: door, x: [2, 1], y: [0, 2], from: 10, until: 20, low: true}
robot:
  {x: 1, y: 1, yaw: 180, radius: 0.3, speed: 2, turn_speed: 90, sees_within: 3, view: 360,
   hears_within: 4, words_per_s: 2, patience: 9}
places: [{name: dock, x: 1, y: 1}]
people:
  - {name: Ada, x: 3, y: 1, replies: [{asked: name, says: Ada}, {asked: [a, b], says: c}]}
  - {name: Ben, looks: a man, replies_after: 2,
     stays: [{x: 1, y: 2, until: 5}, {x: 2, y: 2, from: 5}]}
things: [{name: cup, x: 1, y: 2, from: 3}]
sounds:
  - {text: ding dong, from: 5}
  - {text: hum, from: 1, until: 9, x: 1, y: 2}
answers:
  - {to: HttpRunner, asked: [GET, "http://a"], text: b, outputs: {status_code: 201, list: [1, x]}}
  - {to: ProcessRunner, fails: broken, x: [0, 1], y: 2, from: 1, until: 2}
runners:
  SpeechRunner: {fails: 0.5, message: hoarse, duration: 2}
  WaitRunner: {duration: [1, 2]}
"""

EXPECTED = World(
    name="test",
    map=Map(
        Rectangle(0, 0, 4, 2),
        0.5,
        (Obstacle(Rectangle(1, 0, 2, 2), "door", low=True, window=Window(10, 20)),),
    ),
    robot=Robot(1, 1, math.pi, 0.3, 2, math.pi / 2, 3, math.tau, 4, 2, 9),
    places=(Place("dock", 1, 1),),
    people=(
        Person(
            "Ada",
            stays=(Stay(3, 1),),
            replies=(Reply(("name",), "Ada"), Reply(("a", "b"), "c")),
        ),
        Person(
            "Ben",
            "a man",
            stays=(Stay(1, 2, Window(0, 5)), Stay(2, 2, Window(5))),
            replies_after_s=2,
        ),
    ),
    things=(Thing("cup", 1, 2, Window(3)),),
    sounds=(Sound("ding dong", 5, 6), Sound("hum", 1, 9, 1, 2)),
    answers=(
        Answer("HttpRunner", ("GET", "http://a"), "b", {"status_code": 201, "list": [1, "x"]}),
        Answer("ProcessRunner", fails="broken", area=Rectangle(0, 2, 1, 2), window=Window(1, 2)),
    ),
    settings={
        "SpeechRunner": Settings(0.5, "hoarse", (2, 2)),
        "WaitRunner": Settings(duration_s=(1, 2)),
    },
    digest=hashlib.sha256(WHOLE).hexdigest(),
)


def test_everything_that_a_file_can_say():
    assert read_world(WHOLE) == EXPECTED


def test_the_least_that_a_file_can_say():
    world = read_world(b"world: empty")
    assert world.map == Map(Rectangle(-10, -10, 10, 10))
    assert world.robot == Robot()


def test_a_drawn_map_is_upside_up():
    world = read_world(
        b"""
world: drawn
map:
  origin: [-1, 0]
  resolution: 0.25
  rows: |
    ##..
    ##.#
    ...#
robot: {x: 0, y: 0.1}
"""
    )
    assert world.map.area == Rectangle(-1, 0, 0, 0.75)
    areas = {obstacle.area for obstacle in world.map.obstacles}
    assert areas == {Rectangle(-1, 0.25, -0.5, 0.75), Rectangle(-0.25, 0, 0, 0.5)}


MAP = b"map: {x: [-5, 5], y: [-5, 5]}\n"
WRONG = {
    b"": ("1:1", "the file is empty"),
    b"places: []\n": ("1:1", "has no 'world'"),
    b"world: w\nmap: 1\n": ("2:1", "'map' must be a mapping"),
    b"world: w\nmap: {x: [0, 1]}\n": ("2:1", "the map has no area"),
    b"world: w\nmap: {x: [1, 0], y: [0, 1]}\n": ("2:7", "the area of the map is empty"),
    b"world: w\nmap: {x: [0, 1e9], y: [0, 1]}\n": ("2:1", "reaches further"),
    b"world: w\nmap: {x: [0, 900], y: [0, 900]}\n": ("2:1", "81000000 cells"),
    b"world: w\nmap: {x: [0, 9], y: [0, 9], resolution: 0}\n": ("2:29", "'resolution' must be"),
    b"world: w\nmap: {x: [0, 9], y: [0, 9], resolution: 1}\n": ("2:29", "the width of the robot"),
    b"world: w\nmap: {x: [1, 9], y: [0, 9]}\n": ("2:1", "does not start on the map"),
    b"world: w\nmap: {rows: '#x#'}\n": ("2:7", "not 'x'"),
    b"world: w\nmap: {rows: '', x: 1}\n": ("2:7", "the map has no rows"),
    b"world: w\nrobot: {speed: 0}\n": ("2:9", "'speed' must be between"),
    b"world: w\nrobot: {speed: .nan}\n": ("2:9", "'robot.speed' must be a finite number"),
    b"world: w\nrobot: {sped: 1}\n": ("2:9", "the key 'sped' is not known here"),
    b"world: w\npeople: [{name: A}]\n": ("2:10", "'A' is nowhere"),
    b"world: w\npeople: [{name: A, x: 1}]\n": ("2:10", "only one of 'x' and 'y'"),
    b"world: w\npeople: [{x: 1, y: 1}]\n": ("2:10", "has no 'name'"),
    b"world: w\nthings: [{name: A, x: 1, y: 1, from: 2, until: 2}]\n": (
        "2:41",
        "later than 'from'",
    ),
    b"world: w\nsounds: [{text: a}]\n": ("2:10", "has no 'from'"),
    b"world: w\nsounds: [{text: a, from: 2, until: 1}]\n": ("2:29", "later than 'from'"),
    b"world: w\nanswers: [{to: a, fails: b, text: c}]\n": (
        "2:19",
        "an answer that fails has a text",
    ),
    b"world: w\nanswers: [{to: a, outputs: {b: {}}}]\n": ("2:29", "the output 'b' must be"),
    b"world: w\nanswers: [{to: a, asked: {}}]\n": ("2:19", "must be a text or a list of texts"),
    b"world: w\nrunners: {A: {fails: 2}}\n": ("2:15", "must be a probability"),
    b"world: w\nrunners: {A: {duration: [2, 1]}}\n": ("2:15", "must be [least, greatest]"),
    b"world: &a w\nmap: *a\n": ("1:8", "the anchor '&a' is not allowed"),
    b"world: !!python/object/apply:os.system [x]\n": ("1:8", "is not allowed"),
    b"world: [": ("1:", "this is not YAML"),
    b"world: \xff": ("1:1", "this is not UTF-8"),
    b"world: " + b"[" * 60 + b"]" * 60: ("1:", "levels deep"),
    b"world: w\n" + b"#" * (1 << 20): ("1:1", "larger than"),
}


@pytest.mark.parametrize("content", WRONG, ids=lambda content: content[9:40].decode("latin-1"))
def test_what_is_wrong_is_said_with_its_place(content):
    place, message = WRONG[content]
    with pytest.raises(ConfigError) as caught:
        read_world(content, file="w.yaml")
    first = str(caught.value).splitlines()[0]
    assert first.startswith(f"w.yaml:{place}")
    assert ": error: " in first
    assert message in first


@given(st.data())
def test_damaged_files_are_refused_or_read(data):
    content = bytearray(WHOLE)
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(content) - 1))
        part = data.draw(
            st.sampled_from([b"", b"[", b"}", b": ", b"-9", b"1e400", b"\n", b"x", b","])
        )
        content[place : place + data.draw(st.integers(0, 3))] = part
    try:
        world = read_world(bytes(content))
    except ConfigError as error:
        assert str(error).startswith("<world>:")  # noqa: PT017
    else:
        state = WorldState(world)
        pose = state.pose(0.0)
        assert (pose.x, pose.y) == (world.robot.x, world.robot.y)
        state.way(0.0, 3.0, 1.0)
        state.say(3.0, "what is your name?")
        assert isinstance(state.heard(0.0, 100.0), str)


def test_a_file_with_many_mistakes_is_told_in_few_lines():
    content = b"world: w\n" + b"".join(b"k%d: 1\n" % n for n in range(90))
    with pytest.raises(ConfigError) as caught:
        read_world(content)
    assert "and 70 more" in str(caught.value)
    assert len(str(caught.value).splitlines()) < 50


def test_too_many_obstacles():
    content = b"world: w\n" + MAP.rstrip(b"}\n") + b", obstacles: ["
    content += b"{x: 1, y: 1}," * 2001 + b"]}\n"
    with pytest.raises(ConfigError, match="2001 obstacles"):
        read_world(content)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read"):
        load_world(tmp_path / "none.yaml")
    with pytest.raises(ConfigError, match="not a regular file"):
        load_world(tmp_path)


@pytest.mark.parametrize(
    "path", sorted((REPO / "corpus" / "worlds").glob("*.yaml")), ids=lambda path: path.stem
)
def test_the_worlds_of_the_corpus_are_right(path):
    world = load_world(path)
    assert world.name == path.stem
    assert world.places


def test_the_examples_of_the_documentation_are_right():
    text = (REPO / "docs" / "worlds.md").read_text("utf-8")
    whole, drawn, settings = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert read_world(whole.encode()).people[0].name == "Ada"
    assert read_world(f"world: w\n{drawn}".encode()).map.obstacles
    assert read_world(f"world: w\n{settings}".encode()).settings["SpeechRunner"].fails == 0.2


def test_the_documentation_names_every_key():
    text = (REPO / "docs" / "worlds.md").read_text("utf-8")
    models = (schema.MapFile, schema.RobotFile, schema.PersonFile, schema.AnswerFile)
    keys = {key for model in models for key in model.model_fields} - {"from_"}
    assert [key for key in sorted(keys) if f"`{key}`" not in text and f"{key}:" not in text] == []
