"""Whether a journal still has its end: all that was acknowledged must be there.

SQLite reads a write-ahead log up to the first damage and says nothing. So what a journal holds is
compared with what is known of it (``journal_seen``); where that is not known for certain, the log
itself is looked at (``journal_log``). The file alone tells by its last mark whether it holds all
(``journal_marks``).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.execution.journal_errors import DamagedJournalError, JournalError
from gpsfsm.execution.journal_file import FIRST_FORM, beside, form_of
from gpsfsm.execution.journal_log import damage_of
from gpsfsm.execution.journal_marks import last_mark
from gpsfsm.execution.journal_seen import Held, cannot_be_read, held, read_seen

if TYPE_CHECKING:
    import sqlite3

    from gpsfsm.execution.journal_log import Break
    from gpsfsm.execution.journal_marks import Mark

__all__ = ["check_no_log_alone", "loss_in"]

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
        lost = _told(seen.held, now)
        may_go = seen.durability in _MAY_GO and not seen.exact
        if lost and not may_go:
            raise DamagedJournalError(
                f"{path}: the journal is damaged: {lost} that had been written are missing at its "
                f"end; {_how(path)}. {_what_to_do(path)}"
            )
        if lost:
            return (
                f"{path}: {lost} that had been written are missing: the machine went down, which "
                f"the durability '{seen.durability}' does not outlive"
            )
        if seen.exact or may_go:
            return ""
    found = _break(path)
    if found is not None:
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
        lost = _told(Held(mark.runs, 0, mark.decisions), now)
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


def _told(known: Held, now: Held) -> str:
    """What is missing, in words; "" for nothing."""
    words = (("run", "runs"), ("event", "events"), (_DECISION, "decisions of the plan queue"))
    counts = [before - after for before, after in zip(known[:3], now[:3], strict=True)]
    return " and ".join(
        f"{count:,} {many if count > 1 else one}"
        for count, (one, many) in zip(counts, words, strict=True)
        if count > 0
    )


_DECISION = "decision of the plan queue"


def _how(path: str) -> str:
    log = Path(beside(path, "-wal"))
    if not log.exists() or not log.stat().st_size:  # whoever reads makes an empty one
        return f"{log} is gone or empty"
    found = _break(path)
    if found is not None:
        return f"{log} is damaged at byte {found.place:,}"
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
