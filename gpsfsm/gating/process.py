"""The process that decides, as the gate sees it. Loads no analyses: it starts while others do."""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
from contextlib import suppress

from gpsfsm.errors import DEBUG_VARIABLE
from gpsfsm.gating.frames import receive, send

__all__ = ["NoAnswer", "Worker"]

_END_S = 10.0
_CODE = "import sys; sys.path[:] = sys.argv[1:]; from gpsfsm.gating.worker import main; main()"
"""It finds the modules where this process has found them, and looks into no other folder."""


class NoAnswer(Exception):  # noqa: N818  (it says why there is no verdict)
    """There is no verdict, and why."""


class Worker:
    """A worker process. A thread talks to it, so that nobody waits longer than is allowed."""

    def __init__(self) -> None:
        paths = list(sys.path)
        debugging = bool(os.environ.get(DEBUG_VARIABLE))
        try:
            self._process = subprocess.Popen(  # noqa: S603  (this interpreter, our own code)
                [sys.executable, "-I" if sys.flags.isolated else "-P", "-c", _CODE, *paths],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=None if debugging else subprocess.DEVNULL,
            )
        except (OSError, ValueError) as error:
            raise NoAnswer(f"no worker could be started: {error}") from None
        self._jobs: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._talk, daemon=True)
        self._thread.start()

    def ask(self, message: bytes, within_s: float, too_late: str) -> tuple[bytes, bytes]:
        """The kind of the answer and its content. Raises NoAnswer."""
        self._jobs.put(message)
        try:
            answer = self._answers.get(timeout=within_s)
        except queue.Empty:
            raise NoAnswer(too_late) from None
        if not answer:
            raise NoAnswer("the process that decided has ended; the memory may have run out")
        return answer[:1], answer[1:]

    def _talk(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        while (job := self._jobs.get()) is not None:
            try:
                send(self._process.stdin, job)  # type: ignore[arg-type]  # IO[bytes] is one
                self._answers.put(receive(self._process.stdout))  # type: ignore[arg-type]
            except (OSError, EOFError, ValueError):
                self._answers.put(b"")

    def end(self) -> None:
        """End the process; it holds nothing that needs saving."""
        self._process.kill()
        self._jobs.put(None)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)
        self._thread.join(_END_S)
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError, ValueError):
                if stream is not None:
                    stream.close()
