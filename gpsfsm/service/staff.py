"""The processes that work on requests of one kind. One that has ended is replaced."""

from __future__ import annotations

import asyncio
import sys
from contextlib import suppress
from dataclasses import asdict
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.errors import GpsfsmError
from gpsfsm.workers.frames import Gone
from gpsfsm.workers.process import Process

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

    from gpsfsm.service.settings import Settings

__all__ = ["Staff", "Worker"]

_COMMAND = (sys.executable, "-P", "-m", "gpsfsm.service.worker")
"""-P: no module comes from the current folder."""
_START_S = 60.0
_MOST_JOBS = 20_000
"""After so many requests a worker is replaced."""
_PAUSE_S = 1.0


class Worker(NamedTuple):
    """A process that can work, with what it has done so far."""

    process: Process
    jobs: int
    memory_mb: int


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
        self._all: set[Process] = set()
        self._able: set[Process] = set()  # those that have begun to work
        self._hiring = 0
        self._tasks: set[asyncio.Task[None]] = set()
        self._endings: set[asyncio.Task[None]] = set()
        self._closed = False
        self.busy = self.restarts = 0

    @property
    def alive(self) -> int:
        """How many workers can work at once."""
        return min(len(self._able), self.most)

    async def start(self) -> None:
        """Start all workers. Raises GpsfsmError if they cannot work with these settings."""
        await asyncio.gather(*(self._hire() for _ in range(self.most)))
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
        self.busy -= 1
        worn = worker.jobs >= _MOST_JOBS or worker.memory_mb > self._settings.memory_mb * 3 // 4
        if worn or self._closed:
            self._dismiss(worker.process)
        else:
            self._idle.append(worker)

    def end(self, worker: Worker) -> None:
        """It has to be ended, whatever it does."""
        self.busy -= 1
        self._dismiss(worker.process)

    def _dismiss(self, process: Process) -> None:
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

    async def _watch(self, process: Process) -> None:
        """Replace a worker that ends while it has nothing to do; else whoever waits for it does."""
        await process.ended()
        for worker in [each for each in self._idle if each.process is process]:
            self._idle.remove(worker)
            self._dismiss(process)

    async def _begun(self) -> Process:
        """A process. If nobody wants it any more when it has begun, it is ended."""
        starting = asyncio.ensure_future(Process.start((*_COMMAND, str(self._nice))))
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
            "capabilities": list(settings.capabilities),
            "builtin": settings.builtin_capabilities,
            "limits": asdict(settings.limits),
        }
        try:
            async with asyncio.timeout(_START_S):
                await process.tell(head)
                answer, _ = await process.hear()
            if "failed" in answer:
                raise GpsfsmError(answer["failed"])
        except (Gone, TimeoutError) as error:
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
