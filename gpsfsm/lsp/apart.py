"""The process that works for the language server, as the server sees it."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.lsp.work import Job, Result, Work
from gpsfsm.workers import Chunk, Lost
from gpsfsm.workers.crew import Worker

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.lsp.settings import Setting

__all__ = ["Apart", "NoAnswer"]

_MOST_JOBS = 5_000
"""After so many jobs the process is replaced, whatever may have gathered in it."""


class NoAnswer(Exception):  # noqa: N818  (it says why there is no answer)
    """The process has no answer, and why. ``late``: it took longer than it may."""

    def __init__(self, why: str, *, late: bool = False) -> None:
        super().__init__(why)
        self.late = late


class Apart:
    """A process that does one job at a time, and is ended if one takes more than ``timeout_s``.

    ``do`` belongs to one thread; ``stop`` may be called from another one meanwhile.
    """

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._worker: Worker[Job, Result] | None = None
        self._sent = self._jobs = 0
        self._stopped = False

    def do(self, job: Job, setting: Setting | None = None) -> object:
        """The answer. Raises NoAnswer."""
        worker = self._worker
        worn = self._stopped or self._jobs >= _MOST_JOBS
        if worker is None or worn or not worker.alive or worker.process.poll() is not None:
            worker = self._fresh()
            if job.kind != "warm":
                self._ask(worker, Job("warm"))
        if setting is not None:
            job = replace(job, setting=setting.number)
            if self._sent != setting.number:
                job = replace(job, packed=setting.packed)
        answer = self._ask(worker, job)
        if setting is not None:
            self._sent = setting.number
        self._jobs += 1
        return answer

    def stop(self) -> None:
        """End the process; who waits for it gets NoAnswer, and the next job a new one."""
        self._stopped = True
        worker = self._worker
        if worker is not None:
            worker.process.kill()

    def close(self) -> None:
        """End the process for good."""
        if self._worker is not None:
            self._worker.end()
            self._worker = None

    def _fresh(self) -> Worker[Job, Result]:
        self.close()
        self._sent = self._jobs = 0
        self._stopped = False
        self._worker = Worker(Work())
        return self._worker

    def _ask(self, worker: Worker[Job, Result], job: Job) -> Result:
        worker.give(Chunk((0,), (job,)))
        until = time.monotonic() + self._timeout_s
        answer: Sequence[Result] | Lost | None = None
        while answer is None:  # the first that it says is that it is ready
            if worker.alive and not worker.pipe.poll(max(0.0, until - time.monotonic())):
                self.close()
                raise NoAnswer(f"was ended: it took more than {self._timeout_s:g} s", late=True)
            answer = worker.take()
        if isinstance(answer, Lost):
            self.close()
            raise NoAnswer(answer.how)
        return answer[0]
