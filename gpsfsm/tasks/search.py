"""All runs of a plan beside a monitor, to find where they leave the task.

A search over configurations, in the order of the canonical counterexample: fewest outcomes other
than SUCCEEDED, among those the first failing instances in document order, then the fewest events.
A configuration is what the rest of a run depends on: which instances are active, which inputs of
joins that may still fire have arrived, and the state of the monitor. In a plan without parallel
controls one instance is active at a time, and the search is linear in the plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.tasks.monitor import Violation

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.tasks.monitor import Monitor, MState

__all__ = ["DEFAULT_CONFIGURATIONS", "Left", "TooMany", "search"]

DEFAULT_CONFIGURATIONS = 200_000
"""Configurations after which the search is given up."""


class TooMany(Exception):  # noqa: N818  (not an error: an answer of its own)
    """The plan has too many configurations: undecided."""


@dataclass(frozen=True, slots=True)
class Left:
    """A run that leaves the task: its events up to there, its outcomes by number, and why."""

    violation: Violation
    events: tuple[tuple[Event, int], ...]
    outcomes: dict[int, Outcome]


class _Position(NamedTuple):
    """The part of a configuration that belongs to the plan.

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


_Trail = tuple["_Trail", Event | Outcome, int] | None
"""What happened, backwards: an event, or that an instance hangs or does not start."""


def search(
    automaton: Automaton,
    constraints: Constraints,
    monitor: Monitor,
    *,
    most: int = DEFAULT_CONFIGURATIONS,
) -> Iterator[Left]:
    """Every way in which runs leave the task, once each, the plainest run of each.

    What only assumptions on several instances rule out may be among them (``Left.outcomes`` say
    what the run decides). Raises TooMany after ``most`` configurations.
    """
    plays = _Plays(automaton, constraints)
    counter = 0
    heap: list[tuple[int, tuple[int, ...], int, int, _Position, MState, _Trail]] = []
    heappush(heap, (0, (), 0, counter, plays.first(), monitor.start, None))
    seen: set[tuple[_Position, MState]] = set()
    while heap:
        bad, numbers, length, _, position, state, trail = heappop(heap)
        if (position, state) in seen:
            continue
        seen.add((position, state))
        if len(seen) > most:
            raise TooMany
        ended = _at_end(plays, monitor, position, state, trail)
        if ended is not None:
            yield ended
        if position.end is not None and not position.waiting:
            continue
        for event, number, following in plays.steps(position):
            after: MState | Violation
            if isinstance(event, Event):
                after = monitor.after(state, event, number)
            else:
                after = monitor.without_start(state, number)
            further: _Trail = (trail, event, number)
            if isinstance(after, Violation):
                yield _left(after, further)
            elif after is not None:
                counter += 1
                worse = event is Event.FAILED and not position.silent >> number + 1 & 1
                worse = worse or event is Outcome.NO_START
                failing = tuple(sorted((*numbers, number))) if worse else numbers
                entry = (bad + worse, failing, length + 1, counter, following, after, further)
                heappush(heap, entry)


def _at_end(
    plays: _Plays, monitor: Monitor, position: _Position, state: MState, trail: _Trail
) -> Left | None:
    """Whether a run that ends here leaves the task."""
    end, hanging = position.end, plays.stuck(position)
    if end is None and hanging is not None:
        end = End.STUCK
        for number in hanging:
            trail = (trail, Outcome.HANG, number)
    if end is None or position.waiting:
        return None
    violation = monitor.at_end(state, end, hanging=bool(hanging))
    return None if violation is None else _left(violation, trail)


def _left(violation: Violation, trail: _Trail) -> Left:
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


