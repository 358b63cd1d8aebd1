"""Plan queues in virtual and in real time (see ``gpsfsm.execution.queue``)."""

from __future__ import annotations

import asyncio
import heapq
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from gpsfsm.errors import InputError, UsageError
from gpsfsm.execution.bond import LoopClock
from gpsfsm.execution.journal_errors import JournalError, ReplayDivergence
from gpsfsm.execution.lane import in_thread
from gpsfsm.execution.queue import Admitted, Driver, PlanQueue, Refusal
from gpsfsm.execution.queue_rows import CLIENT
from gpsfsm.execution.records import Input, Kind

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from gpsfsm.execution.bond import Bond
    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.queue import Gate, PlanState, QueueLog
    from gpsfsm.execution.virtual import VirtualDriver


_LOOK_S = 0.05


@dataclass(frozen=True, slots=True)
class _BondClock:
    """The clock of a virtual queue, for what must not keep an idle queue going."""

    queue: VirtualQueue[Any]

    def now_us(self) -> int:
        return self.queue.now_us()

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        self.queue.plan_action(at_us, action, idle=False)


class TimedDriver(Driver, Protocol):
    """Runs a plan in virtual time."""

    def now_us(self) -> int:
        """The virtual time since the run began."""

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time of the run."""

    def run(self) -> None:
        """Run until the plan has ended."""


class VirtualQueue(PlanQueue[Admitted]):
    """Runs plans one after the other in virtual time.

    ``begin`` makes the driver of a plan; a UsageError or InputError that it raises refuses the
    plan, unless it is about the journal: then the queue cannot go on, and it is raised. Each
    driver's time begins at zero, the queue's time goes on from plan to plan.
    """

    def __init__(
        self,
        gate: Gate[Admitted],
        log: QueueLog,
        begin: Callable[[PlanState, Admitted], TimedDriver],
        *,
        bond: Bond | None = None,
        most_waiting: int = 100,
        most_plans: int = 10_000,
    ) -> None:
        super().__init__(gate, log, bond=bond, most_waiting=most_waiting, most_plans=most_plans)
        self._make = begin
        self._offset_us = 0  # when the plan that runs began
        self._driver: TimedDriver | None = None
        self._sequence = 0
        self._agenda: list[tuple[int, int, bool, Callable[[], None]]] = []
        self._watch(_BondClock(self))

    def now_us(self) -> int:
        """The virtual time of the queue."""
        return self._offset_us + (0 if self._driver is None else self._driver.now_us())

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time of the queue: submit, cancel, beat."""
        self.plan_action(at_us, action, idle=True)

    def plan_action(self, at_us: int, action: Callable[[], None], *, idle: bool) -> None:
        """Do something at a time; ``idle`` says whether also while no plan waits or runs."""
        self._sequence += 1
        at_us = max(at_us, self.now_us())
        heapq.heappush(self._agenda, (at_us, self._sequence, idle, action))
        if self._driver is not None:
            self._driver.at(at_us - self._offset_us, self._act)

    def _go_to(self, at_us: int) -> None:
        self._offset_us = at_us

    def run_all(self) -> None:
        """Run what waits and do what is planned, until nothing is left.

        More may be submitted afterwards and run by another call. While the bond is lost, plans
        stay where they are.
        """
        while True:
            self._act()
            due, plan = self._due(), self._next()
            if due is not None:
                self._go_on(due)
            elif plan is not None:
                self._run(plan)
            elif any(idle for _, _, idle, _ in self._agenda):
                self._offset_us = self._agenda[0][0]
            else:
                return

    def _go_on(self, due: Due) -> None:
        """Ask for a plan that goes on where another one gave up; that takes no virtual time."""
        with suppress(RuntimeError):  # none runs, as it should be
            asyncio.get_running_loop()
            raise UsageError("plans are continued where no event loop runs, or by a LiveQueue")
        asyncio.run(self.continuing.go_on(self, due))

    def _act(self) -> None:
        """Do all that is due."""
        while self._agenda and self._agenda[0][0] <= self.now_us():
            heapq.heappop(self._agenda)[3]()

    def _run(self, plan: int) -> None:
        compiled, state = self._begin(plan), self._states[plan - 1]
        if state.attempts > 1:  # what it has done happens once more, at the same times
            self._offset_us = state.began_us
        try:
            driver = self._make(state, compiled)
        except (UsageError, InputError) as error:
            _raise_of_journal(error)
            self._cannot_begin(plan, error)
            return
        self._driver, self._running = driver, (plan, driver)
        for at_us, _, _, _ in sorted(self._agenda, key=lambda entry: entry[:2]):
            driver.at(max(0, at_us - self._offset_us), self._act)
        try:
            driver.run()
        finally:
            self._offset_us += driver.now_us()
            self._driver = None
            self._over(plan, driver)


class LiveDriver(Driver, Protocol):
    """Runs a plan in real time."""

    async def run(self) -> None:
        """Run until the plan has ended."""


