"""The evaluator: what happens in one scenario.

It follows the automaton event by event and knows nothing of the analyses, so that every scenario
that they claim can be replayed here before anybody sees it. A run costs time in proportion to the
events that happen, not to the size of the plan.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping

from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import EMITTED, End, Event, Outcome

__all__ = ["Evaluator", "Run"]

OutcomeOf = Callable[[int], Outcome]
"""The outcome of a runner instance by its number in document order, from 0."""


class Run:
    """A maximal run: all events in an order that respects causality.

    ``triggered`` holds each node that is triggered (for a join: that fires), in that order.
    """

    __slots__ = ("_order", "ends", "triggered")

    def __init__(self, order: Mapping[int, int], triggered: Mapping[int, int], ends: End) -> None:
        self._order = order
        self.triggered = triggered
        self.ends = ends

    def __len__(self) -> int:
        return len(self._order)

    def happens(self, signal: Signal) -> bool:
        """Whether the event happens."""
        return signal.node * 4 + _CODES[signal.event] in self._order

    def place(self, signal: Signal) -> int:
        """The place of the event in the order of the run; it must happen."""
        return self._order[signal.node * 4 + _CODES[signal.event]]

    @property
    def failures(self) -> int:
        """The number of FAILED events."""
        return sum(code & 3 == _FAILED for code in self._order)


_CODES = {Event.STARTED: 0, Event.SUCCEEDED: 1, Event.FAILED: 2, Event.STOPPED: 3}
_STARTED, _SUCCEEDED, _FAILED = 0, 1, 2  # events are numbers here, for speed: node * 4 + code


class Evaluator:
    """Replays scenarios on one automaton."""

    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        targets: list[list[int]] = [[] for _ in range(4 * len(automaton.nodes))]
        for source, event, target in automaton.edges:
            targets[source * 4 + _CODES[event]].append(target)
        self._targets = targets
        self._need = [node.need if node.kind is NodeKind.JOIN else 0 for node in automaton.nodes]

    def run(self, outcome_of: OutcomeOf, *, withheld: Collection[int] = ()) -> Run:
        """The run of a scenario.

        ``withheld``: numbers of runners whose outcome never comes (they do start).
        """
        return self._play(lambda number: _EMITTED[outcome_of(number)], withheld)

    def surely(self, decisions: Mapping[int, Outcome], *, withheld: Collection[int] = ()) -> Run:
        """What happens however the outcomes that are not in ``decisions`` turn out.

        Events never prevent others, so that what happens while those are withheld, even their
        STARTED, happens in every run.
        """
        return self._play(
            lambda number: _EMITTED[decisions[number]] if number in decisions else (), withheld
        )

    def possibly(self, decisions: Mapping[int, Outcome], *, withheld: Collection[int] = ()) -> Run:
        """Whatever may happen: outcomes that are not in ``decisions`` come in both ways."""
        both = (_STARTED, _SUCCEEDED, _FAILED)
        return self._play(
            lambda number: _EMITTED[decisions[number]] if number in decisions else both, withheld
        )

    def _play(self, emitted: Callable[[int], tuple[int, ...]], withheld: Collection[int]) -> Run:
        targets, need = self._targets, self._need
        complete, give_up = self.automaton.complete, self.automaton.give_up
        order: dict[int, int] = {}
        triggered: dict[int, int] = {}
        arrived: dict[int, int] = {}
        queue = deque([_SUCCEEDED])  # of the start node
        while queue:
            signal = queue.popleft()
            if signal in order:
                continue
            order[signal] = len(order)
            for target in targets[signal]:
                if need[target]:
                    count = arrived[target] = arrived.get(target, 0) + 1
                    if count == need[target]:
                        triggered[target] = len(triggered)
                        queue.appendleft(target * 4 + _SUCCEEDED)  # a join takes no time
                elif target not in triggered:
                    triggered[target] = len(triggered)
                    if target not in (complete, give_up):
                        number = self.automaton.runner_number(target)
                        events = emitted(number)
                        if withheld and number in withheld:
                            events = events[: events[:1] == (_STARTED,)]
                        queue.extend(target * 4 + event for event in events)
        ends = End.GAVE_UP if give_up in triggered else End.STUCK
        return Run(order, triggered, End.COMPLETED if complete in triggered else ends)


_EMITTED = {outcome: tuple(_CODES[event] for event in EMITTED[outcome]) for outcome in Outcome}
