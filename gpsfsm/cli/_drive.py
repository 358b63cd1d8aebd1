"""Drivers as the command line uses them: they can be interrupted, and slowed down."""

from __future__ import annotations

import signal
import time
from typing import TYPE_CHECKING, Any

from gpsfsm.cli._streams import complain
from gpsfsm.execution.records import Input, Kind
from gpsfsm.execution.virtual import VirtualDriver

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from types import FrameType, TracebackType
    from typing import Self

__all__ = ["Interrupt", "SimulationDriver"]

_SLICE_S = 0.05


class Interrupt:
    """While it is entered, Ctrl-C (or SIGTERM) is noted; a second one raises KeyboardInterrupt."""

    def __init__(self) -> None:
        self.asked = False
        self.action: Callable[[], None] | None = None  # what to do at the first one
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM):
            try:
                self._before[number] = signal.signal(number, self._note)
            except ValueError:  # not in the main thread: somebody else sees to signals
                break
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)
        self._before.clear()

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
        complain("the run is being cancelled; Ctrl-C again aborts it")
        if self.action is not None:
            self.action()


class SimulationDriver(VirtualDriver):
    """A run in virtual time.

    ``speed``: so many seconds of the run pass in a second; None: as fast as possible. Instances
    whose number is in ``no_start`` fail without having started, not before the time that it says;
    the kernel must have a runner for each instance then.
    """

    def __init__(
        self,
        *args: Any,
        interrupt: Interrupt,
        speed: float | None = None,
        no_start: Mapping[int, int] | None = None,
        **named: Any,
    ) -> None:
        super().__init__(*args, **named)
        self._interrupt = interrupt
        self._told = False
        self._speed = speed
        self.tick: Callable[[int], object] = lambda _: None  # told the time while nothing happens
        self.course: Callable[[], None] = super().run  # what ``run`` does
        self.interrupted: Callable[[], object] = lambda: None  # told before the run is cancelled
        self._no_start = no_start or {}
        self._began_s = time.monotonic()

    def run(self) -> None:
        """Run the plan to its end, in the way that ``course`` says."""
        self.course()

    def advance(self) -> bool:
        """Let the next event happen when its time has come; cancel first if that is asked for."""
        if self._speed is not None and self._ready:
            self._wait_until(self._ready[0][0], self._speed)
        if self._interrupt.asked and not self._told:
            self._told = True
            self.interrupted()
            self.cancel("interrupted")
            return True
        return super().advance()

    def _wait_until(self, at_us: int, speed: float) -> None:
        end_s = self._began_s + at_us / 1_000_000 / speed
        while not self._told and (left := end_s - time.monotonic()) > 0:
            if self._interrupt.asked:
                return
            self.tick(round((time.monotonic() - self._began_s) * speed * 1_000_000))
            time.sleep(min(left, _SLICE_S))

    def load(self, runner: int) -> None:
        """Load a runner, unless the scenario says that this instance does not start."""
        if runner not in self._no_start:
            super().load(runner)
            return
        failed = Input(Kind.NOT_LOADED, runner=runner, message="the scenario says so")
        self.at(max(self._now_us + 1, self._no_start[runner]), lambda: self.deliver(failed))
