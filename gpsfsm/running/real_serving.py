"""The process that runs the plans of the service for real (``gpsfsm.running.real_serving``).

It does in real time what ``gpsfsm.running.serving`` does in virtual time. But nothing moves by
itself: whatever a process before has left is stopped, and the queue is held until an operator
releases it. So it is after a stop, and when the bond of an operator is lost.
"""

from __future__ import annotations

import asyncio
import os
import queue
import sys
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.checking.parallel import CheckApart
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.bond import Bond, LoopClock
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.journal_errors import EmptyJournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.queue import QueueFullError, QueueKind, QueueRow
from gpsfsm.ros.ledger import OURS
from gpsfsm.running.admission import Admission, Admitted, as_text
from gpsfsm.running.bounds import PERMISSIONS
from gpsfsm.running.drivers import Shared
from gpsfsm.running.history import Unfinished, begun_run, check_versions, queues, unfinished
from gpsfsm.running.interruption import Interruption
from gpsfsm.running.one_run import LiveRun, RunObserver, StderrObserver
from gpsfsm.running.prepare import REAL
from gpsfsm.running.queue_answers import (
    ABOUT_PLANS,
    KeyedLog,
    TracedPlans,
    length_of,
    open_journal,
    to_json,
)
from gpsfsm.running.session import OneWorld, Session
from gpsfsm.running.worlds import Start, Starts
from gpsfsm.streams import complain
from gpsfsm.syntax import Limits
from gpsfsm.workers import limit_memory
from gpsfsm.workers.parent_link import ParentLink

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence
    from typing import Self

    from gpsfsm.execution.journal import Journal
    from gpsfsm.execution.queue import PlanState
    from gpsfsm.execution.queues import LiveQueue
    from gpsfsm.running.history import Begun
    from gpsfsm.running.one_run import Run

_MOST_ATTEMPTS = 3
_SETTLE_S, _LOOK_S = 2.2, 0.005
"""What the goals that are cancelled by a stop may take to end before it is not confirmed."""
_NOTE_S = 0.05
_LEAVE_S = 9.0
"""What a run may take to stop when the service ends: more than the grace time of its runners."""
_NOT_STOPPED = 3
"""The exit code if a run could not be stopped in time."""
_RESTARTED = "the process that runs the plans was restarted"
_STOPPED = "the service was stopped"
_NOT_REAL = "a run of real runners cannot be stepped, sped up or made to fail"


class _Setting(OneWorld):
    """The setting of real runs; plans that are to begin paused do."""

    def __init__(self, shared: Shared, starts: Starts, interruption: Interruption) -> None:
        super().__init__(shared)
        self._starts, self._interruption = starts, interruption

    def heading(self, plan: int, base: Heading) -> Heading:
        """As for ``gpsfsm run``, with the seed that the client wishes."""
        seed = self._starts.seed(plan, base.seed)
        return replace(super().heading(plan, base), seed=seed)

    def began(self, plan: int, run: str) -> None:
        """A plan runs."""
        super().began(plan, run)
        self._interruption.paused = self._starts.of(plan).paused


