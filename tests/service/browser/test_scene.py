"""The page's own map at any time, held against the simulation; and its reader of events."""

from __future__ import annotations

import json
import math
import random
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.simulation.base import Pose, WorldState
from gpsfsm.simulation.load import load_world
from gpsfsm.simulation.world import outline
from gpsfsm.watch.record_text import feedback_words
from tests.conftest import REPO

if TYPE_CHECKING:
    from collections.abc import Mapping

WEB = REPO / "gpsfsm" / "viewing" / "web"
HERE = Path(__file__).parent
NAMES = ("closing", "home", "arena")


@pytest.fixture(scope="module")
def modules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The modules of the page, where node takes them for modules."""
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    folder = tmp_path_factory.mktemp("modules")
    for module in WEB.glob("*.js"):
        shutil.copy(module, folder)
    (folder / "package.json").write_text('{"type": "module"}')
    return folder


def seen_in_node(modules: Path, scene: dict[str, Any]) -> dict[str, Any]:
    done = subprocess.run(
        ["node", HERE / "scenes.mjs", modules],
        input=json.dumps(scene),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    return document


class Journal:
    """What a world tells while it is used, and how it was at many times."""

    def __init__(self, state: WorldState) -> None:
        self.records: list[dict[str, Any]] = []
        self.looked: list[tuple[float, dict[str, Any]]] = []
        self.now_s = 0.0
        self.state = state
        state.tell = self._write

    def _write(self, what: str, data: Mapping[str, Any], words: str) -> None:
        at_us = round(self.now_s * 1e6)
        data_ = {"world": what, **data}
        self.records.append(
            {"kind": "LOG", "at_us": at_us, "node": -1, "data": data_, "message": words}
        )

    def look(self) -> None:
        state, now_s = self.state, self.now_s
        people = [each.name for each in state.world.people if each.stay(now_s) is not None]
        pose, closed = state.pose(now_s), list(state.zones.closed(now_s))
        self.looked.append((now_s, {"pose": pose, "closed": closed, "people": people}))

    def act(self, chance: random.Random) -> None:
        """Something that a plan might do, at a time after the last one."""
        state, area = self.state, self.state.world.map.area
        x, y = chance.uniform(area.x0, area.x1), chance.uniform(area.y0, area.y1)
        deed = chance.choice(("drive", "drive", "drive", "halt", "put", "arrive"))
        if deed == "drive" and (points := state.route(self.now_s, x, y)) is not None:
            state.drive(self.now_s, points)
        elif deed == "halt":
            state.halt(self.now_s)
        elif deed == "put":
            state.put(Pose(x, y, chance.uniform(-math.pi, math.pi)))
        elif deed == "arrive":
            state.arrive(self.now_s, x, y)


@pytest.mark.parametrize("name", NAMES)
def test_the_map_shows_at_any_time_what_the_simulation_had(name: str, modules: Path) -> None:
    world = load_world(str(REPO / "corpus" / "worlds" / f"{name}.yaml"))
    chance = random.Random(name)  # noqa: S311
    state = WorldState(world)
    journal = Journal(state)
    for _ in range(60):
        journal.act(chance)
        for _ in range(4):
            journal.now_s = round(journal.now_s + chance.uniform(0.01, 6), 3)
            journal.look()
        journal.now_s = round(journal.now_s + 0.1, 3)  # what happens at an instant is shown at it
    times = [now_s * 1e6 for now_s, _ in journal.looked]
    order = list(range(len(times)))
    chance.shuffle(order)  # scrubbed to and fro
    scene = {"geometry": outline(world), "begun_s": 0, "pieces": [], "records": journal.records}
    seen = seen_in_node(modules, scene | {"times": [times[place] for place in order]})["seen"]
    for place, shown in zip(order, seen, strict=True):
        expected = journal.looked[place][1]
        pose = expected["pose"]
        assert math.hypot(shown["x"] - pose.x, shown["y"] - pose.y) < 0.01
        assert math.cos(shown["yaw"] - pose.yaw) > 0.999
        assert shown["closed"] == expected["closed"]
        assert shown["people"] == expected["people"]
    assert len({str(each[1]["pose"]) for each in journal.looked}) > 30


def test_what_is_said_is_shown_while_it_is_said(modules: Path) -> None:
    world = load_world(str(REPO / "corpus" / "worlds" / "home.yaml"))
    say = {"world": "say", "text": "Hello.", "x": 5, "y": 2, "seconds": 2}
    reply = {
        "world": "reply",
        "who": "Ada",
        "text": "Hi.",
        "x": 6,
        "y": 2,
        "after_s": 1,
        "seconds": 1,
    }
    name = "perception_capabilities/SpeechRunner"
    records = [
        {"kind": "TRIGGERED", "at_us": 0, "node": 1, "interface": name, "data": {"text": "Hello."}},
        {"kind": "STARTED", "at_us": 1_000_000, "node": 1, "interface": name},
    ]
    geometry = outline(world)
    scene = {"geometry": geometry, "begun_s": 500, "pieces": [], "times": [0.5e6, 2e6, 90e6]}
    shown = [each["said"] for each in seen_in_node(modules, scene | {"records": records})["seen"]]
    assert shown == [[], ["Hello."], ["Hello."]]  # nobody knows yet when it ends
    records += [
        {"kind": "LOG", "at_us": 3_000_000, "node": 1, "data": say},
        {"kind": "LOG", "at_us": 3_000_000, "node": 1, "data": reply},
        {"kind": "SUCCEEDED", "at_us": 3_000_000, "node": 1, "interface": name},
    ]
    seen = seen_in_node(modules, scene | {"records": records, "times": [0.5e6, 2e6, 4.2e6, 90e6]})
    assert [each["said"] for each in seen["seen"]] == [[], ["Hello."], ["Hello.", "Hi."], []]
    assert seen["seen"][0]["people"] == ["Ben"]  # 500 s after the world has begun


def test_events_are_read_however_the_stream_is_cut(modules: Path) -> None:
    text = (
        'retry: 1000\n\n: still there\n\nid: 7\nevent: record\ndata: {"text":\n'
        'data: "a: b\\u00e9"}\n\nevent: status\r\ndata:{"run":1}\r\n\r\n'
        "id: 8\n\nevent: end\ndata: {}\n\n"
    )
    expected = [
        {"id": "7", "event": "record", "data": {"text": "a: bé"}},
        {"id": "", "event": "status", "data": {"run": 1}},
        {"id": "", "event": "end", "data": {}},
    ]
    world = load_world(str(REPO / "corpus" / "worlds" / "arena.yaml"))
    scene = {"geometry": outline(world), "begun_s": 0, "records": [], "times": []}
    chance = random.Random(3)  # noqa: S311
    for _ in range(5):
        cuts = sorted(chance.sample(range(len(text)), 12))
        edges = [0, *cuts, len(text)]
        pieces = [text[a:b] for a, b in pairwise(edges)]
        observed = seen_in_node(modules, scene | {"pieces": pieces})
        assert observed["events"] == expected
        assert observed["ended"]


def pose(at_us: int, x: float, y: float, yaw: float = 0.0) -> dict[str, Any]:
    data = {"world": "pose", "x": x, "y": y, "yaw": yaw}
    return {"kind": "LOG", "at_us": at_us, "node": 1, "data": data}


def test_the_map_of_a_real_run_grows_with_the_places(modules: Path) -> None:
    nothing = {"geometry": None, "begun_s": 0, "pieces": [], "records": [], "times": [0]}
    empty = seen_in_node(modules, nothing)
    assert empty["area"] is None
    assert "x" not in empty["seen"][0]  # nobody knows where it is
    records = [
        pose(1_000_000, 0.2, 0.1, 0.5),
        pose(2_000_000, -7.5, 3.0),
        pose(3_000_000, 1e9, 0.0),
    ]
    observed = seen_in_node(
        modules, {**nothing, "records": records, "times": [0, 1_500_000, 4_000_000]}
    )
    assert observed["area"] == [-10, -2, 2, 4]
    before, first, last = observed["seen"]
    assert "x" not in before
    assert (first["x"], first["y"], first["yaw"]) == (0.2, 0.1, 0.5)
    assert (last["x"], last["y"]) == (-7.5, 3.0)  # what is nowhere moves nothing
    assert observed["trail"] == [[0.2, 0.1], [-7.5, 3.0]]


def test_feedback_has_the_same_words_as_on_a_terminal(modules: Path) -> None:
    feedback: list[dict[str, Any]] = [
        {"feedback": "drive", "distance_left_m": 1.24, "time_left_s": 12.3},
        {"feedback": "dock", "battery_percent": 45.2, "waypoints_left": 3},
        {"feedback": "dock", "state": "turns", "docked": False, "force": 0.125},
        {"feedback": "dock"},
        {"feedback": "drive", "speed_m_per_s": 0.2, "recoveries": 12345678},
    ]
    scene = {"geometry": None, "begun_s": 0, "pieces": [], "records": [], "times": []}
    observed = seen_in_node(modules, {**scene, "feedback": feedback})
    assert observed["words"] == [feedback_words(each) for each in feedback]
