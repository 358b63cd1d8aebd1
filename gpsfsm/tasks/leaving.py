"""A run that leaves the task: its events up to there, and what it decides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.model.event import End, Event, Outcome

if TYPE_CHECKING:
    from gpsfsm.tasks.monitor import Monitor, MState, Violation
    from gpsfsm.tasks.plays import Plays, Position

__all__ = ["Left", "Trail", "left_at_end", "left_by", "worse"]


@dataclass(frozen=True, slots=True)
class Left:
    """A run that leaves the task: its events up to there, its outcomes by number, and why."""

    violation: Violation
    events: tuple[tuple[Event, int], ...]
    outcomes: dict[int, Outcome]

    @property
    def failing(self) -> tuple[int, ...]:
        """The instances that fail before the task is left, ascending."""
        failed = {number for event, number in self.events if event is Event.FAILED}
        silent = {number for number, each in self.outcomes.items() if each is Outcome.NO_START}
        return tuple(sorted(failed | silent))


Trail = tuple["Trail", Event | Outcome, int] | None
"""What happened, backwards: an event, or that an instance hangs or does not start."""


def worse(position: Position, event: Event | Outcome, number: int) -> bool:
    """Whether this adds to the outcomes other than SUCCEEDED, at a position before it."""
    if event is Outcome.NO_START:
        return True
    return event is Event.FAILED and not position.silent >> number + 1 & 1


def left_by(violation: Violation, trail: Trail) -> Left:
    """The run that led to a violation."""
    events: list[tuple[Event, int]] = []
    outcomes: dict[int, Outcome] = {}
    while trail is not None:
        trail, event, number = trail
        if isinstance(event, Outcome):
            outcomes[number] = event
        else:
            events.append((event, number))
            if event is not Event.STARTED:
                outcomes.setdefault(number, Outcome(event.value))
    return Left(violation, tuple(reversed(events)), outcomes)


def left_at_end(
    plays: Plays, monitor: Monitor, position: Position, state: MState, trail: Trail
) -> Left | None:
    """The run, if it can end at this position and leaves the task by that."""
    end, hanging = position.end, plays.stuck(position)
    if end is None and hanging is not None:
        end = End.STUCK
        for number in hanging:
            trail = (trail, Outcome.HANG, number)
    if end is None or position.waiting:
        return None
    violation = monitor.at_end(state, end, hanging=bool(hanging))
    return None if violation is None else left_by(violation, trail)
