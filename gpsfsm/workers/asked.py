"""A process that answers messages, as somebody sees it who waits for each answer.

A thread talks to it, so that nobody waits longer than is allowed. ``process`` is for event loops.
"""

from __future__ import annotations

import queue
import subprocess
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.workers.frames import Gone, pack, read

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Asked"]

_END_S = 10.0


class Asked:
    """One process. Ask it one thing after the other; what comes too late costs it its life.

    ``silent``: what it prints to standard error goes nowhere. Raises OSError or ValueError if it
    cannot be started.
    """

    def __init__(self, command: Sequence[str], *, silent: bool) -> None:
        self._process = subprocess.Popen(  # noqa: S603  (callers start this interpreter)
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if silent else None,
        )
        self._jobs: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[tuple[dict[str, Any], bytes] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._talk, daemon=True)
        self._thread.start()

    def ask(
        self, head: dict[str, Any], body: bytes = b"", *, within_s: float
    ) -> tuple[dict[str, Any], bytes]:
        """The answer. After TimeoutError or Gone nothing more can be asked; ``end`` it.

        Raises ValueError for a message that is too long.
        """
        self._jobs.put(pack(head, body))
        try:
            answer = self._answers.get(timeout=within_s)
        except queue.Empty:
            raise TimeoutError from None
        if answer is None:
            raise Gone("has ended")
        return answer

    def _talk(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        while (job := self._jobs.get()) is not None:
            try:
                self._process.stdin.write(job)
                self._process.stdin.flush()
                self._answers.put(read(self._process.stdout))  # type: ignore[arg-type]
            except (OSError, EOFError, ValueError):
                self._answers.put(None)

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
