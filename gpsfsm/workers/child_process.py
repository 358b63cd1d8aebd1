"""A child process: it is started, asked, killed when it is late, and leaves nothing behind.

What a hostile text may take down is done in one. Its side is ``parent_link``: it notices when this
process ends, and ends as well. Both fronts speak the protocol of ``frames``: ``ChildProcess`` is
for those who wait, ``AsyncChildProcess`` for event loops. Nothing heavy is imported here, so that a
child can load while its parent does.
"""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from gpsfsm.workers.frames import GoneError, pack, read, receive
from gpsfsm.workers.parent_link import kill_below

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Callable, Sequence

    from gpsfsm.workers.frames import Message

_PROGRAM = """import sys; target, *sys.path[:] = sys.argv[1:]; del sys.argv[1:]
from gpsfsm.workers.parent_link import main; main(target)"""
_END_S = 10.0
_MOST_LINE = 8_192


def child_command(target: str, *, own_modules: bool = True) -> list[str]:
    """The command for a child that runs a function without arguments: ``package.module:function``.

    It finds the modules where this process finds them, and looks into no other folder; with
    ``own_modules`` it needs those of gpsfsm alone, and looks into the working folder only if
    PYTHONPATH names it: a file beside plans must not be a module. The main program of this process
    is not run again, as ``multiprocessing`` would.
    """
    isolation = "-I" if sys.flags.isolated else "-P"
    path = _own_path() if own_modules else [folder or str(Path.cwd()) for folder in sys.path]
    return [sys.executable, isolation, "-c", _PROGRAM, target, *path]


def _own_path() -> list[str]:
    """The folders of modules without the working folder, unless it is named or gpsfsm is there."""
    try:
        here = str(Path.cwd())  # for comparison, and not for use
    except OSError:  # it was removed
        return [folder for folder in sys.path if folder]
    named = "" if sys.flags.ignore_environment else os.environ.get("PYTHONPATH", "")
    wanted = {str(Path(__file__).parents[2]), *(named.split(os.pathsep) if named else ())}
    if here in {str(Path(here, folder)) for folder in wanted}:
        return [folder or here for folder in sys.path]
    return [folder for folder in sys.path if folder not in ("", here)]


class ChildProcess:
    """A child that gives one answer to each message, in their order.

    A thread talks to it, so that nobody waits longer than is allowed. Answers go to ``inbox``,
    which children may share; None in place of an answer says that there will be none any more.
    ``silent``: what it prints to standard error goes nowhere. ``garbled``: it was killed since what
    it said was no message. ``kill`` and ``end`` may be called from any thread, all else from one.
    Raises OSError or ValueError if it cannot be started.
    """

    Inbox: TypeAlias = "queue.SimpleQueue[tuple[ChildProcess, Message | None]]"

    def __init__(
        self, command: Sequence[str], *, silent: bool = False, inbox: Inbox | None = None
    ) -> None:
        self.inbox = inbox or queue.SimpleQueue()
        self.garbled = False
        self._over = self._thread_ends = False
        self._unanswered = 0
        self._sending = threading.Lock()
        # A group of its own: Ctrl-C is the business of this process alone, which ends its children.
        self._process = subprocess.Popen(  # noqa: S603  (callers start this interpreter)
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if silent else None,
            process_group=0,
        )
        self._outbox: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._talk, daemon=True)
        try:
            self._thread.start()
        except BaseException:  # no thread is to be had: no child is left behind
            self._reap()
            raise

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """True while it runs and was not killed."""
        return not self._over and self._process.poll() is None

    def send(self, head: dict[str, Any], body: bytes = b"") -> None:
        """Send a message, to which an answer will come. Raises ValueError if it is too long."""
        message = pack(head, body)
        with self._sending:  # nothing is put behind the end, where nobody would answer it
            if self._thread_ends:
                self.inbox.put((self, None))
            else:
                self._outbox.put(message)
        self._unanswered += 1

    def next_answer(self, within_s: float) -> Message | None:
        """The next answer, where the inbox is its own; None: it has ended. Raises TimeoutError."""
        assert self._unanswered > 0, "an answer without a question would never come"
        try:
            sender, answer = self.inbox.get(timeout=max(0.0, within_s))
        except queue.Empty:
            raise TimeoutError from None
        assert sender is self, "the inbox is shared"
        self._unanswered -= 1
        return answer

    def ask(self, head: dict[str, Any], body: bytes = b"", *, within_s: float) -> Message:
        """The answer to a message. After TimeoutError or GoneError nothing more can be asked.

        Raises ValueError for a message that is too long.
        """
        assert self._unanswered == 0, "an earlier answer would be taken for this one"
        self.send(head, body)
        answer = self.next_answer(within_s)
        if answer is None:
            raise GoneError("has ended")
        return answer

    def _talk(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        while (message := self._outbox.get()) is not None:
            try:
                self._process.stdin.write(message)
                self._process.stdin.flush()
                self.inbox.put((self, read(self._process.stdout)))
            except (OSError, EOFError):
                self.inbox.put((self, None))
            except (ValueError, MemoryError):  # nothing can be understood from here on
                self.garbled = not self._over
                self._kill()
                self.inbox.put((self, None))

    def exit_code(self) -> int | None:
        """The code with which it has ended; below zero: the signal. None: it has not ended."""
        with suppress(subprocess.TimeoutExpired):
            return self._process.wait(_END_S)
        return None

    def kill(self) -> None:
        """Let it end at once, whatever it does; from any thread. Who waits gets GoneError."""
        self._over = True
        self._kill()

    def _kill(self) -> None:
        if self._process.returncode is None:
            _kill_all(self._process.pid)
        self._process.kill()

    def end(self) -> None:
        """End the process, and give back all that it took; it holds nothing that needs saving."""
        self.kill()
        with self._sending:
            self._thread_ends = True
            self._outbox.put(None)
        self._thread.join(_END_S)
        self._reap()

    def _reap(self) -> None:
        self._kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_END_S)
        if self._thread.is_alive():  # somebody outside of the group holds the pipe: do not wait
            return
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError, ValueError):
                if stream is not None:
                    stream.close()


