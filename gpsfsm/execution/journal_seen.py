"""How far a journal has been written, kept beside it: so that nobody can lose its end unseen.

A few bytes in ``<journal>-seen`` say how much was acknowledged. They are written after each
transaction and before anything is done, outlive the process, and go when the journal is closed.
"""

from __future__ import annotations

import os
import sqlite3
import struct
import zlib
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from gpsfsm.execution.journal_errors import (
    DATABASE_ERRORS,
    DamagedJournalError,
    JournalError,
    JournalFullError,
    told,
)
from gpsfsm.execution.journal_file import beside

__all__ = ["Acknowledged", "Held", "Seen", "cannot_be_read", "held", "read_seen"]

_FORM = struct.Struct("<8s16s8s16sQQQ")
_CHECK = struct.Struct("<I")
_MAGIC = b"gpsfseen"
_BOOT = Path("/proc/sys/kernel/random/boot_id")
_HELD = """SELECT count(*), coalesce(sum((
  SELECT seq FROM event WHERE event.run = run.run ORDER BY seq DESC LIMIT 1)), 0),
  (SELECT coalesce(max(seq), 0) FROM queue), (SELECT id FROM run WHERE run = 1) FROM run"""


class Held(NamedTuple):
    """How much is in a journal; ``first`` is the id of its first run, "" without one."""

    runs: int = 0
    events: int = 0
    decisions: int = 0
    first: str = ""


class Acknowledged(NamedTuple):
    """How much was acknowledged, with which durability, and since when the machine is up."""

    held: Held
    durability: str
    boot: bytes

    @property
    def exact(self) -> bool:
        """Whether nothing can have been acknowledged that is not told of here."""
        return self.boot == _boot()


def held(connection: sqlite3.Connection, path: str) -> Held:
    """How much is in a journal. Raises JournalError."""
    try:
        runs, events, decisions, first = connection.execute(_HELD).fetchone()
    except DATABASE_ERRORS as error:
        raise told(error, path, "read") from error
    if not all(isinstance(count, int) for count in (runs, events, decisions)):
        raise DamagedJournalError(f"{path}: there are values of the wrong type")
    return Held(runs, events, decisions, str(first or ""))


def read_seen(path: str) -> Acknowledged | None:
    """What is known of the journal at ``path``; None if nothing, or if that cannot be made out."""
    place = Path(beside(path, "-seen"))
    try:
        if not place.is_file():
            return None
        with place.open("rb") as source:
            found = source.read(_FORM.size + _CHECK.size)
    except OSError:
        return None
    if len(found) < _FORM.size + _CHECK.size or not found.startswith(_MAGIC):
        return None
    if _CHECK.unpack_from(found, _FORM.size) != (zlib.crc32(found[: _FORM.size]),):
        return None  # the machine went down while it was written
    _, boot, durability, first, runs, events, decisions = _FORM.unpack_from(found)
    return Acknowledged(
        Held(runs, events, decisions, first.hex() if any(first) else ""),
        durability.rstrip(b"\0").decode("ascii", "replace"),
        boot,
    )


def cannot_be_read(path: str) -> bool:
    """Whether there is a file beside the journal that should tell, but it does not."""
    return Path(beside(path, "-seen")).is_file() and read_seen(path) is None


class Seen:
    """Writes down how much of the journal at ``path`` is acknowledged. Raises JournalError."""

    def __init__(self, path: str, durability: str, now: Held) -> None:
        self._path = beside(path, "-seen")
        self._durability = durability.encode()
        self._boot = _boot()
        self._runs, self._events, self._decisions, self._first = now
        try:
            self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_NONBLOCK, 0o644)
        except OSError as error:
            raise JournalError(f"{self._path} cannot be written: {error.strerror}") from error
        try:
            found = os.pread(self._file, len(_MAGIC), 0)
            if found not in (b"", _MAGIC):
                raise JournalError(f"{self._path}: this is no file of gpsfsm; move it away")
            self._write()
        except OSError as error:
            os.close(self._file)
            raise JournalFullError(
                f"{self._path} cannot be written ({error.strerror}); is the disk full? Nothing of "
                "the plan has been run: make room, then run it again"
            ) from error
        except JournalError:
            os.close(self._file)
            raise

    def add(self, *, runs: int = 0, events: int = 0, decisions: int = 0, first: str = "") -> None:
        """So much more is in the journal."""
        self._runs += runs
        self._events += events
        self._decisions += decisions
        self._first = self._first or first
        with suppress(OSError):  # then less is known, but the journal itself is as it must be
            self._write()

    def _write(self) -> None:
        content = _FORM.pack(
            _MAGIC,
            self._boot,
            self._durability,
            bytes.fromhex(self._first),
            self._runs,
            self._events,
            self._decisions,
        )
        os.pwrite(self._file, content + _CHECK.pack(zlib.crc32(content)), 0)

    def close(self, *, remove: bool) -> None:
        """``remove`` it if everything is in the one file of the journal."""
        os.close(self._file)
        if remove:
            with suppress(OSError):
                os.unlink(self._path)  # noqa: PTH108


def _boot() -> bytes:
    """Another one after each start of the machine; nothing but zeros where that is not known."""
    try:
        return bytes.fromhex(_BOOT.read_text(encoding="ascii").strip().replace("-", ""))[:16]
    except (OSError, ValueError):
        return bytes(16)
