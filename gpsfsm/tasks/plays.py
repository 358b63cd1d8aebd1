"""The moves of a plan: which events can happen next, and what they lead to.

A position is what the rest of a run depends on. Starts take no time: what an event triggers starts
at the instant of the event, in any order, before any outcome comes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.constraints import Constraints

__all__ = ["Move", "Plays", "Position"]


class Position(NamedTuple):
    """What the rest of a run depends on.

    Masks by node: ``waiting`` is triggered and about to start at this very instant, ``active`` is
    between start and outcome, ``silent`` will fail without having started. ``arrived`` has a bit
    per connection to a join that may still fire; ``end`` is set once the end is triggered.
    ``decided``: outcomes that bind others, by number.
    """

    waiting: int
    active: int
    silent: int
    arrived: int
    end: End | None
    decided: tuple[tuple[int, Outcome], ...]


Move = tuple[Event | Outcome, int]
"""An event of the instance with this number, or NO_START: it will fail without a start."""

_OUTCOMES = ((Event.SUCCEEDED, Outcome.SUCCEEDED), (Event.FAILED, Outcome.FAILED))


class Plays:
    """The moves of a plan."""

    def __init__(self, automaton: Automaton, constraints: Constraints) -> None:
        self._automaton = automaton
        self._allowed = constraints.allowed
        self._outputs: dict[Signal, list[tuple[int, int]]] = {}  # targets, and bits at joins
        self._inputs = [0] * len(automaton.nodes)  # per join: the bits of its connections
        for index, (source, event, target) in enumerate(automaton.edges):
            bit = 1 << index
            self._outputs.setdefault(Signal(source, event), []).append((target, bit))
            if automaton.nodes[target].kind is NodeKind.JOIN:
                self._inputs[target] |= bit
        self._joins = [target for _, _, target in automaton.edges]  # per connection
        self._behind = self._before()
        self._group: dict[int, int] = {}  # the nodes whose outcomes are tied to an instance's
        self._wanted: dict[int, int] = {}  # the nodes that can still ask for such an outcome
        for group in constraints.groups:
            mask = sum(1 << number + 1 for number in group)
            self._group |= dict.fromkeys(group, mask)
            wanted = mask
            for number in group:
                wanted |= self._behind[number + 1]
            self._wanted |= dict.fromkeys(group, wanted)
        self._bound: set[int] = set()
        if constraints.formulas:
            from gpsfsm.analysis.assumptions.formula import runners  # noqa: PLC0415

            for formula in constraints.formulas:
                self._bound |= set(runners(formula))
            self._bound |= set(self._group)

    def first(self) -> Position:
        """The instant at which the plan begins."""
        nothing = Position(0, 0, 0, 0, None, ())
        return self._settle(nothing, Signal(0, Event.SUCCEEDED))

    def stuck(self, position: Position) -> list[int] | None:
        """If nothing more need happen: the instances that hang. None: something will."""
        if position.waiting or position.silent or position.end is not None:
            return None
        numbers = [node - 1 for node in _bits(position.active)]
        decided = dict(position.decided)
        if all(Outcome.HANG in self._possible(number, decided) for number in numbers):
            return numbers
        return None

    def moves(self, position: Position) -> Iterator[Move]:
        """What can happen next, in document order: starts, which take no time, come first."""
        decided = dict(position.decided)
        for node in _bits(position.waiting):
            number = node - 1
            possible = self._possible(number, decided)
            if possible - {Outcome.NO_START}:
                yield Event.STARTED, number
            if Outcome.NO_START in possible:
                yield Outcome.NO_START, number
        if position.waiting:
            return
        for node in _bits(position.active | position.silent):
            number = node - 1
            if position.silent >> node & 1:
                yield Event.FAILED, number
                continue
            possible = self._possible(number, decided)
            for event, outcome in _OUTCOMES:
                if outcome in possible:
                    yield event, number

    def after(self, position: Position, move: Move) -> Position:
        """The position after a move that is possible."""
        event, number = move
        node, bit = number + 1, 1 << number + 1
        if isinstance(event, Outcome):
            after = position._replace(waiting=position.waiting & ~bit, silent=position.silent | bit)
            return self._forget(self._decide(after, number, event))
        if event is Event.STARTED:
            after = position._replace(waiting=position.waiting & ~bit, active=position.active | bit)
        elif position.silent & bit:
            after = position._replace(silent=position.silent & ~bit)
        else:
            after = position._replace(active=position.active & ~bit)
            after = self._decide(after, number, Outcome(event.value))
        return self._settle(after, Signal(node, event))

    def _possible(self, number: int, decided: dict[int, Outcome]) -> frozenset[Outcome]:
        allowed = self._allowed[number]
        mask = self._group.get(number)
        if mask is None:
            return allowed
        others = {decided[node - 1] for node in _bits(mask) if node - 1 in decided}
        for node in _bits(mask):
            allowed &= self._allowed[node - 1]
        return allowed & others if others else allowed

    def _decide(self, position: Position, number: int, outcome: Outcome) -> Position:
        if number not in self._group and number not in self._bound:
            return position
        decided = {**dict(position.decided), number: outcome}
        return position._replace(decided=tuple(sorted(decided.items())))

    def _settle(self, position: Position, signal: Signal) -> Position:
        """What an event triggers at its instant, through joins."""
        waiting, arrived, end = position.waiting, position.arrived, position.end
        nodes, outputs = self._automaton.nodes, self._outputs
        pending = [signal]
        while pending:
            current = pending.pop()
            for target, bit in outputs.get(current, ()):
                kind = nodes[target].kind
                if kind is NodeKind.JOIN:
                    before = (arrived & self._inputs[target]).bit_count()
                    arrived |= bit
                    after = (arrived & self._inputs[target]).bit_count()
                    if before < nodes[target].need <= after:
                        pending.append(Signal(target, Event.SUCCEEDED))
                elif kind is NodeKind.RUNNER:
                    waiting |= 1 << target
                else:
                    end = End.COMPLETED if kind is NodeKind.COMPLETE else End.GAVE_UP
        return self._forget(position._replace(waiting=waiting, arrived=arrived, end=end))

    def _forget(self, position: Position) -> Position:
        """Without what can make no difference any more."""
        active = position.waiting | position.active | position.silent
        if not active:
            return position._replace(arrived=0)
        arrived = todo = position.arrived
        while todo:
            join = self._joins[(todo & -todo).bit_length() - 1]
            todo &= ~self._inputs[join]
            if not active & self._behind[join]:
                arrived &= ~self._inputs[join]
        decided = position.decided
        if decided and not self._bound:
            decided = tuple(one for one in decided if self._wanted[one[0]] & active)
        return position._replace(arrived=arrived, decided=decided)

    def _before(self) -> list[int]:
        """Per node, as masks: the runner nodes from which a way leads to it."""
        automaton = self._automaton
        found = [0] * len(automaton.nodes)
        missing = [len(inputs) for inputs in automaton.inputs]
        ready = [node for node, count in enumerate(missing) if not count]
        while ready:
            node = ready.pop()
            mask = found[node]
            if automaton.nodes[node].kind is NodeKind.RUNNER:
                mask |= 1 << node
            for target in automaton.successors[node]:
                found[target] |= mask
                missing[target] -= 1
                if not missing[target]:
                    ready.append(target)
        return found


def _bits(mask: int) -> Iterator[int]:
    """The numbers of the bits that are set, ascending."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low
