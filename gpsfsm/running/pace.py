"""The pace of runs in virtual time: as fast as possible, slowed down, or as a client wants it.

Whatever a client does is a NOTE in the journal before it is done. So a run that goes on in another
process is paused if it was, and an instance that was made to fail fails again.
"""

from __future__ import annotations

import math
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.virtual import Pacing
from gpsfsm.running.interruption import REASON, Interruption

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.replay import Comparing
    from gpsfsm.execution.virtual import VirtualDriver

CONTROL, FAIL = "control", "fail"
"""In the data of a NOTE: that somebody does something to the run, and that an instance fails."""

PAUSE, RESUME, STEP, SPEED = "pause", "resume", "step", "speed"

_SECOND = 1_000_000
_SLICE_S = 0.05
_LATE_S = 0.5
_MOST_STEPS = 10_000
_PAUSABLE = (Status.QUEUED, Status.RUNNING)
_NOT_RUNNING = "this runner is not running"
_ENDING = "the run is about to end"


class Pace(Pacing):
    """As fast as possible; an instance fails if a NOTE says so.

    ``tick`` gets the time of the run again and again while nothing happens, ``past`` is the sink of
    a run that is simulated again, ``driver`` that of the run.
    """

    driver: VirtualDriver

    def __init__(self) -> None:
        self.tick: Callable[[int], object] = lambda _: None
        self.past: Comparing | None = None

    @property
    def in_past(self) -> bool:
        """True while what has happened already happens once more: nobody may intervene there."""
        return self.past is not None and self.past.next is not None

    def before_run(self, driver: VirtualDriver) -> None:
        """A run is about to begin."""

    def over(self) -> None:
        """The run has ended."""

    def noted(self, driver: VirtualDriver, note: Input) -> None:
        """Let an instance fail, when that is written and whenever the run is simulated again."""
        if note.outputs.get(CONTROL) == FAIL:
            driver.fail(note.number, note.message)


class InterruptiblePace(Pace):
    """The pace of a command: somebody may interrupt it, or let the run pause.

    ``speed``: so many seconds of the run pass in a second; None: as fast as possible.
    ``interrupted`` is called before the run is cancelled.
    """

    def __init__(
        self,
        interruption: Interruption,
        speed: float | None = None,
        interrupted: Callable[[], object] = lambda: None,
    ) -> None:
        super().__init__()
        self._interruption = interruption
        self._interrupted = interrupted
        self._cancelled = False
        self._paused = False  # what was heeded last
        self._speed = speed
        self._began_s = time.monotonic()

    def before_run(self, driver: VirtualDriver) -> None:
        """A pause outlasts the plan before."""
        self._heed(driver)

    def before_event(self, driver: VirtualDriver) -> bool:
        """Wait for the time of the next event, and heed who intervenes meanwhile."""
        if self.in_past:
            return False
        self._wait(driver)
        if self._interruption.requested and not self._cancelled:
            self._cancelled = True
            self._catch_up(driver)
            self._interrupted()
            driver.cancel(REASON)
            return True
        return self._heed(driver)

    def _heed(self, driver: VirtualDriver) -> bool:
        """Pause or go on, if somebody wants that; whether something has changed."""
        if not self._turned():
            return False
        self._paused = self._interruption.paused
        kernel = driver.kernel
        if self._paused is kernel.paused or kernel.status not in _PAUSABLE:
            return False
        self._catch_up(driver)
        driver.deliver(Input(Kind.PAUSE if self._paused else Kind.RESUME))
        return True

    def _turned(self) -> bool:
        return self._interruption.paused is not self._paused

    def _wait(self, driver: VirtualDriver) -> None:
        """Wait for the next event, and for ever while a pause lets nothing happen."""
        kernel = driver.kernel
        while not (self._cancelled or self._interruption.requested or self._turned()):
            at_us, left_s = driver.next_us(), 0.0
            if at_us is None and kernel.paused and kernel.status is Status.RUNNING:
                left_s = _SLICE_S
            elif at_us is not None and self._speed is not None:
                left_s = self._began_s + at_us / _SECOND / self._speed - time.monotonic()
            if left_s <= 0:
                return
            self.tick(self._clock_us(driver))
            time.sleep(min(left_s, _SLICE_S))

    def _clock_us(self, driver: VirtualDriver) -> int:
        """The time of the run; without a speed, time stands still while nothing happens."""
        if self._speed is None:
            return driver.now_us()
        return round((time.monotonic() - self._began_s) * self._speed * _SECOND)

    def _catch_up(self, driver: VirtualDriver) -> None:
        """Whoever intervenes does so now, not at the time of the last event."""
        at_us, clock_us = driver.next_us(), self._clock_us(driver)
        driver.pass_to(clock_us if at_us is None else min(clock_us, at_us - 1))


# -- clients ----------------------------------------------------------------------------------


def note(
    what: str, *, number: int = -1, speed: float = 0.0, events: int = 1, message: str = ""
) -> Input:
    """The NOTE about what a client does to a run."""
    data: dict[str, RunValue] = {CONTROL: what}
    text = {
        PAUSE: "a client has paused the run",
        RESUME: "a client has continued the run",
        STEP: "a client has stepped the run by one event",
        FAIL: message,
    }
    if what == SPEED:
        data["speed"] = speed
        pace = f"{speed:g} s of the run per second" if speed else "as fast as possible"
        text[SPEED] = f"a client has set the speed: {pace}"
    if what == STEP:
        data["events"] = events
        if events > 1:
            text[STEP] = f"a client has stepped the run by {events} events"
    return Input(Kind.NOTE, number, outputs=data, message=text[what])


