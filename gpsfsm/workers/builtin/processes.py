"""Several processes on this machine: ``--jobs N``.

Chunks of one item: a message costs next to nothing, no worker waits for another one at the end, and
when a worker is ended it is known at once which item did it.
"""

from __future__ import annotations

from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from gpsfsm.workers.builtin.serial import Serial
from gpsfsm.workers.engines import Kind
from gpsfsm.workers.pool_worker import Worker, available_cores

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.workers.child_process import ChildProcess
    from gpsfsm.workers.engines import Chunk, Engine, Item, Lost, Result, Source, Work
    from gpsfsm.workers.frames import Message

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
        self._inbox: ChildProcess.Inbox = SimpleQueue()
        self._idle: list[Worker[Any, Any]] = []
        self._busy: dict[ChildProcess, Worker[Any, Any]] = {}

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        workers = (*self._busy.values(), *self._idle)
        for worker in workers:
            worker.child.kill()  # all at once, and then one after the other
        for worker in workers:
            worker.end()
        self._busy.clear()
        self._idle.clear()

    def map(
        self, work: Work[Item, Result], source: Source[Item], /
    ) -> Iterator[tuple[Chunk[Item], Sequence[Result] | Lost]]:
        """Each chunk with its results, as they come in; always with the same work."""
        self._hand_out(work, source)
        while self._busy:
            done = self._answers()
            late = [worker for worker in self._busy.values() if worker.left_s == 0]
            done += [self._ended(worker) for worker in late]
            self._hand_out(work, source)
            yield from done
            self._hand_out(work, source)  # those that were lost

    def _hand_out(self, work: Work[Item, Result], source: Source[Item]) -> None:
        while len(self._busy) < self.ahead and (chunk := source.take()) is not None:
            worker = self._idle.pop() if self._idle else self._hire(work)
            assert worker.alive, "a worker that has ended was kept"
            if not worker.child.alive:  # it has ended with nothing in hand: no item is lost
                worker.end()
                worker = self._hire(work)
            worker.give(chunk)
            self._busy[worker.child] = worker
        assert len(self._busy) + len(self._idle) <= max(self.ahead, 1), "more workers than allowed"

    def _hire(self, work: Work[Item, Result]) -> Worker[Item, Result]:
        return Worker(work, timeout_s=self._timeout_s, inbox=self._inbox)

    def _answers(self) -> list[tuple[Chunk[Any], Sequence[Any] | Lost]]:
        """The answers of the workers: waits for the first message, if none is there."""
        limits = (worker.left_s for worker in self._busy.values())
        done = []
        with suppress(Empty):
            patience_s = min((limit for limit in limits if limit is not None), default=None)
            message = self._inbox.get(timeout=patience_s)
            while True:
                if (answer := self._answer(*message)) is not None:
                    done.append(answer)
                message = self._inbox.get_nowait()
        return done

    def _answer(
        self, child: ChildProcess, message: Message | None
    ) -> tuple[Chunk[Any], Sequence[Any] | Lost] | None:
        worker = self._busy.get(child)  # none: it was ended meanwhile
        answer = None if worker is None else worker.take(message)
        if worker is None or answer is None:
            return None
        del self._busy[child]
        assert worker.chunk is not None
        if worker.alive:
            self._idle.append(worker)
        return worker.chunk, answer

    def _ended(self, worker: Worker[Any, Any]) -> tuple[Chunk[Any], Lost]:
        del self._busy[worker.child]
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