class _Plays:
    """The moves of a plan."""

    def __init__(self, automaton: Automaton, constraints: Constraints) -> None:
        self._automaton = automaton
        self._allowed = constraints.allowed
        self._bit: dict[tuple[Signal, int], int] = {}  # the connection's, of one to a join
        self._inputs = [0] * len(automaton.nodes)  # per join: the bits of its connections
        for index, (source, event, target) in enumerate(automaton.edges):
            if automaton.nodes[target].kind is NodeKind.JOIN:
                self._bit[(Signal(source, event), target)] = 1 << index
                self._inputs[target] |= 1 << index
        self._ahead = self._reach()
        self._group: dict[int, int] = {}  # the nodes whose outcomes are tied to an instance's
        for group in constraints.groups:
            mask = sum(1 << number + 1 for number in group)
            self._group |= dict.fromkeys(group, mask)
        self._bound: set[int] = set()
        if constraints.formulas:
            from gpsfsm.analysis.assumptions.formula import runners  # noqa: PLC0415

            for formula in constraints.formulas:
                self._bound |= set(runners(formula))
            self._bound |= set(self._group)

    def first(self) -> _Position:
        """The instant at which the plan begins."""
        nothing = _Position(0, 0, 0, 0, None, ())
        return self._settle(nothing, Signal(0, Event.SUCCEEDED))

    def stuck(self, position: _Position) -> list[int] | None:
        """If nothing more need happen: the instances that hang. None: something will."""
        if position.waiting or position.silent or position.end is not None:
            return None
        numbers = [node - 1 for node in _bits(position.active)]
        decided = dict(position.decided)
        if all(Outcome.HANG in self._possible(number, decided) for number in numbers):
            return numbers
        return None

    def steps(self, position: _Position) -> Iterator[tuple[Event | Outcome, int, _Position]]:
        """What can happen next, in document order: starts, which take no time, come first."""
        decided = dict(position.decided)
        for node in _bits(position.waiting):
            number, bit = node - 1, 1 << node
            possible = self._possible(number, decided)
            begun = position._replace(waiting=position.waiting & ~bit)
            if possible - {Outcome.NO_START}:
                after = begun._replace(active=begun.active | bit)
                yield Event.STARTED, number, self._settle(after, Signal(node, Event.STARTED))
            if Outcome.NO_START in possible:
                after = begun._replace(silent=begun.silent | bit)
                after = self._decide(after, number, Outcome.NO_START)
                yield Outcome.NO_START, number, self._forget(after)
        if position.waiting:
            return
        for node in _bits(position.active | position.silent):
            number, bit = node - 1, 1 << node
            if position.silent & bit:
                after = position._replace(silent=position.silent & ~bit)
                yield Event.FAILED, number, self._settle(after, Signal(node, Event.FAILED))
                continue
            after = position._replace(active=position.active & ~bit)
            possible = self._possible(number, decided)
            for event in (Event.SUCCEEDED, Event.FAILED):
                outcome = Outcome(event.value)
                if outcome in possible:
                    done = self._decide(after, number, outcome)
                    yield event, number, self._settle(done, Signal(node, event))

    def _possible(self, number: int, decided: dict[int, Outcome]) -> frozenset[Outcome]:
        allowed = self._allowed[number]
        mask = self._group.get(number)
        if mask is None:
            return allowed
        others = {decided[node - 1] for node in _bits(mask) if node - 1 in decided}
        for node in _bits(mask):
            allowed &= self._allowed[node - 1]
        return allowed & others if others else allowed

    def _decide(self, position: _Position, number: int, outcome: Outcome) -> _Position:
        if number not in self._group and number not in self._bound:
            return position
        decided = {**dict(position.decided), number: outcome}
        return position._replace(decided=tuple(sorted(decided.items())))

    def _settle(self, position: _Position, signal: Signal) -> _Position:
        """What an event triggers at its instant, through joins."""
        waiting, arrived, end = position.waiting, position.arrived, position.end
        nodes, outputs = self._automaton.nodes, self._automaton.outputs
        pending = [signal]
        while pending:
            current = pending.pop()
            for target in outputs.get(current, ()):
                kind = nodes[target].kind
                if kind is NodeKind.JOIN:
                    before = (arrived & self._inputs[target]).bit_count()
                    arrived |= self._bit[(current, target)]
                    after = (arrived & self._inputs[target]).bit_count()
                    if before < nodes[target].need <= after:
                        pending.append(Signal(target, Event.SUCCEEDED))
                elif kind is NodeKind.RUNNER:
                    waiting |= 1 << target
                else:
                    end = End.COMPLETED if kind is NodeKind.COMPLETE else End.GAVE_UP
        return self._forget(position._replace(waiting=waiting, arrived=arrived, end=end))

    def _forget(self, position: _Position) -> _Position:
        """Without what can make no difference any more."""
        active = position.waiting | position.active | position.silent
        if not active:
            return position._replace(arrived=0)
        ahead, connections = active, 0
        for node in _bits(active):
            ahead |= self._ahead[node][0]
            connections |= self._ahead[node][1]
        arrived = position.arrived & connections
        decided = position.decided
        if decided and not self._bound:
            decided = tuple(one for one in decided if self._group[one[0]] & ahead)
        return position._replace(arrived=arrived, decided=decided)

    def _reach(self) -> list[tuple[int, int]]:
        """Per node, as masks: the runner nodes behind it, and the connections of joins there."""
        automaton = self._automaton
        found = [(0, 0)] * len(automaton.nodes)
        missing = [len(targets) for targets in automaton.successors]
        ready = [node for node, count in enumerate(missing) if not count]
        while ready:
            node = ready.pop()
            nodes = connections = 0
            for target in automaton.successors[node]:
                nodes |= found[target][0] | 1 << target
                connections |= found[target][1] | self._inputs[target]
            found[node] = (nodes, connections)
            for source, _ in automaton.inputs[node]:
                missing[source] -= 1
                if not missing[source]:
                    ready.append(source)
        return found


def _bits(mask: int) -> Iterator[int]:
    """The numbers of the bits that are set, ascending."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low
