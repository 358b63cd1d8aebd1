"""Roles: instances of two plans that are the same occurrence of an action, in whatever run.

Instances that have been paired in some run belong to one role. If no run triggers two instances
of one plan in one role, a role happens once at most, and its trigger in a plan is the first of the
triggers of its instances there.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.witness import necessary
from gpsfsm.model.event import Event
from gpsfsm.tasks.pairs import Difference, Pair, Step

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.tasks.pairs import Joint, Meeting, Sides

__all__ = ["Played", "Roles", "play", "roles_of"]


class Roles:
    """Which instances belong together; a role is named by a number."""

    def __init__(self, sides: Sides) -> None:
        self._offset = len(sides.kinds[0])
        self._leader = list(range(self._offset + len(sides.kinds[1])))

    def of(self, side: int, number: int) -> int:
        """The role of an instance of the first (0) or the second (1) plan."""
        found = number + side * self._offset
        while self._leader[found] != found:
            self._leader[found] = self._leader[self._leader[found]]
            found = self._leader[found]
        return found

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
        """Whether it shows a difference that no other way to pair hides."""
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
    found: set[int] = set()
    for number, name in enumerate(names[0]):
        if counts[0][name] == counts[1][name] == 1:
            found.add(number)
            if sides.kinds[0][number] == sides.kinds[1][there[name]]:
                roles.join(Pair(number, there[name]))
    return found


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
