"""Reading a journal: its runs, their events, and whether they are as they were written."""

from __future__ import annotations

import hashlib
import sqlite3
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.journal_errors import (
    DamagedJournalError,
    EmptyJournalError,
    JournalError,
    told,
)
from gpsfsm.execution.journal_file import open_to_read
from gpsfsm.execution.journal_loss import loss_in
from gpsfsm.execution.journal_rows import Row, chained, decoded, line, queue_line
from gpsfsm.execution.records import Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["JournalReader", "StoredRun"]

_EVENTS = (
    "SELECT seq, at_us, input, record, kind, node, element, runner, interface, provider, cause, "
    "data, message, wall_us, hash FROM event WHERE run = ? AND seq > ? ORDER BY seq"
)


_RUNS = "SELECT run, id, header, file, wall_us FROM run"
_SPAN = "SELECT coalesce(min(run), 0), coalesce(max(run), 0) FROM run"
_EVENT_TYPES = "iiiisisississib"
_TYPES = {"i": int, "s": str, "b": bytes}
_QUEUE = (
    "SELECT seq, at_us, kind, plan, by, data, message, hash FROM queue WHERE seq > ? ORDER BY seq"
)
_WALL = "SELECT wall_us FROM queue ORDER BY seq"


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A run in a journal. ``header`` is the heading with digests; ``events`` how many there are.

    ``status`` is RUNNING for a run that has no end in the journal: it goes on, or its process has
    ended without it.
    """

    number: int
    id: str
    header: Mapping[str, Any]
    file: str
    wall_us: int
    events: int
    at_us: int
    status: Status

    @property
    def seed(self) -> int:
        """The seed of the run."""
        found = self.header.get("seed", 0)
        return found if isinstance(found, int) else 0

    @property
    def mode(self) -> str:
        """How the runners were made."""
        return str(self.header.get("mode", ""))

    @property
    def options(self) -> Mapping[str, Any]:
        """What else decided what happened."""
        found = self.header.get("options", {})
        return found if isinstance(found, dict) else {}


class JournalReader:
    """A journal that is read, also while a run writes to it. Raises JournalError."""

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            self._connection = open_to_read(path)
        except EmptyJournalError:
            loss_in(path)  # maybe there was something
            raise

    def each_run(self) -> Iterator[StoredRun]:
        """One run after the other, the first one first."""
        for row in self._rows(f"{_RUNS} ORDER BY run", types="isssi"):
            yield self._stored(*row)

    def runs(self) -> tuple[StoredRun, ...]:
        """All runs, the first one first."""
        return tuple(self.each_run())

    def run(self, number: int | None = None) -> StoredRun:
        """The run with this number, or the last one."""
        if number is None:
            found = self._rows(f"{_RUNS} ORDER BY run DESC LIMIT 1", types="isssi")
        else:
            found = self._rows(f"{_RUNS} WHERE run = ?", number, types="isssi")
        row = next(found, None)
        if row is not None:
            return self._stored(*row)
        self.check_end()  # maybe there was one
        first, last = next(self._rows(_SPAN, types="ii"))
        if not last:
            raise JournalError(f"{self.path}: there is no run in this journal")
        held = f"run {first} alone" if first == last else f"runs {first} to {last}"
        raise JournalError(f"there is no run {number} in {self.path}; it holds {held}")

    def has_runs(self) -> bool:
        """Whether any run has begun."""
        return bool(next(self._rows(_SPAN, types="ii"))[1])

    def check_end(self) -> str:
        """Whether all is here that was ever written: a note about what a power failure has taken.

        The note also tells if that cannot be known. Raises DamagedJournalError if something is
        missing that the journal has to outlive.
        """
        return loss_in(self.path, self._connection)

    def check_file(self) -> None:
        """Raises DamagedJournalError if the file is damaged as a database."""
        for (found,) in self._rows("PRAGMA quick_check(1)", types="s"):
            if found != "ok":
                what = " ".join(found.split())
                raise DamagedJournalError(
                    f"{self.path}: the journal is damaged ({what:.200}); events before the damage "
                    "can still be read"
                )

    def _stored(self, number: int, name: str, header: str, file: str, wall_us: int) -> StoredRun:
        last = "SELECT seq, at_us FROM event WHERE run = ? ORDER BY seq DESC LIMIT 1"
        count, at_us = next(self._rows(last, number, types="ii"), (0, 0))
        ended = next(
            self._rows(
                "SELECT data FROM event WHERE run = ? AND kind = 'ENDED'", number, types="s"
            ),
            None,
        )
        try:
            status = Status(str(decoded(ended[0])["status"])) if ended else Status.RUNNING
        except (KeyError, ValueError):
            raise DamagedJournalError(f"{self.path}: the end of run {number} is damaged") from None
        return StoredRun(number, name, decoded(header), file, wall_us, count, at_us, status)

    def content(self, run: StoredRun, name: str) -> bytes:
        """The ``plan``, ``world`` or ``capabilities`` of a run; b"" if it has none."""
        digest = run.header.get(name, "")
        statement = "SELECT bytes FROM content WHERE sha256 = ?"
        try:
            found = next(self._rows(statement, str(digest), types="b"), None)
        except DamagedJournalError as error:
            why = str(error).removeprefix(f"{self.path}: ")
            raise DamagedJournalError(
                f"{self.path}: the {name} of run {run.number} is damaged: {why}"
            ) from error
        content: bytes = found[0] if found else b""
        if digest and hashlib.sha256(content).hexdigest() != digest:
            raise DamagedJournalError(f"{self.path}: the {name} of run {run.number} is damaged")
        return content

    def events(self, number: int, *, after: int = 0) -> Iterator[Row]:
        """The events of a run in order, those behind the event ``after``."""
        for values in self._rows(_EVENTS, number, after, types=_EVENT_TYPES):
            yield _row(values)

    def verify(self, number: int, *, last: int = 0) -> int:
        """How many events a run has, if none was changed, added or taken out of the middle.

        With ``last`` only so many at the end are looked at. Raises DamagedJournalError otherwise.
        Events that were taken away at the end are told of by ``check_end``.
        """
        self.content(self.run(number), "plan")
        header, name = next(
            self._rows("SELECT header, id FROM run WHERE run = ?", number, types="ss")
        )
        if hashlib.sha256(f"{number}\n{header}".encode()).hexdigest()[:32] != name:
            raise DamagedJournalError(f"{self.path}: the heading of run {number} was changed")
        link, count = chained(b"", header), 0
        if last:
            sought = "SELECT hash, seq FROM event WHERE run = ? ORDER BY seq DESC LIMIT 1 OFFSET ?"
            link, count = next(self._rows(sought, number, last, types="bi"), (link, 0))
        for values in self._rows(_EVENTS, number, count, types=_EVENT_TYPES):
            count += 1
            link = chained(link, line(_row(values)))
            if values[0] != count or values[-1] != link:
                raise DamagedJournalError(
                    f"{self.path}: event {count} of run {number} is not as it was written"
                )
        return count

    def queue(self, *, after: int = 0) -> Iterator[tuple[Any, ...]]:
        """The decisions of the plan queue: seq, at_us, kind, plan, by, data (JSON), message."""
        for *row, _ in self._rows(_QUEUE, after, types="iisiissb"):
            yield tuple(row)

    def queue_wall_us(self) -> Iterator[int]:
        """When each decision was written, in microseconds since 1970."""
        for (wall_us,) in self._rows(_WALL, types="i"):
            yield wall_us

    def verify_queue(self) -> int:
        """How many decisions of the queue there are; like ``verify``."""
        link, count = b"", 0
        for *row, found in self._rows(_QUEUE, 0, types="iisiissb"):
            count += 1
            link = chained(link, queue_line(row))
            if row[0] != count or found != link:
                raise DamagedJournalError(
                    f"{self.path}: decision {count} of the plan queue is not as it was written"
                )
        return count

    def _rows(self, statement: str, *values: object, types: str) -> Iterator[tuple[Any, ...]]:
        """Rows whose values are integers, strings and bytes, as ``types`` tells."""
        wanted = tuple(_TYPES[letter] for letter in types)
        try:
            for row in self._connection.execute(statement, values):
                if tuple(map(type, row)) != wanted:
                    raise DamagedJournalError(f"{self.path}: there are values of the wrong type")
                yield row
        except sqlite3.Error as error:
            raise told(error, self.path, "read") from error

    def close(self) -> None:
        """Let go of the file."""
        self._connection.close()

    def __enter__(self) -> JournalReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _row(values: tuple[Any, ...]) -> Row:
    return Row._make(values[:-1])._replace(input=bool(values[2]), record=bool(values[3]))
