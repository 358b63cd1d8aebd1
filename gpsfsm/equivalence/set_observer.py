"""Differences that no pairing hides: equal actions that began together get one outcome.

An observer who gives every outcome to all instances of an action that were triggered since the last
one need not know how they are paired: pairs keep to these sets. What both plans have triggered
after such a set depends on the outcomes alone and not on their order (semantics, 4.3). So if it is
not the same then, the plans differ on the way, whichever way the pairs are made. The search is
linear in these sets where all ways to pair would be too many; that it finds nothing says nothing.

Example: ``parallel(A; B, A; C)`` and ``parallel(A; B, A; D)``. Both begin with a set of two A.
Success of the whole set triggers B and C in the first plan, B and D in the second: the plans
differ, though nobody has said which A is which.

The second search (``difference_of_late_pairs``) splits the sets: the observer picks one instance.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.equivalence.pairs import OUTCOMES, Difference, Pair, Step

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.equivalence.admission import Outcomes
    from gpsfsm.equivalence.pairs import Behaviour, Sides, State
    from gpsfsm.model.event import End, Event

_MOST_TO_THE_END = 3_000_000


class Together(NamedTuple):
    """Active instances of one action in both plans, as many in either."""

    first: tuple[int, ...]
    second: tuple[int, ...]


class Place(NamedTuple):
    """The states of both plans, and the sets of what is active."""

    here: State
    there: State
    sets: tuple[Together, ...]
    decided: tuple[tuple[int, Event], ...] = ()
    assigned: tuple[Outcomes, Outcomes] = ((), ())

    def without(self, each: Together) -> tuple[Together, ...]:
        """The other sets."""
        return tuple(other for other in self.sets if other != each)


class _Played(NamedTuple):
    """The state that a set of outcomes has led to in one plan."""

    state: State
    triggered: tuple[int, ...]
    end: End | None


@dataclass(frozen=True, slots=True, eq=False)
class _Trail:
    """The outcomes up to a place, backwards."""

    before: _Trail | None
    assigned: tuple[int, ...]
    event: Event

    def moves(self) -> list[tuple[tuple[int, ...], Event]]:
        moves = []
        trail: _Trail | None = self
        while trail is not None:
            moves.append((trail.assigned, trail.event))
            trail = trail.before
        return moves[::-1]


def difference_of_sets(sides: Sides, *, max_work: int) -> Difference | None:
    """A certain difference, not known to be the shortest; None: none was found.

    ``max_work`` bounds the sum of the sizes of all places that are visited. The first half is spent
    on what a few outcomes show, the other half on what comes late in the plans; it may be more, if
    it takes more to get to the end once.
    """
    start = beginning(sides)
    if start is None:
        return _replayed(sides, None)
    difference = _among_few(sides, start, max_work // 2)
    if difference is None:
        size = len(sides.kinds[0]) + len(sides.kinds[1])
        once = min(size * size, _MOST_TO_THE_END)
        difference = _in_depth(sides, start, max(max_work // 2, once))
    return None if difference is None else _replayed(sides, difference)


def _among_few(sides: Sides, start: Place, max_work: int) -> _Trail | None:
    """The outcomes after which the plans differ, the fewest first."""
    heap: list[tuple[int, int, Place, _Trail | None]] = [(0, 0, start, None)]
    seen = {start}
    work = counter = 0
    while heap:
        count, _, place, trail = heappop(heap)
        for each, event in _moves(sides, place):
            work += _cost(place, each)
            if work > max_work:
                return None
            further = _Trail(trail, each.first, event)
            after = moved(sides, place, each, event, place.without(each))
            if after is None:
                return further
            if after.sets and after not in seen:
                seen.add(after)
                counter += 1
                heappush(heap, (count + len(each.first), counter, after, further))
    return None


def _in_depth(sides: Sides, start: Place, max_work: int) -> _Trail | None:
    """The same, what lies deepest first: successes, and what depends on the last of them."""
    seen = {start}
    stack: list[tuple[Place, Iterator[tuple[Together, Event]], _Trail | None]] = [
        (start, _moves(sides, start), None)
    ]
    work = 0
    while stack:
        place, moves, trail = stack[-1]
        move = next(moves, None)
        if move is None:
            stack.pop()
            continue
        each, event = move
        work += _cost(place, each)
        if work > max_work:
            return None
        further = _Trail(trail, each.first, event)
        after = moved(sides, place, each, event, place.without(each))
        if after is None:
            return further
        if after.sets and after not in seen:
            seen.add(after)
            stack.append((after, _moves(sides, after), further))
    return None


def _cost(place: Place, each: Together) -> int:
    """About what it takes to give outcomes to these."""
    return 2 + len(place.sets) + len(each.first) * (1 + len(place.here.active) // 8)


def beginning(sides: Sides) -> Place | None:
    """Both plans have begun; None: they differ."""
    return _met(sides, (), _begun(sides.first), _begun(sides.second), single=True)


def _begun(behaviour: Behaviour) -> _Played:
    state, reaction = behaviour.begin()
    return _Played(state, reaction.triggered, reaction.end)


def _moves(sides: Sides, place: Place) -> Iterator[tuple[Together, Event]]:
    for each in place.sets:
        for event in OUTCOMES:
            if admits(sides, place, each, event):
                yield each, event


def admits(sides: Sides, place: Place, each: Together, event: Event) -> bool:
    """True if all may have this outcome, however they are paired. Raises InconclusiveError."""
    kind = sides.kinds[0][each.first[0]]
    if any(decided_kind == kind and event is not other for decided_kind, other in place.decided):
        return False
    admission = sides.admission
    return admission is None or all(
        all(admission.permits(side, number, event) for number in each[side])
        and admission.admits(side, _with(sides, place.assigned[side], side, each, event))
        for side in (0, 1)
    )


def _with(sides: Sides, outcomes: Outcomes, side: int, each: Together, event: Event) -> Outcomes:
    """The outcomes that others depend on, with these."""
    admission = sides.admission
    if admission is None:
        return outcomes
    new = [(number, event) for number in each[side] if admission.tied(side, number)]
    return tuple(sorted((*outcomes, *new))) if new else outcomes


def moved(
    sides: Sides, place: Place, each: Together, event: Event, rest: tuple[Together, ...]
) -> Place | None:
    """The place after the outcome of these, with the ``rest`` left; None: the plans differ then."""
    decided = place.decided
    if sides.consistent:
        decided = tuple(sorted({*decided, (sides.kinds[0][each.first[0]], event)}))
    here = _play(sides.first, place.here, each.first, event)
    there = _play(sides.second, place.there, each.second, event)
    met = _met(sides, rest, here, there, single=len(each.first) == 1)
    if met is None or not met.sets:
        return met
    first, second = (_with(sides, place.assigned[side], side, each, event) for side in (0, 1))
    return met._replace(decided=decided, assigned=(first, second))


def _play(behaviour: Behaviour, state: State, numbers: Sequence[int], event: Event) -> _Played:
    """Up to the end of the run, if that comes."""
    triggered: list[int] = []
    for number in numbers:
        state, reaction = behaviour.after(state, number, event)
        triggered += reaction.triggered
        if reaction.end is not None:
            return _Played(state, tuple(triggered), reaction.end)
    return _Played(state, tuple(triggered), None)


def _met(
    sides: Sides,
    rest: tuple[Together, ...],
    here: _Played,
    there: _Played,
    *,
    single: bool,
) -> Place | None:
    """The sets that are active now; None: the plans differ by now.

    Not ``single``: several outcomes have come. If both plans have ended in one way then, what came
    before the end may depend on how the pairs are made, and nothing is told.
    """
    if here.end is not there.end:
        return None
    if here.end is not None and not single:
        return Place(here.state, there.state, ())
    mine, theirs = _by_kind(sides, 0, here.triggered), _by_kind(sides, 1, there.triggered)
    if {kind: len(each) for kind, each in mine.items()} != {
        kind: len(each) for kind, each in theirs.items()
    }:
        return None
    if here.end is not None:
        return Place(here.state, there.state, ())
    new = [
        each
        for kind, numbers in mine.items()
        for each in _sets(sides, tuple(numbers), tuple(theirs[kind]))
    ]
    return Place(here.state, there.state, tuple(sorted((*rest, *new))))


def _by_kind(sides: Sides, side: int, numbers: Sequence[int]) -> dict[int, list[int]]:
    groups: dict[int, list[int]] = {}
    for number in sorted(numbers):
        groups.setdefault(sides.kinds[side][number], []).append(number)
    return groups


def _sets(sides: Sides, mine: tuple[int, ...], theirs: tuple[int, ...]) -> list[Together]:
    """One set; or pairs, where those of one plan can be exchanged, so that all pairs are alike."""
    assert len(mine) == len(theirs), "a set has as many instances in either plan"
    twins = {sides.twins[0][each] for each in mine}, {sides.twins[1][each] for each in theirs}
    if 1 in map(len, twins):
        return [Together((one,), (other,)) for one, other in zip(mine, theirs, strict=True)]
    return [Together(mine, theirs)]


def _replayed(sides: Sides, trail: _Trail | None) -> Difference | None:
    """The difference as one way to make the pairs shows it."""
    meeting, steps = sides.begin(), []
    for numbers, event in trail.moves() if trail is not None else ():
        for number in numbers:
            if not meeting.ways:
                break
            joint = meeting.ways[0]
            step = Step(next(pair for pair in joint.pairs if pair.first == number), event)
            steps.append(step)
            meeting = sides.after(joint, step)
    if meeting.ways:
        return None
    return Difference(tuple(steps), meeting.first, meeting.second, shortest=False)


# Pairs that are made late. The observer picks an instance of either plan and an outcome. Only then
# is it settled which instance of the other plan, of those that began with it, is the same. Whoever
# pairs knows more then than when the instances begin, as the definition has it (docs/tasks.md). So
# if the observer finds a difference all the same, the plans differ. There are far fewer pairs than
# ways to make all of them; that no difference is seen says nothing.
#
# Example: the plans above. The observer picks the A before C and lets it succeed. The A of the
# second plan trigger B or D where the first plan triggers C, so whichever is said to be the same,
# the plans differ.

_WON = -1
"""The place at which the plans differ."""


@dataclass(frozen=True, slots=True)
class _Edge:
    """A pick of the observer at a place: the pairs that it may mean, and where each leads to."""

    place: int
    steps: tuple[Step, ...]
    ways: tuple[int, ...]


@dataclass(slots=True)
class _Graph:
    """The places that are known, and those at which the observer finds a difference."""

    numbers: dict[Place, int] = field(default_factory=dict)
    edges: list[_Edge] = field(default_factory=list)
    incoming: list[list[int]] = field(default_factory=list)
    missing: list[int] = field(default_factory=list)
    won: dict[int, _Edge] = field(default_factory=dict)

    def add(self, place: int, steps: tuple[Step, ...], ways: tuple[int, ...]) -> None:
        """Add what the observer can pick, and tell those who waited for it."""
        number = len(self.edges)
        self.edges.append(_Edge(place, steps, ways))
        open_ways = [
            target for target in dict.fromkeys(ways) if target != _WON and target not in self.won
        ]
        self.missing.append(len(open_ways))
        assert len(self.missing) == len(self.edges)
        for target in open_ways:
            self.incoming[target].append(number)
        ready = [] if open_ways else [number]
        while ready:
            edge = self.edges[ready.pop()]
            if edge.place in self.won:
                continue
            self.won[edge.place] = edge
            for other in self.incoming[edge.place]:
                self.missing[other] -= 1
                if not self.missing[other]:
                    ready.append(other)


def difference_of_late_pairs(sides: Sides, *, max_work: int) -> Difference | None:
    """A certain difference, not known to be the shortest; None: none was found.

    ``max_work`` bounds the sum of the sizes of all places that are visited.
    """
    start = beginning(sides)
    if start is None:
        return _difference_along(sides, _Graph())
    graph = _Graph({start: 0}, incoming=[[]])
    todo = deque([start])
    work = 0
    while todo and 0 not in graph.won:
        place = todo.popleft()
        number = graph.numbers[place]
        for steps in _picks(sides, place):
            work += len(steps) * (2 + len(place.sets) + len(place.here.active) // 8)
            if work > max_work:
                return None
            ways = []
            for step in steps:
                after = _after(sides, place, step)
                if after is None:
                    ways.append(_WON)
                    continue
                if after not in graph.numbers:
                    graph.numbers[after] = len(graph.incoming)
                    graph.incoming.append([])
                    if after.sets:
                        todo.append(after)
                ways.append(graph.numbers[after])
            graph.add(number, steps, tuple(ways))
            if number in graph.won:
                break
    return _difference_along(sides, graph) if 0 in graph.won else None


def _picks(sides: Sides, place: Place) -> Iterator[tuple[Step, ...]]:
    """Per instance of either plan and outcome: the pairs that it may belong to.

    Of those that can be exchanged one stands for all. A pick is left out where some pair may not
    have the outcome.
    """
    for each in place.sets:
        mine, theirs = (_different(sides, side, each[side]) for side in (0, 1))
        choices = [tuple(Pair(one, other) for other in theirs) for one in mine]
        if len(mine) > 1 or len(theirs) > 1:
            choices += [tuple(Pair(one, other) for one in mine) for other in theirs]
        for pairs in choices:
            for event in OUTCOMES:
                if all(
                    admits(sides, place, Together((one,), (other,)), event) for one, other in pairs
                ):
                    yield tuple(Step(pair, event) for pair in pairs)


def _different(sides: Sides, side: int, numbers: tuple[int, ...]) -> list[int]:
    """The first of each group of twins."""
    return list({sides.twins[side][number]: number for number in reversed(numbers)}.values())[::-1]


def _after(sides: Sides, place: Place, step: Step) -> Place | None:
    """Both members of a pair have had their outcome; None: the plans differ by then."""
    (one, other), event = step
    each = next(each for each in place.sets if one in each.first and other in each.second)
    first = tuple(number for number in each.first if number != one)
    second = tuple(number for number in each.second if number != other)
    rest = place.without(each)
    assert len(first) == len(second), "a pair takes one instance of either plan"
    if first:
        rest = tuple(sorted((*rest, Together(first, second))))
    return moved(sides, place, Together((one,), (other,)), event, rest)


def _difference_along(sides: Sides, graph: _Graph) -> Difference | None:
    """The difference along the picks, with the first pair that each may mean."""
    steps: list[Step] = []
    here, first = sides.first.begin()
    there, second = sides.second.begin()
    number = 0 if graph.won else _WON
    while number != _WON:
        edge = graph.won[number]
        step, number = edge.steps[0], edge.ways[0]
        steps.append(step)
        here, first = sides.first.after(here, step.pair.first, step.event)
        there, second = sides.second.after(there, step.pair.second, step.event)
    return Difference(tuple(steps), first, second, shortest=False)
