"""A process that answers messages, as an event loop sees it; ``asked`` is for all others."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.workers.frames import Gone, pack, receive

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Process"]


class Process:
    """One process, with a line to it. Made by ``start``."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process

    @classmethod
    async def start(cls, command: Sequence[str]) -> Process:
        """Start it: in a session of its own, so that Ctrl-C is our business alone."""
        environment = {**os.environ, "MALLOC_ARENA_MAX": "2", "PYTHONHASHSEED": "0"}
        return cls(
            await asyncio.create_subprocess_exec(
                *command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
                env=environment,
                limit=1 << 20,
            )
        )

    @property
    def alive(self) -> bool:
        """Whether it runs, as far as is known."""
        return self._process.returncode is None

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

    async def tell(self, head: dict[str, Any], body: bytes = b"") -> None:
        """Send a message. Raises Gone, and ValueError if it is too long."""
        assert self._process.stdin is not None
        message = pack(head, body)
        try:
            self._process.stdin.write(message)
            await self._process.stdin.drain()
        except (OSError, RuntimeError):
            raise Gone(await self._how()) from None

    async def hear(self) -> tuple[dict[str, Any], bytes]:
        """The next message. Raises Gone."""
        assert self._process.stdout is not None
        try:
            return await receive(self._process.stdout)
        except (EOFError, OSError, ValueError):
            raise Gone(await self._how()) from None

    async def _how(self) -> str:
        with suppress(TimeoutError):
            async with asyncio.timeout(5):
                await self._process.wait()
        code = self._process.returncode
        if code is not None and code < 0:
            with suppress(ValueError):
                return f"was ended by {signal.Signals(-code).name}"
        return f"ended with code {code}"

    async def end(self, *, within_s: float = 0.0) -> None:
        """Let it end by closing the line, and kill it if it has not ended within that time."""
        if self._process.stdin is not None:
            with suppress(OSError, RuntimeError):
                self._process.stdin.close()
        if within_s:
            with suppress(TimeoutError):
                async with asyncio.timeout(within_s):
                    await self._process.wait()
        with suppress(ProcessLookupError):
            self._process.kill()
        await self._process.wait()
