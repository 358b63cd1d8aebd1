"""The other side of ``gpsfsm.workers.crew``: a process that works on what it is sent.

It is told what to do once, says that it is ready, and then answers chunk after chunk until its
parent closes the pipe. Only the parent holds the other end: nobody else can send it anything.
"""

from __future__ import annotations

from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from gpsfsm.errors import UsageError

__all__ = ["READY", "main"]

READY = "ready"


def main(handle: int) -> None:
    """The life of a worker; ``handle`` is the file descriptor of its pipe."""
    pipe: Connection[Any, Any] = Connection(handle)
    with suppress(EOFError, OSError, KeyboardInterrupt):  # the parent has gone, or is about to
        try:
            work = pipe.recv()
        except (AttributeError, ImportError) as error:
            pipe.send(UsageError(f"workers cannot import what they are to do: {error}"))
            return
        pipe.send(READY)
        while True:
            items = pipe.recv()
            answer: list[Any] | UsageError
            try:
                answer = [work(item) for item in items]
            except UsageError as error:
                answer = error
            pipe.send(answer)
