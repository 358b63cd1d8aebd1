"""The pool of worker processes: which one gets which request, and when. Who is late is ended.

Requests are of three cost classes. Small gate requests have workers of their own. All others share
the rest, which large ones never have to themselves, unless there is one alone; these workers give
way to the others on this machine. Within a class each client has its turn. A small request that
takes long turns out to be large: its worker is ended, or goes on as one that has a large request.
A worker that has ended is replaced (``Staff``).
"""

from __future__ import annotations

import asyncio
import math
import time
from collections import Counter, OrderedDict
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm import logs
from gpsfsm.errors import GpsfsmError
from gpsfsm.service.clients import Line
from gpsfsm.service.costs import SMALL_BYTES, Kind, expected_ms, kind_of
from gpsfsm.service.shapes import Problem
from gpsfsm.service.traces import Traces
from gpsfsm.workers.child_process import AsyncChildProcess, child_command
from gpsfsm.workers.frames import GoneError

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

    from gpsfsm.service.clients import Ticket
    from gpsfsm.service.settings import Settings

_TARGET = "gpsfsm.service.worker:main"
_START_S = 60.0
_MOST_JOBS = 20_000
"""After so many requests a worker is replaced."""
_PAUSE_S = 1.0
_NICE = 5
"""The niceness of workers that have no small gate requests."""
_WAITS = 3
"""A request may wait as long as so many of them may take."""
_STRIKE_S, _MOST_STRIKES, _MOST_STRIKERS = 60.0, 2, 1_024
_STRICTER = 4.0
"""So many times with every strike: then small is what a gate would take for small."""
_NEXT = {Kind.GATE: Kind.SMALL, Kind.SMALL: Kind.LARGE}
_TIMES = {Kind.GATE: 1.0, Kind.SMALL: 4.0}
"""How many times ``Settings.small_s`` of a core a request may take that counts as small."""
_LEAST_S = 0.02
_OUTCOMES = {429: "refused", 504: "late"}
_SOON = 0.5
"""A worker that has needed so much of its time may have to be ended soon."""


class Worker(NamedTuple):
    """A process that can work, with what it has done so far."""

    process: AsyncChildProcess
    jobs: int
    memory_mb: int


async def all_of(*parts: Coroutine[None, None, None]) -> None:
    """Do all at once; if one fails, the others are cancelled and waited for, and its error raised.

    ``asyncio.gather`` lets them go on, and so does whoever waits for it no longer: a process that
    has just been started would outlive its event loop.
    """
    try:
        async with asyncio.TaskGroup() as group:
            for each in parts:
                group.create_task(each)
    except ExceptionGroup as errors:
        raise errors.exceptions[0] from None


