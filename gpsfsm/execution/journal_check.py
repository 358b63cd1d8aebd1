"""What is looked at before anything is written into a journal that is there already."""

from __future__ import annotations

from pathlib import Path

from gpsfsm.execution.journal_errors import EmptyJournalError
from gpsfsm.execution.journal_loss import check_no_log_alone
from gpsfsm.execution.journal_read import JournalReader

__all__ = ["check_before_writing"]

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
