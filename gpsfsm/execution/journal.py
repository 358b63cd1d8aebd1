"""The journal: every event of a run is in it before it has any effect (docs/execution.md).

An SQLite file that is only ever appended to. An input and what follows from it are one transaction.
"""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from gpsfsm.errors import UsageError
from gpsfsm.execution.journal_errors import (
    DATABASE_ERRORS,
    EmptyJournalError,
    JournalError,
    journal_error,
)
from gpsfsm.execution.journal_file import (
    DURABILITY,
    FIRST_FORM,
    Lease,
    check_place,
    form_of,
    mark_closed,
    mark_opened,
    open_to_write,
    settle,
    upgrade,
)
from gpsfsm.execution.journal_loss import Seen, check_no_log_alone, held
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import (
    RowMaker,
    canonical,
    chained,
    clean,
    heading_wall_hash,
    line,
    queue_line,
    unlined,
    wall_chained,
)
from gpsfsm.execution.kernel import VERSION as KERNEL_VERSION
from gpsfsm.execution.queue import QueueKind, QueueRow
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Input, Record, RunValue

_Result = TypeVar("_Result")
_EVENT = "INSERT INTO event VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
_LAST_OF_RUN = "SELECT seq, hash, wall_hash FROM event WHERE run = ? ORDER BY seq DESC LIMIT 1"
_LAST_OF_QUEUE = "SELECT seq, hash, wall_hash FROM queue ORDER BY seq DESC LIMIT 1"


class _Links(NamedTuple):
    """The last links of the two chains of a run."""

    hash: bytes
    wall_hash: bytes


@dataclass(frozen=True, slots=True)
class Heading:
    """The heading of a run; the same heading and inputs give the same events.

    ``plan`` and ``world`` are the files' contents, ``capabilities`` the table of the library
    (``gpsfsm.capabilities.table.dump``), ``mode`` says how runners are made, ``options`` whatever
    else decides what happens, ``parent`` is the id of the run whose plan loaded this one. ``file``
    is the plan's name for people and no part of the run's identity.
    """

    plan: bytes
    file: str = ""
    capabilities: str = ""
    world: bytes = b""
    seed: int = 0
    mode: str = ""
    options: Mapping[str, RunValue] = field(default_factory=dict)
    parent: str = ""

    def text(self) -> str:
        """The heading as canonical JSON, with digests for contents."""
        return canonical(
            {
                "plan": _digest(self.plan),
                "capabilities": _digest(self.capabilities.encode()),
                "world": _digest(self.world) if self.world else "",
                "seed": self.seed,
                "mode": self.mode,
                "options": dict(self.options),
                "parent": self.parent,
                "version": VERSION,
                "kernel": KERNEL_VERSION,
            }
        )


