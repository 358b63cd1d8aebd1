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
from gpsfsm.simulation.base import WorldState
from gpsfsm.simulation.load import load_world, read_world
from gpsfsm.simulation.world import (
    Answer,
    Change,
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
    Window,
    World,
    WorldObject,
    Zone,
)
from tests.conftest import REPO
from tests.simulation.support import LIBRARY

WHOLE = b"""
world: test
description: everything once
map:
  x: [0, 4]
  y: [0, 2]
  resolution: 0.5
  obstacles:
    - {name: door, x: [2, 1], y: [0, 2], from: 10, until: 20, low: true}
  zones:
    - {name: ramp, x: [3, 4], y: [1, 0]}
    - {name: lift, x: [2, 3], y: [0, 1], closed: true}
robot:
  {x: 1, y: 1, yaw: 180, radius: 0.3, speed: 2, turn_speed: 90, sees_within: 3, view: 360,
   hears_within: 4, words_per_s: 2, patience: 9}
changes:
  - {at: 30, close: ramp}
  - {after_arrivals: 2, close: [ramp], open: [lift]}
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
        (Zone("ramp", Rectangle(3, 0, 4, 1)), Zone("lift", Rectangle(2, 0, 3, 1), closed=True)),
    ),
    robot=Robot(1, 1, math.pi, 0.3, 2, math.pi / 2, 3, math.tau, 4, 2, 9),
    changes=(
        Change("ramp", closed=True, at_s=30),
        Change("ramp", closed=True, after_arrivals=2),
        Change("lift", closed=False, after_arrivals=2),
    ),
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
    things=(WorldObject("cup", 1, 2, Window(3)),),
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
MAP_OF = b"world: w\nmap: {x: [0, 5], y: [0, 5]"
WRONG = {
    b"": ("1:1", "the file is empty"),
    b"places: []\n": ("1:1", "has no 'world'"),
    b"world: w\nmap: 1\n": ("2:1", "'map' must be a mapping"),
    b"world: w\nmap: {x: [0, 1]}\n": ("2:1", "the map has no area"),
    b"world: w\nmap: {x: [1, 0], y: [0, 1]}\n": ("2:7", "the area of the map is empty"),
    b"world: w\nmap: {x: [0, 1], y: [1, 1]}\n": ("2:18", "the area of the map is empty"),
    b"world: w\nmap: {x: [0, 1], y: [0, 0.3]}\n": ("2:1", "is narrower than the robot"),
    b"world: w\nmap: {x: [a, 1], y: [0, 1]}\n": ("2:11", "'map.x[1]' must be a finite number"),
    b"world:\n": ("1:1", "'world' is empty"),
    b"- world\n": ("1:1", "the file holds a list"),
    b"world: w\nmap:\n\tx: 1\n": ("3:1", "found character '\\t'"),
    b"world: w\nworld: v\n": ("2:1", "is here twice"),
    MAP_OF + b", obstacles: [{x: [7, 8], y: [0, 1]}]}\n": (
        "2:41",
        "this obstacle is not on the map",
    ),
    MAP_OF + b", obstacles: [{x: 1, y: [0, 1], name: a}]}\n": ("2:42", "'a' has no width"),
    MAP_OF + b", obstacles: [{x: [0, 1], y: [0, 1], name: a}]}\nrobot: {y: 0.5, x: 0.5}\n": (
        "3:17",
        "the robot starts in the obstacle 'a', at (0.5, 0.5)",
    ),
    MAP_OF + b"}\nrobot: {x: 6}\n": ("3:9", "does not start on the map: it starts at (6, 0)"),
    MAP_OF + b"}\nthings: [{name: a, x: 6, y: 1}]\n": ("3:10", "'a' is not on the map: (6, 1)"),
    MAP_OF + b"}\nplaces: [{name: a, x: 1, y: 6}]\n": ("3:10", "the place 'a' is not on the map"),
    MAP_OF + b", obstacles: [{x: [0, 1], y: [1, 2]}]}\npeople: [{name: A, x: 0.5, y: 1.5}]\n": (
        "3:10",
        "'A' stands in an obstacle",
    ),
    MAP_OF + b", zones: [{name: a, x: [1, 2], y: [1, 2]}]}\nchanges: [{at: 1, close: b}]\n": (
        "3:19",
        "no zone is called 'b'",
    ),
    b"world: w\nchanges: [{close: a}]\n": ("2:11", "one of 'at' and 'after_arrivals'"),
    b"world: w\nchanges: [{at: 1, after_arrivals: 1, close: a}]\n": ("2:11", "needs one of"),
    b"world: w\nchanges: [{at: 1}]\n": ("2:11", "must close or open a zone"),
    b"world: w\nchanges: [{at: -1, close: a}]\n": ("2:12", "'at' must be between 0 and"),
    b"world: w\nchanges: [{after_arrivals: 0, close: a}]\n": ("2:12", "must be a whole number"),
    b"world: w\nchanges: [{after_arrivals: 1.5, close: a}]\n": ("2:12", "a whole number"),
    b"world: w\nplaces: [{name: a, x: 1, y: 1}, {name: a, x: 2, y: 2}]\n": (
        "2:34",
        "a place called 'a' is here twice, first in line 2",
    ),
    b"world: w\npeople: [{name: a, x: 1, y: 1}, {name: a, x: 2, y: 2}]\n": (
        "2:34",
        "is here twice",
    ),
    b"world: w\nmap:\n  resolution: 0.3\n  rows: |\n    ...\n    .o.\n": ("6:6", "not 'o'"),
    b"world: w\nmap:\n  resolution: 0.3\n  rows: |\n    ...\n    ..\n": (
        "6:7",
        "row 2 of the map has 2 characters, the first has 3",
    ),
    b"world: w\nmap:\n  resolution: 0.3\n  rows: |\n    ...\n    ....\n": ("6:8", "4 characters"),
    b"world: w\nmap:\n  resolution: 0.3\n  rows: |\n    ...\n\n    ...\n": ("4:3", "0 characters"),
    b"world: w\nthings: [{name: a, x: 0.9, y: 0.1}]\nmap: {resolution: 0.4, rows: '..#'}\n": (
        "2:10",
        "'a' is in a wall of the drawing",
    ),
    b"world: w\nrunners: {A: {fails: -0.5}}\n": ("2:15", "must be a probability"),
    b"world: w\nrunners: {A: {duration: -1}}\n": ("2:15", "must be [least, greatest]"),
    b"world: w\nrunners: {A: }\n": ("2:11", "'runners.A' must be a mapping"),
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


def refusal(content: bytes, **options: str) -> str:
    """What is said about a file that is wrong."""
    with pytest.raises(ConfigError) as caught:
        read_world(content, **options)
    return str(caught.value)


@pytest.mark.parametrize("content", WRONG, ids=lambda content: content[9:40].decode("latin-1"))
def test_what_is_wrong_is_said_with_its_place(content):
    place, message = WRONG[content]
    first = refusal(content, file="w.yaml").splitlines()[0]
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
        state.route(0.0, 3.0, 1.0)
        state.say(3.0, "what is your name?")
        assert isinstance(state.heard(0.0, 100.0), str)


def test_a_file_with_many_mistakes_is_told_in_few_lines():
    content = b"world: w\n" + b"".join(b"k%d: 1\n" % n for n in range(90))
    said = refusal(content)
    assert "and 70 more" in said
    assert len(said.splitlines()) < 50


@pytest.mark.parametrize(
    ("content", "hint"),
    [
        (b"", "describe a world in it, or remove it"),
        (b"---\nworld: a\n---\nworld: b\n", "put each world into a file of its own"),
        (b"#" * (1 << 20) + b"\n", "describe a smaller world"),
        (b"world: w\nthings: [" + b"1," * 20_000 + b"]", "describe a smaller world"),
        (b"world: w\nplase: []\n", "did you mean 'places'?"),
        (b"world: w\nzzz: []\n", "the keys are world, description, map"),
        (b"world: w\nthings: [{name: a, x: 1, y: 1, form: 2}]\n", "did you mean 'from'?"),
    ],
    ids=range(7),
)
def test_what_is_said_speaks_of_worlds(content, hint):
    said = refusal(content)
    assert hint in said
    assert "capabilit" not in said


@pytest.mark.parametrize("area", ["x: [0, 0], y: [0, 5]", "rows: 'x'", "x: [5, 6]"])
def test_a_map_that_is_wrong_is_the_only_mistake(area):
    places = "things: [{name: a, x: 5, y: 5}]\nrobot: {x: 3, y: 3}"
    said = refusal(f"world: w\nmap: {{{area}}}\n{places}\n".encode())
    assert said.count("error:") == 1


def test_people_may_sit_and_things_stand_in_shelves():
    world = read_world(
        MAP_OF
        + b""", obstacles: [
  {name: sofa, x: [1, 2], y: [1, 2], low: true},
  {name: shelf, x: [3, 4], y: [1, 2]},
  {name: truck, x: [3, 4], y: [3, 4], from: 10, until: 20}]}
