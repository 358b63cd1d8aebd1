"""Counterexamples: runs that leave the task, and the search for the plainest of each kind.

``Plays`` gives the moves of a plan: the events that can come next, and the positions that they lead
to. Starts take no time: what an event triggers starts at the instant of the event, in any order,
before any outcome comes. The stepper says what that is.

``search`` visits configurations in the order of the canonical counterexample: fewest outcomes other
than SUCCEEDED, among those the first failing instances in document order, then the fewest events. A
configuration is what the rest of a run depends on: the position in the plan and the state of the
monitor. In a plan without parallel controls one instance is active at a time, and the search is
linear in the plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.stepper import START, Stepper
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.tasks.monitor import Violation

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.compile import Compiled
    from gpsfsm.compile.stepper import Arrived
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.tasks.monitor import Monitor, MState


class Position(NamedTuple):
    """All that the rest of a run depends on.

    Masks by node: ``waiting`` is triggered and about to start at this very instant, ``active`` is
    between start and outcome, ``silent`` will fail without having started. ``arrived``: inputs of
    joins; ``end`` is set once the end is triggered. ``decided``: outcomes that bind others, by
    number.
    """

    waiting: int
    active: int
    silent: int
    arrived: Arrived
    end: End | None
    decided: tuple[tuple[int, Outcome], ...]


Move = tuple[Event | Outcome, int]
"""An event of the instance with this number, or NO_START: it will fail without a start."""

_OUTCOMES = ((Event.SUCCEEDED, Outcome.SUCCEEDED), (Event.FAILED, Outcome.FAILED))


class Plays:
    """The moves of a plan."""

    def __init__(self, compiled: Compiled, constraints: Constraints) -> None:
        self._stepper = Stepper(compiled)
        self._allowed = constraints.allowed
        self._group: dict[int, int] = {}  # the nodes whose outcomes are tied to an instance's
        self._wanted: dict[int, int] = {}  # the nodes that can still ask for such an outcome
        for group in constraints.groups:
            mask = sum(1 << number + 1 for number in group)
            self._group |= dict.fromkeys(group, mask)
            self._wanted |= dict.fromkeys(group, _upstream(compiled.automaton, group))
        self._bound: set[int] = set()
        if constraints.formulas:
            from gpsfsm.analysis.assumptions.formula import runners

            for formula in constraints.formulas:
                self._bound |= set(runners(formula))
            self._bound |= set(self._group)

    def first(self) -> Position:
        """The instant at which the plan begins."""
        return self._settle(Position(0, 0, 0, (), None, ()), START)

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
        """The events that can come next, in document order; starts, which take no time, first."""
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
        """The position after all that an event triggers at its instant."""
        assert position.end is None or signal.event is Event.STARTED, "nothing comes after the end"
        triggered, arrived, end = self._stepper.settle(position.arrived, signal)
        waiting = position.waiting | sum(1 << number + 1 for number in triggered)
        end = end or position.end
        arrived_now = tuple(sorted(arrived.items()))
        return self._forget(position._replace(waiting=waiting, arrived=arrived_now, end=end))

    def _forget(self, position: Position) -> Position:
        """Without what can make no difference any more."""
        active = position.waiting | position.active | position.silent
        arrived = position.arrived
        if arrived:
            arrived = self._stepper.relevant(arrived, [node - 1 for node in _bits(active)])
        decided = position.decided
        if decided and not self._bound:
            decided = tuple(one for one in decided if self._wanted[one[0]] & active)
        return position._replace(arrived=arrived, decided=decided)


def _upstream(automaton: Automaton, numbers: Sequence[int]) -> int:
    """The runner nodes from which a way leads to one of these instances, as a mask, with them."""
    seen = {number + 1 for number in numbers}
    pending = list(seen)
    while pending:
        new = {signal.node for signal in automaton.inputs[pending.pop()]} - seen
        seen |= new
        pending += new
    return sum(1 << node for node in seen if automaton.nodes[node].kind is NodeKind.RUNNER)


def _bits(mask: int) -> Iterator[int]:
    """The numbers of the bits that are set, ascending."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low


