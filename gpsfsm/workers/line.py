"""The life of a process that answers messages: it ends when the process that it works for ends.

It is told what to do on standard input and answers on standard output (``frames``). Whatever else
is printed goes to standard error. The other end is ``asked`` or ``process``.
"""

from __future__ import annotations

import os
import queue
import sys
import threading
from typing import TYPE_CHECKING, Any, BinaryIO

from gpsfsm.workers.frames import pack, read

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Line"]

Message = tuple[dict[str, Any], bytes]


class Line:
    """The line to the other process. A thread reads, so that its end is noticed at any time.

    ``ended`` is called with it then, in that thread, maybe before it is assigned to anything;
    without it this process ends, whatever it does.
    """

    def __init__(self, ended: Callable[[Line], None] | None = None) -> None:
        self._in: BinaryIO = os.fdopen(os.dup(0), "rb")
        self._out: BinaryIO = os.fdopen(os.dup(1), "wb")
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.dup2(2, 1)
        os.close(nothing)
        sys.stdin, sys.stdout = open(0, closefd=False), sys.stderr  # noqa: SIM115
        self._ended = ended or _end
        self._over = False
        self._writing = threading.Lock()
        self.messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()

    def say(self, head: dict[str, Any], body: bytes = b"") -> None:
        """Send a message; may be called from any thread."""
        message = pack(head, body)
        try:
            with self._writing:
                self._out.write(message)
                self._out.flush()
        except OSError:
            self._gone()

    def _gone(self) -> None:
        if not self._over:
            self._over = True
            self._ended(self)

    def _listen(self) -> None:
        try:
            while True:
                self.messages.put(read(self._in))
        except (EOFError, OSError, ValueError):
            self._gone()


def _end(_: Line) -> None:
    sys.stderr.flush()
    os._exit(0)
