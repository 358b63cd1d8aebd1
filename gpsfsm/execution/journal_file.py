"""The file of a journal: its tables, its marks, and how it is opened to write and to read.

A mark says whether the journal was closed, and holds all, or was being written to.
"""

from __future__ import annotations

import errno
import os
import sqlite3
import time
from contextlib import closing, suppress
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from gpsfsm.execution.journal_errors import (
    DATABASE_ERRORS,
    DamagedJournalError,
    EmptyJournalError,
    JournalBusyError,
    JournalError,
    journal_error,
)

DURABILITY = {"power": "FULL", "process": "NORMAL", "none": "OFF"}
"""What a journal outlives, and the way of synchronisation that takes."""

_NO_FILES = ("SQLITE_CANTOPEN", "SQLITE_READONLY", "SQLITE_IOERR_SHM", "SQLITE_FULL")
"""What comes of a folder in which no file can be made that belongs to a log."""
_SMALLEST = 512
"""Bytes of the smallest page."""
_APPLICATION = 0x67707366  # "gpsf"
FIRST_FORM, _FORM = 1, 2
_FIRST_TABLES = """
CREATE TABLE content (sha256 TEXT PRIMARY KEY, bytes BLOB NOT NULL) STRICT, WITHOUT ROWID;
CREATE TABLE run (
  run INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, header TEXT NOT NULL, file TEXT NOT NULL,
  wall_us INTEGER NOT NULL
) STRICT;
CREATE TABLE event (
  run INTEGER NOT NULL REFERENCES run, seq INTEGER NOT NULL, at_us INTEGER NOT NULL,
  input INTEGER NOT NULL, record INTEGER NOT NULL, kind TEXT NOT NULL,
  node INTEGER NOT NULL, element TEXT NOT NULL,
  runner INTEGER NOT NULL, interface TEXT NOT NULL, provider TEXT NOT NULL,
  cause INTEGER NOT NULL, data TEXT NOT NULL, message TEXT NOT NULL, wall_us INTEGER NOT NULL,
  hash BLOB NOT NULL, PRIMARY KEY (run, seq)
) STRICT, WITHOUT ROWID;
CREATE UNIQUE INDEX one_end ON event (run) WHERE kind = 'ENDED';
CREATE TABLE queue (
  seq INTEGER PRIMARY KEY, at_us INTEGER NOT NULL, kind TEXT NOT NULL, plan INTEGER NOT NULL,
  by INTEGER NOT NULL, data TEXT NOT NULL, message TEXT NOT NULL, wall_us INTEGER NOT NULL,
  hash BLOB NOT NULL
) STRICT;
"""
_SECOND_TABLES = """
ALTER TABLE run ADD COLUMN wall_hash BLOB NOT NULL DEFAULT x'';
ALTER TABLE event ADD COLUMN wall_hash BLOB NOT NULL DEFAULT x'';
ALTER TABLE queue ADD COLUMN wall_hash BLOB NOT NULL DEFAULT x'';
CREATE TABLE mark (
  seq INTEGER PRIMARY KEY, kind TEXT NOT NULL, runs INTEGER NOT NULL, decisions INTEGER NOT NULL
) STRICT;
CREATE TABLE ending (
  run INTEGER NOT NULL, rows INTEGER NOT NULL, ended TEXT NOT NULL,
  hash BLOB NOT NULL, wall_hash BLOB NOT NULL, PRIMARY KEY (run, rows)
) STRICT, WITHOUT ROWID;
"""
"""What the second form has besides. It is added to a journal of the first one when a process begins
to write to it; rows that were there keep empty hashes."""

_GUARDED = (("content", "run", "event", "queue"), ("mark", "ending"))
_GUARD = """CREATE TRIGGER {table}_{verb} BEFORE {verb} ON {table} BEGIN
  SELECT RAISE(ABORT, 'a journal is only ever appended to'); END;
"""


def beside(path: str, ending: str) -> str:
    """The path of a file that belongs to a journal: SQLite puts it beside what a link leads to."""
    return f"{os.path.realpath(path) if Path(path).is_symlink() else path}{ending}"


