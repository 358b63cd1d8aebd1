"""The core of the service, which all requests share: workers, the plan queue, counters.

Counters are written in the text format of Prometheus (``Metrics``).
"""

from __future__ import annotations

import asyncio
import os
from bisect import bisect_left
from collections import Counter
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias, TypeVar

from gpsfsm import logs
from gpsfsm.service.clients import Share, client_of
from gpsfsm.service.costs import SMALL_BYTES, Kind
from gpsfsm.service.pool import Pool, all_of
from gpsfsm.service.shapes import Problem, announced, whole_body
from gpsfsm.service.traces import Traces
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Iterable, Iterator

    from starlette.requests import Request

    from gpsfsm.service.plan_queue import PlanQueueClient
    from gpsfsm.service.settings import Settings
    from gpsfsm.service.stopper import Stopper

STOP_S, HALT_S = 3.0, 3.0
"""What the stopper and the plan queue may take to answer to a stop."""

STOPPED = "the service was stopped"

Unready: TypeAlias = Literal[
    "draining",
    "gate_workers_down",
    "journal_not_writable",
    "queue_down",
    "stopper_down",
    "workers_down",
]
"""A reason for which no requests should be sent to the service."""

_LEAST_FREE = 1 << 20
"""Bytes that have to be free where the journal is."""
_DISK_S, _LOOK_S = 1.0, 1.0
"""What a look at the disk may take, and how long it holds: anybody may have it looked at."""

_Made = TypeVar("_Made")


NOT_CONFIRMED = "it is not confirmed that everything has stopped"


class Halted(NamedTuple):
    """The effect of a stop: ``goals`` is None where no stopper is needed."""

    held: str
    plan: str | None
    goals: int | None
    problems: list[str]


async def _nothing() -> None:
    """No stopper is needed."""


