"""Programs that the user allows, without a shell."""

from __future__ import annotations

import asyncio
import os
import shlex
from typing import TYPE_CHECKING

from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.runners.generic.parameters import number, text
from gpsfsm.runners.generic.supervised import Program

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["ProcessRunner"]

_MAX_ARGUMENTS = 1_000
_ENVIRONMENT = ("HOME", "LANG", "LC_ALL", "LOGNAME", "PATH", "TMPDIR", "TZ", "USER")


class ProcessRunner(Runner):
    """Runs a program.

    The service ``allow_programs`` holds the programs that may be run, as plans write them: a name
    that is looked up in the path, or a full path. ``environment`` holds further variables; of
    those of this process a program gets only a few. When the program ends, or is stopped, or when
    this process ends in whatever way, so do the processes that it has started.
    """

    def __init__(self) -> None:
        self._programs: frozenset[str] = frozenset()
        self._environment: dict[str, str] = {}

    async def start(self, context: LoadContext) -> None:
        """Get ready."""
        self._programs = frozenset(context.services.get("allow_programs", ()))
        self._environment = {
            name: os.environ[name] for name in _ENVIRONMENT if name in os.environ
        } | dict(context.services.get("environment", {}))

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Run the program to its end."""
        arguments = self._arguments(parameters)
        timeout_s = number(parameters, "timeout_s", 30.0)
        environment = {**self._environment, "GPSFSM_KEY": context.key}
        try:
            program = Program(arguments, environment)
            try:
                async with asyncio.timeout(timeout_s):
                    await program.end()
            finally:
                await program.stop()
                if program.left:
                    context.log(f"{program.left:,} of its processes could not be ended")
        except TimeoutError:
            raise RunnerError(f"{arguments[0]} was stopped after {timeout_s:g} s") from None
        except (OSError, ValueError) as error:
            raise RunnerError(f"{arguments[0]} cannot be run: {error}") from error
        complaints = program.text(2)
        if program.code != 0:
            raise RunnerError(
                f"{arguments[0]} ended with exit code {program.code}",
                stderr=complaints,
                exit_code=program.code,
            )
        return {"stdout": program.text(1), "stderr": complaints, "exit_code": program.code}

    def _arguments(self, parameters: Mapping[str, RunValue]) -> list[str]:
        command = parameters.get("command")
        try:
            arguments = (
                [str(part) for part in command]
                if isinstance(command, list)
                else shlex.split(text(parameters, "command"))
            )
        except ValueError as error:
            raise RunnerError(f"the command cannot be read: {error}") from error
        if not 0 < len(arguments) <= _MAX_ARGUMENTS:
            raise RunnerError(f"the command has {len(arguments):,} parts")
        if arguments[0] not in self._programs:
            raise RunnerError(f"the program {arguments[0][:200]!r} is not allowed")
        return arguments
