"""Logs of long-running processes: events on standard error, for people or as JSON.

An event has a level, a name, a message and fields. As text it is ``gpsfsm:`` and its message, and
for a defect where that is in the source; as JSON it is an object on a line of its own, with its
time and all fields. A thread writes, so that a terminal or pipe that takes nothing more cannot hold
up whoever serves a robot: when too many lines wait, further ones are counted and dropped. Messages
and fields never hold tokens or texts of plans.

    with writing("info", "json"):
        event("info", "serving", "serving at http://…", address="http://…")

    {"time":"2026-01-31T12:00:00.000Z","level":"info","event":"serving","message":"serving at …",…}
"""

from __future__ import annotations

import json
import logging
import queue
import threading
import traceback
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

from gpsfsm.model.printable import clip
from gpsfsm.streams import Form, captured_stderr, write_stderr

if TYPE_CHECKING:
    from collections.abc import Iterator

Level = Literal["debug", "info", "warning", "error"]
Format = Literal["text", "json"]
LEVELS: tuple[Level, ...] = get_args(Level)
FORMATS: tuple[Format, ...] = get_args(Format)

REQUEST: Final = "request"
"""The name of events of an access log: as text, these alone begin with their time."""

_MOST_WAITING = 10_000
_LONGEST = 2_000
_MOST_FRAMES = 30
_END_S = 2.0
_PREFIX = "gpsfsm: "
_FOREIGN = ("uvicorn", "asyncio", "opentelemetry")
"""Loggers of libraries whose messages are events of ours."""
_SAID = ("Traceback (most recent call last)", "Application startup failed")
"""How uvicorn begins to repeat why an application has not started, which said so itself."""


class Log:
    """A log. ``level`` is the lowest that is written."""

    def __init__(self, level: Level, output_format: Format) -> None:
        self.level, self.format = level, output_format
        self._least = LEVELS.index(level)
        self._lines: queue.Queue[str | None] | None = None
        self._lost = 0
        self._writer = threading.Thread(target=self._write_all, name="log", daemon=True)

    def takes(self, level: Level) -> bool:
        """True if events of this level are written."""
        return LEVELS.index(level) >= self._least

    def event(self, level: Level, name: str, message: str, fields: dict[str, Any]) -> None:
        """Write an event, if its level is high enough."""
        if not self.takes(level):
            return
        line = self._line(level, name, message, fields)
        if self._lines is None:
            self._write(line)
            return
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            self._lost += 1

    def _line(self, level: Level, name: str, message: str, fields: dict[str, Any]) -> str:
        if self.format == "text":
            first, *others = message.splitlines() or [""]
            if name not in _FOREIGN:
                others += [f"at {place}" for place in fields.get("stack", ())]
            first = f"{now()} {first}" if name == REQUEST else first
            # Indented: no line of a message, whatever is in it, looks like an event of its own.
            return "".join(f"{line}\n" for line in (_PREFIX + first, *(f"  {x}" for x in others)))
        row = {"time": now(), "level": level, "event": name, "message": message, **fields}
        bounded = {key: _bounded(value) for key, value in row.items() if value is not None}
        return json.dumps(bounded, separators=(",", ":")) + "\n"

    def _write(self, line: str) -> None:
        write_stderr(line, Form.JSON if self.format == "json" else Form.TEXT)

    def start(self) -> None:
        """Let a thread write from now on."""
        self._lines = queue.Queue(_MOST_WAITING)
        self._writer.start()

    def end(self) -> None:
        """Write what waits, if that does not take for ever."""
        assert self._lines is not None
        with suppress(queue.Full):
            self._lines.put(None, timeout=_END_S)
        self._writer.join(_END_S)

    def _write_all(self) -> None:
        assert self._lines is not None
        while (line := self._lines.get()) is not None:
            self._write(line)
            if self._lost:
                lost, self._lost = self._lost, 0
                text = f"{lost:,} lines of the log were dropped: standard error takes no more"
                self._write(self._line("warning", "log_dropped", text, {"lines": lost}))


def now() -> str:
    """The time in UTC as RFC 3339 has it."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _bounded(value: Any) -> Any:
    if isinstance(value, str):
        return value if len(value) <= _LONGEST else value[: _LONGEST - 1] + "…"
    return value


_QUIET = Log("warning", "text")
"""The log of a process that has begun none: what goes wrong is written at once."""
_LOGS = [_QUIET]


def event(level: Level, name: str, message: str, **fields: Any) -> None:
    """Write an event to the log of this process; fields that are None are left out."""
    _LOGS[-1].event(level, name, message, fields)


def takes(level: Level) -> bool:
    """True if the log of this process writes events of this level."""
    return _LOGS[-1].takes(level)


def is_json() -> bool:
    """True if each line of the log is an object."""
    return _LOGS[-1].format == "json"


@contextmanager
def writing(level: Level, output_format: Format) -> Iterator[None]:
    """The log of this process: its own events, messages of libraries, and errors of commands.

    As JSON it takes all that this process writes to standard error.
    """
    log, handler = Log(level, output_format), _Handler()
    before = [(each, each.level, each.propagate) for each in map(logging.getLogger, _FOREIGN)]
    log.start()
    _LOGS.append(log)
    for logger, _, _ in before:
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
        logger.propagate = False
    try:
        if output_format == "json":
            with captured_stderr(_from_stderr):
                yield
        else:
            yield
    finally:
        for logger, old_level, propagates in before:
            logger.removeHandler(handler)
            logger.setLevel(old_level)
            logger.propagate = propagates
        _LOGS.remove(log)
        log.end()


def _from_stderr(text: str) -> None:
    """A message that was made for standard error."""
    event("error", "message", text.removeprefix(_PREFIX).rstrip("\n"))


def from_child(process: str, line: bytes) -> None:
    """A line that a child process has written to its standard error, which is a pipe."""
    text = line.decode("utf-8", "replace").rstrip("\r\n").removeprefix(_PREFIX)
    event("warning", "output", clip(text, _LONGEST), process=process)


def failure(name: str, message: str, error: BaseException, **fields: Any) -> None:
    """Write that something failed by a defect. The text of the exception may hold a plan: not it.

    The stack goes with it as places of the source: the first is where it was raised.
    """
    event("error", name, message, **_about(error), **fields)


def _about(error: BaseException) -> dict[str, Any]:
    frames = traceback.extract_tb(error.__traceback__)[-_MOST_FRAMES:]
    stack = [f"{each.filename}:{each.lineno} {each.name}" for each in reversed(frames)]
    return {"error": type(error).__name__, "stack": stack}


class _Handler(logging.Handler):
    """Makes events of the messages of libraries."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record. What libraries call information is of use to nobody but a developer."""
        level: Level = "debug"
        if record.levelno >= logging.ERROR:
            level = "error"
        elif record.levelno >= logging.WARNING:
            level = "warning"
        library = record.name.partition(".")[0]
        try:
            first, *_ = record.getMessage().splitlines() or [""]  # further lines may hold a plan
        except (TypeError, ValueError):
            first = str(record.msg)
        level = "debug" if first.startswith(_SAID) else level
        if not takes(level):
            return
        error = record.exc_info[1] if record.exc_info else None
        about = {} if error is None else _about(error)
        kind = f" ({about['error']})" if about else ""
        event(level, library, f"{library}: {clip(first, 300)}{kind}", **about)
