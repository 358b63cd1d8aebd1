"""How far two who grade the same answers agree: people and gpsfsm."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.grading import Grade

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["GRADES", "Confusion", "confusion_of"]

GRADES = (Grade.SUCCESS, Grade.PARTIAL, Grade.FAILED)
"""The grades that people give."""


@dataclass(frozen=True, slots=True)
class Confusion:
    """``counts``: the number of answers by the grade that people gave and the one given here."""

    counts: Mapping[tuple[Grade, Grade], int]

    @property
    def known(self) -> int:
        """The answers that people graded."""
        return sum(self.counts.values())

    @property
    def equal(self) -> int:
        """The answers with equal grades."""
        return sum(count for (human, ours), count in self.counts.items() if human is ours)

    @property
    def accuracy(self) -> float | None:
        """The share of answers with equal grades; None if people graded none."""
        return self.equal / self.known if self.known else None

    @property
    def kappa(self) -> float | None:
        """The agreement beyond chance: 1 is perfect, 0 what chance gives, below 0 less than that.

        None where chance alone gives perfect agreement: if there is no answer, or both give one and
        the same grade to all. J. Cohen, "A Coefficient of Agreement for Nominal Scales",
        Educational and Psychological Measurement 20 (1960).
        """
        human: Counter[Grade] = Counter()
        ours: Counter[Grade] = Counter()
        for (one, other), count in self.counts.items():
            human[one] += count
            ours[other] += count
        by_chance = sum(human[grade] * ours[grade] for grade in Grade)  # times the square of known
        possible = self.known**2 - by_chance
        return (self.known * self.equal - by_chance) / possible if possible else None


def confusion_of(pairs: Iterable[tuple[Grade | None, Grade]]) -> Confusion:
    """Count pairs of the human grade and ours; without a human grade an answer does not count."""
    return Confusion(Counter((human, ours) for human, ours in pairs if human is not None))
