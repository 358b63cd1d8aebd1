"""What befalls the runner instances of a plan in one run: outcomes, and how long they take."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from gpsfsm.model.event import Outcome

__all__ = ["FAULTS", "SIMPLE_MS", "Act", "Fate", "TimedScenario"]

SIMPLE_MS = 1_000
"""What an action takes if nothing else is said."""


class Fate(StrEnum):
    """What becomes of an action; the order is from plain to strange.

    LATE: it does not end within its time, is stopped and counts as failed; then its success is
    reported all the same. HANG: it never ends by itself. NO_START: its runner cannot be loaded.
    """

    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"
    LATE = "LATE"
    NO_START = "NO_START"
    HANG = "HANG"

    @property
    def outcome(self) -> Outcome:
        """The outcome that this is for a plan (semantics, 4.2); being late is failing."""
        return Outcome.FAILED if self is Fate.LATE else Outcome(self.value)


FAULTS: dict[str, Fate] = {
    "failed": Fate.FAILED,
    "late": Fate.LATE,
    "no-start": Fate.NO_START,
    "hang": Fate.HANG,
}
"""What ``--faults`` names."""


@dataclass(frozen=True, slots=True)
class Act:
    """What one instance does once it is triggered.

    ``duration_ms``, positive: until its outcome; for LATE from the end of its time until its answer
    comes; without meaning for HANG. It is a whole number of microseconds, the least of them the
    shortest of all durations: what is declared to take 0 seconds takes that long.
    """

    fate: Fate = Fate.SUCCEEDED
    duration_ms: float = SIMPLE_MS

    @property
    def duration_us(self) -> int:
        """The duration in microseconds."""
        return round(self.duration_ms * 1_000)


@dataclass(frozen=True, slots=True)
class TimedScenario:
    """An act for every runner instance of a plan, in document order."""

    acts: tuple[Act, ...]

    @property
    def faults(self) -> tuple[int, ...]:
        """The numbers of the instances that do not succeed, ascending."""
        return tuple(
            number for number, act in enumerate(self.acts) if act.fate is not Fate.SUCCEEDED
        )

    def with_act(self, number: int, act: Act) -> TimedScenario:
        """The same, but for one instance."""
        return TimedScenario((*self.acts[:number], act, *self.acts[number + 1 :]))
