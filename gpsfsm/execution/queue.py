"""The plan queue: plans run one after the other, each checked before it is queued.

A plan is submitted by a client, or by a runner of the plan that runs (``services['plans']``). It
gets the next number, passes the gate, and waits. What has become of it is never forgotten. Every
decision of the queue is a row, written before it has any effect.

All queues share this; ``gpsfsm.execution.queues`` has those for virtual and real time.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from gpsfsm.errors import GpsfsmError, InputError, UsageError
from gpsfsm.execution.chain import Continuing
from gpsfsm.execution.queue_rows import (
    CLIENT,
    PlanState,
    QueueKind,
    QueueLog,
    QueueRow,
    in_order,
    recall,
)
from gpsfsm.execution.records import RunValue, Status

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable

    from gpsfsm.execution.bond import Bond, Clock
    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.kernel import Kernel

__all__ = [
    "CLIENT",
    "Driver",
    "Ending",
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


class QueueFullError(GpsfsmError):
    """So many plans have been submitted that the queue takes no more."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """A refusal by the gate: one line for each finding."""

    findings: tuple[str, ...]


Admitted = TypeVar("Admitted")
"""What a gate makes of a plan that passes: the queue hands it to whoever runs the plan."""

Admitted_co = TypeVar("Admitted_co", covariant=True)


class Gate(Protocol[Admitted_co]):
    """Checks plans before they are queued."""

    def __call__(self, text: str, name: str, /) -> Admitted_co | Refusal:
        """The plan ready to run, or what is wrong with it; ``name`` is what it is called."""


class Driver(Protocol):
    """A driver of a plan, as the queue needs it."""

    kernel: Kernel
    failure: BaseException | None  # why the run cannot be journaled any more

    def cancel(self, reason: str) -> None:
        """Stop the run."""


@dataclass(frozen=True, slots=True)
class Ending(Generic[Admitted]):
    """The runs of another process that are brought to their ends, not gone on with, and why.

    ``runs`` are the plans that have one. ``gate`` admits them: nothing of them acts any more.
    """

    reason: str
    runs: Container[int]
    gate: Gate[Admitted]


class PlanQueue(ABC, Generic[Admitted]):
    """The part that queues in virtual and in real time share. Not thread-safe.

    ``held`` is why nothing begins until the queue is released, "" if it is not held. At most
    ``most_waiting`` plans wait (a further one is refused), at most ``most_plans`` are ever
    submitted (then QueueFullError is raised), so plans that submit plans come to an end.
    """

    def __init__(
        self,
        gate: Gate[Admitted],
        log: QueueLog,
        *,
        bond: Bond | None = None,
        most_waiting: int = 100,
        most_plans: int = 10_000,
    ) -> None:
        self._gate = gate
        self._log = log
        self._bond = bond
        self.continuing = Continuing()  # asks for plans that go on where others gave up
        self._most_waiting = most_waiting
        self._most_plans = most_plans
        self._states: list[PlanState] = []
        self._admitted: dict[int, Admitted] = {}  # the plans that wait
        self._waiting: deque[int] = deque()
        self._running: tuple[int, Driver] | None = None
        self.held = ""
        self.ending: dict[int, str] = {}  # plans whose runs are only brought to their ends, and why

    @abstractmethod
    def now_us(self) -> int:
        """Microseconds since the queue began."""

    @abstractmethod
    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time."""

    @abstractmethod
    def _go_to(self, at_us: int) -> None:
        """Let the queue's time go on from there."""

    def _wake(self) -> None:
        """Something may be ready to begin."""

    # -- for clients and runners ------------------------------------------------------------

    def submit(
        self, text: str, *, name: str = "", by: int = CLIENT, gate: Gate[Admitted] | None = None
    ) -> int:
        """Check a plan and queue it; its number. Whether it was refused is in its state.

        ``gate`` is the gate of this plan, if it is another one. Raises QueueFullError when no more
        plans are taken.
        """
        name = self._named(name, by)
        return self._take_in(text, name, by, self._examine(text, name, gate))

    async def submitted(
        self, text: str, *, name: str = "", by: int = CLIENT, gate: Gate[Admitted] | None = None
    ) -> int:
        """Like ``submit``; in real time without holding anything up while the gate checks."""
        return self.submit(text, name=name, by=by, gate=gate)

    def _named(self, name: str, by: int) -> str:
        """The name of the next plan. Raises QueueFullError if there may be no next one."""
        if why := self.full():
            raise QueueFullError(why)
        return name if by == CLIENT else f"plan {len(self._states) + 1} from {name or 'a runner'}"

    def full(self) -> str:
        """The reason why no further plan may be submitted; "" if one may."""
        if len(self._states) < self._most_plans:
            return ""
        return f"the queue takes no more than {self._most_plans:,} plans"

    def continue_with(self, gave_up: int, text: str) -> int:
        """Check a plan that goes on where another one gave up; its number. It is the next to begin.

        Raises UsageError if that plan has not given up or is continued already, and while another
        one runs; QueueFullError when no more plans are taken.
        """
        name = self._continuation(gave_up)
        return self._take_in(text, name, gave_up, self._ask_gate(text, name), continues=gave_up)

    async def continued(self, gave_up: int, text: str) -> int:
        """Like ``continue_with``; in real time without holding anything up meanwhile."""
        return self.continue_with(gave_up, text)

    def _continuation(self, gave_up: int) -> str:
        """The name of the plan that continues another one, if there may be one."""
        if self.state(gave_up).status is not Status.GAVE_UP:
            raise UsageError(f"plan {gave_up} has not given up, so nothing continues it")
        if any(
            state.continues == gave_up and state.status is not Status.REFUSED
            for state in self._states
        ):
            raise UsageError(f"plan {gave_up} is continued already")
        if self._running is not None:
            raise UsageError(f"plan {self._running[0]} runs: nothing can come before it")
        self._named("", CLIENT)
        return f"plan {len(self._states) + 1}, which continues plan {gave_up}"

    def _take_in(
        self, text: str, name: str, by: int, verdict: Admitted | Refusal, *, continues: int = 0
    ) -> int:
        """Queue a plan that has passed the gate, or note why it has not."""
        plan = len(self._states) + 1
        digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
        state = PlanState(
            *(plan, Status.QUEUED, digest, name, by),
            submitted_us=self.now_us(),
            continues=continues,
        )
        data: dict[str, RunValue] = {"sha256": digest, "name": name}
        if continues:
            data["continues"] = continues
        if isinstance(verdict, Refusal):
            data["findings"] = list(verdict.findings)
            self.write(QueueRow(QueueKind.REFUSED, plan, by, data))
            state = replace(
                state, status=Status.REFUSED, findings=verdict.findings, ended_us=self.now_us()
            )
            self._states.append(state)
            return plan
        data["text"] = text
        self.write(QueueRow(QueueKind.SUBMITTED, plan, by, data))
        self._states.append(state)
        self._admitted[plan] = verdict
        if continues:
            self._waiting.appendleft(plan)
        else:
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
        if plan in self.ending:  # it is being cancelled, and its run has to come to its end
            return True
        self.write(QueueRow(QueueKind.CANCEL, plan, by, message=reason))
        self._states[plan - 1] = replace(self._states[plan - 1], reason=reason)
        if self._running is not None and self._running[0] == plan:
            driver = self._running[1]
            self.at(self.now_us(), lambda: driver.cancel(reason))
        else:
            self._waiting.remove(plan)
            del self._admitted[plan]
            self._end(plan, Status.CANCELLED)
        return True

    def hold(self, reason: str, *, renew: bool = False) -> None:
        """Let nothing begin until the queue is released; the plan that runs goes on.

        ``renew``: if it is held already, this is the reason from now on.
        """
        if not self.held or (renew and self.held != reason):
            self.held = reason
            self.write(QueueRow(QueueKind.HELD, message=reason))

    def release(self) -> bool:
        """Let plans begin again; False if the queue was not held."""
        if not self.held:
            return False
        self.write(QueueRow(QueueKind.RELEASED))
        self.held = ""
        self._wake()
        return True

    @property
    def running(self) -> tuple[int, Driver] | None:
        """The plan that runs, and its driver."""
        return self._running

    def state(self, plan: int) -> PlanState:
        """The state of a plan. Raises UsageError for a number that was never given."""
        if not 1 <= plan <= len(self._states):
            raise UsageError(f"there is no plan {plan}")
        current = self._states[plan - 1]
        if self._running is not None and self._running[0] == plan:
            status = self._running[1].kernel.status
            if not status.ended and status is not Status.QUEUED:
                return replace(current, status=status)
        return current

    def states(self) -> tuple[PlanState, ...]:
        """All plans that were ever submitted, in order."""
        return tuple(self.state(plan) for plan in range(1, len(self._states) + 1))

    @property
    def waiting(self) -> int:
        """The number of plans that wait."""
        return len(self._waiting)

    @property
    def submitted_ever(self) -> int:
        """The number of all plans, whatever has become of them."""
        return len(self._states)

    def service(self, plan: int) -> PlanService:
        """The service that the runners of a plan get as ``services['plans']``."""
        return PlanService(self, plan)

    def restore(
        self,
        rows: Iterable[tuple[int, QueueRow]],
        gate: Gate[Admitted] | None = None,
        ending: Ending[Admitted] | None = None,
    ) -> int:
        """Take up the queue that another process left, by its rows and their times.

        Plans that waited wait again, if they still pass the gate, or the one that is given here.
        The plan that ran, if any, is the first of them; its number is returned, else 0. One that
        was being cancelled is. With ``ending`` the queue is held, and what ran is cancelled: its
        run is brought to its end all the same. Raises UsageError if this queue has been used.
        """
        if self._states:
            raise UsageError("a queue can be restored only before it is used")
        texts: dict[int, str] = {}
        for at_us, row in rows:
            self._go_to(at_us)
            recall(self._states, texts, row, at_us)
            self.continuing.take(row)
            if row.kind in (QueueKind.HELD, QueueKind.RELEASED):
                self.held = row.message if row.kind is QueueKind.HELD else ""
        if ending is not None:
            self.hold(ending.reason)
        running = 0
        for state in in_order(self._states):
            if ending is not None and state.attempts:
                running = self._bring_to_end(state, texts[state.plan], ending) or running
                continue
            if state.reason:
                self._end(state.plan, Status.CANCELLED)
                continue
            verdict = self._examine(texts[state.plan], state.name, gate)
            if isinstance(verdict, Refusal):
                self._states[state.plan - 1] = replace(state, findings=verdict.findings)
                self._end(state.plan, Status.REFUSED, "; ".join(verdict.findings))
                continue
            self._admitted[state.plan] = verdict
            self._waiting.append(state.plan)
            running = running or (state.plan if state.attempts else 0)
        self._wake()
        return running

    def _bring_to_end(self, state: PlanState, text: str, ending: Ending[Admitted]) -> int:
        """Cancel a plan that ran; its number if there is a run to be brought to its end, else 0."""
        plan = state.plan
        if not state.reason:
            self.write(QueueRow(QueueKind.CANCEL, plan, message=ending.reason))
            self._states[plan - 1] = replace(state, reason=ending.reason)
        verdict = self._ask_gate(text, state.name, ending.gate)
        if plan not in ending.runs or isinstance(verdict, Refusal):
            self._end(plan, Status.CANCELLED)
            return 0
        self.ending[plan] = self._states[plan - 1].reason
        self._admitted[plan] = verdict
        self._waiting.appendleft(plan)
        return plan

    # -- the way of a plan ------------------------------------------------------------------

    def _examine(self, text: str, name: str, gate: Gate[Admitted] | None) -> Admitted | Refusal:
        return self._full() or self._ask_gate(text, name, gate)

    def _full(self) -> Refusal | None:
        if len(self._waiting) < self._most_waiting:
            return None
        return Refusal((f"the queue is full: {len(self._waiting)} plans wait",))

    def _ask_gate(
        self, text: str, name: str, gate: Gate[Admitted] | None = None
    ) -> Admitted | Refusal:
        try:
            return (gate or self._gate)(text, name)
        except Exception as error:  # a gate that breaks lets nothing through
            return Refusal((f"the gate failed: {type(error).__name__}: {error}"[:1000],))

    def _watch(self, clock: Clock) -> None:
        if self._bond is not None:
            self._bond.watch(clock, lost=self._bond_lost, renewed=self._bond_renewed)

    def _bond_lost(self, reason: str) -> None:
        self.write(QueueRow(QueueKind.BOND_LOST, message=reason))
        self.continuing.stop()
        if self._running is not None:
            plan, driver = self._running
            self._states[plan - 1] = replace(self._states[plan - 1], reason=reason)
            driver.cancel(reason)

    def _bond_renewed(self) -> None:
        self.write(QueueRow(QueueKind.BOND_RENEWED))
        self._wake()

    def _next(self) -> int | None:
        """The plan to begin now, if any: none begins while the queue is held or the bond lost."""
        if not self._waiting:
            return None
        plan = self._waiting[0]
        return plan if self._may_begin() or plan in self.ending else None

    def _due(self) -> Due | None:
        """The continuation that is owed now: before it has been submitted, nothing begins."""
        return self.continuing.due() if self._may_begin() else None

    def _may_begin(self) -> bool:
        return not self.held and (self._bond is None or self._bond.held)

    def _begin(self, plan: int) -> Admitted:
        assert self._running is None, "plans run one after the other"
        assert self._waiting[0] == plan, "plans begin in their order"
        self.write(QueueRow(QueueKind.BEGUN, plan))
        self._waiting.popleft()
        state = self._states[plan - 1]
        self._states[plan - 1] = replace(
            state,
            status=Status.RUNNING,
            began_us=self.now_us() if state.began_us < 0 else state.began_us,
            attempts=state.attempts + 1,
        )
        return self._admitted.pop(plan)

    def _cannot_begin(self, plan: int, error: UsageError | InputError) -> None:
        self._states[plan - 1] = replace(self._states[plan - 1], findings=(str(error),))
        self._end(plan, Status.REFUSED, str(error))

    def _end(self, plan: int, status: Status, message: str = "") -> None:
        data: dict[str, RunValue] = {"status": status.value}
        self.write(QueueRow(QueueKind.ENDED, plan, data=data, message=message))
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
        assert not state.status.ended, "a plan ends once"
        assert status.ended, "what has an end has ended"
        reason = state.reason if status is Status.CANCELLED else ""
        ended = replace(state, status=status, reason=reason, ended_us=self.now_us())
        self._states[plan - 1] = ended

    def write(self, row: QueueRow) -> None:
        """Keep a row about what the queue does; when this returns it is safe."""
        self._log.write_queue(self.now_us(), row)
        self.continuing.take(row)


@dataclass(frozen=True, slots=True)
class PlanService:
    """The queue as the runners of one plan see it."""

    queue: PlanQueue[Any]
    plan: int

    def submit(self, text: str, name: str = "") -> int:
        """Queue a plan behind the one that runs; its number. See ``findings`` for a refusal."""
        return self.queue.submit(text, name=name, by=self.plan)

    async def submitted(self, text: str, name: str = "") -> int:
        """The same for runners that act in real time: one that is asked to stop can stop here."""
        return await self.queue.submitted(text, name=name, by=self.plan)

    def cancel(self, plan: int, reason: str = "cancelled by a plan") -> bool:
        """Cancel a plan, maybe the one that runs; False if it has ended already."""
        return self.queue.cancel(plan, reason, by=self.plan)

    def status(self, plan: int) -> str:
        """The status of a plan."""
        return self.queue.state(plan).status.value

    def findings(self, plan: int) -> tuple[str, ...]:
        """The findings for which a plan was refused; empty if it was not."""
        return self.queue.state(plan).findings
