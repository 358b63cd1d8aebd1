"""Gathers problems: places, caps, order."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Problem, Related
from gpsfsm.model.plan import Location

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.syntax.text import Lines
    from gpsfsm.syntax.tokens import Fault

_OF_TEXT = ("GP101", "GP102", "GP108", "GP110")
_VAIN = 100


class Collector:
    """The problems of one text; of each rule at most ``cap`` are kept, the others counted.

    ``exhausted`` tells that there are so many errors in the text itself that reading on is vain.
    """

    def __init__(self, lines: Lines, cap: int) -> None:
        self.lines = lines
        self._cap = cap
        self._counts: Counter[str] = Counter()
        self._problems: list[Problem] = []
        self.exhausted = False

    def location(self, offset: int, element: str = "") -> Location:
        """The place of an offset."""
        line, column = self.lines.position(offset)
        return Location(line, column, element)

    def add(
        self,
        rule: str,
        start: int,
        length: int,
        *,
        message: str,
        hint: str = "",
        element: str = "",
        related: Iterable[Related] = (),
    ) -> None:
        """Report a problem; ``length`` is cut at the end of the line."""
        if self.full(rule):
            self.count(rule)
            return
        self._counts[rule] += 1
        shown = min(length, self.lines.rest(start))
        location = self.location(start, element)
        self._problems.append(Problem(rule, message, location, hint, shown, tuple(related)))

    def full(self, rule: str) -> bool:
        """True if no more problems of ``rule`` are kept."""
        return self._counts[rule] >= self._cap

    def count(self, rule: str) -> None:
        """Count a problem that is not kept; cheaper than finding words for it."""
        self._counts[rule] += 1
        if rule in _OF_TEXT and self._counts[rule] > _VAIN * self._cap:
            self.exhausted = True

    def add_faults(self, faults: list[Fault], element: str) -> None:
        """Report what the scanner found."""
        for start, length, message, hint, rule in faults:
            self.add(rule, start, length, message=message, hint=hint, element=element)

    def problems(self) -> tuple[Problem, ...]:
        """The problems in text order."""

        def place(problem: Problem) -> tuple[int, int]:
            return problem.location.line, problem.location.column

        return tuple(sorted(self._problems, key=place))

    def notes(self) -> tuple[str, ...]:
        """One note per rule of which problems were left out."""
        return tuple(
            f"{count:,} problems of rule {rule} were found; the first {self._cap:,} are listed"
            for rule, count in sorted(self._counts.items())
            if count > self._cap
        )