class Core:
    """The service without its HTTP. ``closing`` is set when it is about to stop.

    ``draining`` is set before: it still does all it can, but is not ready for more.
    """

    def __init__(self, settings: Settings, traces: Traces | None = None) -> None:
        self.settings = settings
        self.metrics = Metrics()
        self.traces = traces or Traces()
        self.pool = Pool(settings, self.traces)
        self.budget = Share(settings.bodies)
        self.closing = asyncio.Event()
        self.draining = asyncio.Event()
        self._writable = True
        self._looked_s = float("-inf")
        self._looking: asyncio.Future[bool] | None = None
        self.streams = Share(settings.streams)
        self.generating = Share(settings.generating)
        self._reading = asyncio.Semaphore(1)
        self._queue: PlanQueueClient | None = None
        self.stopper: Stopper | None = None
        self._stopping: set[asyncio.Task[None]] = set()
        self._ending: asyncio.Task[None] | None = None

    @property
    def has_queue(self) -> bool:
        """True if plans can be queued."""
        return self._queue is not None

    @property
    def queue(self) -> PlanQueueClient:
        """The plan queue. Raises Problem 501 if there is none."""
        if self._queue is None:
            raise Problem(501, "there is no plan queue: start the service with --journal FILE")
        return self._queue

    @property
    def failure(self) -> str:
        """The reason why the plan queue cannot go on; empty if it can, or there is none."""
        return self._queue.failure if self._queue is not None else ""

    async def start(self) -> None:
        """Start workers and the queue. Raises GpsfsmError if that is not possible."""
        settings = self.settings
        try:
            if settings.journal and settings.executor:
                from gpsfsm.service.plan_queue import PlanQueueClient

                if settings.stopper:  # nothing moves before it can be stopped
                    from gpsfsm.service.stopper import Stopper

                    self.stopper = Stopper(settings.stopper, self._requested_stop)
                    await self.stopper.start()
                self._queue = PlanQueueClient(settings, self._stop_robot, self.traces)
                await all_of(self._queue.start(), self.pool.start())
                if settings.real:
                    self._ending = asyncio.create_task(self._halt_at_end())
            else:
                await self.pool.start()
        except BaseException:
            await self.close()
            raise

    @asynccontextmanager
    async def body(self, request: Request) -> AsyncIterator[bytes]:
        """The body of a request. Raises Problem, before it is read if nobody could look at it."""
        if self.closing.is_set():
            raise Problem(503, "the service is about to stop", retry_s=5)
        settings, client = self.settings, client_of(request.scope)
        self.pool.expect(announced(request, settings.max_body), client)
        async with whole_body(
            request,
            most=settings.max_body,
            within_s=settings.body_s,
            budget=self.budget,
            client=client,
        ) as body:
            yield body

    async def made_of(self, body: bytes, make: Callable[[bytes], _Made]) -> _Made:
        """The result of work on a body; a long one holds up nobody else but long ones."""
        if len(body) <= SMALL_BYTES:
            return make(body)
        async with self._reading:
            return await asyncio.to_thread(make, body)

    @contextmanager
    def stream(self, client: str) -> Iterator[None]:
        """Count a client that follows a run or waits for its end. Raises Problem 429."""
        if not self.streams.take(client):
            raise Problem(
                429,
                "too many clients follow runs; try again later, or close other streams",
                retry_s=10,
            )
        try:
            yield
        finally:
            self.streams.give_back(client)

    def room_for_stream(self, client: str) -> None:
        """Raises Problem 429 if as many clients as may follow runs already."""
        with self.stream(client):
            pass

    async def wait_for_news(self, since: int, within_s: float) -> None:
        """Wait until the queue has moved on, the service stops, or so long."""
        news = asyncio.ensure_future(self.queue.news(since, within_s))
        closing = asyncio.ensure_future(self.closing.wait())
        try:
            await asyncio.wait({news, closing}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            news.cancel()
            closing.cancel()

    def begin_draining(self) -> None:
        """It is going to stop: whoever asks whether it is ready is told that it is not."""
        self.draining.set()

    def begin_closing(self) -> None:
        """Nothing new begins any more, and what would go on for ever ends."""
        self.draining.set()
        self.closing.set()

    async def unready(self) -> list[Unready]:
        """The reasons for which no requests should be sent here; none if it is ready."""
        queue = self._queue
        holds: tuple[tuple[Unready, bool], ...] = (
            ("draining", self.draining.is_set()),
            ("workers_down", not self.pool.alive),
            ("gate_workers_down", not self.pool.gates.alive),
            ("queue_down", queue is not None and not queue.up),
            ("journal_not_writable", queue is not None and not await self._journal_writable()),
            ("stopper_down", self.stopper is not None and not self.stopper.up),
        )
        return [reason for reason, is_so in holds if is_so]

    async def _journal_writable(self) -> bool:
        """True if there is room where the journal is, and it may be written; a short look."""
        now_s = asyncio.get_running_loop().time()
        if now_s - self._looked_s > _LOOK_S:
            self._looked_s = now_s
            # A disk of a network that is gone holds up a look for ever: one thread, and no more.
            if self._looking is None or self._looking.done():
                looking = asyncio.to_thread(_writable, self.settings.journal)
                self._looking = asyncio.ensure_future(looking)
            await asyncio.wait({self._looking}, timeout=_DISK_S)
            self._writable = self._looking.done() and self._looking.result()
        return self._writable

    async def close(self) -> None:
        """End all processes; what the queue has accepted is in its journal."""
        self.begin_closing()
        await self.pool.close()
        if self._ending is not None:
            await asyncio.wait({self._ending})
        if self._queue is not None:
            await self._queue.close()
        if self._stopping:
            await asyncio.wait(self._stopping)
        if self.stopper is not None:
            await self.stopper.close()

    async def _halt_at_end(self) -> None:
        """Let a robot stop as soon as the service is to end: requests under way may take longer."""
        await self.draining.wait()
        assert self._queue is not None
        await self._queue.halt(STOPPED, HALT_S, renew=False)

    async def stop_robot(self, reason: str) -> Halted:
        """Stop all that moves, by the stopper and by the plan queue, independently."""
        stopping = _nothing() if self.stopper is None else self.stopper.stop(STOP_S)
        stopped, halted = await asyncio.gather(stopping, self.queue.halt(reason, HALT_S))
        problems = [] if stopped is None else [*stopped.problems]
        if halted["problem"]:
            problems.append(halted["problem"])
        problems += halted.get("open", ())
        plan = halted.get("cancelled")
        return Halted(
            held=halted.get("held") or reason,
            plan=str(plan) if plan else None,
            goals=None if stopped is None else stopped.cancelled,
            problems=problems,
        )

    async def _requested_stop(self) -> tuple[bool, str]:
        """Stop it for who has called the service of ROS 2: if that is confirmed, and words."""
        if self._queue is None:
            return False, "the plan queue is not running"
        halted = await self.stop_robot("stopped by a call of gpsfsm/stop")
        if halted.problems:
            return False, f"{NOT_CONFIRMED}: {'; '.join(halted.problems)}"
        return True, f"everything has stopped; goals cancelled: {halted.goals}"

    def _stop_robot(self) -> None:
        """The process of the queue has ended: what it did may go on outside."""
        if self.stopper is not None:
            task = asyncio.create_task(self._stopped())
            self._stopping.add(task)
            task.add_done_callback(self._stopping.discard)

    async def _stopped(self) -> None:
        assert self.stopper is not None
        for problem in (await self.stopper.stop(STOP_S)).problems:
            text = f"what the plan queue has left is not stopped for sure: {problem}"
            logs.event("error", "not_stopped", text, problem=problem)

    def gauges(self) -> Iterator[Gauge]:
        """The values that can be measured now."""
        pool = self.pool
        waiting = {kind: pool.waiting(kind) for kind in Kind}
        yield Gauge("workers", "Workers that check plans.", pool.alive)
        yield Gauge("gate_workers", "Workers for small gate requests.", pool.gates.alive)
        yield Gauge("workers_busy", "Workers that are handling a request.", pool.busy)
        yield Gauge("requests_waiting", "Requests that wait for a worker.", sum(waiting.values()))
        yield Gauge("worker_restarts_total", "Workers that were replaced.", pool.restarts)
        yield Gauge("clients", "Clients that wait for a worker or have one.", pool.clients)
        for kind in Kind:
            of = f'class="{kind}"'
            yield Gauge("class_waiting", "Requests that wait, by cost class.", waiting[kind], of)
        for kind in Kind:
            of, running = f'class="{kind}"', pool.running(kind)
            yield Gauge(
                "class_running", "Requests that workers are handling, by cost class.", running, of
            )
        for (of_kind, outcome), count in sorted(pool.outcomes.items()):
            of = f'class="{of_kind}",outcome="{outcome}"'
            yield Gauge("class_requests_total", "Requests by cost class and outcome.", count, of)
        yield Gauge("body_bytes", "Bytes of bodies in memory.", self.budget.used)
        yield Gauge("streams", "Clients that follow a run.", self.streams.used)
        if self._queue is not None:
            queue = self._queue
            yield Gauge("queue_up", "Whether the plan queue answers.", float(queue.up))
            yield Gauge("queue_restarts_total", "Restarts of the plan queue.", queue.restarts)


def _writable(journal: str) -> bool:
    """True if a journal can be written: the file, its folder, and room on the disk."""
    folder = Path(journal).absolute().parent
    try:
        room = os.statvfs(folder)
    except OSError:
        return False
    free = room.f_bavail * room.f_frsize
    return free >= _LEAST_FREE and os.access(journal, os.W_OK) and os.access(folder, os.W_OK)


MEDIA = "text/plain; version=0.0.4; charset=utf-8"

_BOUNDS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)


