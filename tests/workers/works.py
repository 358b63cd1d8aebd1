"""Things to do with an item, some of which end the process that does them."""

from __future__ import annotations

import os
import signal
import time
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
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