def open_to_write(path: str, durability: str) -> sqlite3.Connection:
    """The journal at ``path``, made if it does not exist. Raises JournalError."""
    check_place(path)
    connection = _connect(path, "rwc", path)
    try:
        _check_kind(connection, path, may_be_new=True)
        connection.execute("PRAGMA journal_mode = WAL").fetchone()
        connection.execute(f"PRAGMA synchronous = {DURABILITY[durability]}")
        connection.execute("PRAGMA foreign_keys = ON")
        if _is_new(connection):
            _make(connection)
        connection.execute("BEGIN IMMEDIATE")  # fails here if nothing can be written
        connection.execute("ROLLBACK")
    except DATABASE_ERRORS as error:
        connection.close()
        raise journal_error(error, path, "written", begun=False) from error
    except JournalError:
        connection.close()
        raise
    return connection


def open_to_read(path: str) -> sqlite3.Connection:
    """The journal at ``path`` for reading, also while another process writes to it."""
    check_place(path)
    if not Path(path).exists():
        raise JournalError(f"{path}: there is no such file")
    # A read-only connection leaves files beside a journal that was complete, another one removes
    # them again; and where there is a log, reading must not change anything.
    connection = _connect(path, "ro" if Path(beside(path, "-wal")).exists() else "rw", path)
    try:
        try:
            _check_kind(connection, path)
        except sqlite3.OperationalError as error:
            # The folder may be read-only or full; without a log beside it the file is complete.
            log = Path(beside(path, "-wal"))
            connection.close()
            if not error.sqlite_errorname.startswith(_NO_FILES) or (
                log.exists() and log.stat().st_size
            ):
                raise
            connection = _connect(path, "ro&immutable=1", path)
            _check_kind(connection, path)
        connection.execute("PRAGMA query_only = ON")
    except DATABASE_ERRORS as error:
        connection.close()
        raise journal_error(error, path, "read") from error
    except JournalError:
        connection.close()
        raise
    return connection


def _connect(path: str, mode: str, shown: str) -> sqlite3.Connection:
    try:
        if mode == "rwc":
            _make_private(path)
        address = f"file:{quote(os.fsencode(Path(path).absolute()))}?mode={mode}"
        connection = sqlite3.connect(address, uri=True, isolation_level=None, timeout=5.0)
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 256_000_000)
        connection.execute("PRAGMA trusted_schema = OFF")
    except DATABASE_ERRORS as error:
        doing = "written" if mode == "rwc" else "read"
        raise journal_error(error, shown, doing, begun=False) from error
    return connection


