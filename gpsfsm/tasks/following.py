"""A demand followed along an instance: what its own events do, and those that come beside it.

The state at an instant is known exactly; while an instance is active, and others are as well, it
may change by any of their events, as often as they let it. So sets of states are followed that
hold the state of every run. A set is *closed* under events if none of them leads out of it.

Example: the demand is "no B after A", and X, B run side by side after A. With A over the state is
"A has come". X leaves it as it is. B leads to the violation: this is said to be so for B, and X
is followed no further in runs in which it has happened.

The events that can come beside an instance are those of instances that are not *settled* then:
over, or never to be triggered any more.
"""

from __future__ import annotations

from collections.abc import Hashable
from functools import reduce
from operator import and_, or_
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.tasks.ltlf import TooLargeError
from gpsfsm.tasks.monitor import Violation

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.model.automaton import Automaton
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
    """Follows one demand through the events of a plan. Raises TooLargeError after many steps."""

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
            raise TooLargeError
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


_MAX_NODES = 2_000
_OTHER = {Event.SUCCEEDED: Event.FAILED, Event.FAILED: Event.SUCCEEDED}


class Settled:
    """The instances that can come between events of one automaton. Raises TooLargeError.

    A moment of a run is that of the node that is triggered there. What can still happen then, and
    so get between one event and the next, follows from the connections alone, whatever the
    outcomes:

    - ``needed``: the outcomes without which a node is never triggered. A node that waits for all of
      its inputs needs what any of them needs, any other what all of them need.
    - ``settled``: the nodes that are over once a node is triggered, or cannot come any more since
      they need the other outcome of an instance that is over. It is inherited in the same way.

    Two instances can be active at once only if neither is settled when the other is triggered.

    Example: in ``A; recovery(B); C`` the instance C is triggered by the success of A, after which B
    cannot come, or by that of B. So A and B are settled when C is triggered, in either case, and no
    two of the three are ever active at once.

    Sets are masks by node. Where one event leads to one node and nothing waits, one instance is
    active at a time, and no masks are needed.
    """

    def __init__(self, automaton: Automaton) -> None:
        self._automaton = automaton
        self.alone = _alone(automaton)
        if self.alone:
            return
        size = len(automaton.nodes)
        if size > _MAX_NODES:
            raise TooLargeError
        self._runners = sum(1 << node.index for node in automaton.runners)
        self._needed = {event: [0] * size for event in _OTHER}
        self._need()
        self._needing = {event: _transposed(rows) for event, rows in self._needed.items()}
        self._settled = [0] * size
        for node in automaton.order:
            inputs = automaton.inputs[node]
            if inputs:
                self._settled[node] = self._joined(node, list(map(self._settled_by, inputs)))
        self._settling = _transposed(self._settled)

    def beside(self, node: int) -> int:
        """The instances of which an event can come while this one is active."""
        if self.alone:
            return 0
        return self._runners & ~(self._settled[node] | self._settling[node] | 1 << node)

    def before(self, signal: Signal, join: int) -> int:
        """The instances of which an event can come between an input of a join and its success."""
        if self.alone:
            return 0
        return self._runners & ~(self._settled_by(signal) | self._settling[join])

    def open_at(self, node: int) -> int:
        """The instances of which an event can come at the instant of the node or later."""
        return 0 if self.alone else self._runners & ~self._settled[node]

    def excluded(self, event: Event, node: int) -> int:
        """The instances of which this outcome cannot come if the node is triggered."""
        other = _OTHER.get(event)
        return 0 if self.alone or other is None else self._needed[other][node]

    def _need(self) -> None:
        for node in self._automaton.order:
            inputs = self._automaton.inputs[node]
            for event, needed in self._needed.items() if inputs else ():
                sets = [
                    needed[each.node] | (1 << each.node if each.event is event else 0)
                    for each in inputs
                ]
                needed[node] = self._joined(node, sets)

    def _joined(self, node: int, sets: Sequence[int]) -> int:
        """The union of the sets of its inputs if a node waits for all, else the intersection."""
        waits = self._automaton.nodes[node].need == len(sets)
        return reduce(or_ if waits else and_, sets)

    def _settled_by(self, signal: Signal) -> int:
        """The nodes that are settled right after an event."""
        node, event = signal
        settled = self._settled[node]
        if event in _OTHER:
            settled |= self._needing[_OTHER[event]][node] | 1 << node
        return settled


def _alone(automaton: Automaton) -> bool:
    """True if one instance is active at a time: each event leads to one node, and none waits."""
    single = all(len(targets) == 1 for targets in automaton.outputs.values())
    waits = any(node.need > 1 for node in automaton.nodes)
    chained = any(event is Event.STARTED for _, event, _ in automaton.edges)
    return single and not waits and not chained and len(automaton.starts) == 1


def _transposed(rows: Sequence[int]) -> list[int]:
    """The matrix of bits with rows and columns exchanged.

    Rows of the bits {1, 2}, {2} and {} have the columns {}, {0} and {0, 1}.
    """
    size = len(rows)
    lines = [format(row, f"0{size}b")[::-1] for row in reversed(rows)]
    return [int("".join(column), 2) for column in zip(*lines, strict=True)]


def waits(automaton: Automaton, node: int) -> bool:
    """True if a node is triggered by the last of several inputs."""
    kind, need = automaton.nodes[node].kind, automaton.nodes[node].need
    return kind is NodeKind.JOIN and need == len(automaton.inputs[node]) > 1