class LiveQueue(PlanQueue[Admitted]):
    """Runs plans one after the other in real time, on the event loop that makes it.

    Not thread-safe: call it from the event loop, from elsewhere through ``call_soon_threadsafe``.
    ``look`` raises a UsageError or InputError if what a plan needs is not there, which refuses it;
    meanwhile the plan waits, and can be cancelled.
    Plans that come in through ``submitted`` are checked in a thread, one after the other; a gate
    that has said nothing after ``gate_s`` seconds refuses the plan.
    """

    def __init__(
        self,
        gate: Gate[Admitted],
        log: QueueLog,
        begin: Callable[[PlanState, Admitted], LiveDriver],
        *,
        bond: Bond | None = None,
        most_waiting: int = 100,
        most_plans: int = 10_000,
        gate_s: float = 120.0,
        look: Callable[[PlanState, Admitted], Awaitable[None]] | None = None,
    ) -> None:
        super().__init__(gate, log, bond=bond, most_waiting=most_waiting, most_plans=most_plans)
        self._make, self._look = begin, look
        self._gate_s = gate_s
        self._turn = asyncio.Lock()  # who submits first is checked first
        self._checking = 0  # submissions without a verdict
        self._at_gate: asyncio.Task[Admitted | Refusal] | None = None
        self._clock = LoopClock(asyncio.get_running_loop())
        self._offset_us = 0
        self._ready = asyncio.Event()
        self._closed = False
        self._watch(self._clock)

    def now_us(self) -> int:
        """Microseconds since the queue was made; a restored one goes on from its last row."""
        return self._offset_us + self._clock.now_us()

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time of the queue."""
        self._clock.at(at_us - self._offset_us, action)

    def _go_to(self, at_us: int) -> None:
        self._offset_us = at_us - self._clock.now_us()

    async def submitted(
        self, text: str, *, name: str = "", by: int = CLIENT, gate: Gate[Admitted] | None = None
    ) -> int:
        """Check a plan while everything goes on, and queue it; its number.

        Whoever calls first has the lower number. A call that is cancelled queues nothing. Raises
        QueueFullError, and UsageError if the plan that submits has ended meanwhile.
        """
        self._checking += 1
        try:
            async with self._turn:
                name = self._named(name, by)
                verdict = self._full() or await self._examine_apart(text, name, gate)
                if by != CLIENT and (self._running is None or self._running[0] != by):
                    raise UsageError(f"plan {by}, which submits a plan, has ended meanwhile")
                return self._take_in(text, name, by, self._full() or verdict)
        finally:
            self._checking -= 1
            self._wake()

    async def continued(self, gave_up: int, text: str) -> int:
        """Like ``continue_with``, while everything goes on."""
        async with self._turn:
            name = self._continuation(gave_up)
            verdict = await self._examine_apart(text, name)
            return self._take_in(text, name, gave_up, verdict, continues=gave_up)

    async def _examine_apart(
        self, text: str, name: str, gate: Gate[Admitted] | None = None
    ) -> Admitted | Refusal:
        """Ask the gate in a thread. One that nobody waits for any more is never asked twice."""
        if self._at_gate is not None:
            await asyncio.wait({self._at_gate}, timeout=self._gate_s)
            if not self._at_gate.done():
                return Refusal(("the gate is still busy with an earlier plan",))
        self._at_gate = asyncio.ensure_future(in_thread(self._ask_gate, text, name, gate))
        await asyncio.wait({self._at_gate}, timeout=self._gate_s)
        if not self._at_gate.done():
            return Refusal((f"the gate has not decided within {self._gate_s:g} s",))
        return self._at_gate.result()

    def close(self) -> None:
        """Let ``serve`` return once nothing waits that may begin, and nothing is at the gate."""
        self._closed = True
        self._wake()

    async def serve(self) -> None:
        """Run plans as they come, until the queue is closed. An empty queue waits for more."""
        while True:
            self._ready.clear()
            due, plan = self._due(), self._next()
            if due is not None:
                await self.continuing.go_on(self, due)
            elif plan is not None:
                await self._run(plan)
            elif self._closed and not self._checking:
                return
            else:
                await self._ready.wait()

    def _wake(self) -> None:
        self._ready.set()

    async def _run(self, plan: int) -> None:
        missing = await self._looked(plan)
        if self._next() != plan:  # it was cancelled meanwhile, or nothing may begin
            return
        compiled = self._begin(plan)
        try:
            if missing is not None:
                raise missing
            driver = self._make(self._states[plan - 1], compiled)
        except (UsageError, InputError) as error:
            _raise_of_journal(error)
            self._cannot_begin(plan, error)
            return
        self._running = (plan, driver)
        try:
            await driver.run()
        finally:
            self._over(plan, driver)

    async def _looked(self, plan: int) -> UsageError | InputError | None:
        """The reason why a plan cannot begin; a look that nobody waits for any more is ended."""
        if self._look is None:
            return None
        looking = asyncio.ensure_future(self._look(self._states[plan - 1], self._admitted[plan]))
        try:
            while not looking.done() and self._next() == plan:
                await asyncio.wait({looking}, timeout=_LOOK_S)
        finally:
            looking.cancel()
            await asyncio.wait({looking})
        if looking.cancelled():
            return None
        error = looking.exception()
        if error is None or isinstance(error, UsageError | InputError):
            return error
        raise error


def _raise_of_journal(error: UsageError | InputError) -> None:
    """Raise an error of the journal: it says nothing about the plan, which may run another day.

    A plan whose past does not come out the same is another matter: others can run.
    """
    if isinstance(error, JournalError) and not isinstance(error, ReplayDivergence):
        raise error


def run_together(drivers: Sequence[VirtualDriver]) -> None:
    """Run many plans at once, on one clock: the event that is due first comes first.

    Of events at the same time those of the driver that is further in front come first. Each run is
    the one that its driver would have run alone; only what runners share can tell the difference.
    """
    due: list[tuple[int, int]] = []

    def plan_next(index: int) -> None:
        driver = drivers[index]
        while not driver.kernel.status.ended:
            at_us = driver.next_us()
            if at_us is not None:
                heapq.heappush(due, (at_us, index))
                return
            driver.deliver(Input(Kind.SILENCE))

    try:
        for index, driver in enumerate(drivers):
            driver.deliver(Input(Kind.BEGIN))
            plan_next(index)
        while due:
            _, index = heapq.heappop(due)
            drivers[index].advance()
            plan_next(index)
    finally:
        for driver in drivers:
            driver.abandon()
