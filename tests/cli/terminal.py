"""Runs the command line on a terminal of its own, as a user at a keyboard does."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import termios
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from tests.cli.support import environment
from tests.forked import Forked, can_fork, take_terminal

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path
    from types import TracebackType
    from typing import Self

__all__ = ["PATIENCE_S", "SPACE_PAUSES", "Terminal", "gpsfsm"]

PATIENCE_S = 30.0
SPACE_PAUSES = "space pauses, q cancels"


def gpsfsm(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "gpsfsm", *arguments]


def _start(
    command: Sequence[str], folder: Path, around: Mapping[str, str], terminal: int
) -> subprocess.Popen[bytes]:
    if command[:3] == gpsfsm() and can_fork(around):
        return Forked(
            command[3:],
            cwd=folder,
            environment=around,
            stdin=terminal,
            stdout=terminal,
            stderr=terminal,
            leads=True,
        )
    return subprocess.Popen(
        command,
        cwd=folder,
        env=around,
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        start_new_session=True,
        preexec_fn=take_terminal,  # noqa: PLW1509  (it takes no lock)
    )


class Terminal:
    """A terminal with a process that it controls: ``gpsfsm(…)`` or another command."""

    def __init__(self, command: Sequence[str], folder: Path, **variables: str) -> None:
        around = environment(TERM="xterm", **variables)
        self.number, theirs = os.openpty()
        try:
            self.process = _start(command, folder, around, theirs)
        finally:
            os.close(theirs)
        self.shown = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.process.kill()
        self.process.wait()
        with suppress(OSError):
            os.close(self.number)

    @property
    def pid(self) -> int:
        return self.process.pid

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
        before, _, self.shown = self.shown.partition(text)
        return before

    def type(self, keys: str) -> None:
        os.write(self.number, keys.encode())

    def ended(self) -> int:
        """Wait for the end; the exit code, negative for a signal. What is left is in ``shown``."""
        end_s = time.monotonic() + PATIENCE_S
        while (code := self.process.poll()) is None:
            assert time.monotonic() < end_s, self.shown[-2000:]
            self._read()
        while self._read():
            pass
        return code

    def _read(self) -> bool:
        try:
            if not select.select([self.number], [], [], 0.05)[0]:
                return False
            part = os.read(self.number, 65_536)
        except OSError:  # nobody has it open any more
            return False
        self.shown += part.decode("utf-8", "replace")
        return bool(part)