def _kill_all(pid: int) -> None:
    """Kill a child that was not waited for, with all below it: these may hold its pipes."""
    if not hasattr(os, "killpg"):  # Windows: no groups, and no signal but an end at once
        with suppress(OSError):
            os.kill(pid, signal.SIGTERM)
        return
    kill_below(pid, itself=True)
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


async def relay(process: asyncio.subprocess.Process, line: Callable[[bytes], object]) -> None:
    """Hand over the lines of the standard error of a process, long ones in parts."""
    assert process.stderr is not None
    rest = b""
    with suppress(OSError):
        while part := await process.stderr.read(_MOST_LINE):
            *whole, rest = (rest + part).split(b"\n")
            if len(rest) >= _MOST_LINE:
                whole, rest = [*whole, rest], b""
            for each in whole:
                line(each)
    if rest:
        line(rest)


class AsyncChildProcess:
    """A child as an event loop sees it; messages may go both ways at any time. See ``start``."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process
        self._relay: asyncio.Task[None] | None = None

    @classmethod
    async def start(
        cls, command: Sequence[str], *, line: Callable[[bytes], object] | None = None
    ) -> AsyncChildProcess:
        """Start it, in a session of its own: Linux may share the cores among sessions.

        ``line`` gets each line of its standard error, which else is that of this process.
        """
        import asyncio  # a gate needs none

        environment = {**os.environ, "MALLOC_ARENA_MAX": "2", "PYTHONHASHSEED": "0"}
        child = cls(
            await asyncio.create_subprocess_exec(
                *command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=None if line is None else subprocess.PIPE,
                start_new_session=True,
                env=environment,
                limit=1 << 20,
            )
        )
        if line is not None:
            child._relay = asyncio.create_task(relay(child._process, line))
        return child

    @property
    def alive(self) -> bool:
        """True while it runs; the system is asked, since the event loop learns it a little later.

        Where the system cannot be asked, as on older systems of Apple, the loop has to do.
        """
        if self._process.returncode is not None or not hasattr(os, "waitid"):
            return self._process.returncode is None
        try:
            how = os.WEXITED | os.WNOHANG | os.WNOWAIT  # whoever waits for it still does
            return os.waitid(os.P_PID, self._process.pid, how) is None
        except ChildProcessError:  # it was waited for
            return False

    @property
    def code(self) -> int | None:
        """The code with which it has ended; below zero: the signal. None: it runs."""
        return self._process.returncode

    def cpu_s(self) -> float | None:
        """The seconds of a core that it has used; None where nobody can say."""
        try:
            stat = Path(f"/proc/{self._process.pid}/stat").read_text(encoding="utf-8")
            used = [int(field) for field in stat.rpartition(")")[2].split()[11:13]]
            return sum(used) / os.sysconf("SC_CLK_TCK")
        except (OSError, ValueError):
            return None

    async def ended(self) -> None:
        """Wait until it runs no more."""
        await self._process.wait()

    async def send(self, head: dict[str, Any], body: bytes = b"") -> None:
        """Send a message. Raises GoneError, and ValueError if it is too long."""
        assert self._process.stdin is not None
        message = pack(head, body)
        try:
            self._process.stdin.write(message)
            await self._process.stdin.drain()
        except (OSError, RuntimeError):
            raise GoneError(await self._how()) from None

    async def receive(self) -> Message:
        """The next message. Raises GoneError."""
        assert self._process.stdout is not None
        try:
            return await receive(self._process.stdout)
        except (EOFError, OSError, ValueError):
            raise GoneError(await self._how()) from None

    async def _how(self) -> str:
        import asyncio

        with suppress(TimeoutError):
            async with asyncio.timeout(_END_S / 2):
                await self._process.wait()
        code = self._process.returncode
        if code is not None and code < 0:
            with suppress(ValueError):
                return f"was ended by {signal.Signals(-code).name}"
        return f"ended with code {code}"

    async def end(self, *, within_s: float = 0.0) -> None:
        """Let it end by closing the pipe, and kill it if it has not ended within that time."""
        import asyncio

        if self._process.stdin is not None:
            with suppress(OSError, RuntimeError):
                self._process.stdin.close()
        if within_s:
            with suppress(TimeoutError):
                async with asyncio.timeout(within_s):
                    await self._process.wait()
        if self.code is None:  # not by its own method, which may wait for it before the loop does
            _kill_all(self._process.pid)
        await self._process.wait()