@dataclass(slots=True)
class Clock:
    """The clock of a run. ``speed`` 0 is as fast as possible, ``steps`` may happen in a pause."""

    speed: float = 0.0
    paused: bool = False
    steps: int = 0
    _anchor: tuple[float, int] = field(default_factory=lambda: (time.monotonic(), 0))

    def anchor(self, now_us: int) -> None:
        """The clock goes on from here and now."""
        self._anchor = (time.monotonic(), now_us)

    def clock_us(self, now_us: int) -> int:
        """The time of the run; ``now_us`` is when something has happened the last time."""
        if self.paused or not self.speed:
            return now_us
        began_s, at_us = self._anchor
        passed_us = (time.monotonic() - began_s) * self.speed * _SECOND
        return max(now_us, at_us + round(passed_us))

    def left_s(self, now_us: int, next_us: int | None) -> float:
        """The seconds to wait for the next event."""
        if self.paused:
            return 0.0 if self.steps else math.inf
        if next_us is None or not self.speed:
            return 0.0
        return (next_us - self.clock_us(now_us)) / _SECOND / self.speed

    def happened(self, now_us: int) -> None:
        """An event has happened; if it came late, the rest does not hurry."""
        self.steps = max(0, self.steps - 1)
        if self.speed and self.clock_us(now_us) - now_us > _LATE_S * self.speed * _SECOND:
            self.anchor(now_us)

    def take(self, data: Mapping[str, Any], now_us: int) -> None:
        """A client does something."""
        what = data[CONTROL]
        if what in (PAUSE, STEP):
            self.paused = True
        if what == RESUME:
            self.paused, self.steps = False, 0
        elif what == STEP:
            self.steps = min(self.steps + int(data.get("events", 1)), _MOST_STEPS)
        elif what == SPEED:
            self.speed = float(data.get("speed", 0.0))
        if what != FAIL:
            self.anchor(now_us)


class ClientPace(Pace):
    """The pace of a run that a client can pause, step, slow down and meddle with."""

    def __init__(self, *, speed: float = 0.0, paused: bool = False) -> None:
        super().__init__()
        self.clock = Clock(speed, paused)
        self._wishes: deque[tuple[Input, Callable[[str], None]]] = deque()
        self._inputs = 0  # how many there were before the event that happens
        self._behind = True  # the clock has to be set: until now the past came once more
        self._at_rest = False  # nothing goes on inside of an event
        self._released = False

    # -- for clients ----------------------------------------------------------------------------

    def clock_us(self) -> int:
        """The time of the run."""
        now_us, next_us = self.driver.now_us(), self.driver.next_us()
        late_us = now_us if self._behind else self.clock.clock_us(now_us)
        return late_us if next_us is None else max(now_us, min(late_us, next_us))

    def wish(self, happened: Input, done: Callable[[str], None] = lambda _: None) -> str:
        """Do something before the next event; why not, "" if it will be tried.

        ``done`` is called when it is in the journal and done, with "", or else why it was not.
        """
        if self._released or not self._open:
            return _ENDING
        if self.in_past:
            return "the run is being resumed; try again"
        if happened.outputs[CONTROL] == FAIL and not self.driver.may_fail(happened.number):
            return _NOT_RUNNING
        self._wishes.append((happened, done))
        return ""

    def release(self) -> None:
        """It is cancelled: nothing waits any more. What a client does then is done now."""
        if self._at_rest:
            self._catch_up()
        self._released = True
        self._refuse_all()

    def over(self) -> None:
        """Nothing more is done: those who wait for it get an answer."""
        self._refuse_all()

    def _refuse_all(self) -> None:
        while self._wishes:
            _, done = self._wishes.popleft()
            done(_ENDING)

    @property
    def _open(self) -> bool:
        return self.driver.kernel.status in _PAUSABLE

    # -- for the run ----------------------------------------------------------------------------

    def before_event(self, driver: VirtualDriver) -> bool:
        """Wait for the time of the next event, or do what a client wishes."""
        self._inputs = driver.inputs
        if self.in_past:
            return False
        if self._behind:
            self._behind = False
            self.clock.anchor(driver.now_us())
        self._wait()
        if not self._wishes:
            self._inputs = driver.inputs
            return False
        self._catch_up()
        while self._wishes and self._open:
            happened, done = self._wishes.popleft()
            if happened.outputs[CONTROL] != FAIL or driver.may_fail(happened.number):
                driver.mark(happened)
                done("")
            else:
                done(_NOT_RUNNING)
        self._refuse_all()  # what was done last may have ended the run
        return True

    def after_event(self, driver: VirtualDriver) -> None:
        """Steps count what the kernel has taken in; other events are parts of those."""
        if driver.inputs != self._inputs:
            self.clock.happened(driver.now_us())

    def noted(self, driver: VirtualDriver, note: Input) -> None:
        """Do what a client does when it is written."""
        super().noted(driver, note)
        if CONTROL in note.outputs:
            with suppress(TypeError, ValueError, OverflowError):  # of a journal that was changed
                self.clock.take(note.outputs, driver.now_us())

    def _wait(self) -> None:
        driver = self.driver
        self._at_rest = True
        try:
            while not (self._wishes or self._released):
                left_s = self.clock.left_s(driver.now_us(), driver.next_us())
                if left_s <= 0:
                    return
                self.tick(self.clock.clock_us(driver.now_us()))
                if not (self._wishes or self._released):
                    time.sleep(min(left_s, _SLICE_S))
        finally:
            self._at_rest = False

    def _catch_up(self) -> None:
        """Whoever intervenes does so now, not at the time of the last event."""
        driver = self.driver
        at_us, clock_us = driver.next_us(), self.clock.clock_us(driver.now_us())
        driver.pass_to(clock_us if at_us is None else min(clock_us, at_us - 1))
