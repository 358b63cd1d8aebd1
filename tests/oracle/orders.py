"""All orders of events with free durations (semantics, sections 4.4, 8.4 and 8.6).

A *moment* is what has come by some instant: the set of the outcomes that have been delivered. A
step delivers one or several outcomes at one instant, and what they trigger is triggered at that
instant too, but its outcome has to come later. That several outcomes come at one instant matters:
they can trigger together, at the very instant of completion, what else never is active together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, combinations
from typing import TYPE_CHECKING

from .runs import HANG, Run

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .capabilities import World


@dataclass(frozen=True, slots=True)
class Moment:
    """What has come by some instant: delivered outcomes and all signals, as bits.

    ``active`` are the paths of the instances that are active then; ``over``: complete or give_up
    is triggered at that instant or before.
    """

    delivered: frozenset[str]
    fired: int
    active: frozenset[str]
    over: bool


def moment(run: Run, delivered: frozenset[str]) -> Moment:
    """What has come once these outcomes and no others are delivered."""
    graph = run.system.graph
    fired = run._after(delivered)
    triggered = frozenset(node.path for node in graph.runners if node.trigger & fired)
    over = bool(fired & (graph.success | graph.failure))
    return Moment(delivered, fired, triggered - delivered, over)


def steps(run: Run, now: Moment) -> Iterator[Moment]:
    """All moments that can come next."""
    hanging = {path for path, outcome in run.scenario.items() if outcome == HANG}
    ready = sorted(now.active - hanging)
    for some in chain.from_iterable(
        combinations(ready, count) for count in range(1, len(ready) + 1)
    ):
        yield moment(run, now.delivered | frozenset(some))


@lru_cache(maxsize=4096)
def moments(run: Run) -> frozenset[Moment]:
    """All moments of a run, in all orders, that are not later than complete or give_up."""
    first = moment(run, frozenset())
    todo, seen = [first], {first}
    while todo:
        now = todo.pop()
        for following in () if now.over else steps(run, now):
            if following not in seen:
                seen.add(following)
                todo.append(following)
    return frozenset(seen)


def free_overlaps(world: World) -> set[tuple[str, str, str]]:
    """The instances that hold a resource at one instant if durations are free."""
    results = set()
    for run in world.runs:
        for now in moments(run):
            results |= holding(world, now)
    return results


def holding(world: World, now: Moment) -> set[tuple[str, str, str]]:
    """The pairs of instances that hold the same resource at a moment, in document order."""
    active = [one for one in world.instances if one.path in now.active and one.described]
    return {
        (one.path, other.path, resource)
        for one, other in combinations(active, 2)
        if one.described and other.described
        for resource in one.described.resources
        if resource in other.described.resources
    }


def loaded(world: World) -> tuple[int, int] | None:
    """The peak and the number of all runners (8.6); None if the options contradict each other."""
    if not world.runs:
        return None
    runner = {one.path: (one.runner.interface, one.runner.provider) for one in world.instances}
    peak = max(
        len({runner[path] for path in now.active}) for run in world.runs for now in moments(run)
    )
    return peak, len(set(runner.values()))
