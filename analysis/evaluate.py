"""The evaluator: what happens in one scenario.

It follows the automaton event by event and knows nothing of the analyses, so that every scenario
that they claim can be replayed here before anybody sees it. A run costs time in proportion to the
events that happen, not to the size of the plan.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping

from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import EMITTED, End, Event, Outcome

OutcomeOf = Callable[[int], Outcome]
"""The outcome of a runner instance by its number in document order, from 0."""


class Run:
    """A maximal run: all events in an order that respects causality.

    ``triggered`` holds each node that is triggered (for a join: that fires), in that order.
    ``broken`` holds the joins at which a second input aborts the engine, if it has such joins. All
    events are listed that can happen in some order; ``ends`` is ABORT if in some order the engine
    aborts before the plan completes.
    """

    __slots__ = ("_order", "broken", "ends", "triggered")

    def __init__(
        self,
        order: Mapping[int, int],
        triggered: Mapping[int, int],
        ends: End,
        broken: frozenset[int] = frozenset(),
    ) -> None:
        self._order = order
        self.triggered = triggered
        self.ends = ends
        self.broken = broken

    def __len__(self) -> int:
        return len(self._order)

    def happens(self, signal: Signal) -> bool:
        """True if the event happens."""
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
        traits = automaton.traits
        self._breaking = traits.breaking
        for join in traits.breaking:
            if self._need[join] > 1:  # the second input breaks it
                self._need[join] = len(automaton.inputs[join]) + 1
        self._silent = frozenset(map(automaton.runner_number, traits.silent))
        self._loud = dict(_EMITTED)
        if traits.refusals_hang:
            self._loud[Outcome.NO_START] = ()
        self._quiet = {
            outcome: tuple(code for code in codes if code != _STARTED)
            for outcome, codes in self._loud.items()
        }

    def run(self, outcome_of: OutcomeOf, *, withheld: Collection[int] = ()) -> Run:
        """The run of a scenario.

        ``withheld``: numbers of runners whose outcome never comes (they do start).
        """
        return self._play(lambda number: self._emitted(number, outcome_of(number)), withheld)

    def _emitted(self, number: int, outcome: Outcome) -> tuple[int, ...]:
        return (self._quiet if number in self._silent else self._loud)[outcome]

    def surely(self, decisions: Mapping[int, Outcome], *, withheld: Collection[int] = ()) -> Run:
        """The run that happens however the outcomes that are not in ``decisions`` turn out.

        Events never prevent others, so that what happens while those are withheld, even their
        STARTED, happens in every run.
        """
        return self._play(
            lambda number: self._emitted(number, decisions[number]) if number in decisions else (),
            withheld,
        )

    def possibly(self, decisions: Mapping[int, Outcome], *, withheld: Collection[int] = ()) -> Run:
        """Whatever may happen: outcomes that are not in ``decisions`` come in both ways."""
        both = (_STARTED, _SUCCEEDED, _FAILED)

        def emitted(number: int) -> tuple[int, ...]:
            if number in decisions:
                return self._emitted(number, decisions[number])
            return both[1:] if number in self._silent else both

        return self._play(emitted, withheld)

    def _play(self, emitted: Callable[[int], tuple[int, ...]], withheld: Collection[int]) -> Run:
        targets, need = self._targets, self._need
        complete, give_up = self.automaton.complete, self.automaton.give_up
        order: dict[int, int] = {}
        triggered: dict[int, int] = {}
        arrived: dict[int, int] = {}
        queue = deque(start * 4 + _SUCCEEDED for start in self.automaton.starts)
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
        broken = self._broken(arrived, triggered) if self._breaking else frozenset()
        return Run(order, triggered, self._end(triggered, broken), broken)

    def _broken(self, arrived: Mapping[int, int], triggered: Mapping[int, int]) -> frozenset[int]:
        """The joins that got a second input."""
        looping = self.automaton.traits.looping
        return frozenset(
            join
            for join, count in arrived.items()
            if join in self._breaking and (count > 1 or (join in looping and join in triggered))
        )

    def _end(self, triggered: Mapping[int, int], broken: frozenset[int]) -> End:
        automaton = self.automaton
        if broken and not broken.isdisjoint(automaton.deadly):
            return End.ABORT
        if automaton.complete in triggered:
            return End.COMPLETED
        if broken:
            raise InternalError("a join that completes the plan has fired without completing it")
        if automaton.give_up in triggered:
            return End.GAVE_UP
        return End.STUCK if automaton.traits.gives_up else End.HANG


_EMITTED = {outcome: tuple(_CODES[event] for event in EMITTED[outcome]) for outcome in Outcome}
