"""Errors of journals: what can be wrong with one, in words for people."""

from __future__ import annotations

import sqlite3

from gpsfsm.errors import InputError


class JournalError(InputError):
    """A journal that cannot be read or written."""


class JournalBusyError(JournalError):
    """Another process writes to the journal."""


class JournalFullError(JournalError):
    """There is no room for another event. What was written before is safe."""


class EmptyJournalError(JournalError):
    """Nothing has been written into the journal yet."""


class DamagedJournalError(JournalError):
    """Something in the journal is not as it was written."""


class ReplayDivergence(JournalError):  # noqa: N818  (it is a finding as much as an error)
    """A replayed event is not the one in the journal.

    ``expected`` is the line in the journal, ``got`` that of the replay; "" where there is none.
    """

    def __init__(self, seq: int, expected: str, got: str) -> None:
        self.seq = seq
        self.expected = expected
        self.got = got
        super().__init__(
            f"the replay differs from the journal at event {seq}:\n"
            f"  journal: {expected or 'nothing more'}\n"
            f"  replay:  {got or 'nothing more'}\n"
            "The journal was written by another version of gpsfsm or for other runners, "
            "or it was changed."
        )


_FULL_ADVICE = (
    "is the disk full? Nothing of the plan has been run: make room, then run it again",
    "is the disk full? What was written before is safe: make room, then resume the run",
)
DATABASE_ERRORS = (sqlite3.Error, UnicodeDecodeError)
"""What may come of a database: its own messages quote what is there, be it text or not."""

_NO_TEXT = "Could not decode to UTF-8"
_FULL = ("SQLITE_FULL", "SQLITE_TOOBIG")
_DAMAGED = ("SQLITE_CORRUPT", "SQLITE_IOERR_SHORT_READ", "SQLITE_MISMATCH", "SQLITE_SCHEMA")


def journal_error(
    error: sqlite3.Error | UnicodeDecodeError, path: str, doing: str, *, begun: bool = True
) -> JournalError:
    """The error for people. ``doing`` is ``read`` or ``written``; ``begun``: a run has begun."""
    name = getattr(error, "sqlite_errorname", "") or ""
    no_text = isinstance(error, UnicodeDecodeError) or str(error).startswith(_NO_TEXT)
    if not name and no_text:  # of Python; it would show what is there
        return DamagedJournalError(
            f"{path}: the journal is damaged (a text in it cannot be decoded); events before "
            "the damage can still be read"
        )
    if name.startswith("SQLITE_NOTADB"):
        return JournalError(
            f"{path}: this is not a journal of gpsfsm, or its first bytes are damaged"
        )
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return JournalBusyError(
            f"{path}: another process writes to this journal; wait until it has ended"
        )
    if doing == "read" and name.startswith(("SQLITE_IOERR_SHM", *_FULL)):
        return JournalFullError(
            f"{path}: the journal cannot be read ({error}): that takes some room beside it; "
            "is the disk full?"
        )
    failed_write = doing == "written" and name.startswith("SQLITE_IOERR") and "READ" not in name
    if failed_write or name.startswith(_FULL):
        return JournalFullError(
            f"{path}: the journal cannot be written ({error}); {_FULL_ADVICE[begun]}"
        )
    if name.startswith(("SQLITE_READONLY", "SQLITE_PERM")):
        return JournalError(
            f"{path}: the journal is read-only; a run needs to write to it and to its folder"
        )
    if name.startswith(("SQLITE_CANTOPEN", "SQLITE_AUTH")):
        return JournalError(
            f"{path}: the journal cannot be opened; check that its folder exists and that both may "
            f"be {doing}"
        )
    if name.startswith(_DAMAGED) or isinstance(error, sqlite3.DataError):
        return DamagedJournalError(
            f"{path}: the journal is damaged ({error}); events before the damage can still be read"
        )
    return JournalError(f"{path}: the journal cannot be {doing} ({error})")
