"""A process that runs or resumes a plan in real time; its actions leave a mark in a file.

python -m tests.execution.crash_child_real JOURNAL PLAN EFFECTS [COUNT DELAY]

With COUNT it dies DELAY microseconds after its action number COUNT has begun.
"""

from __future__ import annotations

import asyncio
import itertools
import os
import signal
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.replay import resume_into
from gpsfsm.execution.runner import Runner
from tests.execution.journaling import compiled

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext


class Acting(Runner):
    """Does something that cannot be undone: writes its key into a file."""

    def __init__(self, target: int, countdown: Callable[[], None], *, idempotent: bool) -> None:
        self._target = target
        self._countdown = countdown
        self.idempotent = idempotent

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        os.write(self._target, f"{context.number} {context.key}\n".encode())
        self._countdown()
        await context.sleep(context.random.uniform(0.01, 0.06))
        return None


def countdown(count: int, delay_us: int) -> Callable[[], None]:
    """Lets the process die some time after the given number of calls; never for 0."""
    calls = itertools.count(1)

    def call() -> None:
        if next(calls) == count:
            signal.setitimer(signal.ITIMER_REAL, max(delay_us, 1) / 1e6)  # nobody handles it

    return call


async def main(arguments: Sequence[str]) -> None:
    path, plan, effects = arguments[:3]
    deadly = countdown(*map(int, arguments[3:] or (0, 0)))
    text = Path(plan).read_bytes()
    kernel = Kernel(compiled(text.decode()))
    target = os.open(effects, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    with ExitStack() as stack:
        journal = stack.enter_context(Journal(path, "process"))
        reader = stack.enter_context(JournalReader(path))
        library = reader.runs()
        writer = journal.go_on(kernel, 1) if library else journal.begin(kernel, Heading(plan=text))
        driver = RealtimeDriver(
            kernel,
            writer,
            lambda interface, _provider: Acting(target, deadly, idempotent=interface == "again"),
            run_id=writer.id,
        )
        if library:
            resume_into(driver, list(reader.events(1)))
        await driver.run()
    os.write(1, b"ended\n")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1:]))