class RealQueue(StderrObserver):
    """The queue of real runs; lives on one event loop. ``over`` is done when it cannot go on.

    ``send`` never waits: a service that does not listen holds up no bond.
    """

    queue: LiveQueue[Admitted]

    def __init__(
        self, head: dict[str, Any], journal: Journal, stack: ExitStack, link: ParentLink
    ) -> None:
        self.keys: dict[str, int] = {}
        self.numbers: dict[int, int] = {}
        self.starts = Starts()
        self.traced = TracedPlans()
        self.over: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.head = head
        outbox: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self.send = outbox.put
        threading.Thread(target=_send_all, args=(link, outbox), name="answers", daemon=True).start()
        self._bonds: dict[str, Bond] = {}
        self._submitting = asyncio.Lock()
        self._capabilities = choose_capabilities(
            head["capabilities"], builtin=head["builtin"], robot=head.get("robot")
        )
        self._base = _heading(head, self._capabilities.library)
        check = stack.enter_context(CheckApart(head["check_s"])).check
        limits = Limits(**head["limits"])
        self._admission = Admission(self._base, self._capabilities, limits, trees=True, check=check)
        self._log = KeyedLog(journal, self.starts, more={REAL: True})
        interruption = Interruption()
        self._shared = Shared(notify=complain)
        self._session = Session(
            *(self._base, self._admission, self),
            journal=journal,
            log=self._log,
            setting=_Setting(self._shared, self.starts, interruption),
            interruption=interruption,
            most_waiting=head["most_waiting"],
            most_plans=head["most_plans"],
        )
        if head.get("model"):
            self._shared.model = self._model(stack)
        self.queue = self._session.live_queue()

    def _model(self, stack: ExitStack) -> Any:
        from gpsfsm.generation.providers import Configured, settings_of
        from gpsfsm.running.model_access import model_of_run

        files = Configured(**self.head["model_files"])
        settings = settings_of(self.head["model"], configured=files)
        return model_of_run(self._base, settings, self._capabilities, stack)

    # -- a restart ------------------------------------------------------------------------------

    def restore(self, tell: Callable[[dict[str, Any]], object]) -> None:
        """Take up what an earlier process has left: its runs are cancelled, the queue is held.

        ``tell`` gets the news that runs were left, before anything can go wrong with them or take
        its time. Raises GpsfsmError if that is not possible.
        """
        left = None
        if Path(self.head["journal"]).exists():
            try:
                with JournalReader(self.head["journal"]) as reader:
                    left = self._read(reader, tell)
            except EmptyJournalError:
                left = None
        for _, row in () if left is None else left.queue.rows:
            self.starts.take(row)
            if isinstance(key := (row.data or {}).get("key"), str):
                self.keys[key] = row.plan
        self._session.take_up(left, self.head.get("why") or _RESTARTED)

    def _read(
        self, reader: JournalReader, tell: Callable[[dict[str, Any]], object]
    ) -> Unfinished | None:
        every = queues(reader)
        if not every:
            return None
        queue, runs = every[-1], every[-1].runs()
        simulated = any(
            row.kind is QueueKind.SUBMITTED and (row.data or {}).get(REAL) is not True
            for _, row in queue.rows
        )
        if simulated or any(reader.run(number).mode != REAL for number in runs.values()):
            raise UsageError(
                f"{reader.path}: the plans of this journal were not submitted to be run for real; "
                "use another journal"
            )
        self.numbers = dict(runs)
        begun: dict[int, Begun] = {}
        open_plans = [plan for plan in queue.open() if plan in runs]
        if open_plans:
            tell({"left": len(open_plans)})
        for plan in open_plans:
            if self._attempts(queue.rows, plan) >= _MOST_ATTEMPTS:
                complain(
                    f"plan {plan} is cancelled, but what it still does outside is unknown: "
                    f"the process that should stop it has ended {_MOST_ATTEMPTS} times"
                )
                continue
            run = reader.run(runs[plan])
            check_versions(reader.path, run, complain)
            begun[plan] = self._permitted(begun_run(reader, run, queue))
        return unfinished(reader, queue, self._base, begun)

    @staticmethod
    def _attempts(rows: Sequence[tuple[int, QueueRow]], plan: int) -> int:
        return sum(row.kind is QueueKind.BEGUN and row.plan == plan for _, row in rows)

    def _permitted(self, begun: Begun) -> Begun:
        """A run with what is allowed now: a journal allows nothing."""
        heading = begun.prepared.heading
        kept = {name: each for name, each in heading.options.items() if name not in PERMISSIONS}
        now = {name: each for name, each in self._base.options.items() if name in PERMISSIONS}
        heading = replace(heading, options={**kept, **now})
        return replace(begun, prepared=replace(begun.prepared, heading=heading))

    # -- for the session ------------------------------------------------------------------------

    def wrote(self, row: QueueRow) -> None:
        """Let the service know."""
        self.send({"note": row.kind.value})

    def in_doubt(self, doubts: Sequence[str]) -> None:
        """A run has ended although something may still act: nothing begins before a release."""
        super().in_doubt(doubts)
        self.queue.held = ""
        self.queue.hold(f"in doubt: {doubts[0]}")

    def run_begins(self, run: Run) -> RunObserver:
        """Watch a run."""
        assert run.state is not None
        self.numbers[run.state.plan] = run.number
        return _Watch(self, run.state.plan, run)

    # -- what the service asks for --------------------------------------------------------------

    async def submit(self, head: dict[str, Any], body: bytes) -> dict[str, Any]:
        """Queue a plan that passes the gate here as well; when this returns it is in the journal.

        One after the other: a key that comes twice is queued once.
        """
        async with self._submitting:
            plan = self.keys.get(head["key"])
            if plan is not None:
                return to_json(self, self.queue.state(plan))
            if self.queue.waiting >= self.head["most_waiting"]:
                why = f"the queue is full: {self.queue.waiting} plans wait"
                return {"problem": 429, "detail": why, "retry_s": 5}
            start = Start.of(head.get("start") or {}, "")
            if start is not None and (start.world or start.speed is not None):
                why = "start: real runners act in the real world, at their own speed"
                return {"problem": 422, "detail": why}
            self._log.key, self._log.start = head["key"], start
            try:
                plan = await self.queue.submitted(as_text(body), name=head["name"])
            finally:
                self._log.key, self._log.start = "", None
            self.keys[head["key"]] = plan
            self.traced.submitted(plan, head)
            return to_json(self, self.queue.state(plan))

    async def cancel(self, head: dict[str, Any], _: bytes) -> dict[str, Any]:
        """Cancel a plan. Raises UsageError if there is none."""
        done = self.queue.cancel(head["plan"], head["reason"])
        return {**to_json(self, self.queue.state(head["plan"])), "done": done}

    async def control(self, head: dict[str, Any], _: bytes) -> dict[str, Any]:
        """Let a run pause or go on."""
        plan, what = head["plan"], head["what"]
        why, running = "", self.queue.running
        if running is None or running[0] != plan:
            why = "the plan is not running"
        elif what not in ("pause", "resume"):
            why = _NOT_REAL
        else:
            assert isinstance(running[1], LiveRun)
            running[1].pause(on=what == "pause")
            await asyncio.sleep(0)  # it is done behind earlier requests
            await asyncio.sleep(0)
        return {**to_json(self, self.queue.state(plan)), "done": not why, "why": why}

    async def stop(self, head: dict[str, Any], _: bytes) -> dict[str, Any]:
        """Cancel the plan that runs, and hold the queue; ``open`` is what may act all the same."""
        plan = self.halt(head["reason"], renew=head["renew"])
        end = time.monotonic() + _SETTLE_S
        while (left := OURS.open()) and time.monotonic() < end:
            await asyncio.sleep(_LOOK_S)
        return {**self.held(), "cancelled": plan, "open": [each.words for each in left]}

    def halt(self, reason: str, *, renew: bool = True) -> int:
        """The same; the number of the plan that is cancelled, 0 if none runs.

        ``renew``: whoever releases the queue has to know of this reason as well.
        """
        OURS.stop()
        running = self.queue.running
        plan = 0 if running is None else running[0]
        if running is not None:
            try:
                self.queue.cancel(plan, reason)
            except BaseException:  # it cannot be written down, and is to be done all the same
                running[1].cancel(reason)
                raise
        self.queue.hold(reason, renew=renew)
        self.queue.continuing.stop()
        return plan

    async def release(self, head: dict[str, Any], _: bytes) -> dict[str, Any]:
        """Let plans begin again, unless the queue is held for another reason than the one named."""
        done = head["held"] in (None, self.queue.held) and self.queue.release()
        if done:
            OURS.release()
        return {**self.held(), "done": done}

    async def about(self, _head: dict[str, Any], _: bytes) -> dict[str, Any]:
        """The state of the queue."""
        return self.held()

    async def beat(self, head: dict[str, Any], _: bytes) -> dict[str, Any]:
        """A beat of an operator; the first one begins a bond, and ``end`` leaves it."""
        client, lease_s = head["client"], head["lease_s"]
        bond = self._bonds.get(client)
        if bond is not None and not bond.beat():
            while self._bonds.get(client) is bond:  # its loss has an effect before anything else
                await asyncio.sleep(0)
            bond = None
        if head["end"]:
            self._bonds.pop(client, None)
        elif bond is None or bond.timeout_s != lease_s:
            self._begin_bond(client, lease_s)
        return self.held()

    def _begin_bond(self, client: str, lease_s: float) -> None:
        bond = self._bonds[client] = Bond(lease_s)

        def lost(reason: str) -> None:
            if self._bonds.get(client) is bond:  # else it was left, or another one has begun
                del self._bonds[client]
                self.attempt(lambda: self.halt(f"{reason} from {client}"))

        bond.watch(LoopClock(asyncio.get_running_loop()), lost=lost)

    def held(self) -> dict[str, Any]:
        """The state of the queue: why it is held, what runs, and how many plans wait."""
        running = self.queue.running
        return {
            "held": self.queue.held,
            "plan": 0 if running is None else running[0],
            "waiting": self.queue.waiting,
            "bonds": len(self._bonds),
        }

    def pace_of(self, state: PlanState) -> dict[str, Any]:
        """Real runs go at the speed of the world."""
        start, clock_us = self.starts.of(state.plan), length_of(state)
        paused, running = start.paused and not state.status.ended, self.queue.running
        if running is not None and running[0] == state.plan:
            assert isinstance(running[1], LiveRun)
            paused, clock_us = running[1].kernel.paused, running[1].now_us()
        return {"world": REAL, "speed": 1.0, "paused": paused, "clock_us": clock_us}

    # -- messages -------------------------------------------------------------------------------

    def attempt(self, action: Callable[[], object]) -> None:
        """Do something; if it cannot be written down, this process cannot go on."""
        try:
            action()
        except Exception as error:
            self.fail(error)

    def fail(self, error: BaseException) -> None:
        """Nothing can go on: what runs is stopped, and the process ends."""
        if not self.over.done():
            self.over.set_exception(error)

    async def answer(self, head: dict[str, Any], body: bytes) -> None:
        """Answer a message of the service."""
        try:
            if head["op"] in ABOUT_PLANS:
                reply = ABOUT_PLANS[head["op"]](self, head, body)
            else:
                reply = await _OPS[head["op"]](self, head, body)
        except QueueFullError as error:
            reply = {"problem": 507, "detail": f"{error}; start with a new journal"}
        except UsageError as error:
            reply = {"problem": 404, "detail": str(error)}
        except Exception as error:
            self.fail(error)
            return
        self.send({"id": head["id"], **reply})


