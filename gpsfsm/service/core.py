"""What all requests of the service share: workers, the plan queue, counters."""

from __future__ import annotations

import asyncio
from contextlib import contextmanager
from typing import TYPE_CHECKING

from gpsfsm.service.bodies import Budget
from gpsfsm.service.metrics import Metrics
from gpsfsm.service.pool import Pool
from gpsfsm.service.problems import Problem

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.service.plan_queue import PlanQueueClient
    from gpsfsm.service.settings import Settings

__all__ = ["Core"]


class Core:
    """The service without its HTTP. ``closing`` is set when it is about to stop."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.metrics = Metrics()
        self.pool = Pool(settings)
        self.budget = Budget(settings.max_bodies)
        self.closing = asyncio.Event()
        self.streams = 0
        self.generating = 0
        self._queue: PlanQueueClient | None = None

    @property
    def has_queue(self) -> bool:
        """Whether plans can be queued."""
        return self._queue is not None

    @property
    def queue(self) -> PlanQueueClient:
        """The plan queue. Raises Problem 501 if there is none."""
        if self._queue is None:
            raise Problem(501, "there is no plan queue: start the service with --journal FILE")
        return self._queue

    async def start(self) -> None:
        """Start workers and the queue. Raises GpsfsmError if that is not possible."""
        settings = self.settings
        try:
            if settings.journal and settings.executor:
                from gpsfsm.service.plan_queue import PlanQueueClient  # noqa: PLC0415

                self._queue = PlanQueueClient(settings)
                async with asyncio.TaskGroup() as group:
                    group.create_task(self._queue.start())
                    group.create_task(self.pool.start())
            else:
                await self.pool.start()
        except ExceptionGroup as errors:
            await self.close()
            raise errors.exceptions[0] from None
        except BaseException:
            await self.close()
            raise

    @contextmanager
    def stream(self) -> Iterator[None]:
        """Count a client that follows a run or waits for its end. Raises Problem 429."""
        self.room_for_stream()
        self.streams += 1
        try:
            yield
        finally:
            self.streams -= 1

    def room_for_stream(self) -> None:
        """Raises Problem 429 if as many clients as may follow runs already."""
        if self.streams >= self.settings.streams:
            raise Problem(429, "too many clients follow runs; try again", retry_s=10)

    async def wait_for_news(self, since: int, within_s: float) -> None:
        """Wait until the queue has moved on, the service stops, or so long."""
        news = asyncio.ensure_future(self.queue.news(since, within_s))
        closing = asyncio.ensure_future(self.closing.wait())
        try:
            await asyncio.wait({news, closing}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            news.cancel()
            closing.cancel()

    def begin_closing(self) -> None:
        """Nothing new begins any more, and what would go on for ever ends."""
        self.closing.set()

    async def close(self) -> None:
        """End all processes; what the queue has accepted is in its journal."""
        self.closing.set()
        await self.pool.close()
        if self._queue is not None:
            await self._queue.close()

    def gauges(self) -> dict[str, tuple[str, float]]:
        """What can be measured now."""
        pool = self.pool
        found: dict[str, tuple[str, float]] = {
            "workers": ("Worker processes.", pool.alive),
            "workers_busy": ("Workers that have a request in hand.", pool.busy),
            "requests_waiting": ("Requests that wait for a worker.", pool.waiting),
            "worker_restarts_total": ("Workers that were replaced.", pool.restarts),
            "body_bytes": ("Bytes of bodies in memory.", self.budget.used),
            "streams": ("Clients that follow a run.", self.streams),
        }
        if self._queue is not None:
            queue = self._queue
            found["queue_up"] = ("Whether the plan queue answers.", float(queue.up))
            found["queue_restarts_total"] = ("Restarts of the plan queue.", queue.restarts)
        return found
