"""The process that decides, as the gate sees it. Loads no analyses: it starts while others do."""

from __future__ import annotations

import os
import sys
from typing import Any

from gpsfsm.errors import DEBUG_VARIABLE
from gpsfsm.workers.asked import Asked
from gpsfsm.workers.frames import Gone

__all__ = ["NoAnswer", "Worker"]

_CODE = "import sys; sys.path[:] = sys.argv[1:]; from gpsfsm.gating.worker import main; main()"
"""It finds the modules where this process has found them, and looks into no other folder."""


class NoAnswer(Exception):  # noqa: N818  (it says why there is no verdict)
    """There is no verdict, and why."""


class Worker:
    """A worker process. Raises NoAnswer if it cannot be started."""

    def __init__(self) -> None:
        isolation = "-I" if sys.flags.isolated else "-P"
        command = [sys.executable, isolation, "-c", _CODE, *sys.path]
        try:
            self._asked = Asked(command, silent=not os.environ.get(DEBUG_VARIABLE))
        except (OSError, ValueError) as error:
            raise NoAnswer(f"no worker could be started: {error}") from None

    def ask(
        self, head: dict[str, Any], body: bytes, within_s: float, too_late: str
    ) -> tuple[dict[str, Any], bytes]:
        """The answer. Raises NoAnswer."""
        try:
            return self._asked.ask(head, body, within_s=within_s)
        except TimeoutError:
            raise NoAnswer(too_late) from None
        except Gone:
            told = "the process that decided has ended; the memory may have run out"
            raise NoAnswer(told) from None

    def end(self) -> None:
        """End the process; it holds nothing that needs saving."""
        self._asked.end()
