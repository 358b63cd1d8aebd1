"""The evaluator: what happens in one scenario.

It follows the automaton event by event and knows nothing of the analyses, so that every scenario
that they claim can be replayed here before anybody sees it. A run costs time in proportion to the
events that happen, not to the size of the plan.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome

__all__ = ["Evaluator", "Run"]

OutcomeOf = Callable[[int], Outcome]
"""The outcome of a runner instance by its number in document order, from 0."""


@dataclass(frozen=True, slots=True)
class Run:
    """A maximal run: all events in an order that respects causality.

    ``events`` maps each event that happens to its place in that order; ``triggered`` maps each
    node that is triggered (for a join: that fires) likewise.
    """

    events: Mapping[Signal, int]
    triggered: Mapping[int, int]
    ends: End

    @property
    def failures(self) -> int:
        """The number of FAILED events."""
        return sum(signal.event is Event.FAILED for signal in self.events)


class Evaluator:
    """Replays scenarios on one automaton."""

    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self._outputs = automaton.outputs
        self._needs = {
            node.index: node.need for node in automaton.nodes if node.kind is NodeKind.JOIN
        }
        self._first = automaton.runners[0].index if automaton.runners else 0

    def runner_number(self, node: int) -> int:
        """The number of a runner node in document order, from 0."""
        return node - self._first

    def runner_node(self, number: int) -> int:
        """The node of the runner instance with this number."""
        return number + self._first

    def run(
        self,
        outcome_of: OutcomeOf,
        *,
        withheld: Collection[int] = (),
        redirect: Mapping[Signal, Signal] | None = None,
    ) -> Run:
        """The run of a scenario.

        ``withheld``: numbers of runners whose outcome never comes (they do start). ``redirect``:
        signals that come as another one, for questions of the kind "what if it had succeeded".
        """
        redirect = redirect or {}
        events: dict[Signal, int] = {}
        triggered: dict[int, int] = {}
        arrived: dict[int, int] = {}
        queue: deque[Signal] = deque([Signal(0, Event.SUCCEEDED)])
        while queue:
            signal = queue.popleft()
            signal = redirect.get(signal, signal)
            if signal in events:
                continue
            events[signal] = len(events)
            for target in self._outputs.get(signal, ()):
                need = self._needs.get(target)
                if need is not None:
                    arrived[target] = arrived.get(target, 0) + 1
                    if arrived[target] == need:
                        triggered[target] = len(triggered)
                        queue.appendleft(Signal(target, Event.SUCCEEDED))  # a join takes no time
                elif target not in triggered:
                    triggered[target] = len(triggered)
                    if target not in (self.automaton.complete, self.automaton.give_up):
                        number = target - self._first
                        queue.extend(_emitted(target, outcome_of(number), number in withheld))
        return Run(events, triggered, self._ending(triggered))

    def _ending(self, triggered: Mapping[int, int]) -> End:
        if self.automaton.complete in triggered:
            return End.COMPLETED
        return End.GAVE_UP if self.automaton.give_up in triggered else End.STUCK


def _emitted(node: int, outcome: Outcome, withheld: bool) -> list[Signal]:
    """The events of a triggered runner."""
    signals = []
    if outcome is not Outcome.NO_START:
        signals.append(Signal(node, Event.STARTED))
    if withheld:
        return signals
    if outcome is Outcome.SUCCEEDED:
        signals.append(Signal(node, Event.SUCCEEDED))
    elif outcome in (Outcome.FAILED, Outcome.NO_START):
        signals.append(Signal(node, Event.FAILED))
    return signals
