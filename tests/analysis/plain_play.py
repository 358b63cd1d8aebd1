"""Runs played event by event with one queue: what the evaluator is held against."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import EMITTED, Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

SURE: tuple[Event, ...] = ()
POSSIBLE = (Event.STARTED, Event.SUCCEEDED, Event.FAILED)


@dataclass(frozen=True, slots=True)
class Played:
    """``events`` and ``triggered`` nodes in order; ``arrived``: inputs that came, by join."""

    events: Sequence[Signal]
    triggered: Sequence[int]
    arrived: Mapping[int, int]

    def broken(self, automaton: Automaton) -> frozenset[int]:
        """The joins that got a second input."""
        traits = automaton.traits
        return frozenset(
            join
            for join, count in self.arrived.items()
            if join in traits.breaking
            and (count > 1 or (join in traits.looping and join in self.triggered))
        )


def play(
    automaton: Automaton,
    outcomes: Mapping[int, Outcome],
    undecided: Sequence[Event] = SURE,
    withheld: Collection[int] = (),
) -> Played:
    """The run; ``undecided`` are the events of runners without an outcome."""
    played: list[Signal] = []
    triggered: list[int] = []
    arrived: dict[int, int] = {}
    queue = deque([Signal(0, Event.SUCCEEDED)])
    while queue:
        signal = queue.popleft()
        played.append(signal)
        for source, event, target in automaton.edges:
            if (source, event) != signal:
                continue
            arrived[target] = arrived.get(target, 0) + 1
            node = automaton.nodes[target]
            if node.kind is NodeKind.JOIN:
                breaks = target in automaton.traits.breaking and node.need > 1
                if arrived[target] == node.need and not breaks:
                    triggered.append(target)
                    queue.appendleft(Signal(target, Event.SUCCEEDED))
            elif target not in triggered:
                triggered.append(target)
                if node.kind is NodeKind.RUNNER:
                    events = emitted(automaton, target, outcomes, undecided)
                    if target - 1 in withheld:
                        events = [each for each in events if each is Event.STARTED]
                    queue.extend(Signal(target, each) for each in events)
    joins = {node.index for node in automaton.nodes if node.kind is NodeKind.JOIN}
    return Played(played, triggered, {key: arrived[key] for key in joins & arrived.keys()})


def emitted(
    automaton: Automaton, node: int, outcomes: Mapping[int, Outcome], undecided: Sequence[Event]
) -> list[Event]:
    """The events of a runner that is triggered."""
    outcome = outcomes.get(node - 1)
    events = list(undecided if outcome is None else EMITTED[outcome])
    if outcome is Outcome.NO_START and automaton.traits.refusals_hang:
        return []
    if node in automaton.traits.silent:
        return [event for event in events if event is not Event.STARTED]
    return events