async def _worlds(_served: RealQueue, _head: dict[str, Any], _: bytes) -> dict[str, Any]:
    return {"worlds": []}


async def _world(_served: RealQueue, _head: dict[str, Any], _: bytes) -> dict[str, Any]:
    return {"problem": 404, "detail": "there is no such world"}


_OPS: dict[str, Callable[[RealQueue, dict[str, Any], bytes], Awaitable[dict[str, Any]]]] = {
    "submit": RealQueue.submit,
    "cancel": RealQueue.cancel,
    "control": RealQueue.control,
    "stop_all": RealQueue.stop,
    "release": RealQueue.release,
    "queue": RealQueue.about,
    "bond": RealQueue.beat,
    "worlds": _worlds,
    "world": _world,
}


class _Watch(RunObserver):
    """Lets the service know of what happens in a run, and sees to the time."""

    def __init__(self, served: RealQueue, plan: int, run: Run) -> None:
        self._served, self._plan, self._run = served, plan, run
        self._until_s = time.monotonic() + served.head["run_s"]
        self._noted_s = 0.0
        self._unsent = self._over = False

    def __enter__(self) -> Self:
        assert self._run.state is not None
        self._traced = self._served.traced.begun(self._run.state)
        return self

    def __exit__(self, *_: object) -> None:
        if (spans := self._traced()) is not None:
            self._served.send(spans)

    def __call__(self, *_: object, **__: object) -> None:
        """Something has happened in the run."""
        self._unsent = True
        self._tell()

    def tick(self, *_: object, **__: object) -> None:
        """Nothing happens at this time of the run."""
        self._tell()
        if time.monotonic() > self._until_s and not self._over:
            self._over = True
            why = f"it took more than {self._served.head['run_s']:g} s"
            self._served.attempt(lambda: self._served.queue.cancel(self._plan, why))

    def _tell(self) -> None:
        now_s = time.monotonic()
        soon = now_s - self._noted_s <= _NOTE_S and not self._run.kernel.status.ended
        if self._unsent and not soon:
            self._noted_s, self._unsent = now_s, False
            self._served.send({"note": "EVENT"})


