"""The end of a journal: how much was acknowledged, and whether all of that is still there.

A few bytes in ``<journal>-seen`` say how much was acknowledged. They are written after each
transaction and before anything is done, outlive the process, and go when the journal is closed.
SQLite reads a write-ahead log up to the first damage and says nothing. So what a journal holds is
compared with those bytes; where they say nothing for certain, the log itself is read. The file
alone tells by its last mark (``journal_file``) whether it holds all.
"""

from __future__ import annotations

import os
import sqlite3
import struct
import time
import zlib
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

from gpsfsm.execution.journal_errors import (
    DATABASE_ERRORS,
    DamagedJournalError,
    JournalError,
    JournalFullError,
    journal_error,
)
from gpsfsm.execution.journal_file import FIRST_FORM, beside, form_of, last_mark

if TYPE_CHECKING:
    import sqlite3

    from gpsfsm.execution.journal_file import Mark


_FORM = struct.Struct("<8s16s8s16sQQQ")
_CHECK = struct.Struct("<I")
_MAGIC = b"gpsfseen"
_BOOT = Path("/proc/sys/kernel/random/boot_id")
_HELD = """SELECT count(*), coalesce(sum((
  SELECT seq FROM event WHERE event.run = run.run ORDER BY seq DESC LIMIT 1)), 0),
  (SELECT coalesce(max(seq), 0) FROM queue), (SELECT id FROM run WHERE run = 1) FROM run"""


class Held(NamedTuple):
    """The amounts of a journal; ``first`` is the id of its first run, "" without one."""

    runs: int = 0
    events: int = 0
    decisions: int = 0
    first: str = ""


class Acknowledged(NamedTuple):
    """Acknowledged amounts, with which durability, and since when the machine is up."""

    held: Held
    durability: str
    boot: bytes

    @property
    def exact(self) -> bool:
        """True if nothing can have been acknowledged that is not told of here."""
        return self.boot == _boot()


def held(connection: sqlite3.Connection, path: str) -> Held:
    """The amounts that are in a journal. Raises JournalError."""
    try:
        runs, events, decisions, first = connection.execute(_HELD).fetchone()
    except DATABASE_ERRORS as error:
        raise journal_error(error, path, "read") from error
    if not all(isinstance(count, int) for count in (runs, events, decisions)):
        raise DamagedJournalError(f"{path}: there are values of the wrong type")
    return Held(runs, events, decisions, str(first or ""))


def read_seen(path: str) -> Acknowledged | None:
    """The note about the journal at ``path``; None without one, or if it cannot be made out."""
    place = Path(beside(path, "-seen"))
    try:
        if not place.is_file():
            return None
        with place.open("rb") as source:
            data = source.read(_FORM.size + _CHECK.size)
    except OSError:
        return None
    if len(data) < _FORM.size + _CHECK.size or not data.startswith(_MAGIC):
        return None
    if _CHECK.unpack_from(data, _FORM.size) != (zlib.crc32(data[: _FORM.size]),):
        return None  # the machine went down while it was written
    _, boot, durability, first, runs, events, decisions = _FORM.unpack_from(data)
    return Acknowledged(
        Held(runs, events, decisions, first.hex() if any(first) else ""),
        durability.rstrip(b"\0").decode("ascii", "replace"),
        boot,
    )


def cannot_be_read(path: str) -> bool:
    """True if there is a file beside the journal that should tell, but does not."""
    return Path(beside(path, "-seen")).is_file() and read_seen(path) is None


class Seen:
    """Writes down how much of the journal at ``path`` is acknowledged. Raises JournalError."""

    def __init__(self, path: str, durability: str, now: Held) -> None:
        self._path = beside(path, "-seen")
        self._durability = durability.encode()
        self._boot = _boot()
        self._runs, self._events, self._decisions, self._first = now
        try:
            self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_NONBLOCK, 0o600)
        except OSError as error:
            raise JournalError(f"{self._path} cannot be written: {error.strerror}") from error
        try:
            magic = os.pread(self._file, len(_MAGIC), 0)
            if magic not in (b"", _MAGIC):
                raise JournalError(f"{self._path}: this is not a gpsfsm file; move it away")
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
                Path(self._path).unlink()


def _boot() -> bytes:
    """Another one after each start of the machine; nothing but zeros where that is not known."""
    try:
        return bytes.fromhex(_BOOT.read_text(encoding="ascii").strip().replace("-", ""))[:16]
    except (OSError, ValueError):
        return bytes(16)


