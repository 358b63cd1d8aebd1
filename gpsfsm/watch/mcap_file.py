"""The recording of a run as an MCAP file, which Foxglove opens: channels of JSON with schemas.

The schemas keep to what viewers read of JSON Schema: every object lists its properties, every type
is one word. Poses come from the LOG rows of simulated worlds and of real runners. A drive is a line
with a speed, so its poses are computed; a viewer then shows a movement.
"""

from __future__ import annotations

import importlib
import io
import json
import math
from collections import deque
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.errors import GpsfsmError, UsageError, installing
from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.journal_rows import canonical, line
from gpsfsm.execution.records import Kind, Record, Status
from gpsfsm.version import VERSION
from gpsfsm.watch.live import STATES, State
from gpsfsm.watch.moments import Tally, status_of, stored_moments
from gpsfsm.watch.record_text import Detail

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from mcap.writer import Writer

    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.watch.record_text import Words

_PERIOD_US = 100_000  # ten poses a second
_POSES_OF_DRIVE = 2_000
_POSES = 1_000_000
"""The most computed poses of a run; of later drives only the ends are written."""
_POINTS = 100_000
_ALL_RUNNERS = 200
"""Plans with more runner instances: a message then holds those alone that have changed."""
_LAST_US = 2**64 // 1000 - 1  # an MCAP file counts nanoseconds in 64 bits
_FRAME = "map"
_INFO, _WARNING, _ERROR = 2, 3, 4
_WARNS = (Kind.FAILED, Kind.TIMEOUT, Kind.NOT_LOADED, Kind.CANCEL)


def _object(title: str = "", **properties: Any) -> dict[str, Any]:
    schema = {"type": "object", "properties": properties}
    return {"title": title, **schema} if title else schema


def _integers(*names: str) -> dict[str, Any]:
    return {name: {"type": "integer"} for name in names}


def _numbers(*names: str) -> dict[str, Any]:
    return {name: {"type": "number"} for name in names}


def _texts(*names: str) -> dict[str, Any]:
    return {name: {"type": "string"} for name in names}


