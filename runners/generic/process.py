"""Programs that the user allows, without a shell."""

from __future__ import annotations

import asyncio
import os
import shlex
import signal
from contextlib import suppress
from typing import TYPE_CHECKING

from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.runners.generic.parameters import number, text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["ProcessRunner"]

_MAX_OUTPUT = 400_000  # bytes of each stream: decoded and together they fit into outputs
_MAX_ARGUMENTS = 1_000
_POLITE_S = 1.0  # between asking a program to end and ending it
_ENVIRONMENT = ("HOME", "LANG", "LC_ALL", "LOGNAME", "PATH", "TMPDIR", "TZ", "USER")


class ProcessRunner(Runner):
    """Runs a program.

    The service ``allow_programs`` holds the programs that may be run, as plans write them: a name
    that is looked up in the path, or a full path. ``environment`` holds further variables; of
    those of this process a program gets only a few. When the program ends, or is stopped, so are
    the processes that it has started.
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
        try:
            transport, program = await asyncio.get_running_loop().subprocess_exec(
                _Program,
                *arguments,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
                env={**self._environment, "GPSFSM_KEY": context.key},
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            raise RunnerError(f"{arguments[0]} cannot be run: {error}") from error
        group = transport.get_pid()
        try:
            async with asyncio.timeout(timeout_s):
                await program.end(group)
        except TimeoutError:
            raise RunnerError(f"{arguments[0]} was stopped after {timeout_s:g} s") from None
        finally:
            await _stop(program, group)
            transport.close()
        code = transport.get_returncode() or 0
        complaints = program.text(2)
        if code != 0:
            raise RunnerError(
                f"{arguments[0]} ended with exit code {code}", stderr=complaints, exit_code=code
            )
        return {"stdout": program.text(1), "stderr": complaints, "exit_code": code}

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


class _Program(asyncio.SubprocessProtocol):
    """A program that runs: what it has written, and whether it has ended."""

    def __init__(self) -> None:
        self.exited = False
        self._written = {1: bytearray(), 2: bytearray()}
        self._open = {1, 2}
        self._changed = asyncio.Event()

    def pipe_data_received(self, fd: int, data: bytes) -> None:
        """Keep what it writes, up to one piece above the limit."""
        if len(self._written[fd]) <= _MAX_OUTPUT:
            self._written[fd] += data
        self._changed.set()

    def pipe_connection_lost(self, fd: int, exc: Exception | None) -> None:  # noqa: ARG002
        """Nobody writes there any more."""
        self._open.discard(fd)
        self._changed.set()

    def process_exited(self) -> None:
        """It has ended; what it has started may still write."""
        self.exited = True
        self._changed.set()

    async def end(self, group: int) -> None:
        """Wait for its end, then end what it leaves behind and read the rest.

        Raises RunnerError if it writes too much.
        """
        while not self.exited:
            await self.change()
        _signal(group, signal.SIGKILL)
        with suppress(TimeoutError):  # something that has left the group may keep the pipes
            async with asyncio.timeout(_POLITE_S):
                while self._open:
                    await self.change()

    async def change(self) -> None:
        """Wait until something happens. Raises RunnerError if the program has written too much."""
        await self._changed.wait()
        self._changed.clear()
        if any(len(written) > _MAX_OUTPUT for written in self._written.values()):
            raise RunnerError(f"it writes more than {_MAX_OUTPUT:,} bytes")

    async def exit(self) -> None:
        """Wait until it has ended, whatever it writes."""
        while not self.exited:
            await self._changed.wait()
            self._changed.clear()

    def text(self, fd: int) -> str:
        """What it has written."""
        return self._written[fd].decode("utf-8", "replace")


async def _stop(program: _Program, group: int) -> None:
    """End a program and all that it has started: first it is asked to."""
    try:
        if not program.exited:
            _signal(group, signal.SIGTERM)
            with suppress(TimeoutError):
                async with asyncio.timeout(_POLITE_S):
                    await program.exit()
    finally:  # also when this is cut off meanwhile
        _signal(group, signal.SIGKILL)
    await program.exit()


def _signal(group: int, number: int) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, number)
