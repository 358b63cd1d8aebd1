"""Several processes on this machine: ``--jobs N``.

Chunks of one item: a pipe costs next to nothing, no worker waits for another one at the end, and
when a worker is ended it is known at once which item did it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.workers.base import Kind
from gpsfsm.workers.crew import Worker, available_cores
from gpsfsm.workers.known.serial import Serial

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from multiprocessing.connection import Connection

    from gpsfsm.workers.base import Chunk, Engine, Item, Lost, Result, Source, Work

__all__ = ["KIND", "MOST", "Processes"]

MOST = 256
"""More processes than this are a mistake."""


class Processes:
    """An engine of ``size`` worker processes, which begin when they are needed.

    ``timeout_s``: what an item may take; the worker is ended then, and the item lost.
    """

    chunk_size = 1

    def __init__(self, size: int, *, timeout_s: float | None = None) -> None:
        self.ahead = size
        self._timeout_s = timeout_s
        self._idle: list[Worker[Any, Any]] = []
        self._busy: dict[Connection[Any, Any], Worker[Any, Any]] = {}

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in (*self._busy.values(), *self._idle):
            worker.end()
        self._busy.clear()
        self._idle.clear()

    def map(
        self, work: Work[Item, Result], source: Source[Item], /
    ) -> Iterator[tuple[Chunk[Item], Sequence[Result] | Lost]]:
        """Each chunk with its results, as they come in; always with the same work."""
        from multiprocessing.connection import wait  # noqa: PLC0415  (slow, rarely needed)

        self._hand_out(work, source)
        while self._busy:
            answered = wait(list(self._busy), self._patience())
            found = [each for pipe in answered if (each := self._answer(pipe)) is not None]
            late = [worker for worker in self._busy.values() if worker.left_s == 0]
            found += [self._ended(worker) for worker in late]
            self._hand_out(work, source)
            yield from found
            self._hand_out(work, source)  # those that were lost

    def _hand_out(self, work: Work[Item, Result], source: Source[Item]) -> None:
        while len(self._busy) < self.ahead and (chunk := source.take()) is not None:
            worker = self._idle.pop() if self._idle else self._hire(work)
            if not worker.give(chunk):
                worker.end()
                worker = self._hire(work)
                worker.give(chunk)  # if it is dead already, its pipe tells when we wait for it
            self._busy[worker.pipe] = worker

    def _hire(self, work: Work[Item, Result]) -> Worker[Item, Result]:
        return Worker(work, timeout_s=self._timeout_s)

    def _patience(self) -> float | None:
        limits = (worker.left_s for worker in self._busy.values())
        return min((limit for limit in limits if limit is not None), default=None)

    def _answer(self, pipe: object) -> tuple[Chunk[Any], Sequence[Any] | Lost] | None:
        worker = next(found for known, found in self._busy.items() if known is pipe)
        answer = worker.take()
        if answer is None:
            return None
        del self._busy[worker.pipe]
        assert worker.chunk is not None
        if worker.alive:
            self._idle.append(worker)
        else:
            worker.end()
        return worker.chunk, answer

    def _ended(self, worker: Worker[Any, Any]) -> tuple[Chunk[Any], Lost]:
        del self._busy[worker.pipe]
        assert worker.chunk is not None
        return worker.chunk, worker.give_up()


def _accepts(jobs: str) -> bool:
    return jobs.isascii() and jobs.isdigit() and len(jobs) < 4 and int(jobs) <= MOST


def _make(jobs: str, items: int | None) -> Engine:
    size = _size(jobs, items)
    return Serial() if size <= 1 else Processes(size)


def _make_timed(jobs: str, items: int | None, timeout_s: float) -> Engine:
    return Processes(max(1, _size(jobs, items)), timeout_s=timeout_s)


def _size(jobs: str, items: int | None) -> int:
    size = int(jobs) or available_cores()
    return size if items is None else min(size, items)


KIND = Kind(
    order=2,
    forms=f"a number of processes up to {MOST}, 0 for one per core",
    accepts=_accepts,
    make=_make,
    make_timed=_make_timed,
)