def _send_all(link: ParentLink, outbox: queue.SimpleQueue[dict[str, Any]]) -> None:
    while True:
        link.send(outbox.get())


def _heading(head: dict[str, Any], library: Any) -> Heading:
    """The part that the headings of all runs have in common."""
    from gpsfsm.capabilities.table import dump

    # no two real actions ever have the same key
    options = {**head.get("options", {}), "nonce": os.urandom(8).hex()}
    return Heading(
        plan=b"", capabilities=dump(library), seed=head.get("seed", 0), mode=REAL, options=options
    )


def main() -> int:
    """Run plans until the service ends."""
    link = ParentLink(_leave)
    head, _ = link.messages.get()
    if head.get("op") == "stop":
        return 0
    limit_memory(head["memory_mb"], itself_alone=True)  # not the programs that its runners start
    try:
        with ExitStack() as stack:
            asyncio.run(_serve(head, open_journal(head, stack), stack, link))
    except GpsfsmError as error:
        link.send({"failed": str(error)})
        return 2
    return 0


def _leave(link: ParentLink) -> None:
    """The service has gone: let the run stop in good order, but not for ever."""
    link.messages.put(({"op": "stop"}, b""))
    timer = threading.Timer(_LEAVE_S, os._exit, (_NOT_STOPPED,))
    timer.daemon = True
    timer.start()


