"""How fast a run of the service goes, and what a client does to it meanwhile.

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

from gpsfsm.cli._drive import CONTROL, FAIL, SimulationDriver
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.virtual import VirtualDriver

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import RunValue

__all__ = ["PAUSE", "RESUME", "SPEED", "STEP", "Pace", "PacedDriver", "note"]

_SECOND = 1_000_000
_SLICE_S = 0.05
_LATE_S = 0.5
_MOST_STEPS = 10_000
PAUSE, RESUME, STEP, SPEED = "pause", "resume", "step", "speed"
_NOT_RUNNING = "this runner is not running"
_ENDING = "the run is about to end"


def note(
    what: str, *, number: int = -1, speed: float = 0.0, events: int = 1, message: str = ""
) -> Input:
    """What a client does to a run, as its journal keeps it."""
    data: dict[str, RunValue] = {CONTROL: what}
    said = {
        PAUSE: "a client lets the run stand still",
        RESUME: "a client lets the run go on",
        STEP: "a client lets one event happen",
        FAIL: message,
    }
    if what == SPEED:
        data["speed"] = speed
        slow = f"so that {speed:g} s of it pass in a second" if speed else "as fast as it can"
        said[SPEED] = f"a client lets the run go {slow}"
    if what == STEP:
        data["events"] = events
        if events > 1:
            said[STEP] = f"a client lets {events} events happen"
    return Input(Kind.NOTE, number, outputs=data, message=said[what])


@dataclass(slots=True)
class Pace:
    """The clock of a run. ``speed`` 0 is as fast as possible, ``steps`` may happen in a pause."""

    speed: float = 0.0
    paused: bool = False
    steps: int = 0
    _anchor: tuple[float, int] = field(default_factory=lambda: (time.monotonic(), 0))

    def anchor(self, now_us: int) -> None:
        """The clock goes on from here and now."""
        self._anchor = (time.monotonic(), now_us)

    def clock_us(self, now_us: int) -> int:
        """How late it is; ``now_us`` is when something has happened the last time."""
        if self.paused or not self.speed:
            return now_us
        began_s, at_us = self._anchor
        passed_us = (time.monotonic() - began_s) * self.speed * _SECOND
        return max(now_us, at_us + round(passed_us))

    def left_s(self, now_us: int, next_us: int | None) -> float:
        """How long to wait for the next event."""
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


class PacedDriver(SimulationDriver):
    """A run that a client can pause, let go on event by event, slow down and meddle with."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self.pace = Pace()
        self._wishes: deque[tuple[Input, Callable[[str], None]]] = deque()
        self._inputs = 0  # how many the kernel has taken in
        self._behind = True  # the clock has to be set: until now the past came once more
        self._at_rest = False  # nothing goes on inside of an event
        self._released = False

    # -- for clients ----------------------------------------------------------------------------

    def clock_us(self) -> int:
        """How late it is in the run."""
        now_us, next_us = self.now_us(), self.next_us()
        late_us = now_us if self._behind else self.pace.clock_us(now_us)
        return late_us if next_us is None else max(now_us, min(late_us, next_us))

    def wish(self, happened: Input, done: Callable[[str], None] = lambda _: None) -> str:
        """Do something before the next event; why not, "" if it will be tried.

        ``done`` is told when it is in the journal and done, with "", or else why it was not.
        """
        if self._released or not self._open:
            return _ENDING
        if self.in_past():
            return "the run is just being taken up again; try once more"
        if happened.outputs[CONTROL] == FAIL and not self._may_fail(happened.number):
            return _NOT_RUNNING
        self._wishes.append((happened, done))
        return ""

    def release(self) -> None:
        """It is cancelled: nothing waits any more. What a client does then is done now."""
        if self._at_rest:
            self._catch_up()
        self._released = True
        self.refuse_all()

    def refuse_all(self) -> None:
        """Nothing more is done: those who wait for it are told."""
        while self._wishes:
            _, done = self._wishes.popleft()
            done(_ENDING)

    @property
    def _open(self) -> bool:
        return self.kernel.status in (Status.QUEUED, Status.RUNNING)

    def _may_fail(self, number: int) -> bool:
        return number in self._acting and number not in self.kernel.overdue

    # -- for the run ----------------------------------------------------------------------------

    def advance(self) -> bool:
        """Let the next event happen when its time has come, or do what a client wishes."""
        if self.in_past():
            return self._one()
        if self._behind:
            self._behind = False
            self.pace.anchor(self.now_us())
        self._wait()
        if not self._wishes:
            return self._one()
        self._catch_up()
        while self._wishes and self._open:
            happened, done = self._wishes.popleft()
            if happened.outputs[CONTROL] != FAIL or self._may_fail(happened.number):
                self.mark(happened)
                done("")
            else:
                done(_NOT_RUNNING)
        self.refuse_all()  # what was done last may have ended the run
        return True

    def _one(self) -> bool:
        before = self._inputs
        moved = VirtualDriver.advance(self)
        if self._inputs != before:
            self.pace.happened(self.now_us())
        return moved

    def _deliver(self, happened: Input) -> None:
        self._inputs += 1
        super()._deliver(happened)

    def mark(self, happened: Input) -> None:
        """Write something down; what a client does is done with that."""
        super().mark(happened)
        if happened.kind is Kind.NOTE and CONTROL in happened.outputs:
            with suppress(TypeError, ValueError, OverflowError):  # of a journal that was changed
                self.pace.take(happened.outputs, self.now_us())

    def _wait(self) -> None:
        self._at_rest = True
        try:
            while not (self._wishes or self._released):
                left_s = self.pace.left_s(self.now_us(), self.next_us())
                if left_s <= 0:
                    return
                self.tick(self._clock_us())
                if not (self._wishes or self._released):
                    time.sleep(min(left_s, _SLICE_S))
        finally:
            self._at_rest = False

    def _clock_us(self) -> int:
        return self.pace.clock_us(self.now_us())
