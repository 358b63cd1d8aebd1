"""Waiting and logging. Both work through their context alone, in real and in virtual time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunContext, Runner, RunnerError
from gpsfsm.runners.generic.parameters import number, text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["LogRunner", "WaitRunner"]


class WaitRunner(Runner):
    """Waits for ``seconds``."""

    idempotent = True
    simulated = True

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Wait."""
        seconds = number(parameters, "seconds")
        if seconds < 0:
            raise RunnerError(f"it cannot wait {seconds:g} seconds")
        await context.sleep(seconds)


class LogRunner(Runner):
    """Writes ``text`` into the journal, with its ``level``."""

    idempotent = True
    simulated = True

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Write one line."""
        context.log(f"{text(parameters, 'level', 'info')}: {text(parameters, 'text')}")
