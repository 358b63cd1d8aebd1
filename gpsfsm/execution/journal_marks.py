"""Marks in the file of a journal: who has it open, and how far each run and the queue go.

A process that begins to write marks the journal OPENED, and that is in the file itself, not only in
the log beside it, before anything is acknowledged. When it is closed in good order, the end of each
run and of the plan queue is recorded, and it is marked CLOSED. So a file that has lost its log, or
the end of a run, says so. The exception is a reader that keeps an older state of the journal for
more than a second: as long as it does, the mark is in the log alone (``settle``). Journals of the
first form have no marks.
"""

from __future__ import annotations

import sqlite3
from enum import StrEnum
from typing import NamedTuple

from gpsfsm.execution.journal_errors import DATABASE_ERRORS, DamagedJournalError, told

__all__ = [
    "QUEUE",
    "Ending",
    "Mark",
    "MarkKind",
    "ending_of",
    "first_mark",
    "last_mark",
    "mark_closed",
    "mark_opened",
    "settle",
    "write_mark",
]

QUEUE = 0
"""Stands for the plan queue where a number of a run is expected."""

_WAIT_MS = 1000
"""How long the first event of a process waits for those who read an older state."""


class MarkKind(StrEnum):
    """What has happened to a journal."""

    MADE = "MADE"
    UPGRADED = "UPGRADED"  # from the first form; what was in it then has no hashes of wall times
    OPENED = "OPENED"
    CLOSED = "CLOSED"


class Mark(NamedTuple):
    """A mark, with the number of runs and decisions of the queue that were there then."""

    seq: int
    kind: MarkKind
    runs: int
    decisions: int

    @property
    def closed(self) -> bool:
        """Whether the file holds all that was acknowledged."""
        return self.kind is not MarkKind.OPENED


class Ending(NamedTuple):
    """How far a run, or the queue, went when the journal was closed.

    ``rows`` are its events or decisions, ``ended`` the data of its event ENDED ("" without one),
    ``hash`` and ``wall_hash`` the last links of its chains.
    """

    rows: int
    ended: str
    hash: bytes
    wall_hash: bytes


_MARK = "SELECT seq, kind, runs, decisions FROM mark ORDER BY seq"
_LAST = "SELECT rows, ended, hash, wall_hash FROM ending WHERE run = ? ORDER BY rows DESC LIMIT 1"
_WRITE = """INSERT INTO mark SELECT coalesce(max(seq), 0) + 1, ?,
  (SELECT count(*) FROM run), (SELECT coalesce(max(seq), 0) FROM queue) FROM mark"""
_ENDINGS = """INSERT INTO ending
  SELECT run.run, coalesce(last.seq, 0), coalesce(ended.data, ''), coalesce(last.hash, x''),
    coalesce(last.wall_hash, run.wall_hash)
  FROM run LEFT JOIN event AS last ON last.run = run.run AND last.seq = (
    SELECT max(seq) FROM event WHERE event.run = run.run)
  LEFT JOIN event AS ended ON ended.run = run.run AND ended.kind = 'ENDED'
  WHERE NOT EXISTS (
    SELECT 1 FROM ending WHERE ending.run = run.run AND rows = coalesce(last.seq, 0))
  UNION ALL
  SELECT 0, seq, '', hash, wall_hash FROM queue WHERE seq = (SELECT max(seq) FROM queue)
  AND NOT EXISTS (SELECT 1 FROM ending WHERE run = 0 AND rows = queue.seq)"""


def first_mark(connection: sqlite3.Connection, path: str) -> Mark:
    """How the journal began. Raises JournalError."""
    return _mark(connection, path, _MARK)


def last_mark(connection: sqlite3.Connection, path: str) -> Mark:
    """What has happened to the journal last. Raises JournalError."""
    return _mark(connection, path, f"{_MARK} DESC")


def _mark(connection: sqlite3.Connection, path: str, statement: str) -> Mark:
    try:
        row = connection.execute(f"{statement} LIMIT 1").fetchone()
    except DATABASE_ERRORS as error:
        raise told(error, path, "read") from error
    kind = None if row is None else next((kind for kind in MarkKind if kind == row[1]), None)
    if kind is None or [type(value) for value in row] != [int, str, int, int]:
        raise DamagedJournalError(f"{path}: the journal is damaged: its marks are not as written")
    return Mark(row[0], kind, *row[2:])


def ending_of(connection: sqlite3.Connection, path: str, run: int) -> Ending | None:
    """The end of a run that was recorded last, or that of the QUEUE. Raises JournalError."""
    try:
        row = connection.execute(_LAST, (run,)).fetchone()
    except DATABASE_ERRORS as error:
        raise told(error, path, "read") from error
    if row is None:
        return None
    if [type(value) for value in row] != [int, str, bytes, bytes]:
        raise DamagedJournalError(f"{path}: the journal is damaged: its marks are not as written")
    return Ending(*row)


def write_mark(connection: sqlite3.Connection, kind: MarkKind) -> None:
    """Append a mark; part of a transaction. Raises sqlite3.Error."""
    connection.execute(_WRITE, (kind.value,))


def mark_opened(connection: sqlite3.Connection, path: str) -> None:
    """Mark the journal as being written to; part of a transaction. Raises sqlite3.Error."""
    if last_mark(connection, path).closed:
        write_mark(connection, MarkKind.OPENED)


def mark_closed(connection: sqlite3.Connection, path: str) -> None:
    """Record all ends, if the journal is open; part of a transaction. Raises sqlite3.Error."""
    if not last_mark(connection, path).closed:
        connection.execute(_ENDINGS)
        write_mark(connection, MarkKind.CLOSED)


def settle(connection: sqlite3.Connection, *, wait: bool = False) -> bool:
    """Move what the log holds into the file, as far as nobody reads; whether that was all of it.

    SQLite moves nothing past what any reader sees: with ``wait`` up to a second is waited for those
    that see less. Who reads longer holds no event up, and what is acknowledged meanwhile is missing
    from a copy of the file alone that does not say so. The log keeps its content, so a log that is
    empty beside an open journal was cut off. Raises sqlite3.Error.
    """
    if not wait:
        return _checkpoint(connection, "PASSIVE")
    (usual,) = connection.execute("PRAGMA busy_timeout").fetchone()
    connection.execute(f"PRAGMA busy_timeout = {_WAIT_MS}")
    try:
        return _checkpoint(connection, "FULL")
    finally:
        connection.execute(f"PRAGMA busy_timeout = {usual}")


def _checkpoint(connection: sqlite3.Connection, how: str) -> bool:
    busy, pages, moved = connection.execute(f"PRAGMA wal_checkpoint({how})").fetchone()
    return not busy and pages == moved
