"""Runs the command line on a terminal of its own, as a user at a keyboard does."""

from __future__ import annotations

import os
import pty
import select
import signal
import sys
import termios
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from tests.cli.support import environment

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from types import TracebackType
    from typing import Self

__all__ = ["SPACE_PAUSES", "Terminal", "gpsfsm"]

PATIENCE_S = 30.0
SPACE_PAUSES = "space pauses, q cancels"


def gpsfsm(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "gpsfsm", *arguments]


class Terminal:
    """A terminal with a process that it controls."""

    def __init__(self, command: Sequence[str], folder: Path, **variables: str) -> None:
        self.pid, self.number = pty.fork()
        if not self.pid:
            try:
                os.chdir(folder)
                os.execve(command[0], command, environment(TERM="xterm", **variables))  # noqa: S606
            finally:
                os._exit(127)
        self.shown = ""
        self.code: int | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.code is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
        with suppress(OSError):
            os.close(self.number)

    @property
    def is_raw(self) -> bool:
        """Whether keys come without a line end, and are not shown."""
        flags = termios.tcgetattr(self.number)[3]
        assert bool(flags & termios.ECHO) == bool(flags & termios.ICANON)
        return not flags & termios.ICANON

    def until(self, text: str) -> str:
        """Everything that is shown up to a text, which must come."""
        end_s = time.monotonic() + PATIENCE_S
        while text not in self.shown:
            assert time.monotonic() < end_s, (text, self.shown[-2000:])
            self._read()
        found, _, self.shown = self.shown.partition(text)
        return found

    def type(self, keys: str) -> None:
        os.write(self.number, keys.encode())

    def ended(self) -> int:
        """Wait for the end; the exit code, negative for a signal. What is left is in ``shown``."""
        end_s = time.monotonic() + PATIENCE_S
        while not (found := os.waitpid(self.pid, os.WNOHANG))[0]:
            assert time.monotonic() < end_s, self.shown[-2000:]
            self._read()
        self.code = os.waitstatus_to_exitcode(found[1])
        while self._read():
            pass
        return self.code

    def _read(self) -> bool:
        try:
            if not select.select([self.number], [], [], 0.05)[0]:
                return False
            part = os.read(self.number, 65_536)
        except OSError:  # nobody has it open any more
            return False
        self.shown += part.decode("utf-8", "replace")
        return bool(part)