async def _serve(
    head: dict[str, Any], journal: Journal, stack: ExitStack, link: ParentLink
) -> None:
    served = RealQueue(head, journal, stack, link)
    served.restore(link.send)
    if head.get("why"):
        served.queue.hold(head["why"])
    link.send({"ready": True})
    loop = asyncio.get_running_loop()
    answers: set[asyncio.Task[None]] = set()

    def take(message: dict[str, Any], body: bytes) -> None:
        if message["op"] == "stop":
            if not served.over.done():
                served.over.set_result(None)
            return
        task = loop.create_task(served.answer(message, body))
        answers.add(task)
        task.add_done_callback(answers.discard)

    def pump() -> None:
        while True:
            message, body = link.messages.get()
            loop.call_soon_threadsafe(take, message, body)
            if message["op"] == "stop":
                return

    threading.Thread(target=pump, name="messages", daemon=True).start()
    running = loop.create_task(served.queue.serve())
    await asyncio.wait({running, served.over}, return_when=asyncio.FIRST_COMPLETED)
    if served.over.done() and served.over.exception() is None:
        served.halt(_STOPPED, renew=False)
        served.queue.close()
        await _until_stopped(served)
    running.cancel()
    await asyncio.wait({running})
    for each in (served.over, running):
        if each.done() and not each.cancelled() and (error := each.exception()) is not None:
            raise error


async def _until_stopped(served: RealQueue) -> None:
    """Wait for the end of the run that was cancelled."""
    until_s = time.monotonic() + _LEAVE_S
    while served.queue.running is not None and time.monotonic() < until_s:
        await asyncio.sleep(0.02)


if __name__ == "__main__":
    sys.exit(main())
