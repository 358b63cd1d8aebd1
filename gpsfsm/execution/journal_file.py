"""The file of a journal: its tables, and how it is opened for writing and for reading."""

from __future__ import annotations

import os
import sqlite3
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote

from gpsfsm.execution.journal_errors import (
    DamagedJournalError,
    EmptyJournalError,
    JournalError,
    told,
)

__all__ = ["DURABILITY", "Lease", "beside", "check_place", "open_to_read", "open_to_write"]

DURABILITY = {"power": "FULL", "process": "NORMAL", "none": "OFF"}
"""What a journal outlives, and the way of synchronisation that takes."""

_NO_FILES = ("SQLITE_CANTOPEN", "SQLITE_READONLY", "SQLITE_IOERR_SHM", "SQLITE_FULL")
"""What comes of a folder in which no file can be made that belongs to a log."""
_APPLICATION = 0x67707366  # "gpsf"
_SCHEMA = 1
_TABLES = """
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
_GUARD = """CREATE TRIGGER {table}_{verb} BEFORE {verb} ON {table} BEGIN
  SELECT RAISE(ABORT, 'a journal is only ever appended to'); END;"""


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
    except sqlite3.Error as error:
        connection.close()
        raise told(error, path, "written", begun=False) from error
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
    except sqlite3.Error as error:
        connection.close()
        raise told(error, path, "read") from error
    except JournalError:
        connection.close()
        raise
    return connection


def _connect(path: str, mode: str, shown: str) -> sqlite3.Connection:
    try:
        address = f"file:{quote(str(Path(path).absolute()))}?mode={mode}"
        connection = sqlite3.connect(address, uri=True, isolation_level=None, timeout=5.0)
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 256_000_000)
        connection.execute("PRAGMA trusted_schema = OFF")
    except sqlite3.Error as error:
        doing = "written" if mode == "rwc" else "read"
        raise told(error, shown, doing, begun=False) from error
    return connection


def check_place(path: str) -> None:
    """Raises JournalError if no journal can be at ``path``; touches nothing.

    Only what cannot be a database is told of here. The file is looked at without its log, and as
    long as a checkpoint is not complete it makes no sense without it: its first page may count
    pages that are in the log alone. Whether it is damaged shows when it is opened with its log.
    """
    place = Path(path)
    if place.is_dir():
        raise JournalError(f"{path}: this is a folder, a journal is a file")
    if not place.exists():
        return
    if not place.is_file():
        raise JournalError(f"{path}: this is no regular file")
    # Not with open(): closing a file takes away the locks that this process has on it.
    connection = _connect(path, "ro&immutable=1", path)
    try:
        connection.execute("PRAGMA application_id").fetchone()
    except sqlite3.Error as error:
        found = told(error, path, "read")
        if not isinstance(found, DamagedJournalError):
            raise found from error
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
    if version > _SCHEMA:
        raise JournalError(
            f"{path}: this journal was written by a newer gpsfsm (its form is {version}, this "
            f"gpsfsm knows {_SCHEMA}); use that one"
        )


def _make(connection: sqlite3.Connection) -> None:
    guards = "".join(
        _GUARD.format(table=table, verb=verb)
        for table in ("content", "run", "event", "queue")
        for verb in ("UPDATE", "DELETE")
    )
    connection.executescript(
        f"BEGIN IMMEDIATE;{_TABLES}{guards}"
        f"PRAGMA application_id = {_APPLICATION};PRAGMA user_version = {_SCHEMA};COMMIT;"
    )


class Lease:
    """The right to write to a journal: one process has it, and loses it when it ends.

    It is a lock on a file beside the journal, which the system lets go of when the process dies.
    """

    def __init__(self, path: str) -> None:
        self._connection = _connect(beside(path, "-lock"), "rwc", path)
        try:
            self._connection.execute("PRAGMA busy_timeout = 0")
            # Nothing is ever in this file: without this, a killed process would leave a third one.
            self._connection.execute("PRAGMA journal_mode = MEMORY").fetchone()
            self._connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            self._connection.close()
            raise told(error, path, "written", begun=False) from error
        with suppress(OSError):  # of an earlier version that was killed
            Path(beside(path, "-lock-journal")).unlink(missing_ok=True)

    def release(self) -> None:
        """Let another process write."""
        with suppress(sqlite3.Error):
            self._connection.close()
