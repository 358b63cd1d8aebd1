"""Groups of graded answers in numbers."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.evaluation.confusion import Confusion, confusion_of
from gpsfsm.evaluation.moments import Moments, combined, moments_of, pooled_deviation

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.grading import Grade

__all__ = ["Entry", "Group", "Summary", "over", "summarize"]


@dataclass(frozen=True, slots=True)
class Entry:
    """One answer: its grade, that of people, and how many seconds the model took, if known."""

    grade: Grade
    human: Grade | None = None
    seconds: float | None = None


@dataclass(frozen=True, slots=True)
class Summary:
    """Some answers: how many have which grade, here and from people, and what they took.

    ``times`` are the moments of all times together. ``pooled`` is their deviation within the groups
    that were put together; one group alone has none.
    """

    grades: Mapping[Grade, int]
    people: Mapping[Grade, int]
    confusion: Confusion
    times: Moments | None
    pooled: float | None

    @property
    def answers(self) -> int:
        """How many answers there are."""
        return sum(self.grades.values())


@dataclass(frozen=True, slots=True)
class Group:
    """A row of a table: what its answers have in common, by column, and the answers in numbers."""

    names: tuple[str, ...]
    summary: Summary


def summarize(entries: Iterable[Entry]) -> Summary:
    """One group in numbers."""
    found = list(entries)
    return Summary(
        grades=Counter(entry.grade for entry in found),
        people=Counter(entry.human for entry in found if entry.human is not None),
        confusion=confusion_of((entry.human, entry.grade) for entry in found),
        times=moments_of(entry.seconds for entry in found if entry.seconds is not None),
        pooled=None,
    )


def over(groups: Sequence[Summary]) -> Summary:
    """Several groups in numbers; each must be one group, not a summary over groups."""
    grades: Counter[Grade] = Counter()
    people: Counter[Grade] = Counter()
    pairs: Counter[tuple[Grade, Grade]] = Counter()
    for group in groups:
        grades.update(group.grades)
        people.update(group.people)
        pairs.update(group.confusion.counts)
    times = [group.times for group in groups if group.times is not None]
    return Summary(grades, people, Confusion(pairs), combined(times), pooled_deviation(times))
