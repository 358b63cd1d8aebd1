"""The bond: a client keeps a plan running by beating; when the beats stop, so does the plan.

A lease of ``timeout_s`` seconds begins when the bond is watched and again with every beat. Once a
lease has run out, the bond is lost, and no later beat brings it back: ``renew`` does, which a
client says knowingly. Time is that of the clock that watches, so a bond is as deterministic as
what it watches.
"""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Callable

_SECOND = 1_000_000
_MOST_INPUT = 65_536  # bytes at once


class Clock(Protocol):
    """Time that passes, virtual (``VirtualDriver``, ``VirtualQueue``) or real (``LoopClock``)."""

    def now_us(self) -> int:
        """Microseconds since some beginning."""

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time; for a time that has passed, next."""


class LoopClock:
    """The clock of an asyncio event loop, from zero."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._began = loop.time()

    def now_us(self) -> int:
        """Microseconds since this clock was made."""
        return round((self._loop.time() - self._began) * _SECOND)

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time, from the event loop."""
        self._loop.call_at(self._began + at_us / _SECOND, action)


class Bond:
    """A lease that a client renews by heartbeats.

    For one run::

        bond = Bond(10.0)
        bond.watch(driver, lost=driver.cancel)

    A plan queue watches its bond itself. Raises UsageError for a timeout that is not positive.
    """

    def __init__(self, timeout_s: float) -> None:
        if not 0 < timeout_s < 1e9:
            raise UsageError(f"a bond must have a timeout above 0 seconds, not {timeout_s}")
        self.timeout_s = timeout_s
        self._timeout_us = max(1, round(timeout_s * _SECOND))
        self._clock: Clock | None = None
        self._lost: Callable[[str], None] = lambda _: None
        self._renewed: Callable[[], None] = lambda: None
        self._until_us = 0  # the last instant of the lease
        self._armed = False  # a look at the lease is planned
        self._held = True

    @property
    def held(self) -> bool:
        """True if the lease still holds; false also between its end and the reaction to it."""
        return self._held and (self._clock is None or self._clock.now_us() <= self._until_us)

    def watch(
        self,
        clock: Clock,
        *,
        lost: Callable[[str], None],
        renewed: Callable[[], None] | None = None,
    ) -> None:
        """Begin the lease. ``lost`` is called once for every loss, with the reason.

        Raises UsageError if the bond is watched already.
        """
        if self._clock is not None:
            raise UsageError("a bond can be watched only once")
        self._clock, self._lost = clock, lost
        if renewed is not None:
            self._renewed = renewed
        self._extend()

    def beat(self) -> bool:
        """Begin the lease anew. False if the bond is lost: then nothing has changed."""
        if self._clock is None:
            return self._held
        if not self.held:
            if self._held:  # it has run out: the look that was planned may be late in real time
                self._lose(self._silence())
            return False
        self._extend()
        return True

    def release(self, reason: str = "the client has left") -> None:
        """Give the bond up at once, as a client does that leaves in good order."""
        if self._held:
            self._lose(reason)

    def renew(self) -> None:
        """Take up a lost bond again. What was stopped stays stopped."""
        if self._clock is None or self.held:
            self.beat()
            return
        if self._held:  # it has run out, and that has had no effect yet
            self._lose(self._silence())
        self._held = True
        self._extend()
        self._clock.at(self._clock.now_us(), self._renewed)

    def _extend(self) -> None:
        assert self._clock is not None
        self._until_us = self._clock.now_us() + self._timeout_us
        self._arm()

    def _arm(self) -> None:
        """Plan one look at a time; beats only move the end that it will find."""
        if not self._armed:
            assert self._clock is not None
            self._armed = True
            self._clock.at(self._until_us + 1, self._look)

    def _look(self) -> None:
        assert self._clock is not None
        self._armed = False
        if not self._held:
            return
        if self.held:
            self._arm()
        else:
            self._held = False
            self._lost(self._silence())

    def _silence(self) -> str:
        return f"the bond is lost: no beat for {self.timeout_s:g} s"

    def _lose(self, reason: str) -> None:
        """Tell the watcher, from the clock: the caller may be in the middle of something."""
        self._held = False
        lost = self._lost
        if self._clock is not None:
            self._clock.at(self._clock.now_us(), lambda: lost(reason))


def beat_on_input(bond: Bond, loop: asyncio.AbstractEventLoop) -> None:
    """Let the bond beat with every line that comes in, and release it at the end of the input.

    A thread of its own waits for lines; it ends with the process.
    """

    def listen() -> None:
        with suppress(RuntimeError):  # the event loop is closed: the run is over
            with suppress(OSError, ValueError, AttributeError):
                number = sys.stdin.fileno()
                # past the buffers of Python, whose lock this thread must not hold at the end
                while part := os.read(number, _MOST_INPUT):
                    if b"\n" in part:
                        loop.call_soon_threadsafe(bond.beat)
            loop.call_soon_threadsafe(bond.release, "the bond is lost: the input has ended")

    threading.Thread(target=listen, name="bond", daemon=True).start()
