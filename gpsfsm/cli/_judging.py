"""The judge of plans that a model writes during a run in real time: a process of its own.

z3 is used by one thread of a process only, and what it is asked can take long; a process can be
ended.
"""

from __future__ import annotations

import threading
from contextlib import suppress
from typing import TYPE_CHECKING

from gpsfsm.generation.loop import Judgement

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from gpsfsm.checking import CheckOptions

__all__ = ["JudgeApart"]


class JudgeApart:
    """A ``PlanJudge`` in another process; may be called from any thread, use it with ``with``.

    The process begins with the first answer. One that takes too long is ended, and its answer
    counts as not decided.
    """

    def __init__(self, options: CheckOptions, timeout_s: float = 100.0) -> None:
        self._options = options
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self._pipe: Connection[str, Judgement] | None = None

    def __enter__(self) -> JudgeApart:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def __call__(self, answer: str, /) -> Judgement:
        """Judge an answer; never raises for anything that is in it."""
        with self._lock:
            try:
                return self._judged(answer)
            except (EOFError, OSError):
                self._end()
                return _undecided("the process that checked the plan has ended")

    def _judged(self, answer: str) -> Judgement:
        if self._pipe is None:
            self._begin()
        assert self._pipe is not None
        self._pipe.send(answer)
        if not self._pipe.poll(self._timeout_s):
            self._end()
            return _undecided(f"the check was ended: it took more than {self._timeout_s:g} s")
        return self._pipe.recv()

    def _begin(self) -> None:
        from multiprocessing import get_context  # noqa: PLC0415  (slow, rarely needed)

        from gpsfsm.workers.crew import without_interrupts  # noqa: PLC0415

        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs, self._options), daemon=True)
        with without_interrupts():
            self._process.start()
        theirs.close()

    def _end(self) -> None:
        if self._pipe is None:
            return
        self._process.kill()  # whoever waits for it in another thread is told by the pipe
        self._process.join()
        self._pipe = None


def _undecided(why: str) -> Judgement:
    return Judgement(False, "", why, decided=False, findings=(("GP904", why),))


def _work(pipe: Connection[Judgement, str], options: CheckOptions) -> None:
    """The life of the process: judge what comes until the parent closes the pipe."""
    from gpsfsm.judging import PlanJudge  # noqa: PLC0415

    judge = PlanJudge(options)
    with suppress(EOFError, OSError):  # the parent has gone
        while True:
            pipe.send(judge(pipe.recv()))
