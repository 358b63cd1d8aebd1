"""What a map shows of a world, and what a world tells while something happens in it."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from gpsfsm.simulation.base import Pose, WorldState
from gpsfsm.simulation.load import load_world, read_world
from gpsfsm.simulation.world import outline
from tests.conftest import REPO

WORLD = b"""world: lab
map:
  x: [0, 8]
  y: [0, 5]
  obstacles: [{name: door, x: [5, 5.2], y: [0, 1], from: 60, until: 90}]
  zones: [{name: ramp, x: [6, 7], y: [0, 2]}]
changes: [{after_arrivals: 2, close: ramp}, {at: 10, close: ramp}]
robot: {x: 1, y: 1, yaw: 90}
places: [{name: desk, x: 2, y: 2}]
people: [{name: Ada, x: 2, y: 3, replies: [{asked: name, says: My name is Ada.}]}]
things: [{name: box, x: 3, y: 3, until: 5}]
sounds: [{text: a bell, from: 2, until: 3}]
"""


def test_an_outline_has_all_that_a_map_shows() -> None:
    shape = outline(read_world(WORLD))
    assert (shape["title"], shape["area"]) == ("lab", [0.0, 0.0, 8.0, 5.0])
    assert shape["robot"]["yaw"] == pytest.approx(math.pi / 2)
    door = {"name": "door", "box": [5.0, 0.0, 5.2, 1.0], "low": False}
    assert shape["obstacles"] == [{**door, "from_s": 60.0, "until_s": 90.0}]
    assert shape["zones"] == [{"name": "ramp", "box": [6.0, 0.0, 7.0, 2.0], "closed": False}]
    assert [(each["zone"], each["at_s"], each["after_arrivals"]) for each in shape["changes"]] == [
        (0, None, 2),
        (0, 10.0, None),
    ]
    assert shape["places"] == [{"name": "desk", "x": 2.0, "y": 2.0}]
    stay = {"x": 2.0, "y": 3.0, "from_s": 0.0, "until_s": None}
    assert shape["people"] == [{"name": "Ada", "looks": "a person", "stays": [stay]}]
    assert shape["things"][0]["until_s"] == 5.0
    bell = {"text": "a bell", "from_s": 2.0, "until_s": 3.0, "x": None, "y": None}
    assert shape["sounds"] == [bell]


@pytest.mark.parametrize("name", ["arena", "closing", "home"])
def test_an_outline_is_json_without_infinities(name: str) -> None:
    shape = outline(load_world(REPO / "corpus" / "worlds" / f"{name}.yaml"))
    assert json.loads(json.dumps(shape, allow_nan=False)) == shape


def reports_of(act: Any) -> list[dict[str, Any]]:
    results: list[dict[str, Any]] = []
    state = WorldState(read_world(WORLD))
    state.tell = lambda what, data, words: results.append({"what": what, "words": words, **data})
    act(state)
    return results


def test_a_drive_is_told_with_its_way_and_where_it_was_broken_off() -> None:
    def act(state: WorldState) -> None:
        state.drive(0.0, [(1.0, 1.0), (3.0, 1.0)])
        state.halt(2.0)
        state.halt(2.5)  # it stands already
        state.drive(3.0, [(2.0, 1.0), (2.0, 2.0)])
        state.halt(5.0)  # at the end of the way, which says so
        state.put(Pose(2.0, 2.0, -0.0))
        state.arrive(5.0, 2.0, 2.0)

    reports = reports_of(act)
    assert [each["what"] for each in reports] == ["drive", "pose", "drive", "pose", "arrive"]
    assert (reports[0]["way"], reports[0]["speed"]) == ([[1.0, 1.0], [3.0, 1.0]], 0.5)
    assert (reports[1]["x"], reports[1]["y"], reports[1]["yaw"]) == (2.0, 1.0, 0.0)
    assert reports[3]["words"] == "the robot stands at (2.0, 2.0)"
    assert math.copysign(1, reports[3]["yaw"]) == 1  # 0 and -0 are two texts
    assert reports[4]["count"] == 1


def test_what_is_said_and_heard_is_told() -> None:
    def act(state: WorldState) -> None:
        state.say(2.0, "What is your name?")
        state.heard(2.0, 10.0)
        state.heard(20.0, 21.0)  # silence is not

    said, reply, hear = reports_of(act)
    assert (said["what"], said["x"], said["seconds"]) == ("say", 1.0, 4 / 2.5)
    assert (reply["what"], reply["who"], reply["after_s"]) == ("reply", "Ada", 1.0)
    assert (hear["what"], hear["text"]) == ("hear", "a bell My name is Ada.")
