"""The pool of workers. A request that takes too long costs its worker the life, nobody else."""

from __future__ import annotations

import asyncio
import sys
from contextlib import suppress
from dataclasses import asdict
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.errors import GpsfsmError
from gpsfsm.service.problems import Problem
from gpsfsm.workers.frames import Gone
from gpsfsm.workers.process import Process

if TYPE_CHECKING:
    from gpsfsm.service.settings import Settings

__all__ = ["Answered", "Pool"]

_COMMAND = (sys.executable, "-P", "-m", "gpsfsm.service.worker")
"""-P: no module comes from the current folder."""
_START_S = 60.0
_MOST_JOBS = 20_000
"""After so many requests a worker is replaced."""
_PAUSE_S = 1.0


class Answered(NamedTuple):
    """What a worker has answered."""

    status: int
    media: str
    body: bytes


class _Worker(NamedTuple):
    process: Process
    jobs: int
    memory_mb: int


class Pool:
    """Worker processes. Not thread-safe: it lives on one event loop.

    At most ``settings.waiting`` requests wait; a further one is told to come again.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._idle: asyncio.LifoQueue[_Worker] = asyncio.LifoQueue()
        self._all: set[Process] = set()
        self._able: set[Process] = set()  # those that have begun to work
        self._hiring: set[asyncio.Task[None]] = set()
        self._closed = False
        self.waiting = self.busy = self.restarts = 0

    @property
    def alive(self) -> int:
        """How many workers there are that can work."""
        return len(self._able)

    async def start(self) -> None:
        """Start all workers. Raises GpsfsmError if they cannot work with these settings."""
        await asyncio.gather(*(self._hire() for _ in range(self._settings.workers)))

    async def do(self, op: str, body: bytes, *, raw: bool = False) -> Answered:
        """Let a worker answer. Raises Problem 429, 503 or 504 if none does in time."""
        if self.waiting >= self._settings.waiting:
            raise Problem(429, f"{self.waiting} requests wait already; try again", retry_s=1)
        worker = await self._free()
        self.busy += 1
        try:
            async with asyncio.timeout(self._settings.request_s):
                await worker.process.tell({"op": op, "raw": raw}, body)
                head, answer = await worker.process.hear()
        except TimeoutError:
            self._dismiss(worker.process)
            message = f"it was not decided within {self._settings.request_s:g} s"
            raise Problem(504, message) from None
        except Gone as gone:
            self._dismiss(worker.process)
            message = f"the process that worked on it {gone}; its memory may have run out"
            raise Problem(503, message, retry_s=5) from None
        except BaseException:  # nobody waits any more; its answer must not meet the next request
            self._dismiss(worker.process)
            raise
        finally:
            self.busy -= 1
        self._done(_Worker(worker.process, worker.jobs + 1, head["memory_mb"]))
        return Answered(head["status"], head["media"], answer)

    async def _free(self) -> _Worker:
        """The next worker that is free. Raises Problem 503 if there is none in time.

        Waiting does not count as work: else a service that is busy would end workers for it.
        """
        while not self._idle.empty():
            worker = self._idle.get_nowait()
            if worker.process.alive:
                return worker
            self._dismiss(worker.process)  # it has ended while it had nothing to do
        self.waiting += 1
        try:
            async with asyncio.timeout(self._settings.request_s):
                return await self._idle.get()
        except TimeoutError:
            raise Problem(503, "no worker was free in time; try again", retry_s=2) from None
        finally:
            self.waiting -= 1

    def _done(self, worker: _Worker) -> None:
        worn = worker.jobs >= _MOST_JOBS or worker.memory_mb > self._settings.memory_mb * 3 // 4
        if worn or self._closed:
            self._dismiss(worker.process)
        else:
            self._idle.put_nowait(worker)

    def _dismiss(self, process: Process) -> None:
        """End a worker, and hire another one in its place."""
        self._all.discard(process)
        self._able.discard(process)
        self._later(process.end())
        if not self._closed:
            self.restarts += 1
            self._later(self._replace())

    def _later(self, work: object) -> None:
        task = asyncio.ensure_future(work)  # type: ignore[call-overload]
        self._hiring.add(task)
        task.add_done_callback(self._hiring.discard)

    async def _replace(self) -> None:
        """Hire, again and again if need be: a machine without memory may have some later."""
        while not self._closed:
            with suppress(GpsfsmError, OSError):
                await self._hire()
                return
            await asyncio.sleep(_PAUSE_S)

    async def _hire(self) -> None:
        settings = self._settings
        process = await Process.start(_COMMAND)
        self._all.add(process)
        head = {
            "memory_mb": settings.memory_mb,
            "capabilities": list(settings.capabilities),
            "builtin": settings.builtin_capabilities,
            "limits": asdict(settings.limits),
        }
        try:
            async with asyncio.timeout(_START_S):
                await process.tell(head)
                found, _ = await process.hear()
        except (Gone, TimeoutError) as error:
            self._all.discard(process)
            await process.end()
            why = str(error) or "did not start in time"
            raise GpsfsmError(f"a worker {why}") from None
        if "failed" in found:
            self._all.discard(process)
            await process.end()
            raise GpsfsmError(found["failed"])
        self._able.add(process)
        self._idle.put_nowait(_Worker(process, 0, 0))

    async def close(self) -> None:
        """End all workers."""
        self._closed = True
        for task in list(self._hiring):
            task.cancel()
        with suppress(asyncio.CancelledError):
            await asyncio.gather(*list(self._hiring), return_exceptions=True)
        await asyncio.gather(*(process.end() for process in list(self._all)))
        self._all.clear()
        self._able.clear()
