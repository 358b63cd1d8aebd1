"""A process that runs or resumes a journaled plan, and may die while it writes.

    python -m tests.execution.crash_child JOURNAL PLAN SEED DURABILITY [WHEN WRITE]

It prints the number of the last event after each write that has returned. With WHEN it kills
itself at the write number WRITE: ``before`` it, between the steps of its SQL statements
(``insert``), between these and the commit (``inside``), or ``after`` it.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.replay import Comparing, simulate_again
from tests.execution.journaling import compiled, driver

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.execution.journal import RunWriter
    from gpsfsm.execution.records import Input, Record

WAYS = ("before", "insert", "inside", "after")


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


class Deadly:
    """A sink that kills the process at some write, and tells what is acknowledged."""

    def __init__(self, writer: RunWriter, journal: Journal, when: str, at: int) -> None:
        self._writer = writer
        self._connection = journal._connection
        self._when = when
        self._left = at

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        self._left -= 1
        if not self._left:
            self._prepare()
        self._writer.write(at_us, happened, records)
        if not self._left and self._when == "after":
            die()
        os.write(1, b"%d\n" % self._writer.seq)

    @property
    def seq(self) -> int:
        return self._writer.seq

    def _prepare(self) -> None:
        if self._when == "before":
            die()
        elif self._when == "insert":  # after some steps of SQLite's machine
            self._connection.set_progress_handler(lambda: die() or 0, 40)
        elif self._when == "inside":  # all is inserted, and now it would be committed
            self._connection.set_trace_callback(
                lambda statement: die() if statement == "COMMIT" else None
            )


def main(arguments: Sequence[str]) -> None:
    path, plan, seed, durability = arguments[:4]
    when, at = (arguments[4], int(arguments[5])) if len(arguments) > 4 else ("", 0)
    text = Path(plan).read_bytes()
    kernel = Kernel(compiled(text.decode()))
    with ExitStack() as stack:
        journal = stack.enter_context(Journal(path, durability))
        reader = stack.enter_context(JournalReader(path))
        library = reader.runs()
        heading = Heading(plan=text, seed=int(seed), mode="crash")
        writer = journal.go_on(kernel, 1) if library else journal.begin(kernel, heading)
        deadly = Deadly(writer, journal, when, at)
        sink = Comparing(kernel, reader.events(1), deadly)
        simulate_again(driver(kernel, sink, int(seed)), sink)
    os.write(1, b"ended\n")


if __name__ == "__main__":
    main(sys.argv[1:])
