"""The heartbeat of ``gpsfsm run --bond``: lines on standard input."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import asyncio

    from gpsfsm.execution.bond import Bond

__all__ = ["beat"]

_MOST = 65_536  # bytes at once


def beat(bond: Bond, loop: asyncio.AbstractEventLoop) -> None:
    """Let the bond beat with every line that comes in, and release it at the end of the input.

    A thread of its own waits for lines; it ends with the process.
    """

    def listen() -> None:
        with suppress(RuntimeError):  # the event loop is closed: the run is over
            with suppress(OSError, ValueError, AttributeError):
                number = sys.stdin.fileno()
                # past the buffers of Python, whose lock this thread must not hold at the end
                while part := os.read(number, _MOST):
                    if b"\n" in part:
                        loop.call_soon_threadsafe(bond.beat)
            loop.call_soon_threadsafe(bond.release, "the bond is lost: the input has ended")

    threading.Thread(target=listen, name="bond", daemon=True).start()