def _list(schema: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": schema}


_TIME = {"timestamp": _object("time", **_integers("sec", "nsec"))}
_RUNNER = {**_integers("node", "line"), **_texts("name")}

SCHEMAS = {
    "/gpsfsm/events": _object(
        "gpsfsm.Event",
        **_integers("seq", "at_us", "cause", "node", "runner", "wall_us"),
        **_texts("kind", "element", "interface", "provider", "message"),
        input={"type": "boolean"},
        record={"type": "boolean"},
        data=_object(),
    ),
    "/gpsfsm/runners": _object(
        "gpsfsm.Runners", **_TIME, runners=_list(_object(**_RUNNER, **_texts("state")))
    ),
    "/gpsfsm/run": _object(
        "gpsfsm.Run",
        **_TIME,
        **_texts("status"),
        paused={"type": "boolean"},
        **_integers("started", "succeeded", "failed", "stopped"),
    ),
    "/gpsfsm/pose": _object(
        "foxglove.PoseInFrame",
        **_TIME,
        **_texts("frame_id"),
        pose=_object(
            "foxglove.Pose",
            position=_object("foxglove.Vector3", **_numbers("x", "y", "z")),
            orientation=_object("foxglove.Quaternion", **_numbers("x", "y", "z", "w")),
        ),
    ),
    "/gpsfsm/feedback": _object(
        "gpsfsm.Feedback",
        **_TIME,
        **_RUNNER,
        **_texts("feedback"),
        values=_list(_object(**_texts("name"), **_numbers("value"))),
    ),
    "/gpsfsm/log": _object(
        "foxglove.Log",
        **_TIME,
        level={
            "title": "foxglove.LogLevel",
            "oneOf": [
                {"title": name, "const": level}
                for level, name in enumerate(
                    ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")
                )
            ],
        },
        **_texts("message", "name", "file"),
        **_integers("line"),
    ),
}
"""The JSON schema of each channel; its title is the name of the schema in the file."""


class Place(NamedTuple):
    """A pose on the plane, in metres and radians."""

    x: float
    y: float
    yaw: float
    frame: str = _FRAME


class Track:
    """The poses of the robot: those that rows tell, and computed ones along its drives."""

    def __init__(self) -> None:
        self._left = _POSES
        self._yaw = 0.0
        self._drive: Iterator[tuple[int, Place]] | None = None
        self._next: tuple[int, Place] | None = None

    def before(self, at_us: int) -> Iterator[tuple[int, Place]]:
        """The computed poses up to a time that were not handed out yet, each with its time."""
        while self._next is not None and self._next[0] <= at_us:
            yield self._next
            self._yaw = self._next[1].yaw
            self._advance()

    def take(self, at_us: int, data: Mapping[str, Any]) -> Place | None:
        """Take in the data of a LOG row; the pose that it tells, if it tells one."""
        what = data.get("world")
        if what == "drive":
            self._begin(at_us, data)
        elif what in ("pose", "arrive"):
            x, y, yaw = (_number(data.get(name)) for name in ("x", "y", "yaw"))
            if x is not None and y is not None:
                self._drive = self._next = None
                self._yaw = self._yaw if yaw is None else yaw
                frame = data.get("frame")
                return Place(x, y, self._yaw, frame if isinstance(frame, str) else _FRAME)
        return None

    def _begin(self, at_us: int, data: Mapping[str, Any]) -> None:
        points, speed = _points(data.get("way")), _number(data.get("speed"))
        if points is None or speed is None or speed <= 0:
            return
        along = [0.0]
        for first, second in pairwise(points):
            along.append(along[-1] + math.dist(first, second))
        took_s = along[-1] / speed
        if 0 < took_s < _LAST_US / 1e6:
            self._drive = self._along(at_us, points, along, round(took_s * 1e6))
            self._advance()

    def _along(
        self, at_us: int, points: Sequence[tuple[float, float]], along: list[float], took_us: int
    ) -> Iterator[tuple[int, Place]]:
        period = max(_PERIOD_US, -(-took_us // _POSES_OF_DRIVE))
        leg, gone_us = 1, 0
        while gone_us < took_us:
            driven = along[-1] * gone_us / took_us
            while leg < len(points) - 1 and along[leg] <= driven:
                leg += 1
            yield at_us + gone_us, _between(points, along, leg, driven)
            self._left -= 1
            gone_us += period if self._left > 0 else took_us
        yield at_us + took_us, _between(points, along, len(points) - 1, along[-1])

    def _advance(self) -> None:
        self._next = None if self._drive is None else next(self._drive, None)


def _between(
    points: Sequence[tuple[float, float]], along: list[float], leg: int, driven: float
) -> Place:
    """The place after so many metres, which is on a leg of the line."""
    (ax, ay), (bx, by) = points[leg - 1], points[leg]
    length = along[leg] - along[leg - 1]
    part = (driven - along[leg - 1]) / length if length > 0 else 1.0
    return Place(ax + (bx - ax) * part, ay + (by - ay) * part, math.atan2(by - ay, bx - ax))


def _number(value: object) -> float | None:
    """A finite number; None for anything else, also for numbers that no float holds."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _points(value: object) -> list[tuple[float, float]] | None:
    if not isinstance(value, list) or not 2 <= len(value) <= _POINTS:
        return None
    points = []
    for each in value:
        x, y = (_number(one) for one in each) if _is_pair(each) else (None, None)
        if x is None or y is None:
            return None
        points.append((x, y))
    return points


def _is_pair(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2


def require_mcap() -> None:
    """Raises UsageError where the library is not installed."""
    try:
        importlib.import_module("mcap.writer")
    except ModuleNotFoundError:
        raise UsageError(f"--format mcap needs mcap: {installing('mcap')}") from None


def recording(
    run: StoredRun,
    events: Iterable[tuple[Row, str]],
    words: Words,
    *,
    motions: Sequence[tuple[int, Mapping[str, Any]]] = (),
    wall_clock: bool = False,
) -> Iterator[bytes]:
    """The MCAP file of a run: the same bytes for the same events. ``events`` come with their lines.

    Times count from the beginning of the run; with ``wall_clock`` they are dates. ``motions`` are
    drives and poses that no row holds, with their times. Raises DamagedJournalError behind what
    could still be read.
    """
    file = _File(run, words, motions, wall_clock=wall_clock)
    damage: DamagedJournalError | None = None
    try:
        file.take(events)
    except DamagedJournalError as error:
        damage = error
    yield file.finished()
    if damage is not None:
        raise damage


class _File:
    """An MCAP file that grows."""

    def __init__(
        self,
        run: StoredRun,
        words: Words,
        motions: Sequence[tuple[int, Mapping[str, Any]]],
        *,
        wall_clock: bool,
    ) -> None:
        from mcap.writer import Writer

        self._motions = deque(motions)
        self._posed: tuple[int, Place] | None = None  # the last pose that was written
        self._run, self._words, self._wall_clock = run, words, wall_clock
        self._offset_us = run.wall_us if wall_clock else 0
        self._content = io.BytesIO()
        self._writer: Writer = Writer(self._content)
        self._writer.start(profile="", library=f"gpsfsm {VERSION}")
        self._channels = {topic: self._register(topic) for topic in SCHEMAS}
        self._counts = dict.fromkeys(SCHEMAS, 0)
        self._track, self._tally, self._paused = Track(), Tally(), False
        nodes = [node for node, _ in enumerate(words.automaton.runners, 1)]
        self._states = dict.fromkeys(nodes, State.WAITING)
        self._changed = self._states if len(nodes) <= _ALL_RUNNERS else {}
        self._stood: dict[str, Any] = {}  # how the run stood when that was last written
        self._runner_news = True
        self._now_us = 0

    def _register(self, topic: str) -> int:
        schema = SCHEMAS[topic]
        text = json.dumps(schema, separators=(",", ":")).encode()
        number = self._writer.register_schema(schema["title"], "jsonschema", text)
        return self._writer.register_channel(topic, "json", number)

    def take(self, events: Iterable[tuple[Row, str]]) -> None:
        """Write what the events of a run tell."""
        automaton, words = self._words.automaton, self._words
        rows = self._each(events)
        for row, moment in stored_moments(rows, len(automaton.nodes), len(words.runners)):
            self._take(row, moment.record)

    def _each(self, events: Iterable[tuple[Row, str]]) -> Iterator[Row]:
        """The rows; all that belongs before a row is written before it."""
        for row, text in events:
            if row.at_us != self._now_us:
                self._flush()
            while self._motions and self._motions[0][0] <= row.at_us:
                self._move(*self._motions.popleft())
            self._go_on(row.at_us)
            self._now_us = row.at_us
            if self._wall_clock and row.kind == Kind.CONTINUED and self._run.mode == "real":
                # real time went on between the processes, and never goes back in a file
                self._offset_us = max(self._offset_us, row.wall_us - row.at_us)
            shown = line(row, wall_clock=True) if self._wall_clock else text
            self._write("/gpsfsm/events", row.at_us, shown.encode())
            yield row

    def _take(self, row: Row, record: Record) -> None:
        kind, node, at_us = record.kind, record.node, row.at_us
        if kind is Kind.LOG and record.data:
            self._move(at_us, record.data)
            if "feedback" in record.data:
                self._write_feedback(at_us, node, record.data)
        if kind is Kind.ENDED or self._words.shown(record, Detail.RUN):
            self._write_log(at_us, record)
        if row.record:
            self._tally.add(at_us, [record])
        if kind in (Kind.PAUSE, Kind.RESUME):
            self._paused = kind is Kind.PAUSE
        state = STATES.get(kind)
        if state is not None and node in self._states and row.record:
            self._states[node] = self._changed[node] = state
            self._runner_news = True

    def _move(self, at_us: int, data: Mapping[str, Any]) -> None:
        """Take in what was journaled, or simulated, about where the robot is."""
        self._go_on(at_us)
        place = self._track.take(at_us, data)
        if place is not None:
            self._write_pose(at_us, place)

    def _go_on(self, at_us: int) -> None:
        for when_us, place in self._track.before(at_us):
            self._write_pose(when_us, place)

    def _flush(self) -> None:
        """Write how the run and its runners stand after all events of an instant."""
        if self._runner_news:
            runners = [
                {**self._runner(node), "state": state.name} for node, state in self._changed.items()
            ]
            self._write_object("/gpsfsm/runners", self._now_us, {"runners": runners})
            if self._changed is not self._states:
                self._changed = {}
            self._runner_news = False
        tally = self._tally
        stands: dict[str, Any] = {
            "status": tally.status.value,
            "paused": self._paused,
            "started": tally.started,
            "succeeded": tally.succeeded,
            "failed": tally.failed,
            "stopped": tally.stopped,
        }
        if stands != self._stood:
            self._stood = stands
            self._write_object("/gpsfsm/run", self._now_us, {**stands})

    def _runner(self, node: int) -> dict[str, Any]:
        if node <= 0:
            return {"node": 0, "line": 0, "name": ""}
        element = self._words.element(node)
        return {"node": node, "line": element.line, "name": self._words.node(node)}

    def _write_feedback(self, at_us: int, node: int, data: Mapping[str, Any]) -> None:
        values = []
        for name, value in sorted(data.items()):
            number = _number(value)
            if number is not None:
                values.append({"name": name, "value": number})
        feedback = {"feedback": str(data["feedback"]), "values": values, **self._runner(node)}
        self._write_object("/gpsfsm/feedback", at_us, feedback)

    def _write_log(self, at_us: int, record: Record) -> None:
        level = _WARNING if record.kind in _WARNS else _INFO
        if record.kind is Kind.ENDED and status_of(record) is not Status.COMPLETED:
            level = _ERROR
        log = {
            "level": level,
            "message": self._words.verb(record),
            "name": self._words.node(record.node) if record.node >= 0 else "run",
            "file": self._run.file,
            "line": self._words.element(record.node).line if record.node >= 0 else 0,
        }
        self._write_object("/gpsfsm/log", at_us, log)

    def _write_pose(self, at_us: int, place: Place) -> None:
        if (at_us, place) == self._posed:
            return
        self._posed = at_us, place
        half = place.yaw / 2
        pose = {
            "position": {"x": place.x, "y": place.y, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
        }
        self._write_object("/gpsfsm/pose", at_us, {"frame_id": place.frame, "pose": pose})

    def _write_object(self, topic: str, at_us: int, values: dict[str, Any]) -> None:
        seconds, rest = divmod(at_us + self._offset_us, 1_000_000)
        values["timestamp"] = {"sec": seconds, "nsec": rest * 1000}
        self._write(topic, at_us, canonical(values).encode())

    def _write(self, topic: str, at_us: int, message: bytes) -> None:
        at_us += self._offset_us
        if at_us > _LAST_US:
            raise GpsfsmError(
                f"run {self._run.number} takes longer than an MCAP file can tell (584 years); "
                "'--format jsonl' has all of its events"
            )
        self._counts[topic] += 1
        number = self._counts[topic] % 2**32
        self._writer.add_message(
            self._channels[topic], at_us * 1000, message, at_us * 1000, sequence=number
        )

    def finished(self) -> bytes:
        """The whole file."""
        self._flush()
        self._writer.add_metadata(
            "gpsfsm",
            {
                "run": self._run.id,
                "number": str(self._run.number),
                "file": self._run.file,
                "mode": self._run.mode,
                "seed": str(self._run.seed),
                "status": self._run.status.value,
            },
        )
        finish: Callable[[], object] = self._writer.finish
        finish()
        return self._content.getvalue()
