"""The worker of the gate: a process that decides and that can be killed.

It gets the options and then plans on standard input, and answers on standard output; what else is
printed goes nowhere. A message begins with a byte that says what it is.
"""

from __future__ import annotations

import os
import pickle
import queue
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, BinaryIO

from gpsfsm.errors import UsageError
from gpsfsm.gating.deciding import gate_text
from gpsfsm.gating.frames import receive, send
from gpsfsm.gating.wire import encode
from gpsfsm.workers.memory import limit_memory

if TYPE_CHECKING:
    from gpsfsm.gating.verdicts import GateOptions

__all__ = ["MISUSE", "READY", "VERDICT", "main"]

READY, VERDICT, MISUSE = b"R", b"V", b"U"

_WARM = b"""<Plan><Control type="parallel_all"><Runner interface="a/A" provider="a/A"/>
<Runner interface="a/B" provider="a/B"/></Control></Plan>"""


def main() -> None:
    """Decide until the gate ends; then end as well, whatever is being decided."""
    source, target = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 0)
    os.dup2(nowhere, 1)
    with suppress(EOFError, OSError):
        # From the process that has started this one; nothing of a plan is in it.
        options, memory_mb = pickle.loads(receive(source))  # noqa: S301
        with suppress(OSError, ValueError):
            limit_memory(memory_mb)
        send(target, READY + _decided(_WARM, "", options)[:1])  # loads what it takes
        for job in iter(_listening(source).get, b""):
            name, _, text = job.partition(b"\0")
            send(target, _decided(text, name.decode("utf-8", "surrogatepass"), options))


def _decided(text: bytes, name: str, options: GateOptions) -> bytes:
    try:
        return VERDICT + encode(gate_text(text, name, options))
    except UsageError as error:
        return MISUSE + str(error).encode("utf-8", "replace")


def _listening(source: BinaryIO) -> queue.SimpleQueue[bytes]:
    """The jobs, as they come in. A thread reads, so that the end of the gate ends this process."""
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                jobs.put(receive(source))
        except (EOFError, OSError, ValueError):
            sys.stderr.flush()
            os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    return jobs
