"""A process that runs ``gpsfsm`` and kills itself at a row of the plan queue in its journal.

python -m tests.cli.killed_run KIND N WHEN ARGUMENTS…

WHEN is ``before`` the Nth row of this kind, ``inside`` of writing it (it is inserted and would be
committed now), or ``after`` it.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import TYPE_CHECKING

from gpsfsm.cli import main
from gpsfsm.execution.journal import Journal

if TYPE_CHECKING:
    from gpsfsm.execution.queue import QueueRow


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def kill_at(kind: str, number: int, when: str) -> None:
    left = number
    write = Journal.write_queue

    def deadly(self: Journal, at_us: int, row: QueueRow) -> None:
        nonlocal left
        left -= row.kind == kind
        now = row.kind == kind and not left
        if now and when == "before":
            die()
        if now and when == "inside":
            self._connection.set_trace_callback(
                lambda statement: die() if statement == "COMMIT" else None
            )
        write(self, at_us, row)
        if now:
            die()

    Journal.write_queue = deadly  # type: ignore[method-assign]


if __name__ == "__main__":
    kill_at(sys.argv[1], int(sys.argv[2]), sys.argv[3])
    sys.exit(main(sys.argv[4:]))
