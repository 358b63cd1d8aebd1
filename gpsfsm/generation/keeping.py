"""Keeping attempts in a journal, and finding them there again.

A session is a row ASKED, a row ATTEMPT for each answer, and a row GENERATED with what came of it; a
session without the last one was interrupted, and can go on.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError
from gpsfsm.execution.queue_rows import QueueKind, QueueRow
from gpsfsm.generation.stored import (
    Session,
    attempt_data,
    attempt_of,
    session_data,
    session_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.execution.queue_rows import QueueLog
    from gpsfsm.execution.records import RunValue
    from gpsfsm.generation.loop import Attempt, Generated

__all__ = ["Keeper", "KeptSession", "sessions"]


@dataclass(frozen=True, slots=True)
class Keeper:
    """Writes one session. ``plan`` is the plan that gave up, 0 if a person asked."""

    log: QueueLog
    plan: int = 0
    now_us: Callable[[], int] = lambda: 0

    def asked(self, session: Session) -> None:
        """A session begins."""
        self._write(QueueKind.ASKED, session_data(session))

    def attempt(self, attempt: Attempt) -> None:
        """An answer has come, or none could be had."""
        self._write(QueueKind.ATTEMPT, attempt_data(attempt))

    def generated(self, found: Generated) -> None:
        """The session is over."""
        data: dict[str, RunValue] = {"accepted": found.accepted}
        if found.best is not None:
            data |= {"round": found.best.round, "candidate": found.best.candidate}
        if found.plan:
            text = found.plan.encode("utf-8", "surrogatepass")
            data["sha256"] = hashlib.sha256(text).hexdigest()
        self._write(QueueKind.GENERATED, data, found.reason)

    def _write(self, kind: QueueKind, data: Mapping[str, RunValue], message: str = "") -> None:
        row = QueueRow(kind, self.plan, data=data, message=message)
        self.log.write_queue(self.now_us(), row)


@dataclass(slots=True)
class KeptSession:
    """A session in a journal.

    ``result`` is the data of GENERATED, None if the session was interrupted; ``reason`` tells why
    no plan was accepted.
    """

    plan: int
    session: Session
    attempts: list[Attempt] = field(default_factory=list)
    result: Mapping[str, RunValue] | None = None
    reason: str = ""

    @property
    def accepted(self) -> bool:
        """Whether it has led to a plan."""
        return self.result is not None and self.result.get("accepted") is True


def sessions(rows: Iterable[QueueRow]) -> list[KeptSession]:
    """The sessions among the rows of a journal, in order.

    Raises InputError for rows that no gpsfsm has written.
    """
    found: list[KeptSession] = []
    for row in rows:
        data = row.data or {}
        if row.kind is QueueKind.ASKED:
            found.append(KeptSession(row.plan, session_of(data)))
        elif row.kind in (QueueKind.ATTEMPT, QueueKind.GENERATED):
            if not found or found[-1].result is not None or found[-1].plan != row.plan:
                if row.kind is QueueKind.GENERATED and data.get("accepted") is False and row.plan:
                    continue  # nobody was asked: the bounds of a queue did not allow it
                raise InputError(f"a row {row.kind} belongs to no session")
            if row.kind is QueueKind.ATTEMPT:
                found[-1].attempts.append(attempt_of(data))
            else:
                found[-1].result, found[-1].reason = data, row.message
    return found
