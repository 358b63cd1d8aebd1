"""Recordings of runs, read back with the library of MCAP and as Foxglove reads JSON schemas."""

from __future__ import annotations

import io
import json
import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

import gpsfsm
from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import Row, journal_jsonl, line
from gpsfsm.execution.runner import RunContext, Runner
from gpsfsm.running.history import motions
from gpsfsm.running.prepare import stored
from gpsfsm.watch import mcap_file
from gpsfsm.watch.mcap_file import SCHEMAS, Place, Track, recording
from tests.conftest import REPO

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from mcap.records import Statistics

    from gpsfsm.execution.records import RunValue

ARENA = str(REPO / "corpus/worlds/arena.yaml")
MISSION = str(REPO / "corpus/missions/navigation_3.xml")
WAYPOINT = "nav2_capabilities/WaypointRunner"


class Message(NamedTuple):
    at_ns: int
    topic: str
    text: str
    value: Any


class Read(NamedTuple):
    """What the reader of the library makes of a file, in the order of the file."""

    messages: list[Message]
    schemas: dict[str, Any]
    metadata: dict[str, str]
    statistics: Statistics

    def of(self, topic: str) -> list[Message]:
        return [each for each in self.messages if each.topic == f"/gpsfsm/{topic}"]


def read(content: bytes) -> Read:
    reader = make_reader(io.BytesIO(content), validate_crcs=True)
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    schemas, messages = {}, []
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        schemas[channel.topic] = json.loads(schema.data)
        assert schema.name == schemas[channel.topic]["title"]
        text = message.data.decode()
        messages.append(Message(message.log_time, channel.topic, text, json.loads(text)))
    topics = {channel.topic for channel in summary.channels.values()}
    assert topics == set(SCHEMAS)
    (metadata,) = reader.iter_metadata()
    return Read(messages, schemas, metadata.metadata, summary.statistics)


