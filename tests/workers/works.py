"""Things to do with an item, some of which end the process that does them."""

from __future__ import annotations

import os
import signal
import time

from gpsfsm.errors import UsageError


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