@dataclass(frozen=True, slots=True)
class Left:
    """A run that leaves the task: its events up to there, its outcomes by number, and why."""

    violation: Violation
    events: tuple[tuple[Event, int], ...]
    outcomes: dict[int, Outcome]

    @property
    def failing(self) -> tuple[int, ...]:
        """The instances that fail before the task is left, ascending."""
        failed = {number for event, number in self.events if event is Event.FAILED}
        silent = {number for number, each in self.outcomes.items() if each is Outcome.NO_START}
        return tuple(sorted(failed | silent))


Trail = tuple["Trail", Event | Outcome, int] | None
"""What happened, backwards: an event, or that an instance hangs or does not start."""


def worse(position: Position, event: Event | Outcome, number: int) -> bool:
    """True if this adds to the outcomes other than SUCCEEDED, at a position before it."""
    if event is Outcome.NO_START:
        return True
    return event is Event.FAILED and not position.silent >> number + 1 & 1


def left_by(violation: Violation, trail: Trail) -> Left:
    """The run that led to a violation."""
    events: list[tuple[Event, int]] = []
    outcomes: dict[int, Outcome] = {}
    while trail is not None:
        trail, event, number = trail
        if isinstance(event, Outcome):
            outcomes[number] = event
        else:
            events.append((event, number))
            if event is not Event.STARTED:
                outcomes.setdefault(number, Outcome(event.value))
    return Left(violation, tuple(reversed(events)), outcomes)


def left_at_end(
    plays: Plays, monitor: Monitor, position: Position, state: MState, trail: Trail
) -> Left | None:
    """The run, if it can end at this position and leaves the task by that."""
    end, hanging = position.end, plays.stuck(position)
    if end is None and hanging is not None:
        end = End.STUCK
        for number in hanging:
            trail = (trail, Outcome.HANG, number)
    if end is None or position.waiting:
        return None
    violation = monitor.at_end(state, end, hanging=bool(hanging))
    return None if violation is None else left_by(violation, trail)


DEFAULT_MOVES = 500_000
"""Moves after which the search is given up."""


class TooManyError(Exception):
    """The plan has too many runs for the search."""


def search(
    compiled: Compiled,
    constraints: Constraints,
    monitor: Monitor,
    *,
    most: int = DEFAULT_MOVES,
) -> Iterator[Left]:
    """Every way in which runs leave the task, the plainest run of each first.

    What only assumptions on several instances rule out may be among them (``Left.outcomes`` say
    what the run decides). Raises TooManyError after ``most`` moves.
    """
    plays = Plays(compiled, constraints)
    counter = moves = 0
    heap: list[tuple[int, tuple[int, ...], int, int, Position, MState | Violation, Trail]] = []
    heappush(heap, (0, (), 0, counter, plays.first(), monitor.start, None))
    seen: set[tuple[Position, MState]] = set()
    while heap:
        bad, numbers, length, _, position, state, trail = heappop(heap)
        if isinstance(state, Violation):
            yield left_by(state, trail)
            continue
        if (position, state) in seen:
            continue
        seen.add((position, state))
        ended = left_at_end(plays, monitor, position, state, trail)
        if ended is not None:
            yield ended
        if position.end is not None and not position.waiting:
            continue
        for event, number in plays.moves(position):
            moves += 1
            if moves > most:
                raise TooManyError
            after = monitor.after(state, event, number)
            if after is None:
                continue
            counter += 1
            fails = worse(position, event, number)
            failing = tuple(sorted((*numbers, number))) if fails else numbers
            wrong = isinstance(after, Violation)
            following = position if wrong else plays.after(position, (event, number))
            further: Trail = (trail, event, number)
            entry = (bad + fails, failing, length + 1, counter, following, after, further)
            heappush(heap, entry)
