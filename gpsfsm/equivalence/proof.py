"""The proof by z3: no outcomes, in whatever order they come, tell two plans apart.

Roles say which instances belong together; z3 looks for sets of outcomes at which a role has been
triggered in one plan alone. What it finds is played in both plans: it shows a difference, or pairs
that belong together, or that the plans cannot be compared in this way.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.counterexamples import necessary
from gpsfsm.equivalence.difference_encoding import LimitError, Question
from gpsfsm.equivalence.pairs import OUTCOMES, Difference, Pair, Step
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.equivalence.difference_encoding import RoleOutcome
    from gpsfsm.equivalence.pairs import Joint, Meeting, Sides

_MAX_ROUNDS = 200
_SHORTEN_RLIMIT = 1_000_000
"""Per question on the way to the shortest difference; one that is longer is certain too."""


class Roles:
    """The roles: instances that belong together have one; a role is named by a number."""

    def __init__(self, sides: Sides) -> None:
        self._offset = len(sides.kinds[0])
        self._leader = list(range(self._offset + len(sides.kinds[1])))

    def of(self, side: int, number: int) -> int:
        """The role of an instance of the first (0) or the second (1) plan."""
        index = number + side * self._offset
        while self._leader[index] != index:
            self._leader[index] = self._leader[self._leader[index]]
            index = self._leader[index]
        return index

    def join(self, pair: Pair) -> bool:
        """Put a pair into one role; whether this is news."""
        one, other = self.of(0, pair.first), self.of(1, pair.second)
        self._leader[max(one, other)] = min(one, other)
        return one != other


class Played(NamedTuple):
    """A run of both plans: the difference that it shows, if any, and whether pairs were a choice.

    ``news``: it has shown pairs that were not known to belong together.
    """

    difference: Difference | None
    chosen: bool
    news: bool

    @property
    def decides(self) -> bool:
        """True if it shows a difference that no other way to pair hides."""
        return self.difference is not None and not self.chosen


def play(sides: Sides, roles: Roles, choose: Callable[[Joint], Step | None]) -> Played:
    """Play both plans with the outcomes that are chosen, until there is no choice or a difference.

    Where pairs can be made in several ways the likeliest is taken.
    """
    steps: list[Step] = []
    chosen = news = False
    meeting: Meeting = sides.begin()
    while meeting.ways:
        chosen |= len(meeting.ways) > 1 or not meeting.every
        joint = meeting.ways[0]
        for pair in joint.pairs:
            news |= roles.join(pair)
        step = choose(joint)
        if step is None:
            return Played(None, chosen, news)
        steps.append(step)
        meeting = sides.after(joint, step)
    return Played(Difference(tuple(steps), meeting.first, meeting.second), chosen, news)


def roles_of(sides: Sides, *, guess: bool) -> Roles:
    """Roles as runs show them that trigger each instance in its plainest way.

    An action that each plan has once needs no run. ``guess``: nor does what looks alike in both.
    """
    roles = Roles(sides)
    paired = _alike(sides, roles, sides.kinds)
    if guess:
        paired |= _alike(sides, roles, sides.ranks)
    automaton = sides.first.compiled.automaton
    for number in range(len(sides.kinds[0])):
        if number in paired:
            continue
        wanted = necessary(automaton, automaton.runner_node(number))
        failing = {other for other, outcome in wanted.items() if outcome.value == Event.FAILED}
        _play_plainly(sides, roles, failing, paired)
    return roles


def _alike(sides: Sides, roles: Roles, names: tuple[tuple[int, ...], tuple[int, ...]]) -> set[int]:
    """Join the instances whose name each plan has once; the numbers in the first plan."""
    counts = Counter(names[0]), Counter(names[1])
    there = {name: number for number, name in enumerate(names[1])}
    alike: set[int] = set()
    for number, name in enumerate(names[0]):
        if counts[0][name] == counts[1][name] == 1:
            alike.add(number)
            if sides.kinds[0][number] == sides.kinds[1][there[name]]:
                roles.join(Pair(number, there[name]))
    return alike


def _play_plainly(sides: Sides, roles: Roles, failing: Iterable[int], paired: set[int]) -> None:
    fails = set(failing)

    def choose(joint: Joint) -> Step | None:
        paired.update(pair.first for pair in joint.pairs)
        steps = (
            Step(pair, Event.FAILED if pair.first in fails else Event.SUCCEEDED)
            for pair in joint.pairs
        )
        return next((step for step in steps if sides.allows(joint, step)), None)

    play(sides, roles, choose)


class NotProvedError(Exception):
    """Z3 met its limit, or equal actions come together in a way that roles cannot tell apart."""


def prove(sides: Sides, *, rlimit: int) -> Difference | None:
    """The first difference in the canonical order, or None: the plans are equal in all runs.

    A difference that is not ``shortest`` is certain, but there may be one after fewer outcomes.
    Raises NotProvedError where it cannot be decided in this way.
    """
    try:
        difference = _prove(sides, roles_of(sides, guess=True), rlimit)
        if difference is None or difference.decides:
            return None if difference is None else difference.difference
        difference = _prove(sides, roles_of(sides, guess=False), rlimit)
    except LimitError:
        raise NotProvedError from None
    if difference is not None and not difference.decides:
        raise NotProvedError
    return None if difference is None else difference.difference


def _prove(sides: Sides, roles: Roles, rlimit: int) -> Played | None:
    """First the simpler question; what it finds may lie behind the end of the run."""
    played = _search(sides, roles, rlimit=rlimit, stops=False)
    if played is not None and played.difference is None:
        played = _search(sides, roles, rlimit=rlimit, stops=True)
    return played


def _search(sides: Sides, roles: Roles, *, rlimit: int, stops: bool) -> Played | None:
    """The run that shows a difference; None: there is none. If it shows none, z3 is mistaken."""
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

    def outcome(self, step: Step) -> RoleOutcome:
        return self.roles.of(0, step.pair.first), step.event

    def steps(self, joint: Joint) -> list[Step]:
        steps = [Step(pair, event) for pair in joint.pairs for event in OUTCOMES]
        return [step for step in steps if self.sides.allows(joint, step)]

    def next(self, joint: Joint) -> Step | None:
        possible = [
            step for step in self.steps(joint) if self.outcome(step) in self.question.outcomes
        ]
        last = self.question.last
        return next(
            (step for step in possible if self.outcome(step) != last),
            possible[0] if possible else None,
        )


class _Shortest(_Follower):
    """Looks for the fewest outcomes, and among those for the first in the canonical order."""

    def play(self, played: Played) -> Played:
        """The first difference; where that takes too long, a shorter one than was ``played``."""
        assert played.difference is not None
        self.question.require(rlimit=_SHORTEN_RLIMIT)
        shortest = self._shorten(len(played.difference.steps))
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
        """True if no fewer outcomes are enough than those that are kept."""
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
        outcomes = [self.outcome(step) for step in steps]
        while True:
            place = next(n for n, each in enumerate(outcomes) if self._in_model(each, last=last))
            if not place or not self.question.can_begin_with(outcomes[:place], last=last):
                break
        self._left -= 1
        self.question.fix(outcomes[place], last=last)
        return steps[place]

    def _in_model(self, outcome: RoleOutcome, *, last: bool) -> bool:
        question = self.question
        if question.last is None:
            return outcome in question.outcomes
        return outcome == question.last if last else outcome in question.outcomes - {question.last}
