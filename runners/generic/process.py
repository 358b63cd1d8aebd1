"""Programs that the user allows, without a shell, each under a supervisor.

The supervisor (supervisor.py) is a process of its own. It holds one end of a socket, this process
the other; when this end is closed, also because this process is killed, the supervisor ends the
program with all that it has started.
"""

from __future__ import annotations

import asyncio
import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import system_reason
from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.runners.generic import number, text
from gpsfsm.workers import lift_limit

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.execution.records import RunValue

_MAX_ARGUMENTS = 1_000
_ENVIRONMENT = ("HOME", "LANG", "LC_ALL", "LOGNAME", "PATH", "TMPDIR", "TZ", "USER")
_SUPERVISOR = Path(__file__).with_name("supervisor.py")
_MAX_OUTPUT = 400_000  # bytes of each stream: decoded and together they fit into outputs
_POLITE_S = 1.0  # between asking a program to end and killing it
_PATIENCE_S = 4.5  # for the supervisor: a second to ask, two to kill, and some to get there
_DRAIN_S = 1.0
_PIECE = 65_536  # bytes
_OF_PYTHON = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")  # some builds do not start without


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
            raise RunnerError(f"{arguments[0]} cannot be run: {system_reason(error)}") from error
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
            wrong = "a quotation has no end, or nothing follows the last backslash"
            raise RunnerError(f"the command cannot be read: {wrong}") from error
        if not 0 < len(arguments) <= _MAX_ARGUMENTS:
            raise RunnerError(f"the command has {len(arguments):,} parts")
        if arguments[0] not in self._programs:
            raise RunnerError(f"the program {arguments[0][:200]!r} is not allowed")
        return arguments


class Program:
    """A program from its start to its end; to be used on one event loop.

    ``code`` is its exit code, negative for a signal.
    """

    def __init__(self, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
        """Start it. Raises OSError and ValueError if that cannot be done."""
        self.code = 0
        self._name = arguments[0]
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()
        self._said = bytearray()
        self._written = {1: bytearray(), 2: bytearray()}
        self._control, theirs = socket.socketpair()
        try:
            with theirs:
                self._process = _start_supervisor(theirs, arguments, environment)
            self._control.send(b"g")
        except BaseException:
            self._control.close()
            raise
        self._open: dict[int, int] = {}  # file descriptors, and which stream each one is
        self._listen(self._control.fileno(), 0)
        for stream, pipe in ((1, self._process.stdout), (2, self._process.stderr)):
            assert pipe is not None
            self._listen(pipe.fileno(), stream)

    def _listen(self, descriptor: int, stream: int) -> None:
        os.set_blocking(descriptor, False)
        self._open[descriptor] = stream
        self._loop.add_reader(descriptor, self._read, descriptor)

    def _read(self, descriptor: int) -> None:
        """Take what arrives; of each stream up to one piece above the limit."""
        stream = self._open[descriptor]
        try:
            piece = os.read(descriptor, _PIECE)
        except BlockingIOError:
            return
        except OSError:  # the supervisor was killed
            piece = b""
        kept = self._said if stream == 0 else self._written[stream]
        if not piece:
            self._loop.remove_reader(descriptor)
            del self._open[descriptor]
        elif len(kept) <= _MAX_OUTPUT:
            kept += piece
        self._changed.set()

    async def end(self) -> None:
        """Wait until nothing of it is left, and read all that it has written.

        Raises OSError if it could not be started, RunnerError if it writes too much or if its
        supervisor was killed.
        """
        await self._until(lambda: self._is_over)
        with suppress(TimeoutError):  # what could not be ended may keep the streams
            async with asyncio.timeout(_DRAIN_S):
                await self._until(lambda: not self._open)
        self._evaluate()

    async def _until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self._changed.clear()
            await self._changed.wait()
            if any(len(written) > _MAX_OUTPUT for written in self._written.values()):
                raise RunnerError(f"it writes more than {_MAX_OUTPUT:,} bytes")

    @property
    def _is_over(self) -> bool:
        return 0 not in self._open.values()

    def _evaluate(self) -> None:
        """Take note of how it has ended."""
        if refused := self._reported("error"):
            raise OSError(refused[0], os.strerror(refused[0]), self._name)
        ended = self._reported("ended")
        if not ended:
            raise RunnerError("the process that supervises it was killed")
        self.code = ended[0]

    def _reported(self, what: str) -> list[int]:
        """The report of the supervisor under a word."""
        for line in self._said.decode("ascii", "replace").splitlines():
            word, *numbers = line.split()
            if word == what:
                return [int(number) for number in numbers]
        return []

    @property
    def left(self) -> int:
        """The number of its processes that could not be ended."""
        ended = self._reported("ended")
        return ended[1] if ended else 0

    async def stop(self) -> None:
        """End it, with all that it has started: first it is asked to. Bounded.

        What happens before the first ``await`` is enough for the supervisor to do so.
        """
        try:
            with suppress(OSError):
                self._control.shutdown(socket.SHUT_WR)
            with suppress(TimeoutError):
                async with asyncio.timeout(_PATIENCE_S):
                    while not self._is_over:
                        self._changed.clear()
                        await self._changed.wait()
        finally:
            self._let_go()

    def _let_go(self) -> None:
        """Give back everything, and see to it that the supervisor is waited for."""
        over = self._is_over
        with suppress(RuntimeError):  # the loop is closed
            for descriptor in self._open:
                self._loop.remove_reader(descriptor)
        self._open.clear()
        self._control.close()
        for pipe in (self._process.stdout, self._process.stderr):
            assert pipe is not None
            pipe.close()
        started = self._reported("started")
        if over and started and not self._reported("ended"):  # the supervisor was killed
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(started[0], signal.SIGKILL)
        if self._process.poll() is None:
            threading.Thread(target=self._process.wait, name="reaper", daemon=True).start()

    def text(self, stream: int) -> str:
        """The text that it has written: 1 is standard output, 2 are its complaints."""
        return self._written[stream].decode("utf-8", "replace")


def _start_supervisor(
    control: socket.socket, arguments: Sequence[str], environment: Mapping[str, str]
) -> subprocess.Popen[bytes]:
    """Start a supervisor. Raises OSError and ValueError."""
    names = [name for name in environment if name and "=" not in name]
    of_python = {name: os.environ[name] for name in _OF_PYTHON if name in os.environ}
    command = [sys.executable, "-I", "-S", str(_SUPERVISOR), str(_POLITE_S), "=".join(names)]
    supervisor = subprocess.Popen(  # noqa: S603  (no shell)
        [*command, *arguments],
        stdin=control.fileno(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        bufsize=0,
        env={**of_python, **environment},
        start_new_session=True,
    )
    with suppress(OSError):  # it has ended, which is noticed elsewhere
        lift_limit(supervisor.pid)
    return supervisor
