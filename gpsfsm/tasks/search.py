"""All runs of a plan beside a monitor, to find where they leave the task.

A search over configurations, in the order of the canonical counterexample: fewest outcomes other
than SUCCEEDED, among those the first failing instances in document order, then the fewest events.
A configuration is what the rest of a run depends on: which instances are active, which inputs of
joins that may still fire have arrived, and the state of the monitor. In a plan without parallel
controls one instance is active at a time, and the search is linear in the plan.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import TYPE_CHECKING

from gpsfsm.model.event import Event
from gpsfsm.tasks.leaving import Left, Trail, left_at_end, left_by, worse
from gpsfsm.tasks.monitor import Violation
from gpsfsm.tasks.plays import Plays

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.tasks.monitor import Monitor, MState
    from gpsfsm.tasks.plays import Position

__all__ = ["DEFAULT_MOVES", "TooMany", "search"]

DEFAULT_MOVES = 500_000
"""Moves after which the search is given up."""


class TooMany(Exception):  # noqa: N818  (not an error: an answer of its own)
    """The plan has too many runs for the search."""


def search(
    automaton: Automaton,
    constraints: Constraints,
    monitor: Monitor,
    *,
    most: int = DEFAULT_MOVES,
) -> Iterator[Left]:
    """Every way in which runs leave the task, the plainest run of each first.

    What only assumptions on several instances rule out may be among them (``Left.outcomes`` say
    what the run decides). Raises TooMany after ``most`` moves.
    """
    plays = Plays(automaton, constraints)
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
                raise TooMany
            if isinstance(event, Event):
                after = monitor.after(state, event, number)
            else:
                after = monitor.without_start(state, number)
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
