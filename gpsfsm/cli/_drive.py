"""Drivers as the command line uses them: they can be interrupted, and slowed down."""

from __future__ import annotations

import signal
import time
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.streams import urgent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from types import FrameType, TracebackType
    from typing import Self

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.virtual import _Action

__all__ = ["CONTROL", "FAIL", "Interrupt", "SimulationDriver"]

CONTROL, FAIL = "control", "fail"
"""In the data of a NOTE: that somebody does something to the run, and that an instance fails."""

_SECOND = 1_000_000
_SLICE_S = 0.05
_MOST_TOLD = 1_000  # by one instance
_PAUSABLE = (Status.QUEUED, Status.RUNNING)
_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


_CANCELLING = "gpsfsm: the run is being cancelled"
_ABORTING = {
    number: f"{_CANCELLING} because of {number.name}; another one aborts it\n"
    for number in _SIGNALS
} | {signal.SIGINT: f"{_CANCELLING}; Ctrl-C again aborts it\n"}


class Interrupt:
    """While it is entered, Ctrl-C (or SIGTERM) is noted; a second one raises KeyboardInterrupt.

    So is the end of the terminal (SIGHUP), unless that is to be ignored. ``paused`` says whether
    somebody wants the run to pause.
    """

    def __init__(self) -> None:
        self.asked = False
        self.paused = False
        self.action: Callable[[], None] | None = None  # what to do at the first one
        self.turned: Callable[[bool], None] | None = None  # is told when ``paused`` changes
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in _SIGNALS:
            if number != signal.SIGINT and signal.getsignal(number) is signal.SIG_IGN:
                continue  # by nohup, say
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

    def toggle(self) -> None:
        """Pause, or go on; may be called from any thread."""
        self.paused = not self.paused
        if self.turned is not None:
            self.turned(self.paused)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
        urgent(_ABORTING.get(number, _ABORTING[signal.SIGINT]))
        if self.action is not None:
            self.action()


class SimulationDriver(VirtualDriver):
    """A run in virtual time.

    ``speed``: so many seconds of the run pass in a second; None: as fast as possible. Instances
    whose number is in ``no_start`` fail without having started, not before the time that it says;
    the kernel must have a runner for each instance then. A NOTE that lets an instance fail does so,
    when it is written and whenever the run is simulated again.
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
        self._paused = False  # what was heeded last
        self._speed = speed
        self.tick: Callable[[int], object] = lambda _: None  # told the time while nothing happens
        self.course: Callable[[], None] = super().run  # what ``run`` does
        self.interrupted: Callable[[], object] = lambda: None  # told before the run is cancelled
        self.in_past: Callable[[], bool] = lambda: False  # what has happened happens once more
        self._no_start = no_start or {}
        self._began_s = time.monotonic()
        self._turn = -1  # the instance that acts now, or did last
        self._abandoned = False

    def run(self) -> None:
        """Run the plan to its end, in the way that ``course`` says."""
        self.course()

    def advance(self) -> bool:
        """Let the next event happen when its time has come, unless somebody intervenes."""
        if self.in_past():
            return super().advance()
        self._wait()
        if self._cancelled():
            self._told = True
            self._catch_up()
            self.interrupted()
            self.cancel("interrupted")
            return True
        return self.heed() or super().advance()

    def heed(self) -> bool:
        """Pause or go on, if somebody wants that; whether something has changed."""
        if not self._turned():
            return False
        self._paused = self._interrupt.paused
        if self._paused is self.kernel.paused or self.kernel.status not in _PAUSABLE:
            return False
        self._catch_up()
        self.deliver(Input(Kind.PAUSE if self._paused else Kind.RESUME))
        return True

    def _cancelled(self) -> bool:
        return self._interrupt.asked and not self._told

    def _turned(self) -> bool:
        return self._interrupt.paused is not self._paused

    def _wait(self) -> None:
        """Wait for the next event, and for ever while a pause lets nothing happen."""
        while not (self._told or self._interrupt.asked or self._turned()):
            at_us, left_s = self.next_us(), 0.0
            if at_us is None and self.kernel.paused and self.kernel.status is Status.RUNNING:
                left_s = _SLICE_S
            elif at_us is not None and self._speed is not None:
                left_s = self._left_s(at_us, self._speed)
            if left_s <= 0:
                return
            self.tick(self._clock_us())
            time.sleep(min(left_s, _SLICE_S))

    def _left_s(self, at_us: int, speed: float) -> float:
        return self._began_s + at_us / _SECOND / speed - time.monotonic()

    def _clock_us(self) -> int:
        """How late it is; without a speed, time stands still while nothing happens."""
        if self._speed is None:
            return self.now_us()
        return round((time.monotonic() - self._began_s) * self._speed * _SECOND)

    def _catch_up(self) -> None:
        """Whoever intervenes does so now, not at the time of the last event."""
        at_us = self.next_us()
        self.pass_to(self._clock_us() if at_us is None else min(self._clock_us(), at_us - 1))

    def load(self, runner: int) -> None:
        """Load a runner, unless the scenario says that this instance does not start."""
        if runner not in self._no_start:
            super().load(runner)
            return
        failed = Input(Kind.NOT_LOADED, runner=runner, message="the scenario says so")
        self.at(max(self._now_us + 1, self._no_start[runner]), lambda: self.deliver(failed))

    # -- what is written down besides -----------------------------------------------------------

    def mark(self, happened: Input) -> None:
        """Write something down; what somebody does to the run is done with that."""
        if self._abandoned:  # whatever runners do then is no part of the run
            return
        super().mark(happened)
        if happened.kind is Kind.NOTE and happened.outputs.get(CONTROL) == FAIL:
            self._let_fail(happened)

    def _let_fail(self, happened: Input) -> None:
        number, action = happened.number, self._acting.get(happened.number)
        if action is not None and not action.stopping:
            self._give_up(number, happened.message)

    def tell(self, what: str, data: Mapping[str, RunValue], words: str, /) -> None:
        """Write down what has happened in the world, for those who draw a map of the run."""
        number = self._turn
        count = self._lines[number] = self._lines.get(number, 0) + 1
        if count <= _MOST_TOLD and not self.kernel.status.ended:
            self.mark(Input(Kind.LOG, number, outputs={"world": what, **data}, message=words))

    def _go_on(self, number: int, action: _Action, throw: BaseException | None = None) -> None:
        self._turn = number
        super()._go_on(number, action, throw)

    def _end(self, action: _Action) -> None:
        self._turn = action.context.number
        super()._end(action)

    def abandon(self) -> None:
        """Stop all that still acts, and let go of the runners."""
        self._abandoned = True
        super().abandon()
