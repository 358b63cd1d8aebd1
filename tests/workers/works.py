"""Things to do with an item, some of which end the process that does them."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import struct
import time
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.workers.parent_link import ParentLink
from gpsfsm.workers.pool_worker import Worker

if TYPE_CHECKING:
    from gpsfsm.workers import Chunk

_GIVE = Worker.give


def killed_with_it_in_hand(worker: Worker[Any, Any], chunk: Chunk[Any]) -> None:
    """In place of ``Worker.give``: the worker is killed before it can do anything with it."""
    os.kill(worker.child.pid, signal.SIGSTOP)
    _GIVE(worker, chunk)
    os.kill(worker.child.pid, signal.SIGKILL)


class Double:
    """Doubles numbers; texts say what shall happen instead."""

    def __call__(self, item: int | str) -> int:
        if item == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        if item == "exit":
            os._exit(7)
        if item == "sleep":
            time.sleep(600)
        if item == "misuse":
            raise UsageError("that makes no sense")
        return 2 * int(item)


class Hostile:
    """What a worker may do that a text has taken over: it answers with something else."""

    def __call__(self, item: int) -> int:
        answers = {
            1: (b"", pickle.dumps((1,))),
            2: (b"{}", b'["1"]'),
            3: (b"{}", b"[1, 2]"),
            4: (b"{}", b"[1"),
            5: (b"no message", b""),
        }
        if item not in answers:
            return item
        head, body = answers[item]
        link = next(each for each in gc.get_objects() if isinstance(each, ParentLink))
        link._out.write(b"".join(struct.pack(">I", len(each)) + each for each in (head, body)))
        link._out.flush()
        time.sleep(600)
        return item
