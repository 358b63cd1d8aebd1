"""Waiting and logging. Both work through their context alone, in real and in virtual time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunContext, Runner, RunnerError
from gpsfsm.runners.generic.parameters import number
from gpsfsm.simulation.base import text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["LogRunner", "WaitRunner"]


LONGEST_WAIT_S = 1e9
"""The greatest ``seconds`` that the capability file of WaitRunner permits: some thirty years."""


class WaitRunner(Runner):
    """Waits for ``seconds``; never fails, as its capability file declares.

    Of a value that the file does not permit, which may arrive from a step before, it says in the
    journal what it makes of it.
    """

    idempotent = True
    simulated = True

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Wait."""
        await context.sleep(waiting_time(parameters, context))


class LogRunner(Runner):
    """Writes ``text`` into the journal, with its ``level``; never fails, as its file declares."""

    idempotent = True
    simulated = True

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Write one line."""
        write_line(parameters, context)


def waiting_time(parameters: Mapping[str, RunValue], context: RunContext) -> float:
    """How many seconds to wait: from 0 to LONGEST_WAIT_S, and 0 for what is no number."""
    try:
        seconds = number(parameters, "seconds")
    except (RunnerError, OverflowError) as error:
        context.log(f"it does not wait: {error}")
        return 0.0
    waited = min(max(0.0, seconds), LONGEST_WAIT_S)
    if waited != seconds:
        context.log(f"it cannot wait {seconds:g} seconds and waits {waited:g}")
    return waited


def write_line(parameters: Mapping[str, RunValue], context: RunContext) -> None:
    """Write ``text`` with its ``level``; of a list each item on a line."""
    level = text_of(parameters.get("level")) or "info"
    context.log(f"{level}: {text_of(parameters.get('text'))}")