class Journal:
    """A journal that is written. Only one process at a time can have it.

    ``durability``: what is written outlives a power failure (``power``), the end of the process
    (``process``: a power failure may take the last events, but never damages the file), or nothing
    in particular (``none``). ``wall_us`` gives the time in microseconds since 1970. ``note`` tells
    what a power failure has taken of what is already there, or may have. Raises JournalError.
    """

    def __init__(
        self,
        path: str,
        durability: str = "power",
        *,
        wall_us: Callable[[], int] = lambda: time.time_ns() // 1000,
    ) -> None:
        if durability not in DURABILITY:
            raise UsageError(f"the durability is one of {', '.join(DURABILITY)}")
        self.path = path
        self._wall_us = wall_us
        self._begun = False  # a run: then it can be resumed
        self._marked = False  # as open, in a transaction
        self._settled = False  # and in the file itself
        check_place(path)
        self._lease = Lease(path)
        try:
            self.note = check_before_writing(path)
            self._connection = open_to_write(path, durability)
            try:
                self._lease.hold()
                self._seen = Seen(path, durability, held(self._connection, path))
            except BaseException:
                self._connection.close()
                raise
        except BaseException:
            self._lease.release()
            raise

    def begin(
        self, kernel: Kernel, heading: Heading, *, queued: tuple[int, int] | None = None
    ) -> RunWriter:
        """Begin the next run; ``kernel`` is that of the run.

        ``queued``: the time of the plan queue and the number of the plan that the run is of; the
        queue gets a row RUN about it.
        """
        text = heading.text()
        contents = [heading.plan, heading.capabilities.encode(), heading.world]

        def insert() -> tuple[int, str, bytes]:
            cursor = self._connection.execute("SELECT coalesce(max(run), 0) + 1 FROM run")
            number: int = cursor.fetchone()[0]
            name = _digest(f"{number}\n{text}".encode())[:32]
            self._connection.executemany(
                "INSERT INTO content VALUES (?, ?) ON CONFLICT DO NOTHING",
                [(_digest(content), content) for content in contents if content],
            )
            file, now = clean(heading.file), self._wall_us()
            wall_hash = heading_wall_hash(name, file, now)
            self._connection.execute(
                "INSERT INTO run VALUES (?, ?, ?, ?, ?, ?)",
                (number, name, text, file, now, wall_hash),
            )
            if queued is not None:
                row = QueueRow(QueueKind.RUN, queued[1], data={"run": number})
                self._insert_queue(queued[0], row)
            return number, name, wall_hash

        number, name, wall_hash = self._transaction(insert)
        self._begun = True
        first = name if number == 1 else ""
        self._seen.add(runs=1, decisions=0 if queued is None else 1, first=first)
        links = _Links(chained(b"", text), wall_hash)
        return RunWriter(self, number, name, RowMaker(kernel), links)

    def go_on(self, kernel: Kernel, run: int) -> RunWriter:
        """A writer that goes on behind the last event of a run; ``kernel`` is one of its plan."""

        def find() -> tuple[str, int, _Links]:
            heading = "SELECT id, header, wall_hash FROM run WHERE run = ?"
            row = self._connection.execute(heading, (run,)).fetchone()
            if row is None:
                raise JournalError(f"there is no run {run} in {self.path}")
            begun = (0, chained(b"", row[1]), row[2])
            seq, *links = self._connection.execute(_LAST_OF_RUN, (run,)).fetchone() or begun
            return row[0], seq, _Links(*links)

        self._begun = True
        name, seq, links = self._transaction(find)
        return RunWriter(self, run, name, RowMaker(kernel, seq), links)

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        """Keep a decision of the plan queue; a chain of its own."""
        self._transaction(lambda: self._insert_queue(at_us, row))
        self._seen.add(decisions=1)

    def _insert_queue(self, at_us: int, row: QueueRow) -> None:
        last = self._connection.execute(_LAST_OF_QUEUE).fetchone()
        seq, link, wall_link = last or (0, b"", b"")
        data, message, now = canonical(row.data or {}), clean(row.message), self._wall_us()
        values = (seq + 1, at_us, row.kind.value, row.plan, row.by, data, message)
        hashes = chained(link, queue_line(values)), wall_chained(wall_link, seq + 1, now)
        self._connection.execute(
            "INSERT INTO queue VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", (*values, now, *hashes)
        )

    def append(self, run: int, rows: Sequence[Row], links: _Links) -> _Links:
        """Keep events of a run in one transaction; the last links of its chains. For RunWriter."""
        now = self._wall_us()
        link, wall_link = links
        values = []
        for place, row in enumerate(rows):
            assert row.seq == rows[0].seq + place, "events are numbered without a gap"
            link = chained(link, line(row))
            wall_link = wall_chained(wall_link, row.seq, now, unlined(row))
            values.append((run, *row[:-1], now, link, wall_link))
        self._transaction(lambda: self._connection.executemany(_EVENT, values))
        self._seen.add(events=len(values))
        return _Links(link, wall_link)

    def _transaction(self, action: Callable[[], _Result]) -> _Result:
        if not self._marked:
            self._committed(self._mark)
            self._marked = True
            self._settle(wait=True)
        elif not self._settled:
            self._settle()
        return self._committed(action)

    def _mark(self) -> None:
        """Before anything is acknowledged, the file itself has to tell that it is not all.

        With ``settle``, which says when it does not.
        """
        if form_of(self._connection, self.path) == FIRST_FORM:
            upgrade(self._connection)
        mark_opened(self._connection, self.path)

    def _settle(self, *, wait: bool = False) -> None:
        try:
            self._settled = settle(self._connection, wait=wait)
        except DATABASE_ERRORS as error:
            raise journal_error(error, self.path, "written", begun=self._begun) from error

    def _committed(self, action: Callable[[], _Result]) -> _Result:
        connection = self._connection
        try:
            connection.execute("BEGIN IMMEDIATE")
            try:
                result = action()
                connection.execute("COMMIT")
            except BaseException:
                if connection.in_transaction:
                    connection.execute("ROLLBACK")
                raise
        except DATABASE_ERRORS as error:
            raise journal_error(error, self.path, "written", begun=self._begun) from error
        return result

    def beat(self) -> None:
        """Give a sign of life while a run goes on in which nothing happens."""
        self._lease.beat()

    def close(self) -> None:
        """Move everything into the one file and let another process write."""
        moved = False
        try:
            self._committed(self._mark_closed)
            moved = not self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()[0]
        except (*DATABASE_ERRORS, JournalError):
            pass  # everything is safe in the file beside it
        finally:
            self._connection.close()
            self._seen.close(remove=moved)
            self._lease.release()

    def _mark_closed(self) -> None:
        if form_of(self._connection, self.path) > FIRST_FORM:
            mark_closed(self._connection, self.path)

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class RunWriter:
    """The sink for one run. Made by ``Journal``."""

    def __init__(
        self, journal: Journal, number: int, name: str, maker: RowMaker, links: _Links
    ) -> None:
        self.number = number
        self.id = name
        self._journal = journal
        self._maker = maker
        self._links = links
        self._failure: BaseException | None = None

    @property
    def seq(self) -> int:
        """The number of the last event."""
        return self._maker.seq

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Keep an input and what follows from it; when this returns it is safe.

        Raises JournalError if it cannot be kept, now and ever after: behind a gap nothing may
        follow.
        """
        if self._failure is not None:
            raise self._failure
        try:
            rows = self._maker.make(at_us, happened, records)
            self._links = self._journal.append(self.number, rows, self._links)
        except BaseException as error:
            self._failure = error
            raise


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


_LARGEST = 1 << 28
"""Bytes of a file of which the whole queue is checked."""

_LAST_EVENTS = 10_000
"""Events at the end of the last run that are checked one by one."""


def check_before_writing(path: str) -> str:
    """A note about what a power failure has taken or may have taken, "" for nothing.

    Raises DamagedJournalError for a journal that is not as it was written: nothing may be written
    behind damage, and SQLite must not have written when it is found. Changes nothing.
    """
    place = Path(path)
    if not place.exists() or not place.stat().st_size:
        check_no_log_alone(path)
        return ""
    try:
        reader = JournalReader(path)
    except EmptyJournalError:
        return ""
    with reader:
        note = reader.check()
        if place.stat().st_size <= _LARGEST:
            reader.verify_queue()
        if reader.has_runs():
            reader.verify(reader.run().number, last=_LAST_EVENTS)
    return note
