"""Rows of a plan queue, and what they say of its plans."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple, Protocol

from gpsfsm.execution.records import RunValue, Status

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

CLIENT = 0
"""Who submits or cancels from outside; plans are numbered from 1."""


class QueueKind(StrEnum):
    """The kinds of rows of the queue."""

    SUBMITTED = "SUBMITTED"  # a plan has passed the gate and waits
    REFUSED = "REFUSED"
    BEGUN = "BEGUN"
    RUN = "RUN"  # which run of the journal is that of a plan; no decision
    CANCEL = "CANCEL"
    ENDED = "ENDED"  # with its status
    BOND_LOST = "BOND_LOST"
    BOND_RENEWED = "BOND_RENEWED"
    HELD = "HELD"  # nothing begins until an operator releases the queue
    RELEASED = "RELEASED"
    # A model writes plans: what it is asked for, each of its answers, and what has come of it. None
    # is a decision of the queue; ``plan`` is the one that gave up, 0 if a person asked.
    ASKED = "ASKED"
    ATTEMPT = "ATTEMPT"
    GENERATED = "GENERATED"


_SAYS_NOTHING = frozenset(
    (
        *(QueueKind.RUN, QueueKind.BOND_LOST, QueueKind.BOND_RENEWED),
        *(QueueKind.HELD, QueueKind.RELEASED),
        *(QueueKind.ASKED, QueueKind.ATTEMPT, QueueKind.GENERATED),
    )
)
"""Kinds of rows that change the state of no plan."""


class QueueRow(NamedTuple):
    """One decision of the queue. ``plan`` and ``by`` are plan numbers, 0 for none or the client."""

    kind: QueueKind
    plan: int = 0
    by: int = CLIENT
    data: Mapping[str, RunValue] | None = None
    message: str = ""

    @classmethod
    def stored(cls, kind: str, plan: int, by: int, data: str, message: str) -> QueueRow:
        """A row as a journal has kept it, ``data`` being JSON or empty."""
        return cls(QueueKind(kind), plan, by, (json.loads(data) or None) if data else None, message)


class QueueLog(Protocol):
    """The place where the queue's rows go: a journal, a list."""

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        """Keep a row; when this returns it is safe. If it raises, nothing is done."""


@dataclass(frozen=True, slots=True)
class PlanState:
    """The state of a plan. Times are microseconds since the queue began, -1 for not yet.

    ``by`` is the plan that submitted it, 0 for a client; ``findings`` say why it was refused,
    ``reason`` why it was cancelled; ``attempts`` is how often it has begun: more than once if
    another process began it, which has ended meanwhile. ``continues`` is the plan that gave up and
    in whose place it runs, 0 for none.
    """

    plan: int
    status: Status
    sha256: str
    name: str = ""
    by: int = CLIENT
    findings: tuple[str, ...] = ()
    reason: str = ""
    submitted_us: int = -1
    began_us: int = -1
    ended_us: int = -1
    attempts: int = 0
    continues: int = 0


def recall(states: list[PlanState], texts: dict[int, str], row: QueueRow, at_us: int) -> None:
    """Take up what a row says of its plan: into ``states``, its text into ``texts``.

    Raises ValueError for a row that no queue writes at this place.
    """
    data = row.data or {}
    if row.kind in (QueueKind.SUBMITTED, QueueKind.REFUSED):
        if row.plan != len(states) + 1:
            raise ValueError(f"plan {row.plan} is submitted as number {len(states) + 1}")
        if not isinstance(data.get("sha256"), str):
            raise ValueError("a plan without a digest")
        refused = row.kind is QueueKind.REFUSED
        findings = data.get("findings", [])
        continued = data.get("continues", 0)
        texts[row.plan] = str(data.get("text", ""))
        state = PlanState(
            row.plan,
            Status.REFUSED if refused else Status.QUEUED,
            str(data["sha256"]),
            str(data.get("name", "")),
            row.by,
            tuple(map(str, findings)) if isinstance(findings, list) else (),
            submitted_us=at_us,
            ended_us=at_us if refused else -1,
            continues=continued if isinstance(continued, int) else 0,
        )
        states.append(state)
        return
    if row.kind in _SAYS_NOTHING:
        return
    if not 1 <= row.plan <= len(states) or states[row.plan - 1].status.ended:
        raise ValueError(f"plan {row.plan} does not wait or run")
    state = states[row.plan - 1]
    if row.kind is QueueKind.BEGUN:
        began_us = at_us if state.began_us < 0 else state.began_us
        state = replace(state, began_us=began_us, attempts=state.attempts + 1)
    elif row.kind is QueueKind.CANCEL:
        state = replace(state, reason=row.message)
    else:
        status = Status(str(data.get("status")))
        if not status.ended:
            raise ValueError(f"plan {row.plan} ends as {status.value}")
        reason = state.reason if status is Status.CANCELLED else ""
        said = (row.message,) if status is Status.REFUSED else ()
        state = replace(state, status=status, reason=reason, findings=said, ended_us=at_us)
    states[row.plan - 1] = state


def in_order(states: Iterable[PlanState]) -> list[PlanState]:
    """The plans that have not ended: the one that ran, one that continues another, the others."""
    left = (state for state in states if not state.status.ended)
    return sorted(left, key=lambda state: (not state.attempts, not state.continues, state.plan))
