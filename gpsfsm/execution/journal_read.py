"""Reading a journal: its runs, their events, and whether they are as they were written."""

from __future__ import annotations

import hashlib
import sqlite3
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.journal_errors import DamagedJournalError, JournalError, told
from gpsfsm.execution.journal_file import open_to_read
from gpsfsm.execution.journal_rows import Row, chained, decoded, line, queue_line
from gpsfsm.execution.records import Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["JournalReader", "StoredRun"]

_EVENTS = (
    "SELECT seq, at_us, input, record, kind, node, element, runner, interface, provider, cause, "
    "data, message, wall_us, hash FROM event WHERE run = ? ORDER BY seq"
)


_EVENT_TYPES = "iiiisisississib"
_TYPES = {"i": int, "s": str, "b": bytes}
_QUEUE = "SELECT seq, at_us, kind, plan, by, data, message, hash FROM queue ORDER BY seq"


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
        self._connection = open_to_read(path)

    def runs(self) -> tuple[StoredRun, ...]:
        """All runs, the first one first."""
        statement = "SELECT run, id, header, file, wall_us FROM run ORDER BY run"
        return tuple(self._stored(*row) for row in self._rows(statement, types="isssi"))

    def run(self, number: int | None = None) -> StoredRun:
        """The run with this number, or the last one."""
        known = self.runs()
        if not known:
            raise JournalError(f"{self.path}: there is no run in this journal")
        if number is None:
            return known[-1]
        for found in known:
            if found.number == number:
                return found
        raise JournalError(
            f"{self.path}: there is no run {number} in this journal, "
            f"only {', '.join(str(found.number) for found in known[:20])}"
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
        found = next(self._rows(statement, str(digest), types="b"), None)
        content: bytes = found[0] if found else b""
        if digest and hashlib.sha256(content).hexdigest() != digest:
            raise DamagedJournalError(f"{self.path}: the {name} of run {run.number} is damaged")
        return content

    def events(self, number: int) -> Iterator[Row]:
        """The events of a run in order."""
        for values in self._rows(_EVENTS, number, types=_EVENT_TYPES):
            yield _row(values)

    def verify(self, number: int) -> int:
        """How many events a run has, if none was changed, added or taken out of the middle.

        Raises DamagedJournalError otherwise. That the last events were taken away can only be told
        if the end of the run is known from elsewhere.
        """
        self.content(self.run(number), "plan")
        header, name = next(
            self._rows("SELECT header, id FROM run WHERE run = ?", number, types="ss")
        )
        if hashlib.sha256(f"{number}\n{header}".encode()).hexdigest()[:32] != name:
            raise DamagedJournalError(f"{self.path}: the heading of run {number} was changed")
        link, count = chained(b"", header), 0
        for values in self._rows(_EVENTS, number, types=_EVENT_TYPES):
            count += 1
            link = chained(link, line(_row(values)))
            if values[0] != count or values[-1] != link:
                raise DamagedJournalError(
                    f"{self.path}: event {count} of run {number} is not as it was written"
                )
        return count

    def queue(self) -> Iterator[tuple[Any, ...]]:
        """The decisions of the plan queue: seq, at_us, kind, plan, by, data (JSON), message."""
        for *row, _ in self._rows(_QUEUE, types="iisiissb"):
            yield tuple(row)

    def verify_queue(self) -> int:
        """How many decisions of the queue there are; like ``verify``."""
        link, count = b"", 0
        for *row, found in self._rows(_QUEUE, types="iisiissb"):
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