def _make_private(path: str) -> None:
    """Make the file that is not there yet, for its owner alone: SQLite copies its rights.

    One that is there is not opened: to close it would let go of a lock on it.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    with suppress(OSError):  # what else is wrong, SQLite says
        os.close(os.open(os.path.realpath(path), flags, 0o600))


def check_place(path: str) -> None:
    """Raises JournalError if no journal can be at ``path``; touches nothing.

    Only what cannot be a database is told of here. The file is looked at without its log, and as
    long as a checkpoint is not complete it makes no sense without it: its first page may count
    pages that are in the log alone. Whether it is damaged shows when it is opened with its log.
    """
    place = Path(path)
    if place.is_dir():
        raise JournalError(f"{path}: this is a folder; a journal is a file")
    if not place.exists():
        return
    if not place.is_file():
        raise JournalError(f"{path}: this is not a regular file")
    if 0 < (size := place.stat().st_size) < _SMALLEST:  # SQLite takes it for a new one
        end = f"{size} byte{'s' if size > 1 else ''}"
        raise JournalError(f"{path}: this is not a journal of gpsfsm: it ends after {end}")
    # Not with open(): closing a file takes away the locks that this process has on it.
    connection = _connect(path, "ro&immutable=1", path)
    try:
        connection.execute("PRAGMA application_id").fetchone()
    except DATABASE_ERRORS as error:
        reported = journal_error(error, path, "read")
        if not isinstance(reported, DamagedJournalError):
            raise reported from error
    finally:
        connection.close()


def _is_new(connection: sqlite3.Connection) -> bool:
    return bool(connection.execute("SELECT count(*) = 0 FROM sqlite_master").fetchone()[0])


def _check_kind(connection: sqlite3.Connection, path: str, *, may_be_new: bool = False) -> None:
    application = connection.execute("PRAGMA application_id").fetchone()[0]
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if not application and not version and _is_new(connection):
        if may_be_new:
            return
        raise EmptyJournalError(f"{path}: nothing has been written into this journal yet")
    if application != _APPLICATION or version < 1:
        raise JournalError(f"{path}: this is not a journal of gpsfsm")
    if version > _FORM:
        raise JournalError(
            f"{path}: this journal was written by a newer gpsfsm (its form is {version}, this "
            f"gpsfsm knows {_FORM}); use that one"
        )


def form_of(connection: sqlite3.Connection, path: str) -> int:
    """The form of a journal that is open. Raises JournalError."""
    try:
        form: int = connection.execute("PRAGMA user_version").fetchone()[0]
    except DATABASE_ERRORS as error:
        raise journal_error(error, path, "read") from error
    return form


def _guards(tables: tuple[str, ...]) -> str:
    verbs = ("UPDATE", "DELETE")
    return "".join(_GUARD.format(table=table, verb=verb) for table in tables for verb in verbs)


def _make(connection: sqlite3.Connection) -> None:
    connection.execute("BEGIN IMMEDIATE")
    _run_all(connection, _script(FIRST_FORM))
    connection.execute(f"PRAGMA application_id = {_APPLICATION}")
    _run_all(connection, _script(_FORM))
    connection.execute(f"PRAGMA user_version = {_FORM}")
    write_mark(connection, MarkKind.MADE)
    connection.execute("COMMIT")


def upgrade(connection: sqlite3.Connection) -> None:
    """Give a journal of the first form what it lacks; part of a transaction."""
    _run_all(connection, _script(_FORM))
    connection.execute(f"PRAGMA user_version = {_FORM}")
    write_mark(connection, MarkKind.UPGRADED)


def _script(form: int) -> str:
    tables = _FIRST_TABLES if form == FIRST_FORM else _SECOND_TABLES
    return tables + _guards(_GUARDED[form - FIRST_FORM])


def _run_all(connection: sqlite3.Connection, script: str) -> None:
    """Like ``executescript``, which would commit what is under way."""
    statement = ""
    for line in script.splitlines(keepends=True):
        statement += line
        if sqlite3.complete_statement(statement):
            connection.execute(statement)
            statement = ""


@cache
def _schema(form: int) -> frozenset[tuple[str, ...]]:
    """The tables, indexes and triggers of a form."""
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        for each in range(FIRST_FORM, form + 1):
            _run_all(connection, _script(each))
        return frozenset(connection.execute(_OBJECTS).fetchall())


_OBJECTS = "SELECT type, name, tbl_name, coalesce(sql, '') FROM sqlite_master"


def check_tables(connection: sqlite3.Connection, path: str) -> None:
    """Raises DamagedJournalError if the journal has other tables or triggers than it was made with.

    Guards that are missing are no damage: only who writes needs them.
    """
    try:
        connection.execute("BEGIN")  # it may be upgraded meanwhile
        form = form_of(connection, path)
        here = frozenset(connection.execute(f"{_OBJECTS} LIMIT 1000").fetchall())
        connection.execute("COMMIT")
    except DATABASE_ERRORS as error:
        raise journal_error(error, path, "read") from error
    wanted = _schema(form)
    different = {*(here - wanted), *(each for each in wanted - here if each[0] != "trigger")}
    if different:
        kind, name, *_ = min(map(_shown, different))
        raise DamagedJournalError(
            f"{path}: the journal is damaged: its {kind} {name} differs, or is missing"
        )


def _shown(row: tuple[object, ...]) -> tuple[str, ...]:
    return tuple(f"{value!s:.40}" for value in row)


class Lease:
    """The right to write to a journal: one process has it, and loses it when it ends.

    It is a lock on a file beside the journal, made before there is a journal, and one on the
    journal itself (``hold``), which nobody can take away without the journal. The system lets go of
    both when the process dies.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._file = -1
        self._identity = (0, 0)
        self._connection = _connect(beside(path, "-lock"), "rwc", path)
        try:
            self._connection.execute("PRAGMA busy_timeout = 0")
            # Nothing is ever in this file: without this, a killed process would leave a third one.
            self._connection.execute("PRAGMA journal_mode = MEMORY").fetchone()
            self._connection.execute("BEGIN EXCLUSIVE")
            if Path(path).exists():
                self.hold()
        except DATABASE_ERRORS as error:
            self._connection.close()
            raise journal_error(error, path, "written", begun=False) from error
        except JournalError:
            self._connection.close()
            raise
        with suppress(OSError):  # of an earlier version that was killed
            Path(beside(path, "-lock-journal")).unlink(missing_ok=True)

    def hold(self) -> None:
        """Lock the journal itself, at a byte of which SQLite makes no use. Raises JournalError.

        The lock is one of the process: it goes when any file of it on the journal is closed, which
        SQLite does not do as long as it has a lock itself. So this is called once more when the
        connection of the writer is open; that one is closed before the lease is released.
        """
        import fcntl

        try:
            status = Path(self._path).stat()
            identity = status.st_dev, status.st_ino
            if self._file < 0 and identity not in _LEASED:
                self._file = os.open(self._path, os.O_RDWR | os.O_CLOEXEC | os.O_NONBLOCK)
                status = os.fstat(self._file)
                self._identity = status.st_dev, status.st_ino
            if self._identity != identity:
                raise BlockingIOError(errno.EAGAIN, "it is another file now, or leased already")
            fcntl.lockf(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _LOCKED_BYTE)
        except OSError as error:
            if self._file < 0 and error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
                return  # SQLite may not write either, and says so
            self._close()
            if error.errno in (errno.EACCES, errno.EAGAIN):
                raise JournalBusyError(
                    f"{self._path}: another process writes to this journal; wait until it has ended"
                ) from None
            raise JournalError(
                f"{self._path}: the journal cannot be locked ({error.strerror}); is it on a local "
                "file system?"
            ) from error
        _LEASED.add(self._identity)

    def beat(self) -> None:
        """Give a sign of life, for ``silence_of``."""
        with suppress(OSError):
            os.utime(beside(self._path, "-lock"))

    def _close(self) -> None:
        if self._file >= 0:
            _LEASED.discard(self._identity)
            os.close(self._file)
            self._file = -1

    def release(self) -> None:
        """Let another process write; the connection of the writer is closed."""
        self._close()
        with suppress(sqlite3.Error):
            self._connection.close()


