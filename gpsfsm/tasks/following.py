"""The states of a demand along an instance: what its own events do, and those beside it.

The state at an instant is known exactly; while an instance is active, and others are as well, it
may change by any of their events, as often as they let it. So sets of states are followed that
hold the state of every run. A set is *closed* under events if none of them leads out of it.

Example: the demand is "no B after A", and X, B run side by side after A. With A over the state is
"A has come". X leaves it as it is. B leads to the violation: this is said to be so for B, and X
is followed no further in runs in which it has happened.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.event import Event, Outcome
from gpsfsm.tasks.ltlf import TooLarge
from gpsfsm.tasks.monitor import Violation

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.tasks.machine import Letter
    from gpsfsm.tasks.monitor import Demand, MState

_MAX_STEPS = 300_000

Letters = tuple[Hashable, ...]
"""Kinds of events, as ``Branching.letter`` tells them apart."""


class States(NamedTuple):
    """States of which one is that of the run, unless it leaves the task before; each once.

    ``right``: the events of the instance itself do not leave it. ``whole``: no other ones do
    either.
    """

    those: tuple[MState, ...]
    right: bool = True
    whole: bool = True


class Follower:
    """Follows one demand through the events of a plan. Raises TooLarge after many steps."""

    def __init__(self, demand: Demand, constraints: Constraints) -> None:
        self.demand = demand
        self._allowed = constraints.allowed
        self._steps = 0
        self._branching = demand.branching()
        self._first: dict[Hashable, Letter] = {}
        self._classes: dict[int, list[tuple[Event, Hashable]]] = {}
        self._closed: dict[tuple[MState, Letters], States] = {}

    def own(self, states: States, event: Event | Outcome, number: int) -> States:
        """The states after an event of the instance that is followed."""
        those: dict[MState, None] = {}
        right = states.right
        for state in states.those:
            after = self._after(state, event, number)
            if isinstance(after, Violation):
                right = False
            else:
                those[after] = None
        return States(tuple(those), right, states.whole)

    def closed(self, states: States, letters: Letters) -> States:
        """The states after any of these events beside the instance, or none."""
        if not letters:
            return states
        those: dict[MState, None] = {}
        whole = states.whole
        for state in states.those:
            reached = self._reached(state, letters)
            those |= dict.fromkeys(reached.those)
            whole = whole and reached.whole
        return States(tuple(those), states.right, whole)

    def letters(self, mask: int, *, failing: int = 0, succeeding: int = 0) -> Letters:
        """The events of the instances in a mask, of each kind one.

        Only those in the other masks fail or succeed.
        """
        letters: dict[Hashable, None] = {}
        comes = {Event.STARTED: mask, Event.FAILED: failing, Event.SUCCEEDED: succeeding}
        for number in _numbers(mask):
            for event, letter in self._of(number):
                if comes[event] >> number + 1 & 1:
                    letters[letter] = None
        return tuple(letters)

    def _reached(self, state: MState, letters: Letters) -> States:
        reached = self._closed.get((state, letters))
        if reached is None:
            those, todo, whole = {state: None}, [state], True
            while todo:
                here = todo.pop()
                for letter in letters:
                    after = self._after(here, *self._first[letter])
                    if isinstance(after, Violation):
                        whole = False
                    elif after not in those:
                        those[after] = None
                        todo.append(after)
            reached = self._closed[state, letters] = States(tuple(those), whole=whole)
        return reached

    def _after(self, state: MState, event: Event | Outcome, number: int) -> MState | Violation:
        self._steps += 1
        if self._steps > _MAX_STEPS:
            raise TooLarge
        return None if state is None else self.demand.after(state, event, number)

    def _of(self, number: int) -> list[tuple[Event, Hashable]]:
        classes = self._classes.get(number)
        if classes is None:
            classes = self._classes[number] = []
            for event, shown in self._events(number):
                letter = self._branching.letter(shown, number)
                self._first.setdefault(letter, (shown, number))
                classes.append((event, letter))
        return classes

    def _events(self, number: int) -> Iterator[tuple[Event, Event | Outcome]]:
        """The events that can come of an instance; a start that does not come counts as one."""
        allowed = self._allowed[number]
        if allowed - {Outcome.NO_START}:
            yield Event.STARTED, Event.STARTED
        if Outcome.NO_START in allowed:
            yield Event.STARTED, Outcome.NO_START
        if Outcome.SUCCEEDED in allowed:
            yield Event.SUCCEEDED, Event.SUCCEEDED
        if allowed & {Outcome.FAILED, Outcome.NO_START}:
            yield Event.FAILED, Event.FAILED


def _numbers(mask: int) -> Iterator[int]:
    """The numbers of the instances in a mask of nodes, ascending."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 2
        mask ^= low
