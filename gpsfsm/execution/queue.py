"""The plan queue: plans run one after the other, each checked before it is queued.

A plan is submitted by a client, or by a runner of the plan that runs (``services['plans']``). It
gets the next number, passes the gate, and waits. What has become of it is never forgotten. Every
decision of the queue is a row, written before it has any effect.

All queues share this; ``gpsfsm.execution.queues`` has those for virtual and real time.
"""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple, Protocol

from gpsfsm.errors import GpsfsmError, InputError, UsageError
from gpsfsm.execution.records import RunValue, Status

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.bond import Bond, Clock
    from gpsfsm.execution.kernel import Kernel

__all__ = [
    "CLIENT",
    "Driver",
    "Gate",
    "PlanQueue",
    "PlanService",
    "PlanState",
    "QueueFullError",
    "QueueKind",
    "QueueLog",
    "QueueRow",
    "Refusal",
]

CLIENT = 0
"""Who submits or cancels from outside; plans are numbered from 1."""


class QueueFullError(GpsfsmError):
    """So many plans have been submitted that the queue takes no more."""


class QueueKind(StrEnum):
    """What a row of the queue tells."""

    SUBMITTED = "SUBMITTED"  # a plan has passed the gate and waits
    REFUSED = "REFUSED"
    BEGUN = "BEGUN"
    RUN = "RUN"  # which run of the journal is that of a plan; no decision
    CANCEL = "CANCEL"
    ENDED = "ENDED"  # with its status
    BOND_LOST = "BOND_LOST"
    BOND_RENEWED = "BOND_RENEWED"


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
    """Where the queue's rows go: a journal, a list."""

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        """Keep a row; when this returns it is safe. If it raises, nothing is done."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a plan does not pass the gate: one line for each finding."""

    findings: tuple[str, ...]


class Gate(Protocol):
    """Checks plans before they are queued."""

    def __call__(self, text: str, /) -> Compiled | Refusal:
        """The compiled plan, or what is wrong with it."""


class Driver(Protocol):
    """What the queue needs of whatever runs a plan."""

    kernel: Kernel
    failure: BaseException | None  # why the run cannot be journaled any more

    def cancel(self, reason: str) -> None:
        """Stop the run."""