def silence_of(path: str) -> str:
    """The reason why what a journal says of now may be out of date; "" if its writer lives.

    Not for a process that has the journal open: closing a file lets go of all of its locks on it.
    """
    import fcntl

    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        try:
            fcntl.lockf(file, fcntl.LOCK_SH | fcntl.LOCK_NB, 1, _LOCKED_BYTE)
        finally:
            os.close(file)
    except BlockingIOError:
        with suppress(OSError):
            silent_s = abs(time.time() - Path(beside(path, "-lock")).stat().st_mtime)
            if silent_s <= _SILENT_S:
                return ""
            return f"its process has given no sign of life for {silent_s:.0f} s"
        return "its process gives no sign of life"
    except OSError:
        pass  # whoever reads it says so
    return "no process writes to the journal any more"


_SILENT_S = 5.0
"""Without a sign of life for so long a process that goes on with a run counts as silent."""

_LEASED: set[tuple[int, int]] = set()
"""Devices and numbers of the files that this process has locked: it would get a lock twice."""

_LOCKED_BYTE = 0x40000000 + 0x10000
"""Behind the bytes that SQLite locks, where no page of a journal is that is shorter than 1 GB; and
a lock is no obstacle to reading or writing there."""


QUEUE = 0
"""Stands for the plan queue where a number of a run is expected."""

_WAIT_MS = 1000
"""How long the first event of a process waits for those who read an older state."""


class MarkKind(StrEnum):
    """The events in the life of a journal."""

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
        """True if the file holds all that was acknowledged."""
        return self.kind is not MarkKind.OPENED


class Ending(NamedTuple):
    """The length of a run, or of the queue, when the journal was closed.

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
    """The mark with which the journal began. Raises JournalError."""
    return _mark(connection, path, _MARK)


def last_mark(connection: sqlite3.Connection, path: str) -> Mark:
    """The last mark of the journal. Raises JournalError."""
    return _mark(connection, path, f"{_MARK} DESC")


def _mark(connection: sqlite3.Connection, path: str, statement: str) -> Mark:
    try:
        row = connection.execute(f"{statement} LIMIT 1").fetchone()
    except DATABASE_ERRORS as error:
        raise journal_error(error, path, "read") from error
    kind = None if row is None else next((kind for kind in MarkKind if kind == row[1]), None)
    if kind is None or [type(value) for value in row] != [int, str, int, int]:
        raise DamagedJournalError(f"{path}: the journal is damaged: its marks were changed")
    return Mark(row[0], kind, *row[2:])


def ending_of(connection: sqlite3.Connection, path: str, run: int) -> Ending | None:
    """The end of a run that was recorded last, or that of the QUEUE. Raises JournalError."""
    try:
        row = connection.execute(_LAST, (run,)).fetchone()
    except DATABASE_ERRORS as error:
        raise journal_error(error, path, "read") from error
    if row is None:
        return None
    if [type(value) for value in row] != [int, str, bytes, bytes]:
        raise DamagedJournalError(f"{path}: the journal is damaged: its marks were changed")
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