_HEADER = struct.Struct(">8I")
_FRAME = struct.Struct(">6I")
_LOG_MAGIC = 0x377F0682  # the last bit says in which order the bytes of words are summed up
_SMALLEST_PAGE, _LARGEST_PAGE = 512, 65536
_LONGEST = 1 << 28
"""Bytes of a log that are looked at. SQLite keeps it at a few megabytes."""

_SECOND_LOOK_S = 0.02


class Break(NamedTuple):
    """A place where a log is not as it was written: first byte and content of that frame."""

    place: int
    content: bytes


def damage_of(path: str) -> Break | None:
    """The damage of the log at ``path``; None if it has none, or there is no log.

    A crash may leave the last transaction incomplete. What cannot come of one is damage: further
    transactions behind a frame that is not as it was written. Raises OSError.
    """
    damage = _first_break(path)
    if damage is not None:
        time.sleep(_SECOND_LOOK_S)  # what is just being written looks otherwise by then
        if _first_break(path) != damage:
            return None
    return damage


def _first_break(path: str) -> Break | None:
    place = Path(path)
    if not place.is_file():  # it is not there, or a pipe, at which one could wait for ever
        return None
    try:
        with place.open("rb") as log:
            return _break_of(log)
    except FileNotFoundError:
        return None


def _break_of(log: IO[bytes]) -> Break | None:
    start = log.read(_HEADER.size)
    if len(start) < _HEADER.size:
        return None
    magic, _, size, _, *salts, first, second = _HEADER.unpack(start)
    is_log = magic & ~1 == _LOG_MAGIC and size.bit_count() == 1
    if not (is_log and _SMALLEST_PAGE <= size <= _LARGEST_PAGE):
        return _unless_empty(log, start)
    order = ">" if magic & 1 else "<"
    if _sums(start[:24], order, (0, 0)) != (first, second):
        return _unless_empty(log, start)
    sums = (first, second)
    place = log.tell()
    while place < _LONGEST:
        head, page = log.read(_FRAME.size), log.read(size)
        if len(page) < size:
            return None
        number, _, *rest = _FRAME.unpack(head)
        sums = _sums(page, order, _sums(head[:8], order, sums))
        if not number or rest != [*salts, *sums]:
            behind = _commits(log, place, (_FRAME.size + size, salts))
            return Break(place, head) if behind else None
        place += len(head) + size
    return None


def _unless_empty(log: IO[bytes], start: bytes) -> Break | None:
    """A log whose beginning is damaged, if there can be any frame in it."""
    behind = log.read(_FRAME.size + _SMALLEST_PAGE)
    return Break(0, start) if len(behind) == _FRAME.size + _SMALLEST_PAGE else None


def _commits(log: IO[bytes], place: int, shape: tuple[int, list[int]]) -> bool:
    """True if more than one incomplete transaction begins at ``place``.

    ``shape`` is the size of a frame and the salts of those that belong to this log: behind them
    there may be those of an older one.
    """
    size, salts = shape
    ended = False
    for each in range(place, _LONGEST, size):
        log.seek(each)
        head = log.read(_FRAME.size)
        if len(head) < _FRAME.size:
            return False
        number, commit, *rest = _FRAME.unpack(head)
        if not number or rest[:2] != salts:
            continue
        if ended:
            return True
        ended = commit != 0
    return False


def _sums(content: bytes, order: str, sums: tuple[int, int]) -> tuple[int, int]:
    """The running checksum of a log."""
    words = struct.unpack(f"{order}{len(content) // 4}I", content)
    first, second = sums
    for even, odd in zip(words[::2], words[1::2], strict=True):
        first = (first + even + second) & 0xFFFFFFFF
        second = (second + odd + first) & 0xFFFFFFFF
    return first, second


_MAY_GO = ("process", "none")
"""Durabilities with which the last events may go when the machine goes down."""

_EMPTY_LOG = 32