@dataclass(frozen=True, slots=True)
class PlanState:
    """What has become of a plan. Times are microseconds since the queue began, -1 for not yet.

    ``by`` is the plan that submitted it, 0 for a client; ``findings`` say why it was refused,
    ``reason`` why it was cancelled; ``attempts`` is how often it has begun: more than once if
    another process began it, which has ended meanwhile.
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


class PlanQueue(ABC):
    """What queues in virtual and in real time share. Not thread-safe.

    At most ``most_waiting`` plans wait (a further one is refused), at most ``most_plans`` are ever
    submitted (then QueueFullError is raised), so plans that submit plans come to an end.
    """

    def __init__(
        self,
        gate: Gate,
        log: QueueLog,
        *,
        bond: Bond | None = None,
        most_waiting: int = 100,
        most_plans: int = 10_000,
    ) -> None:
        self._gate = gate
        self._log = log
        self._bond = bond
        self._most_waiting = most_waiting
        self._most_plans = most_plans
        self._states: list[PlanState] = []
        self._compiled: dict[int, Compiled] = {}  # of the plans that wait
        self._waiting: deque[int] = deque()
        self._running: tuple[int, Driver] | None = None

    @abstractmethod
    def now_us(self) -> int:
        """Microseconds since the queue began."""

    @abstractmethod
    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time."""

    @abstractmethod
    def _go_to(self, at_us: int) -> None:
        """Let the queue's time go on from there."""

    def _wake(self) -> None:  # noqa: B027 - virtual time needs no waking
        """Something may be ready to begin."""

    # -- for clients and runners ------------------------------------------------------------

    def submit(self, text: str, *, name: str = "", by: int = CLIENT) -> int:
        """Check a plan and queue it; its number. Whether it was refused is in its state.

        Raises QueueFullError when no more plans are taken.
        """
        if len(self._states) >= self._most_plans:
            raise QueueFullError(f"the queue takes no more than {self._most_plans:,} plans")
        plan = len(self._states) + 1
        digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
        state = PlanState(plan, Status.QUEUED, digest, name, by, submitted_us=self.now_us())
        found = self._examine(text)
        data: dict[str, RunValue] = {"sha256": digest, "name": name}
        if isinstance(found, Refusal):
            data["findings"] = list(found.findings)
            self._write(QueueRow(QueueKind.REFUSED, plan, by, data))
            state = replace(
                state, status=Status.REFUSED, findings=found.findings, ended_us=self.now_us()
            )
            self._states.append(state)
            return plan
        data["text"] = text
        self._write(QueueRow(QueueKind.SUBMITTED, plan, by, data))
        self._states.append(state)
        self._compiled[plan] = found
        self._waiting.append(plan)
        self._wake()
        return plan

    def cancel(self, plan: int, reason: str = "cancelled", *, by: int = CLIENT) -> bool:
        """Cancel a plan that waits or runs; False if it has ended already.

        A plan that runs is told from the clock, so a runner may cancel its own plan. Raises
        UsageError for a number that was never given.
        """
        state = self.state(plan)
        if state.status.ended:
            return False
        self._write(QueueRow(QueueKind.CANCEL, plan, by, message=reason))
        self._states[plan - 1] = replace(self._states[plan - 1], reason=reason)
        if self._running is not None and self._running[0] == plan:
            driver = self._running[1]
            self.at(self.now_us(), lambda: driver.cancel(reason))
        else:
            self._waiting.remove(plan)
            del self._compiled[plan]
            self._end(plan, Status.CANCELLED)
        return True

    def state(self, plan: int) -> PlanState:
        """What has become of a plan. Raises UsageError for a number that was never given."""
        if not 1 <= plan <= len(self._states):
            raise UsageError(f"there is no plan {plan}")
        found = self._states[plan - 1]
        if self._running is not None and self._running[0] == plan:
            status = self._running[1].kernel.status
            if not status.ended and status is not Status.QUEUED:
                return replace(found, status=status)
        return found

    def states(self) -> tuple[PlanState, ...]:
        """All plans that were ever submitted, in order."""
        return tuple(self.state(plan) for plan in range(1, len(self._states) + 1))

    def service(self, plan: int) -> PlanService:
        """What the runners of a plan get as ``services['plans']``."""
        return PlanService(self, plan)

    def restore(self, rows: Iterable[tuple[int, QueueRow]]) -> int:
        """Take up the queue that another process left, by its rows and their times.

        Plans that waited wait again, if they still pass the gate. The plan that ran, if any, is
        the first of them; its number is returned, else 0. One that was being cancelled is. Raises
        UsageError if this queue has been used already.
        """
        if self._states:
            raise UsageError("a queue can be restored only before it is used")
        texts: dict[int, str] = {}
        for at_us, row in rows:
            self._go_to(at_us)
            self._recall(at_us, row, texts)
        running = 0
        for state in tuple(self._states):
            if state.status.ended:
                continue
            if state.reason:
                self._end(state.plan, Status.CANCELLED)
                continue
            found = self._examine(texts[state.plan])
            if isinstance(found, Refusal):
                self._states[state.plan - 1] = replace(state, findings=found.findings)
                self._end(state.plan, Status.REFUSED, "; ".join(found.findings))
                continue
            self._compiled[state.plan] = found
            self._waiting.append(state.plan)
            running = running or (state.plan if state.attempts else 0)
        self._wake()
        return running

    def _recall(self, at_us: int, row: QueueRow, texts: dict[int, str]) -> None:
        """What a row says of its plan."""
        data = row.data or {}
        if row.kind in (QueueKind.SUBMITTED, QueueKind.REFUSED):
            refused = row.kind is QueueKind.REFUSED
            findings = data.get("findings", [])
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
            )
            self._states.append(state)
            return
        if row.kind in (QueueKind.RUN, QueueKind.BOND_LOST, QueueKind.BOND_RENEWED):
            return
        state = self._states[row.plan - 1]
        if row.kind is QueueKind.BEGUN:
            began_us = at_us if state.began_us < 0 else state.began_us
            state = replace(state, began_us=began_us, attempts=state.attempts + 1)
        elif row.kind is QueueKind.CANCEL:
            state = replace(state, reason=row.message)
        else:
            status = Status(str(data["status"]))
            reason = state.reason if status is Status.CANCELLED else ""
            said = (row.message,) if status is Status.REFUSED else ()
            state = replace(state, status=status, reason=reason, findings=said, ended_us=at_us)
        self._states[row.plan - 1] = state

    # -- the way of a plan ------------------------------------------------------------------

    def _examine(self, text: str) -> Compiled | Refusal:
        if len(self._waiting) >= self._most_waiting:
            return Refusal((f"the queue is full: {len(self._waiting)} plans wait",))
        try:
            return self._gate(text)
        except Exception as error:  # a gate that breaks lets nothing through
            return Refusal((f"the gate failed: {type(error).__name__}: {error}"[:1000],))

    def _watch(self, clock: Clock) -> None:
        if self._bond is not None:
            self._bond.watch(clock, lost=self._bond_lost, renewed=self._bond_renewed)

    def _bond_lost(self, reason: str) -> None:
        self._write(QueueRow(QueueKind.BOND_LOST, message=reason))
        if self._running is not None:
            plan, driver = self._running
            self._states[plan - 1] = replace(self._states[plan - 1], reason=reason)
            driver.cancel(reason)

    def _bond_renewed(self) -> None:
        self._write(QueueRow(QueueKind.BOND_RENEWED))
        self._wake()

    def _next(self) -> int | None:
        """The plan to begin now, if any: none begins while the bond is lost."""
        if not self._waiting or (self._bond is not None and not self._bond.held):
            return None
        return self._waiting[0]

    def _begin(self, plan: int) -> Compiled:
        self._write(QueueRow(QueueKind.BEGUN, plan))
        self._waiting.popleft()
        state = self._states[plan - 1]
        self._states[plan - 1] = replace(
            state,
            status=Status.RUNNING,
            began_us=self.now_us() if state.began_us < 0 else state.began_us,
            attempts=state.attempts + 1,
        )
        return self._compiled.pop(plan)

    def _cannot_begin(self, plan: int, error: UsageError | InputError) -> None:
        self._states[plan - 1] = replace(self._states[plan - 1], findings=(str(error),))
        self._end(plan, Status.REFUSED, str(error))

    def _end(self, plan: int, status: Status, message: str = "") -> None:
        data: dict[str, RunValue] = {"status": status.value}
        self._write(QueueRow(QueueKind.ENDED, plan, data=data, message=message))
        self._settle(plan, status)

    def _over(self, plan: int, driver: Driver) -> None:
        """A run is over, also by an exception; one that broke off counts as cancelled."""
        self._running = None
        if driver.failure is None and driver.kernel.status.ended:
            self._end(plan, driver.kernel.status)
        else:
            self._settle(plan, Status.CANCELLED)

    def _settle(self, plan: int, status: Status) -> None:
        state = self._states[plan - 1]
        reason = state.reason if status is Status.CANCELLED else ""
        ended = replace(state, status=status, reason=reason, ended_us=self.now_us())
        self._states[plan - 1] = ended

    def _write(self, row: QueueRow) -> None:
        self._log.write_queue(self.now_us(), row)


@dataclass(frozen=True, slots=True)
class PlanService:
    """The queue as the runners of one plan see it."""

    queue: PlanQueue
    plan: int

    def submit(self, text: str, name: str = "") -> int:
        """Queue a plan behind the one that runs; its number. See ``findings`` for a refusal."""
        return self.queue.submit(text, name=name, by=self.plan)

    def cancel(self, plan: int, reason: str = "cancelled by a plan") -> bool:
        """Cancel a plan, maybe the one that runs; False if it has ended already."""
        return self.queue.cancel(plan, reason, by=self.plan)

    def status(self, plan: int) -> str:
        """The status of a plan."""
        return self.queue.state(plan).status.value

    def findings(self, plan: int) -> tuple[str, ...]:
        """Why a plan was refused; empty if it was not."""
        return self.queue.state(plan).findings
