"""Drawing scenarios: what happens in the run with this number is a function of the seed."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from gpsfsm.fuzzing.acts import SIMPLE_MS, Act, TimedScenario
from gpsfsm.fuzzing.subject import LONGEST_MS, in_ms

if TYPE_CHECKING:
    from gpsfsm.fuzzing.acts import Fate
    from gpsfsm.fuzzing.subject import Subject

__all__ = ["draw"]

_DURATIONS_MS = (1_000, 2_000, 3_000, 5_000, 8_000, 20_000)
_MOST_DECLARED = 8
_OUTLASTS = "one outlasts the others"
_TIMINGS = ("all alike", "mixed", "mixed", _OUTLASTS)
_WITHOUT_LIMIT_MS = 1_000_000
_RATES = (0.05, 0.2, 0.5)
"""How likely it is that an action does not succeed; one of them is drawn for a run."""
_MOST_ALONE = 100
"""So many instances have their faults alone, one after the other."""


def draw(subject: Subject, seed: int, index: int) -> TimedScenario:
    """The scenario of a run.

    In the first run nothing goes wrong, in the next ones each fault of each instance comes alone,
    and then there are as many as chance will have it. Durations are drawn from few values, so that
    some instances end together, within what the capability files declare. What the assumptions do
    not admit is mended.
    """
    source = random.Random(f"{seed}:{index}")  # noqa: S311  (no secret; the same everywhere)
    if index == 0:
        return subject.mended(subject.plain, source)
    alone = _alone(subject, index - 1)
    rate, timing = source.choice(_RATES), source.choice(_TIMINGS)
    slow = source.randrange(len(subject.fates))
    if alone is None and source.random() < 1 / 3:
        # one fault, while an instance goes on that is most likely beside it: a race
        number = source.randrange(len(subject.fates))
        alone = number, source.choice(subject.fates[number][1:] or subject.fates[number])
        timing = _OUTLASTS
        if source.random() < 0.5:
            slow = min(max(number + source.choice((-2, -1, 1, 2)), 0), len(subject.fates) - 1)
    durations = (*_DURATIONS_MS, *_beside_declared(subject))
    acts: list[Act] = []
    for number, fates in enumerate(subject.fates):
        fate = fates[0]
        if alone is not None:
            fate = alone[1] if number == alone[0] else fate
        elif source.random() < rate and len(fates) > 1:
            fate = source.choice(fates[1:])
        drawn: float = SIMPLE_MS
        if timing == "mixed":
            drawn = source.choice(durations)
            if not subject.bounds[number][0] <= drawn <= subject.bounds[number][1]:
                drawn = source.choice(_declared(subject, number))
        elif timing == _OUTLASTS and number == slow:
            drawn = (subject.limit_ms or _WITHOUT_LIMIT_MS) - 1
        acts.append(subject.act(number, fate, drawn))
    return subject.mended(TimedScenario(tuple(acts)), source)


def _alone(subject: Subject, index: int) -> tuple[int, Fate] | None:
    """The one fault of a run, and the instance that has it; None: they are drawn."""
    for number, fates in enumerate(subject.fates[:_MOST_ALONE]):
        if index < len(fates) - 1:
            return number, fates[1 + index]
        index -= len(fates) - 1
    return None


def _declared(subject: Subject, number: int) -> tuple[float, float, float]:
    """Of what is declared of an instance: one end, the other, and a value between them."""
    least, greatest = subject.bounds[number]
    highest = min(greatest, max(least, 20_000))
    return least, highest, in_ms(round((least + highest) * 500))


def _beside_declared(subject: Subject) -> list[float]:
    """A second more than what runners are declared to take: others may outlast them."""
    ends = {end for bounds in subject.bounds for end in bounds if 1 < end < LONGEST_MS}
    longer = (end + 1_000 for end in sorted(ends) if end >= 1_000)
    most = LONGEST_MS if subject.limit_ms is None else subject.limit_ms - 1
    return [found for found in longer if found <= most][-_MOST_DECLARED:]