def loss_in(path: str, connection: sqlite3.Connection | None = None) -> str:
    """A note about what is lost and may be, or cannot be known; "" if nothing is missing.

    Without a connection for a journal in which there is nothing at all. Raises DamagedJournalError
    if anything else is missing.
    """
    seen = read_seen(path)  # before what is compared with it: a run may be going on
    now = Held() if connection is None else held(connection, path)
    mark = None if connection is None else _checked_mark(connection, path)
    if seen is not None and (not now.first or seen.held.first in ("", now.first)):
        lost = _missing(seen.held, now)
        may_go = seen.durability in _MAY_GO and not seen.exact
        if lost and not may_go:
            raise DamagedJournalError(
                f"{path}: the journal is damaged: {lost} that had been written are missing at its "
                f"end; {_how(path)}. {_what_to_do(path)}"
            )
        if lost:
            return (
                f"{path}: {lost} that had been written are missing: the machine crashed, which "
                f"the durability '{seen.durability}' does not survive"
            )
        if seen.exact or may_go:
            return ""
    damage = _break(path)
    if damage is not None:
        raise DamagedJournalError(
            f"{path}: the journal is damaged: {_how(path)}, and what was written behind that "
            f"cannot be read. {_what_to_do(path)}"
        )
    if seen is None and connection is not None and mark is not None and not mark.closed:
        _check_log(path, connection, now)
    if seen is None and cannot_be_read(path):
        return (
            f"{beside(path, '-seen')} is empty or damaged, so whether the end of {path} is missing "
            "is not known for certain; its log shows no damage"
        )
    return ""


def _checked_mark(connection: sqlite3.Connection, path: str) -> Mark | None:
    """The last mark of a journal, if a closed one holds as much as when it was closed."""
    if form_of(connection, path) == FIRST_FORM:
        return None
    mark = last_mark(connection, path)
    now = held(connection, path)
    if mark.closed and (now.runs, now.decisions) != mark[2:]:
        if last_mark(connection, path) != mark:  # somebody has begun to write
            return None
        lost = _missing(Held(mark.runs, 0, mark.decisions), now)
        what = f"{lost} that had been written are missing" if lost else "there is more than written"
        raise DamagedJournalError(f"{path}: the journal is damaged: {what}. {_what_to_do(path)}")
    return mark


def _check_log(path: str, connection: sqlite3.Connection, now: Held) -> None:
    """Raises DamagedJournalError if the log of a journal that nobody has closed is missing."""
    log = Path(beside(path, "-wal"))
    if log.is_file() and log.stat().st_size > _EMPTY_LOG:
        return
    if last_mark(connection, path).closed:  # it was closed meanwhile
        return
    events = "1 event" if now.events == 1 else f"{now.events:,} events"
    runs = "1 run" if now.runs == 1 else f"{now.runs:,} runs"
    raise DamagedJournalError(
        f"{path}: the journal is incomplete: the process that wrote to it did not close it, and "
        f"{log}, in which the rest is, is missing or empty. The file holds "
        f"{runs} with {events}; more was acknowledged, or may have been. Copy {log} and "
        f"{beside(path, '-seen')} to it from where it was written. What is there can be read "
        f"('gpsfsm events {path}'); nothing more is written into it"
    )


def check_no_log_alone(path: str) -> None:
    """Raises DamagedJournalError if there is a log, but not the journal that it belongs to.

    SQLite would throw it away.
    """
    log = Path(beside(path, "-wal"))
    if log.is_file() and log.stat().st_size > _EMPTY_LOG:
        raise DamagedJournalError(
            f"{path}: the journal is not there, but {log} is, with events of it; put the journal "
            f"back, or move {log} away to begin a new one"
        )


def _missing(acknowledged: Held, now: Held) -> str:
    """The missing amounts, in words; "" for none."""
    words = (("run", "runs"), ("event", "events"), (_DECISION, "decisions of the plan queue"))
    counts = [before - after for before, after in zip(acknowledged[:3], now[:3], strict=True)]
    return " and ".join(
        f"{count:,} {many if count > 1 else one}"
        for count, (one, many) in zip(counts, words, strict=True)
        if count > 0
    )


_DECISION = "decision of the plan queue"


def _how(path: str) -> str:
    log = Path(beside(path, "-wal"))
    if not log.exists() or not log.stat().st_size:  # whoever reads makes an empty one
        return f"{log} is missing or empty"
    damage = _break(path)
    if damage is not None:
        return f"{log} is damaged at byte {damage.place:,}"
    return f"{log} is cut off or damaged at its end"


def _what_to_do(path: str) -> str:
    return (
        f"Copy it and the files beside it away. What is left can be read ('gpsfsm events {path}'); "
        "nothing more is written into it, so begin another journal"
    )


def _break(path: str) -> Break | None:
    try:
        return damage_of(beside(path, "-wal"))
    except OSError as error:
        raise JournalError(f"{path}-wal cannot be read: {error.strerror}") from error
