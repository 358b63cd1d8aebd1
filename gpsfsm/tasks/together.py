"""Differences that no pairing hides: equal actions that began together get one outcome.

An observer who gives every outcome to all instances of an action that were triggered since the last
one need not know how they are paired: pairs keep to these sets. What both plans have triggered
after such a set depends on the outcomes alone and not on their order (semantics, 4.3). So if it is
not the same then, the plans differ on the way, whichever way the pairs are made. The search is
linear in these sets where all ways to pair would be too many; that it finds nothing says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.tasks.behaviour import OUTCOMES
from gpsfsm.tasks.pairs import Difference, Step

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.model.event import End, Event
    from gpsfsm.tasks.admission import Outcomes
    from gpsfsm.tasks.behaviour import Behaviour, State
    from gpsfsm.tasks.pairs import Sides

__all__ = ["Place", "Together", "admits", "beginning", "difference_of_sets", "moved"]


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
    given: tuple[Outcomes, Outcomes] = ((), ())

    def without(self, each: Together) -> tuple[Together, ...]:
        """The other sets."""
        return tuple(other for other in self.sets if other != each)


class _Played(NamedTuple):
    """What a set of outcomes has led to in one plan."""

    state: State
    triggered: tuple[int, ...]
    end: End | None


@dataclass(frozen=True, slots=True, eq=False)
class _Trail:
    """The outcomes up to a place, backwards."""

    before: _Trail | None
    given: tuple[int, ...]
    event: Event

    def moves(self) -> list[tuple[tuple[int, ...], Event]]:
        found = []
        trail: _Trail | None = self
        while trail is not None:
            found.append((trail.given, trail.event))
            trail = trail.before
        return found[::-1]


def difference_of_sets(sides: Sides, *, max_work: int) -> Difference | None:
    """A certain difference, not known to be the shortest; None: none was found.

    ``max_work`` bounds the sum of the sizes of all places that are visited. The first half is spent
    on what a few outcomes show, the other half on what comes late in the plans; it may be more, if
    it takes more to get to the end once.
    """
    start = beginning(sides)
    if start is None:
        return _replayed(sides, None)
    found = _among_few(sides, start, max_work // 2)
    if found is None:
        size = len(sides.kinds[0]) + len(sides.kinds[1])
        once = min(size * size, _MOST_TO_THE_END)
        found = _in_depth(sides, start, max(max_work // 2, once))
    return None if found is None else _replayed(sides, found)


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
    """Whether all of them may have this outcome, however they are paired. Raises Inconclusive."""
    kind = sides.kinds[0][each.first[0]]
    if any(known == kind and event is not other for known, other in place.decided):
        return False
    admission = sides.admission
    return admission is None or all(
        all(admission.permits(side, number, event) for number in each[side])
        and admission.admits(side, _with(sides, place.given[side], side, each, event))
        for side in (0, 1)
    )


def _with(sides: Sides, given: Outcomes, side: int, each: Together, event: Event) -> Outcomes:
    """The outcomes that others depend on, with these."""
    admission = sides.admission
    if admission is None:
        return given
    new = [(number, event) for number in each[side] if admission.tied(side, number)]
    return tuple(sorted((*given, *new))) if new else given


def moved(
    sides: Sides, place: Place, each: Together, event: Event, rest: tuple[Together, ...]
) -> Place | None:
    """Where the outcome of these leads to, the ``rest`` being left; None: the plans differ then."""
    decided = place.decided
    if sides.consistent:
        decided = tuple(sorted({*decided, (sides.kinds[0][each.first[0]], event)}))
    here = _play(sides.first, place.here, each.first, event)
    there = _play(sides.second, place.there, each.second, event)
    met = _met(sides, rest, here, there, single=len(each.first) == 1)
    if met is None or not met.sets:
        return met
    first, second = (_with(sides, place.given[side], side, each, event) for side in (0, 1))
    return met._replace(decided=decided, given=(first, second))


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
    """What is active now; None: the plans differ by now.

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
    found: dict[int, list[int]] = {}
    for number in sorted(numbers):
        found.setdefault(sides.kinds[side][number], []).append(number)
    return found


def _sets(sides: Sides, mine: tuple[int, ...], theirs: tuple[int, ...]) -> list[Together]:
    """One set; or pairs, where those of one plan can be exchanged, so that all pairs are alike."""
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