class Staff:
    """``most`` workers at once, and spare ones that take the place of those that end.

    ``nice`` is how far they give way to others on this machine. ``ready`` is called when one has
    become free. Not thread-safe: it lives on one event loop.
    """

    def __init__(
        self, settings: Settings, most: int, *, spares: int, nice: int, ready: Callable[[], None]
    ) -> None:
        self.most = most
        self._settings = settings
        self._spares = spares
        self._nice = nice
        self._ready = ready
        self._idle: list[Worker] = []
        self._all: set[AsyncChildProcess] = set()
        self._able: set[AsyncChildProcess] = set()  # those that have begun to work
        self._hiring = 0
        self._tasks: set[asyncio.Task[None]] = set()
        self._endings: set[asyncio.Task[None]] = set()
        self._closed = False
        self.busy = self.restarts = 0

    @property
    def alive(self) -> int:
        """The number of workers that can work at once."""
        return min(sum(each.alive for each in self._able), self.most)

    async def start(self) -> None:
        """Start all workers. Raises GpsfsmError if they cannot work with these settings."""
        await all_of(*(self._hire() for _ in range(self.most)))
        self._fill()

    def keep_spare(self) -> None:
        """A worker may soon have to be ended: from now on there is one to take its place."""
        self._spares = max(self._spares, 1)
        self._fill()

    def take(self) -> Worker | None:
        """A worker that is free, which is busy from now on."""
        while self.busy < self.most and self._idle:
            worker = self._idle.pop()
            if worker.process.alive:
                self.busy += 1
                return worker
            self._dismiss(worker.process)  # it has ended while it had nothing to do
        return None

    def give_back(self, worker: Worker) -> None:
        """It has done its work."""
        assert self.busy > 0, "a worker comes back that nobody has taken"
        assert worker not in self._idle
        self.busy -= 1
        worn = worker.jobs >= _MOST_JOBS or worker.memory_mb > self._settings.memory_mb * 3 // 4
        if worn or self._closed:
            self._dismiss(worker.process)
        else:
            self._idle.append(worker)

    def end(self, worker: Worker) -> None:
        """It has to be ended, whatever it does."""
        assert self.busy > 0, "a worker is ended that nobody has taken"
        self.busy -= 1
        self._dismiss(worker.process)

    def _dismiss(self, process: AsyncChildProcess) -> None:
        self._all.discard(process)
        self._able.discard(process)
        self._later(process.end(), self._endings)
        if not self._closed:
            self.restarts += 1
            self._fill()

    def _fill(self) -> None:
        """Hire whoever is missing."""
        for _ in range(self.most + self._spares - len(self._all) - self._hiring):
            self._hiring += 1
            self._later(self._replace(), self._tasks)

    def _later(self, work: Coroutine[None, None, None], among: set[asyncio.Task[None]]) -> None:
        task = asyncio.ensure_future(work)
        among.add(task)
        task.add_done_callback(among.discard)

    async def _replace(self) -> None:
        """Hire, again and again if need be: a machine without memory may have some later."""
        try:
            while not self._closed:
                with suppress(GpsfsmError, OSError):
                    await self._hire()
                    return
                await asyncio.sleep(_PAUSE_S)
        finally:
            self._hiring -= 1

    async def _watch(self, process: AsyncChildProcess) -> None:
        """Replace a worker that ends while it has nothing to do; else whoever waits for it does."""
        await process.ended()
        for worker in [each for each in self._idle if each.process is process]:
            self._idle.remove(worker)
            self._dismiss(process)

    async def _begun(self) -> AsyncChildProcess:
        """A process. If nobody wants it any more when it has begun, it is ended."""
        line = partial(logs.from_child, "worker") if logs.is_json() else None
        starting = asyncio.ensure_future(AsyncChildProcess.start(child_command(_TARGET), line=line))
        try:
            return await asyncio.shield(starting)
        except asyncio.CancelledError:
            await (await starting).end()
            raise

    async def _hire(self) -> None:
        settings = self._settings
        process = await self._begun()
        head = {
            "memory_mb": settings.memory_mb,
            "nice": self._nice,
            "capabilities": list(settings.capabilities),
            "builtin": settings.builtin_capabilities,
            "robot": settings.robot,
            "allow": [list(each) for each in settings.allow],
            "limits": asdict(settings.limits),
        }
        try:
            async with asyncio.timeout(_START_S):
                await process.send(head)
                answer, _ = await process.receive()
            if "failed" in answer:
                raise GpsfsmError(answer["failed"])
        except (GoneError, TimeoutError) as error:
            await process.end()
            why = str(error) or "did not start in time"
            raise GpsfsmError(f"a worker {why}") from None
        except BaseException:
            await process.end()
            raise
        self._all.add(process)
        self._able.add(process)
        self._idle.append(Worker(process, 0, 0))
        self._later(self._watch(process), self._tasks)
        self._ready()

    async def close(self) -> None:
        """End all workers."""
        self._closed = True
        for task in list(self._tasks):
            task.cancel()
        with suppress(asyncio.CancelledError):
            await asyncio.gather(*list(self._tasks), return_exceptions=True)
        await asyncio.gather(*(process.end() for process in list(self._all)), *self._endings)
        self._all.clear()
        self._able.clear()


class Answered(NamedTuple):
    """The answer of a worker."""

    status: int
    media: str
    body: bytes


class _OverrunError(Exception):
    """A small request was none."""


@dataclass(eq=False, slots=True)
class _Work:
    """A request that a worker has in hand."""

    kind: Kind
    ticket: Ticket
    staff: Staff
    worker: Worker
    overrun: bool = False
    cpu_s: float | None = None  # what its worker had used before
    began_s: float = field(default_factory=time.monotonic)


