"""The proof by z3: no outcomes, in whatever order they come, tell two plans apart.

Roles say which instances belong together; z3 looks for sets of outcomes at which a role has been
triggered in one plan alone. What it finds is played in both plans: it shows a difference, or pairs
that belong together, or that the plans cannot be compared in this way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.tasks.behaviour import OUTCOMES
from gpsfsm.tasks.pairs import Step
from gpsfsm.tasks.question import LimitError, Question
from gpsfsm.tasks.roles import play, roles_of

if TYPE_CHECKING:
    from gpsfsm.tasks.pairs import Difference, Joint, Sides
    from gpsfsm.tasks.question import Given
    from gpsfsm.tasks.roles import Played, Roles

__all__ = ["NotProvedError", "prove"]

_MAX_ROUNDS = 200
_SHORTEN_RLIMIT = 1_000_000
"""Per question on the way to the shortest difference; one that is longer is certain too."""


class NotProvedError(Exception):
    """Z3 met its limit, or equal actions come together in a way that roles cannot tell apart."""


def prove(sides: Sides, *, rlimit: int) -> Difference | None:
    """The first difference in the canonical order, or None: the plans are equal in all runs.

    A difference that is not ``shortest`` is certain, but there may be one after fewer outcomes.
    Raises NotProvedError where it cannot be decided in this way.
    """
    try:
        found = _prove(sides, roles_of(sides, guess=True), rlimit)
        if found is None or found.decides:
            return None if found is None else found.difference
        found = _prove(sides, roles_of(sides, guess=False), rlimit)
    except LimitError:
        raise NotProvedError from None
    if found is not None and not found.decides:
        raise NotProvedError
    return None if found is None else found.difference


def _prove(sides: Sides, roles: Roles, rlimit: int) -> Played | None:
    """First the simpler question; what it finds may lie behind the end of the run."""
    played = _search(sides, roles, rlimit=rlimit, stops=False)
    if played is not None and played.difference is None:
        played = _search(sides, roles, rlimit=rlimit, stops=True)
    return played


def _search(sides: Sides, roles: Roles, *, rlimit: int, stops: bool) -> Played | None:
    """What shows a difference; None: nothing does. Without a difference: z3 is mistaken."""
    played = play(sides, roles, lambda _: None)
    if played.difference is not None:
        return played
    for _ in range(_MAX_ROUNDS):
        question = Question(sides, roles, rlimit=rlimit, stops=stops)
        if not question.differs():
            return None
        played = play(sides, roles, _Follower(sides, roles, question).next)
        if not played.news and played.difference is not None:
            played = _Shortest(sides, roles, question).play(played)
        if not played.news:
            return played
    raise LimitError


class _Follower:
    """Gives the outcomes that z3 has found, as they become possible, the last one last."""

    def __init__(self, sides: Sides, roles: Roles, question: Question) -> None:
        self.sides = sides
        self.roles = roles
        self.question = question

    def given(self, step: Step) -> Given:
        return self.roles.of(0, step.pair.first), step.event

    def steps(self, joint: Joint) -> list[Step]:
        steps = [Step(pair, event) for pair in joint.pairs for event in OUTCOMES]
        return [step for step in steps if self.sides.allows(joint, step)]

    def next(self, joint: Joint) -> Step | None:
        found = [step for step in self.steps(joint) if self.given(step) in self.question.outcomes]
        last = self.question.last
        return next(
            (step for step in found if self.given(step) != last), found[0] if found else None
        )


class _Shortest(_Follower):
    """Looks for the fewest outcomes, and among those for the first in the canonical order."""

    def play(self, found: Played) -> Played:
        """The first difference; where that takes too long, a shorter one than was ``found``."""
        assert found.difference is not None
        self.question.require(rlimit=_SHORTEN_RLIMIT)
        shortest = self._shorten(len(found.difference.steps))
        self._left = len(self.question.outcomes)
        follow = super().next
        try:
            if shortest:
                return play(self.sides, self.roles, self._first)
        except LimitError:
            pass
        again = play(self.sides, self.roles, follow)
        if again.difference is None or again.news:
            return again
        return again._replace(difference=again.difference.perhaps_not_first())

    def _shorten(self, most: int) -> bool:
        """Whether no fewer outcomes are enough than those that are kept."""
        least = 1
        while least < most:
            middle = (least + most) // 2
            try:
                enough = self.question.at_most(middle)
            except LimitError:
                return False
            if enough:
                most = len(self.question.outcomes)
            else:
                least = middle + 1
        if len(self.question.outcomes) > most:  # the play met the difference before their end
            try:
                self.question.at_most(most)
            except LimitError:
                return False
        self.question.keep(most)
        return True

    def _first(self, joint: Joint) -> Step | None:
        if not self._left:
            return None
        last = self._left == 1
        steps = self.steps(joint)
        given = [self.given(step) for step in steps]
        while True:
            place = next(n for n, each in enumerate(given) if self._in_model(each, last=last))
            if not place or not self.question.can_begin_with(given[:place], last=last):
                break
        self._left -= 1
        self.question.fix(given[place], last=last)
        return steps[place]

    def _in_model(self, given: Given, *, last: bool) -> bool:
        question = self.question
        if question.last is None:
            return given in question.outcomes
        return given == question.last if last else given in question.outcomes - {question.last}