people: [{name: Ada, x: 1.5, y: 1.5}, {name: Ben, stays: [{x: 3.5, y: 3.5, until: 10}]}]
things: [{name: cup, x: 3.5, y: 1.5}]
"""
    )
    assert [person.name for person in world.people] == ["Ada", "Ben"]


def test_too_many_obstacles():
    content = b"world: w\n" + MAP.rstrip(b"}\n") + b", obstacles: ["
    content += b"{x: 1, y: 1}," * 2001 + b"]}\n"
    with pytest.raises(ConfigError, match="2001 obstacles and zones"):
        read_world(content)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read"):
        load_world(tmp_path / "none.yaml")
    with pytest.raises(ConfigError, match="it is a folder"):
        load_world(tmp_path)


@pytest.mark.parametrize(
    "path", sorted((REPO / "corpus" / "worlds").glob("*.yaml")), ids=lambda path: path.stem
)
def test_the_worlds_of_the_corpus_are_right(path):
    world = load_world(path, library=LIBRARY)
    assert world.name == path.stem
    assert world.places


def test_the_examples_of_the_documentation_are_right():
    text = (REPO / "docs" / "worlds.md").read_text("utf-8")
    whole, drawn, changes, settings = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert read_world(whole.encode(), library=LIBRARY).people[0].name == "Ada"
    assert read_world(f"world: w\n{drawn}".encode()).map.obstacles
    zones = "zones: [{name: ramp, x: [1, 2], y: [1, 2]}, {name: lift, x: [3, 4], y: [1, 2]}]"
    changing = f"world: w\nmap: {{x: [0, 5], y: [0, 5], {zones}}}\n{changes}"
    assert len(read_world(changing.encode()).changes) == 4
    assert read_world(f"world: w\n{settings}".encode()).settings["SpeechRunner"].fails == 0.2


def test_the_documentation_names_every_key():
    text = (REPO / "docs" / "worlds.md").read_text("utf-8")
    models = [each for name, each in vars(schema).items() if name.endswith("File")]
    assert schema.WorldFile in models
    keys = {field.alias or name for model in models for name, field in model.model_fields.items()}
    assert [key for key in sorted(keys) if f"`{key}`" not in text and f"{key}:" not in text] == []
