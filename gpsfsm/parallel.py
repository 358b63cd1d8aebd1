"""Check many plans, in this process or in several.

One process per worker and one pipe to each, instead of a pool of the standard library: when a
worker is killed (out of memory, for instance) we then know which plan it had in hand. That plan is
reported as not decided, the others are checked by a new worker. Inputs are read here, because
standard input and ``/dev/fd/3`` mean nothing in another process.
"""

from __future__ import annotations

import os
import signal
import threading
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from gpsfsm.checking import CheckOptions, check_text, failed, unreadable
from gpsfsm.errors import InputError, UsageError
from gpsfsm.inputs import Input, read_bytes, read_input
from gpsfsm.model.report import PlanReport

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from multiprocessing.connection import Connection
    from multiprocessing.context import SpawnProcess

__all__ = ["CheckApart", "available_cores", "check_inputs"]

_Job = tuple[int, str, bytes]
"""The number of an input, its path and its text."""
_Answer = PlanReport | UsageError


def available_cores() -> int:
    """The cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def check_inputs(
    inputs: Sequence[Input], options: CheckOptions, *, jobs: int = 1
) -> Iterator[PlanReport]:
    """Check every input, in order, in ``jobs`` processes (0: as many as there are cores).

    The reports do not depend on ``jobs``. A defect of gpsfsm that one plan brings to light is
    reported for that plan. Raises UsageError for options that make no sense.
    """
    workers = min(jobs or available_cores(), len(inputs))
    if workers <= 1:
        return (read_input(found, options) for found in inputs)
    return _in_order(_Crew(workers, options), inputs, options)


def _in_order(crew: _Crew, inputs: Sequence[Input], options: CheckOptions) -> Iterator[PlanReport]:
    """The reports in the order of the inputs; workers answer in any order."""
    early: dict[int, PlanReport] = {}
    following = 0
    with crew:
        for number, report in crew.check(_jobs(inputs, options.limits.max_bytes, early)):
            early[number] = report
            while following in early:
                yield early.pop(following)
                following += 1
    while following in early:
        yield early.pop(following)
        following += 1


def _jobs(
    inputs: Iterable[Input], max_bytes: int, answered: dict[int, PlanReport]
) -> Iterator[_Job]:
    """Read one input at a time, as workers ask for them; unreadable ones are answered at once."""
    for number, found in enumerate(inputs):
        try:
            yield number, found.path, read_bytes(found, max_bytes)
        except InputError as error:
            answered[number] = unreadable(found.path, str(error))


class _Crew:
    """Worker processes, each with at most one plan in hand."""

    def __init__(self, size: int, options: CheckOptions) -> None:
        self._size = size
        self._options = options
        self._workers: dict[Connection[_Job, _Answer], _Worker] = {}

    def __enter__(self) -> _Crew:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers.values():
            worker.end()
        self._workers.clear()

    def check(self, jobs: Iterator[_Job]) -> Iterator[tuple[int, PlanReport]]:
        """Numbered reports as they come in."""
        from multiprocessing.connection import wait  # noqa: PLC0415  (slow, rarely needed)

        for job in jobs:
            self._hire(job)
            if len(self._workers) == self._size:
                break
        while self._workers:
            for ready in wait(list(self._workers)):
                worker = next(found for pipe, found in self._workers.items() if pipe is ready)
                yield worker.number, self._answer(worker)
                following = next(jobs, None)
                if following is None:
                    self._dismiss(worker)
                elif not worker.alive or not worker.give(following):
                    self._dismiss(worker)
                    self._hire(following)

    def _hire(self, job: _Job) -> None:
        worker = _Worker(self._options)
        worker.give(job)  # if it is dead already, its pipe tells when we wait for the answer
        self._workers[worker.pipe] = worker

    def _dismiss(self, worker: _Worker) -> None:
        del self._workers[worker.pipe]
        worker.end()

    def _answer(self, worker: _Worker) -> PlanReport:
        answer = worker.take()
        if isinstance(answer, UsageError):
            raise answer
        return answer


class _Worker:
    """One worker process as its parent sees it."""

    def __init__(self, options: CheckOptions) -> None:
        from multiprocessing import get_context  # noqa: PLC0415  (slow, rarely needed)

        context = get_context("spawn")
        self.pipe: Connection[_Job, _Answer]
        self.pipe, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(
            target=_work, args=(theirs, options), daemon=True
        )
        with _without_interrupts():
            self.process.start()
        theirs.close()  # the worker now has the only other end: when it dies, ours says so
        self.number = -1
        self.path = ""
        self.alive = True

    def give(self, job: _Job) -> bool:
        """Hand over a plan; False if the worker is dead."""
        self.number, self.path, _ = job
        try:
            self.pipe.send(job)
        except OSError:
            self.alive = False
        return self.alive

    def take(self) -> _Answer:
        """The answer to the plan in hand, or what became of the worker."""
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            self.alive = False
        self.process.join(timeout=10)
        code = self.process.exitcode
        how = f"by signal {-code}" if code is not None and code < 0 else f"with code {code}"
        return failed(
            self.path,
            f"the process that checked this plan was ended {how}; the memory may have run out",
            hint="check it with more memory, or with --jobs 1",
        )

    def end(self) -> None:
        """End the process; it holds nothing that needs saving."""
        self.pipe.close()
        self.process.kill()
        self.process.join()
        self.process.close()


class CheckApart:
    """Checks plans in a process of its own, one at a time; use it in a ``with`` statement.

    Unlike a thread, a process can be ended when a check takes too long, and shares no z3 with the
    threads of this one. It begins with the first plan.
    """

    def __init__(self, timeout_s: float = 100.0) -> None:
        self._timeout_s = timeout_s
        self._worker: _Worker | None = None

    def __enter__(self) -> CheckApart:
        return self

    def __exit__(self, *_: object) -> None:
        worker = self._worker
        if worker is not None:  # whoever waits for it in another thread is told by its pipe
            worker.process.kill()

    def check(self, text: bytes, path: str, options: CheckOptions) -> PlanReport:
        """Check a plan, always with the same options. Raises UsageError for senseless ones."""
        worker = self._worker
        if worker is None or not worker.alive:
            worker = self._worker = _Worker(options)
        if worker.give((0, path, text)) and not worker.pipe.poll(self._timeout_s):
            self._worker = None
            worker.end()
            return failed(path, f"the check was ended: it took more than {self._timeout_s:g} s")
        answer = worker.take()
        if isinstance(answer, UsageError):
            raise answer
        return answer


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """A process that starts in here ignores Ctrl-C: its parent gets it too, and ends it."""
    if threading.current_thread() is not threading.main_thread():
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))  # it inherits that
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before or signal.SIG_DFL)


def _work(pipe: Connection[_Answer, _Job], options: CheckOptions) -> None:
    """The life of a worker: check what comes until the parent closes the pipe."""
    with suppress(EOFError, OSError):  # the parent has gone
        while True:
            _, path, text = pipe.recv()
            try:
                answer: _Answer = check_text(text, path, options)
            except UsageError as error:
                answer = error
            pipe.send(answer)