class Pool:
    """The workers, and who waits for them. Not thread-safe: it lives on one event loop.

    Of each class at most ``settings.waiting`` requests wait; a further one is told to come again.
    """

    def __init__(self, settings: Settings, traces: Traces | None = None) -> None:
        self._settings = settings
        self._traces = traces or Traces()
        ready = self._dispatch
        self.gates = Staff(settings, settings.reserved, spares=1, nice=0, ready=ready)
        self.checks = Staff(settings, settings.workers, spares=0, nice=_NICE, ready=ready)
        late_s = max(1, round(settings.request_s / 2))
        self._lines = {
            kind: Line(settings.waiting, late_s if kind is Kind.LARGE else 1) for kind in Kind
        }
        self._most_large = max(1, settings.workers - 1)
        self._small_first = False  # a large request was the last that began
        self._tickets = 0
        self._strikes: OrderedDict[str, tuple[int, float]] = OrderedDict()
        self._in_hand: dict[int, _Work] = {}  # by the numbers of tickets
        self.outcomes: Counter[tuple[str, str]] = Counter()

    @property
    def alive(self) -> int:
        """The number of workers for anything but small gate requests."""
        return self.checks.alive

    @property
    def well(self) -> bool:
        """True if there is a worker for every kind of request."""
        return self.gates.alive > 0 and self.checks.alive > 0

    @property
    def busy(self) -> int:
        """The number of workers that have a request in hand."""
        return self.gates.busy + self.checks.busy

    @property
    def restarts(self) -> int:
        """The number of workers that were replaced."""
        return self.gates.restarts + self.checks.restarts

    @property
    def clients(self) -> int:
        """The number of clients that wait, or have a request in hand."""
        waiting = frozenset[str]().union(*(line.clients for line in self._lines.values()))
        return len(waiting.union(work.ticket.client for work in self._in_hand.values()))

    def waiting(self, kind: Kind) -> int:
        """The number of requests of a class that wait."""
        return len(self._lines[kind])

    def running(self, kind: Kind) -> int:
        """The number of requests of a class that workers have in hand."""
        return sum(work.kind is kind for work in self._in_hand.values())

    async def start(self) -> None:
        """Start all workers. Raises GpsfsmError if they cannot work with these settings."""
        await all_of(self.gates.start(), self.checks.start())

    async def close(self) -> None:
        """End all workers."""
        await asyncio.gather(self.gates.close(), self.checks.close())

    def expect(self, length: int, client: str) -> None:
        """Raises Problem 429 if a body of so many bytes would come for nothing."""
        if length > SMALL_BYTES and not self._lines[Kind.LARGE].has_room(client):
            self.outcomes[Kind.LARGE, "refused"] += 1
            close = {"connection": "close"}  # a body follows that nobody reads
            message = (
                "large requests of this client are already waiting; try again later. --waiting of "
                "the service sets how many may wait"
            )
            raise Problem(429, message, retry_s=1, headers=close)

    async def do(self, op: str, body: bytes, *, raw: bool = False, client: str = "") -> Answered:
        """Let a worker answer. Raises Problem 429, 503 or 504 if none does in time."""
        cost_ms, head = expected_ms(op, body, raw=raw), {"op": op, "raw": raw}
        kind = kind_of(op, cost_ms, strictness=_STRICTER ** self._strikes_of(client))
        cost_s = min(cost_ms / 1_000, self._settings.request_s)
        while kind is not Kind.LARGE:
            try:
                return await self._done(kind, client, cost_s, head, body)
            except _OverrunError:
                self._strike(client)
                cost_s = max(cost_s, self._settings.small_s * _TIMES[kind])
                kind = _NEXT[kind]
        return await self._done(kind, client, cost_s, head, body)

    async def _done(
        self, kind: Kind, client: str, cost_s: float, head: dict[str, Any], body: bytes
    ) -> Answered:
        try:
            with self._traces.span("wait for a worker"):
                number = await self._turn(kind, client, cost_s)
            answered = await self._answer(number, head, body)
        except Problem as problem:
            self.outcomes[kind, _OUTCOMES.get(problem.status, "failed")] += 1
            raise
        except _OverrunError:
            self.outcomes[kind, "overrun"] += 1
            raise
        self.outcomes[kind, "answered"] += 1
        return answered

    async def _turn(self, kind: Kind, client: str, cost_s: float) -> int:
        """The number of a request for which a worker is there. Raises Problem 429 or 503.

        Waiting does not count as work: else a service that is busy would end workers for it.
        """
        line = self._lines[kind]
        self._tickets += 1
        ticket = line.join(client, self._tickets, cost_s)
        self._dispatch()
        patience_s = self._settings.request_s * _WAITS
        try:
            async with asyncio.timeout(patience_s):
                await ticket.granted
        except TimeoutError:
            self._give_up(line, ticket)
            raise Problem(503, "no worker was free in time; try again", retry_s=2) from None
        except BaseException:
            self._give_up(line, ticket)
            raise
        return ticket.number

    def _give_up(self, line: Line, ticket: Ticket) -> None:
        if not line.leave(ticket) and ticket.number in self._in_hand:  # its turn came too late
            work = self._in_hand[ticket.number]
            self._over(ticket.number, work.worker)

    async def _answer(self, number: int, head: dict[str, Any], body: bytes) -> Answered:
        """The answer of its worker. Raises Problem, and _OverrunError for what is not small."""
        work, limit_s = self._in_hand[number], self._settings.request_s
        loop, process, kept = asyncio.get_running_loop(), work.worker.process, None
        timers: list[asyncio.TimerHandle] = []
        if parent := self._traces.header():
            head = {**head, "traceparent": parent}
        try:
            async with asyncio.timeout(limit_s) as limit:
                small_s = self._settings.small_s * _TIMES.get(work.kind, math.inf)
                if small_s < limit_s:
                    work.cpu_s = process.cpu_s()
                    timers.append(loop.call_later(small_s, self._grow, work, limit, timers))
                if work.staff is self.checks:
                    timers.append(loop.call_later(limit_s * _SOON, self.checks.keep_spare))
                await process.send(head, body)
                reply, answer = await process.receive()
            kept = Worker(process, work.worker.jobs + 1, reply["memory_mb"])
        except TimeoutError:
            if work.overrun:
                raise _OverrunError from None
            text = f"the plan is undecided after {limit_s:g} s"
            raise Problem(504, f"{text}; --time-limit of the service sets this limit") from None
        except GoneError as gone:
            message = f"the process that worked on it {gone}; its memory may have run out"
            raise Problem(503, message, retry_s=5) from None
        finally:
            for timer in timers:
                timer.cancel()
            self._over(number, kept)  # None also if nobody waits: its answer must meet nobody else
        self._traces.add(reply.get("spans", ()), parent)
        return Answered(reply["status"], reply["media"], answer)

    def _over(self, number: int, kept: Worker | None) -> None:
        """A request is done with; so is its worker, unless it is kept."""
        work = self._in_hand.pop(number)
        assert kept is None or kept.process is work.worker.process, "another worker comes back"
        seconds = time.monotonic() - work.began_s
        self._lines[work.kind].charge(work.ticket.client, seconds - work.ticket.cost_s)
        if kept is None:
            work.staff.end(work.worker)
        else:
            work.staff.give_back(kept)
        self._dispatch()

    def _grow(self, work: _Work, limit: asyncio.Timeout, timers: list[asyncio.TimerHandle]) -> None:
        """A small request takes long: it goes on as a large one, or comes back as such.

        Not if the machine is busy, and its worker has not had the time of a core that it may have.
        """
        if limit.expired():  # in this very moment: it is over
            return
        loop, may_s = asyncio.get_running_loop(), self._settings.small_s * _TIMES[work.kind]
        now_s = work.worker.process.cpu_s()
        if now_s is not None and work.cpu_s is not None:
            left_s = may_s - (now_s - work.cpu_s)
            if left_s > _LEAST_S:
                timers.append(loop.call_later(left_s, self._grow, work, limit, timers))
                return
        if work.kind is Kind.SMALL and self.running(Kind.LARGE) < self._most_large:
            work.kind = Kind.LARGE
            self._small_first = True
        else:
            work.overrun = True
            limit.reschedule(loop.time())

    def _strikes_of(self, client: str) -> int:
        """The number of requests of this client that were lately not as small as they looked."""
        strikes, last_s = self._strikes.get(client, (0, 0.0))
        if strikes and time.monotonic() - last_s > _STRIKE_S:
            del self._strikes[client]
            strikes = 0
        return strikes

    def _strike(self, client: str) -> None:
        """A request of this client was not as small as it looked: look closer for a while."""
        strikes, _ = self._strikes.pop(client, (0, 0.0))
        self._strikes[client] = (min(strikes + 1, _MOST_STRIKES), time.monotonic())
        if len(self._strikes) > _MOST_STRIKERS:
            self._strikes.popitem(last=False)

    def _dispatch(self) -> None:
        """Give workers that are free to those whose turn it is."""
        for staff in (self.gates, self.checks):
            while (kind := self._next(staff)) is not None and (worker := staff.take()) is not None:
                line = self._lines[kind]
                ticket = line.head()
                assert ticket is not None
                assert ticket.number not in self._in_hand, "a request has two workers"
                self._in_hand[ticket.number] = _Work(kind, ticket, staff, worker)
                if staff is self.checks:
                    self._small_first = kind is Kind.LARGE
                line.call(ticket)

    def _next(self, staff: Staff) -> Kind | None:
        """The class of the next request for these workers.

        Of two the one that came first, but after a large one it is the turn of a small one.
        """
        if staff is self.gates:
            return Kind.GATE if self._lines[Kind.GATE].head() else None
        heads = {kind: self._lines[kind].head() for kind in (Kind.SMALL, Kind.LARGE)}
        if self.running(Kind.LARGE) >= self._most_large:
            del heads[Kind.LARGE]
        waiting = {kind: ticket.number for kind, ticket in heads.items() if ticket is not None}
        if self._small_first and Kind.SMALL in waiting:
            return Kind.SMALL
        return min(waiting, key=waiting.__getitem__, default=None)
