"""Differences that no pairing hides, with pairs that are made late.

The observer picks an instance of either plan and an outcome. Only then is it settled which instance
of the other plan, of those that began with it, is the same. Whoever pairs knows more then than when
the instances begin, as the definition has it (docs/tasks.md). So if the observer finds a difference
all the same, the plans differ. There are far fewer pairs than ways to make all of them; that none
is found says nothing.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.tasks.behaviour import OUTCOMES
from gpsfsm.tasks.pairs import Difference, Pair, Step
from gpsfsm.tasks.together import Together, admits, beginning, moved

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.tasks.pairs import Sides
    from gpsfsm.tasks.together import Place

__all__ = ["difference_of_late_pairs"]

_WON = -1
"""The place at which the plans differ."""


@dataclass(frozen=True, slots=True)
class _Edge:
    """What the observer picks at a place: the pairs that this may mean, and where each leads to."""

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
        open_ways = [way for way in dict.fromkeys(ways) if way != _WON and way not in self.won]
        self.missing.append(len(open_ways))
        for way in open_ways:
            self.incoming[way].append(number)
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
        return _told(sides, _Graph())
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
    return _told(sides, graph) if 0 in graph.won else None


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
    if first:
        rest = tuple(sorted((*rest, Together(first, second))))
    return moved(sides, place, Together((one,), (other,)), event, rest)


def _told(sides: Sides, graph: _Graph) -> Difference | None:
    """What the observer picks, with the first pair that each pick may mean."""
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
