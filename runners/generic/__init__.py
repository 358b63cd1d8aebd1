"""Generic runners: wait, log, HTTP requests, programs, and functions of Python.

What they may reach is not for the plan to say. The user allows it, through the services
``allow_hosts``, ``allow_programs`` and ``allow_functions`` of a run; without them nothing is
allowed. Waiting and logging work through their context alone, in real and in virtual time. What a
plan writes may be of another type than a runner needs.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.runner import RunContext, Runner, RunnerError
from gpsfsm.simulation.base import text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.runners.generic.http import HttpRunner
    from gpsfsm.runners.generic.process import ProcessRunner
    from gpsfsm.runners.generic.python import PythonRunner

__all__ = ["HttpRunner", "LogRunner", "ProcessRunner", "PythonRunner", "WaitRunner"]

_MODULES = {
    "HttpRunner": "http",
    "ProcessRunner": "process",
    "PythonRunner": "python",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


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
    """The seconds to wait: from 0 to LONGEST_WAIT_S, and 0 for what is no number."""
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


def text(parameters: Mapping[str, RunValue], name: str, default: str | None = None) -> str:
    """A text; a number or a Boolean as a plan writes it. Raises RunnerError if it is missing."""
    value = parameters.get(name, default)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str | int | float):
        return str(value)
    raise RunnerError(f"{name!r} is missing" if value is None else f"{name!r} is no text")


def number(parameters: Mapping[str, RunValue], name: str, default: float | None = None) -> float:
    """A finite number. Raises RunnerError if it is missing or none."""
    value = parameters.get(name, default)
    if value is None:
        raise RunnerError(f"{name!r} is missing")
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RunnerError(f"{name!r} is {value!r:.80} and has to be a number")
    return float(value)