class Gauge(NamedTuple):
    """A value that is measured when somebody looks; ``labels`` as the format has them."""

    name: str
    help: str
    value: float
    labels: str = ""


class Metrics:
    """Counts requests. Labels are names of endpoints and statuses, never what a client sends."""

    def __init__(self) -> None:
        self._requests: Counter[tuple[str, int]] = Counter()
        self._verdicts: Counter[tuple[str, str]] = Counter()
        self._buckets: dict[str, list[int]] = {}
        self._seconds: dict[str, float] = {}

    def answered(self, endpoint: str, status: int, seconds: float) -> None:
        """Count an answer."""
        self._requests[endpoint, status] += 1
        buckets = self._buckets.setdefault(endpoint, [0] * (len(_BOUNDS_S) + 1))
        buckets[bisect_left(_BOUNDS_S, seconds)] += 1
        self._seconds[endpoint] = self._seconds.get(endpoint, 0.0) + seconds

    def decided(self, verdict: str, reason: str) -> None:
        """Count a verdict of the gate."""
        self._verdicts[verdict, reason] += 1

    def text(self, gauges: Iterable[Gauge]) -> str:
        """All of it; of ``gauges`` those of one name follow one another."""
        return "".join(f"{line}\n" for line in self._lines(gauges))

    def _lines(self, gauges: Iterable[Gauge]) -> Iterator[str]:
        yield from _head("gpsfsm_info", "gauge", "The version of gpsfsm.")
        yield f'gpsfsm_info{{version="{VERSION}"}} 1'
        yield from _head("gpsfsm_requests_total", "counter", "Requests by endpoint and status.")
        for (name, status), count in sorted(self._requests.items()):
            yield f'gpsfsm_requests_total{{endpoint="{name}",status="{status}"}} {count}'
        name = "gpsfsm_gate_verdicts_total"
        yield from _head(name, "counter", "Verdicts of the gate, by reason.")
        for (verdict, reason), count in sorted(self._verdicts.items()):
            yield f'{name}{{verdict="{verdict}",reason="{reason}"}} {count}'
        name = "gpsfsm_request_seconds"
        yield from _head(name, "histogram", "How long requests take.")
        for endpoint, buckets in sorted(self._buckets.items()):
            yield from self._histogram(name, endpoint, buckets)
        last = ""
        for gauge in sorted(gauges, key=lambda each: each.name):
            name = f"gpsfsm_{gauge.name}"
            if name != last:
                kind = "counter" if name.endswith("_total") else "gauge"
                yield from _head(name, kind, gauge.help)
            labels = f"{{{gauge.labels}}}" if gauge.labels else ""
            yield f"{name}{labels} {gauge.value:.15g}"
            last = name

    def _histogram(self, name: str, endpoint: str, buckets: list[int]) -> Iterator[str]:
        total = 0
        for bound, count in zip((*_BOUNDS_S, None), buckets, strict=True):
            total += count
            le = "+Inf" if bound is None else f"{bound:g}"
            yield f'{name}_bucket{{endpoint="{endpoint}",le="{le}"}} {total}'
        yield f'{name}_sum{{endpoint="{endpoint}"}} {self._seconds[endpoint]:.6f}'
        yield f'{name}_count{{endpoint="{endpoint}"}} {total}'


def _head(name: str, kind: str, text: str) -> Iterator[str]:
    yield f"# HELP {name} {text}"
    yield f"# TYPE {name} {kind}"