def recorded(journal: str, number: int | None = None, **more: Any) -> bytes:
    with JournalReader(journal) as reader:
        run = reader.run(number)
        moved = motions(reader, run, lambda _: None)
        events, words = reader.events_written(run.number), stored(reader, run).words()
        return b"".join(recording(run, events, words, motions=moved, **more))


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A mission of five goals in a world, of which one cannot be reached."""
    path = str(tmp_path_factory.mktemp("recording") / "run.db")
    gpsfsm.run(MISSION, world=ARENA, seed=1, journal=path, durability="none")
    return path


@pytest.fixture(scope="module")
def mission(journal: str) -> Read:
    return read(recorded(journal))


# -- the schemas ----------------------------------------------------------------------------------


def each_type(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield schema
    for inner in schema.get("properties", {}).values():
        yield from each_type(inner)
    if "items" in schema:
        yield from each_type(schema["items"])


@pytest.mark.parametrize("topic", SCHEMAS)
def test_schemas_are_of_the_kind_that_viewers_read(topic: str) -> None:
    """Foxglove takes one-word types, objects with properties, and alternatives of numbers."""
    schema = SCHEMAS[topic]
    Draft202012Validator.check_schema(schema)
    assert schema["type"] == "object"
    for each in each_type(schema):
        if "oneOf" in each:
            assert all(isinstance(one["const"], int) and one["title"] for one in each["oneOf"])
            continue
        assert each["type"] in ("boolean", "string", "number", "integer", "object", "array")
        assert each["type"] != "object" or "properties" in each
        assert each["type"] != "array" or "type" in each["items"]


def test_the_well_known_schemas_have_their_fields() -> None:
    pose, log = SCHEMAS["/gpsfsm/pose"], SCHEMAS["/gpsfsm/log"]
    assert (pose["title"], log["title"]) == ("foxglove.PoseInFrame", "foxglove.Log")
    assert set(pose["properties"]) == {"timestamp", "frame_id", "pose"}
    assert set(pose["properties"]["pose"]["properties"]) == {"position", "orientation"}
    names = {"timestamp", "level", "message", "name", "file", "line"}
    assert set(log["properties"]) == names
    levels = {one["title"]: one["const"] for one in log["properties"]["level"]["oneOf"]}
    assert levels == {"UNKNOWN": 0, "DEBUG": 1, "INFO": 2, "WARNING": 3, "ERROR": 4, "FATAL": 5}
    for schema in (pose, log):
        assert schema["properties"]["timestamp"]["title"] == "time"
        assert set(schema["properties"]["timestamp"]["properties"]) == {"sec", "nsec"}


def test_messages_keep_to_their_schemas(mission: Read) -> None:
    for topic, schema in mission.schemas.items():
        validator = Draft202012Validator(schema)
        names = set(schema["properties"])
        for message in mission.of(topic.removeprefix("/gpsfsm/")):
            validator.validate(message.value)
            assert set(message.value) <= names
            if "timestamp" in names:
                time = message.value["timestamp"]
                assert time["sec"] * 10**9 + time["nsec"] == message.at_ns


# -- a run in a world -----------------------------------------------------------------------------


def test_every_event_is_there_as_its_line(journal: str, mission: Read) -> None:
    with JournalReader(journal) as reader:
        lines = "".join(journal_jsonl(reader, reader.run())).splitlines()[1:]
    events = mission.of("events")
    assert [event.text for event in events] == lines
    assert [event.at_ns for event in events] == [event.value["at_us"] * 1000 for event in events]


def test_messages_are_in_the_order_of_their_times(mission: Read) -> None:
    times = [message.at_ns for message in mission.messages]
    assert times == sorted(times)
    assert (mission.statistics.message_start_time, mission.statistics.message_end_time) == (
        times[0],
        times[-1],
    )
    assert mission.statistics.message_count == len(times)
    assert times[-1] == mission.of("events")[-1].at_ns  # nothing comes after the end


def test_runners_are_told_at_each_change(mission: Read) -> None:
    changes = [
        [(each["line"], each["state"]) for each in message.value["runners"]]
        for message in mission.of("runners")
    ]
    lines = (5, 6, 8, 10, 11)
    assert changes[0] == [*zip(lines, ["ACTIVE", *["WAITING"] * 4], strict=True)]
    assert changes[2] == [
        *zip(lines, ["SUCCEEDED", "FAILED", "ACTIVE", "WAITING", "WAITING"], strict=True)
    ]
    assert [state for _, state in changes[-1]] == ["SUCCEEDED", "FAILED", *["SUCCEEDED"] * 3]
    assert all(before != after for before, after in pairwise(changes))
    first = mission.of("runners")[0].value["runners"][0]
    assert first == {
        "node": 1,
        "line": 5,
        "name": "WaypointRunner (x=2.0, y=-0.5)",
        "state": "ACTIVE",
    }


def test_the_status_of_the_run(mission: Read) -> None:
    statuses = [message.value for message in mission.of("run")]
    assert [each["status"] for each in statuses] == [*["RUNNING"] * 5, "COMPLETED"]
    assert (statuses[-1]["started"], statuses[-1]["succeeded"], statuses[-1]["failed"]) == (5, 4, 1)
    assert mission.metadata["status"] == "COMPLETED"
    assert (mission.metadata["mode"], mission.metadata["seed"]) == ("world", "1")


def test_the_log_tells_what_is_done_and_how_it_ends(mission: Read) -> None:
    logs = [message.value for message in mission.of("log")]
    failed = [each for each in logs if each["message"].startswith("failed")]
    assert [(each["level"], each["line"], each["name"]) for each in failed] == [
        (3, 6, "WaypointRunner (x=1.0, y=3.0)")
    ]
    assert failed[0]["file"] == MISSION
    assert (logs[-1]["message"], logs[-1]["level"], logs[-1]["name"]) == (
        "the run has ended: COMPLETED",
        2,
        "run",
    )


def test_a_drive_is_a_movement(mission: Read) -> None:
    """The journal of a run in a world tells no drives: they are simulated once more."""
    poses = mission.of("pose")
    assert not [each for each in mission.of("events") if each.value["kind"] == "LOG"]
    places = [each.value["pose"]["position"] for each in poses]
    assert (places[0]["x"], places[0]["y"]) == (0, 0)
    assert (places[-1]["x"], places[-1]["y"]) == (0, -2)
    for first, second in pairwise(zip(poses, places, strict=True)):
        passed_s = (second[0].at_ns - first[0].at_ns) / 1e9
        moved = math.dist(*((each["x"], each["y"]) for each in (first[1], second[1])))
        assert moved <= 0.5 * passed_s + 1e-3  # the speed of the robot
        assert moved == 0 or passed_s <= 0.1001  # ten times a second while it drives
    for each in poses:
        turn = each.value["pose"]["orientation"]
        assert math.hypot(turn["z"], turn["w"]) == pytest.approx(1)
        assert each.value["frame_id"] == "map"


def test_the_same_run_gives_the_same_bytes(journal: str, tmp_path: Path) -> None:
    content = recorded(journal)
    assert content == recorded(journal)
    again = str(tmp_path / "again.db")
    gpsfsm.run(MISSION, world=ARENA, seed=1, journal=again, durability="none")
    assert recorded(again) == content


def test_dates_count_from_the_begin_of_the_run(journal: str, mission: Read) -> None:
    dated = read(recorded(journal, wall_clock=True))
    with JournalReader(journal) as reader:
        run = reader.run()
        walls = [row.wall_us for row in reader.events(run.number)]
    assert [each.at_ns for each in dated.messages] == [
        each.at_ns + run.wall_us * 1000 for each in mission.messages
    ]
    assert [each.value["wall_us"] for each in dated.of("events")] == walls


def test_each_run_of_a_queue_begins_where_the_last_one_ended(tmp_path: Path) -> None:
    path = str(tmp_path / "two.db")
    paths = []
    for number, x in enumerate((2, -1), 1):
        paths.append(str(tmp_path / f"{number}.xml"))
        plan = f'<Plan><Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="{x}" y="0"/></Plan>'
        (tmp_path / f"{number}.xml").write_text(plan)
    gpsfsm.run(paths, world=ARENA, journal=path, durability="none")
    first, second = (read(recorded(path, number)).of("pose") for number in (1, 2))
    assert first[0].value["pose"]["position"]["x"] == 0
    assert first[-1].value["pose"] == second[0].value["pose"]
    assert second[0].value["pose"]["position"]["x"] == 2
    assert second[-1].value["pose"]["position"]["x"] == -1


# -- what real runners tell -----------------------------------------------------------------------


class Driving(Runner):
    """Tells poses and feedback as a real robot does, and nonsense as a broken one would."""

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        context.log("here", {"world": "pose", "x": 1.5, "y": -2, "yaw": math.pi})
        context.log("there", {"world": "pose", "x": "no", "y": 1})
        feedback: dict[str, RunValue] = {"distance_left_m": 1.25, "recoveries": 2, "text": "ok"}
        context.log("1.25 m", {"feedback": "navigate", **feedback, "over": True})
        return None


def test_poses_and_feedback_of_real_runners(tmp_path: Path) -> None:
    path, plan = str(tmp_path / "real.db"), tmp_path / "plan.xml"
    plan.write_text(f'<Plan>\n<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="1"/></Plan>')
    gpsfsm.run(str(plan), runners={WAYPOINT: Driving}, journal=path, force=True)
    done = read(recorded(path))
    (pose,) = done.of("pose")
    assert pose.value["pose"]["position"] == {"x": 1.5, "y": -2, "z": 0}
    assert pose.value["pose"]["orientation"]["z"] == pytest.approx(1)
    (feedback,) = done.of("feedback")
    assert {**feedback.value, "timestamp": None} == {
        "node": 1,
        "line": 2,
        "name": "WaypointRunner (x=1)",
        "feedback": "navigate",
        "values": [
            {"name": "distance_left_m", "value": 1.25},
            {"name": "recoveries", "value": 2},
        ],
        "timestamp": None,
    }
    assert [(each.value["level"], each.value["message"]) for each in done.of("log")] == [
        (2, "note: forced in spite of GP401 at line 2"),
        (2, "started"),
        (2, "succeeded"),
        (2, "the run has ended: COMPLETED"),
    ]


# -- rows that no run of ours writes --------------------------------------------------------------


def logged(*data: dict[str, Any], at_us: int = 0, kind: str = "LOG") -> list[tuple[Row, str]]:
    rows = []
    for number, each in enumerate(data, 1):
        text = json.dumps(each)
        row = Row(number, at_us, True, kind != "LOG", kind, 1, "", -1, "", "", 0, text, "")
        rows.append((row, line(row)))
    return rows


def of_rows(journal: str, rows: list[tuple[Row, str]], **more: Any) -> Read:
    with JournalReader(journal) as reader:
        run = reader.run()
        words = stored(reader, run).words()
    return read(b"".join(recording(run, rows, words, **more)))


@pytest.mark.parametrize(
    "data",
    [
        {"world": "drive"},
        {"world": "drive", "way": [[0, 0]], "speed": 1},
        {"world": "drive", "way": [[0, 0], [1, 0]], "speed": 0},
        {"world": "drive", "way": [[0, 0], [1, 0]], "speed": -1},
        {"world": "drive", "way": [[0, 0], [1, 0]], "speed": True},
        {"world": "drive", "way": [[0, 0], [1, 0]], "speed": 1e-300},
        {"world": "drive", "way": [[0, 0], [0, 0]], "speed": 1},
        {"world": "drive", "way": [[0, 0], [1]], "speed": 1},
        {"world": "drive", "way": [[0, 0], "ab"], "speed": 1},
        {"world": "drive", "way": [[-1e308, 0], [1e308, 0]], "speed": 1},
        {"world": "drive", "way": [[0, 0]] * 100_001, "speed": 1},
        {"world": "pose", "x": 10**400, "y": 0},
        {"world": "pose", "x": math.inf, "y": 0},
        {"world": "pose"},
        {"world": ["pose"]},
        {"x": 1, "y": 2},
    ],
)
def test_what_tells_no_place_is_no_pose(data: dict[str, Any]) -> None:
    track = Track()
    assert track.take(0, data) is None
    assert [*track.before(10**12)] == []


def test_a_long_drive_has_a_bounded_number_of_poses() -> None:
    track = Track()
    track.take(0, {"world": "drive", "way": [[0, 0], [1, 0], [1, 1]], "speed": 1e-6})
    places = [*track.before(10**13)]
    assert len(places) == 2001
    assert places[0] == (0, Place(0, 0, 0))
    assert places[-1] == (2 * 10**12, Place(1, 1, math.pi / 2))


def test_a_run_has_a_bounded_number_of_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_file, "_POSES", 15)
    track, counts = Track(), []
    for number in range(3):
        track.take(number * 10**7, {"world": "drive", "way": [[0, 0], [1, 0]], "speed": 1})
        counts.append(len([*track.before(number * 10**7 + 10**7 - 1)]))
    assert counts == [11, 6, 2]  # then the ends alone


def test_a_drive_ends_where_the_robot_is_stopped() -> None:
    track = Track()
    track.take(0, {"world": "drive", "way": [[0, 0], [10, 0]], "speed": 1})
    assert len([*track.before(250_000)]) == 3
    assert track.take(250_000, {"world": "pose", "x": 0.25, "y": 0, "yaw": 1, "frame": "odom"}) == (
        Place(0.25, 0, 1, "odom")
    )
    assert [*track.before(10**8)] == []
    arrived = track.take(300_000, {"world": "arrive", "x": 0.25, "y": 0})
    assert arrived == Place(0.25, 0, 1)  # and it looks where it has looked before


def test_a_drive_that_has_no_end_in_the_journal_stops_with_it(journal: str) -> None:
    rows = logged({"world": "drive", "way": [[0, 0], [9, 0]], "speed": 1})
    rows += logged({}, at_us=1_050_000)
    poses = of_rows(journal, rows).of("pose")
    assert [each.at_ns for each in poses] == [number * 10**8 for number in range(11)]


def test_a_run_of_centuries_is_refused_with_words(journal: str) -> None:
    with pytest.raises(GpsfsmError, match=r"584 years.*jsonl"):
        of_rows(journal, logged({}, at_us=2**62))


def test_real_time_that_passed_between_processes_is_in_the_dates(journal: str) -> None:
    """Of a run that was resumed; a clock that was put back does not turn the times."""
    begin, second = 10**15, 10**6
    rows = []
    for number, (kind, at_s, wall_s) in enumerate(
        [("LOG", 0, 0), ("CONTINUED", 5, 65), ("LOG", 6, 66), ("CONTINUED", 7, 1)], 1
    ):
        wall_us = begin + wall_s * second
        row = Row(number, at_s * second, True, False, kind, -1, "", -1, "", "", 0, "", "", wall_us)
        rows.append((row, line(row)))
    with JournalReader(journal) as reader:
        run = reader.run()
        words = stored(reader, run).words()
    changed: Callable[..., Any] = type(run)
    header = {**run.header, "mode": "real"}
    real = changed(*(1, run.id, header, "", begin, 4, 7 * second, run.status))
    done = read(b"".join(recording(real, rows, words, wall_clock=True)))
    times = [(each.at_ns // 1000 - begin) // second for each in done.of("events")]
    assert times == [0, 65, 66, 67]


def test_of_large_plans_only_the_changes_are_told(tmp_path: Path) -> None:
    name = "generic_capabilities/WaitRunner"
    runner = f'<Runner interface="{name}" provider="{name}" seconds="1"/>'
    (tmp_path / "plan.xml").write_text(f"<Plan>{runner * 201}</Plan>")
    path = str(tmp_path / "large.db")
    gpsfsm.run(str(tmp_path / "plan.xml"), world=ARENA, journal=path, durability="none")
    messages = read(recorded(path)).of("runners")
    lines = [
        [(each["node"], each["state"]) for each in message.value["runners"]] for message in messages
    ]
    assert lines[0] == [(1, "ACTIVE")]
    assert lines[1] == [(1, "SUCCEEDED"), (2, "ACTIVE")]
    assert len(lines) == 202


def test_the_status_is_told_when_it_changes(journal: str) -> None:
    rows = logged({}, kind="BEGIN") + logged({}, at_us=5) + logged({}, at_us=9, kind="PAUSE")
    rows += logged({}, at_us=10) + logged({}, at_us=11, kind="RESUME")
    statuses = of_rows(journal, rows).of("run")
    assert [(each.at_ns // 1000, each.value["paused"]) for each in statuses] == [
        (0, False),
        (9, True),
        (11, False),
    ]
