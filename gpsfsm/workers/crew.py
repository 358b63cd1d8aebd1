"""Worker processes on this machine, as their parent sees them.

One pipe to each, instead of a pool of the standard library: when a worker is killed (out of memory,
for instance) we know what it had in hand. They are started as programs of their own and not with
``multiprocessing``, which would run the main program of whoever calls us once more in each of them.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, cast

from gpsfsm.errors import UsageError
from gpsfsm.workers.base import Item, Lost, Result

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from multiprocessing.connection import Connection

    from gpsfsm.workers.base import Chunk, Work

__all__ = ["START_S", "Worker", "available_cores", "without_interrupts"]

START_S = 120.0
"""A worker that has not begun after so many seconds never will."""
_PROGRAM = "import sys; from gpsfsm.workers.child import main; main(int(sys.argv[1]))"


def available_cores() -> int:
    """The cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Worker(Generic[Item, Result]):
    """A process with at most one chunk in hand; ``timeout_s`` is what each item of it may take."""

    def __init__(self, work: Work[Item, Result], *, timeout_s: float | None = None) -> None:
        from multiprocessing import Pipe  # noqa: PLC0415  (slow, rarely needed)

        self.pipe: Connection[Any, Any]
        self.pipe, theirs = Pipe()
        self.chunk: Chunk[Item] | None = None
        self.alive = True
        self._timeout_s = timeout_s
        self._ready = False
        self._until = time.monotonic() + START_S
        handle = theirs.fileno()
        with without_interrupts():
            self.process = subprocess.Popen(  # noqa: S603  (ourselves)
                # -P: a file in the current folder must not pass for a module
                [sys.executable, "-P", "-c", _PROGRAM, str(handle)],
                stdin=subprocess.DEVNULL,
                pass_fds=(handle,),
                env=_environment(),
            )
        theirs.close()  # the worker now has the only other end: when it dies, ours says so
        self._send(work)

    def give(self, chunk: Chunk[Item]) -> bool:
        """Hand over a chunk; False if the worker is dead."""
        self.chunk = chunk
        self._limit()
        return self._send(chunk.items)

    def take(self) -> Sequence[Result] | Lost | None:
        """The results of the chunk in hand, or what became of the worker; None: it is ready now.

        Raises UsageError if the work did.
        """
        try:
            answer = self.pipe.recv()
        except (EOFError, OSError):
            return self._buried()
        if isinstance(answer, UsageError):
            raise answer
        if not self._ready:
            self._ready = True
            self._limit()
            return None
        return cast("list[Result]", answer)

    @property
    def left_s(self) -> float | None:
        """The seconds that it has left; None: any time."""
        if self._ready and self._timeout_s is None:
            return None
        return max(0.0, self._until - time.monotonic())

    def give_up(self) -> Lost:
        """End it because it takes too long."""
        how = f"took more than {self._timeout_s:g} s" if self._ready else "did not begin"
        self.end()
        return Lost(f"was ended: it {how}", late=self._ready)

    def end(self) -> None:
        """End the process; it holds nothing that needs saving."""
        self.alive = False
        self.pipe.close()
        self.process.kill()
        self.process.wait()

    def _limit(self) -> None:
        if self._ready and self._timeout_s is not None and self.chunk is not None:
            self._until = time.monotonic() + self._timeout_s * len(self.chunk.items)

    def _send(self, message: object) -> bool:
        try:
            self.pipe.send(message)
        except OSError:
            self.alive = False
        return self.alive

    def _buried(self) -> Lost:
        self.alive = False
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=10)
        code = self.process.returncode
        how = f"by signal {-code}" if code is not None and code < 0 else f"with code {code}"
        return Lost(f"was ended {how}; the memory may have run out")


def _environment() -> dict[str, str]:
    """What a worker needs to find the modules that this process has found."""
    path = os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path)
    return {**os.environ, "PYTHONPATH": path}


@contextmanager
def without_interrupts() -> Iterator[None]:
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
