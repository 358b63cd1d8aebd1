"""The lockstep search: both plans play all runs side by side, state by state.

Exact for plans whose states can all be visited: where one thing happens after the other these are
few, whatever the length. Every state is visited once, those after fewer outcomes first.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.tasks.behaviour import OUTCOMES
from gpsfsm.tasks.pairs import Difference, Joint, Step

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.tasks.pairs import Meeting, Sides

__all__ = ["TooManyStatesError", "lockstep"]


class TooManyStatesError(Exception):
    """Not all states could be visited: nothing follows from those that were."""


@dataclass(frozen=True, slots=True)
class _Edge:
    """What the observer does in a state, and the states that it leads to, one per way to pair.

    Without ways the plans differ.
    """

    state: int
    step: Step | None
    meeting: Meeting
    ways: tuple[int, ...]


@dataclass(slots=True)
class _Graph:
    numbers: dict[Joint | None, int] = field(default_factory=dict)
    states: list[Joint | None] = field(default_factory=list)
    edges: list[_Edge] = field(default_factory=list)
    outgoing: list[list[int]] = field(default_factory=list)
    incoming: list[list[int]] = field(default_factory=list)

    def number(self, state: Joint | None) -> int:
        """The number of a state; None is the state before the beginning."""
        found = self.numbers.get(state)
        if found is None:
            found = self.numbers[state] = len(self.states)
            self.states.append(state)
            self.outgoing.append([])
            self.incoming.append([])
        return found

    def add(self, state: int, step: Step | None, meeting: Meeting) -> None:
        ways = tuple(dict.fromkeys(map(self.number, meeting.ways)))
        self.outgoing[state].append(len(self.edges))
        for way in ways:
            self.incoming[way].append(len(self.edges))
        self.edges.append(_Edge(state, step, meeting, ways))


def lockstep(sides: Sides, *, max_work: int) -> Difference | None:
    """The first difference in the canonical order, or None if the plans are equal.

    ``max_work`` bounds the sum of the sizes of all states that are visited. Beyond it a difference
    that is found all the same is certain, but perhaps not the first.
    Raises TooManyStatesError if there is none by then, or where too many ways to pair would have
    to be tried.
    """
    graph = _Graph()
    root = graph.number(None)
    layer, work = [root], 0
    while layer:
        seen, differs = len(graph.states), False
        for state in layer:
            for step, meeting in _moves(sides, graph.states[state]):
                graph.add(state, step, meeting)
                differs |= not meeting.ways
                work += 2 + sum(2 + len(way.pairs) for way in meeting.ways)
            if work > max_work:
                return _certain(graph, root)
        if differs and root in (values := _values(graph)):
            return _told(graph, root, values)
        layer = list(range(seen, len(graph.states)))
    return None if root not in _values(graph, suspected=True) else _certain(graph, root)


def _certain(graph: _Graph, root: int) -> Difference:
    """The difference that is certain by now."""
    values = _values(graph)
    if root not in values:
        raise TooManyStatesError
    return _told(graph, root, values).perhaps_not_first()


def _moves(sides: Sides, state: Joint | None) -> Iterator[tuple[Step | None, Meeting]]:
    if state is None:
        yield None, sides.begin()
        return
    for pair in state.pairs:
        for event in OUTCOMES:
            step = Step(pair, event)
            if sides.allows(state, step):
                yield step, sides.after(state, step)


def _values(graph: _Graph, *, suspected: bool = False) -> dict[int, int]:
    """In how many steps the observer finds a difference, whichever way the pairs are made.

    States without an entry are not known to be different. A step with more ways than are listed
    leads to no certain difference; ``suspected`` asks for those too that the listed ways show.
    """
    values: dict[int, int] = {}
    missing = [len(edge.ways) + (not edge.meeting.every and not suspected) for edge in graph.edges]
    ready = deque((0, number) for number, count in enumerate(missing) if not count)
    while ready:  # in ascending order: an edge is ready with the last of its ways
        value, number = ready.popleft()
        state = graph.edges[number].state
        if state in values:
            continue
        values[state] = value + 1
        for other in graph.incoming[state]:
            missing[other] -= 1
            if not missing[other]:
                ready.append((value + 1, other))
    return values


def _told(graph: _Graph, root: int, values: dict[int, int]) -> Difference:
    """Follow the difference: in each state the first of the best steps, then the longest way."""
    steps: list[Step] = []
    state = root
    while True:
        edge = next(
            edge
            for edge in map(graph.edges.__getitem__, graph.outgoing[state])
            if edge.meeting.every
            and all(way in values for way in edge.ways)
            and max((values[way] for way in edge.ways), default=0) + 1 == values[state]
        )
        if edge.step is not None:
            steps.append(edge.step)
        if not edge.ways:
            return Difference(tuple(steps), edge.meeting.first, edge.meeting.second)
        state = max(edge.ways, key=values.__getitem__)
