"""Declared durations and energies (semantics, sections 8.4 and 8.5)."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isinf, lcm
from typing import TYPE_CHECKING

from .graph import JoinNode
from .orders import Moment, free_overlaps, holding, moment, moments, steps
from .runs import HANG, NO_START

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .capabilities import Instance, World
    from .runs import Run

Range = tuple[float, float | None]  # the greatest is None where it is unbounded


def makespan(world: World) -> Range | None:
    """The infimum and the supremum of the time at which a run ends, over all runs that end.

    With fixed outcomes every time is a sum of durations, or the k-th smallest of other times. Such
    functions grow with each duration and have no jumps, so the bounds of the durations give the
    bounds of the end: also those that are approached only, as a least of 0 is.
    """
    if not any(one.described and one.described.duration for one in world.reachable):
        return None
    ends = [run for run in world.runs if not run.stuck]
    if not ends:
        return None
    least = min(end_of(world, run, _least) for run in ends)
    greatest = max(end_of(world, run, _greatest) for run in ends)
    return least, None if isinf(greatest) else greatest


def spans(instance: Instance, run: Run) -> tuple[float, float]:
    """The bounds of the duration of an instance in a run; what does not start heeds no least."""
    least, greatest = instance.bounds(instance.described.duration if instance.described else None)
    return 0.0 if run.scenario[instance.path] == NO_START else least, max(least, greatest)


def _least(instance: Instance, run: Run) -> float:
    return spans(instance, run)[0]


def _greatest(instance: Instance, run: Run) -> float:
    return spans(instance, run)[1]


def end_of(world: World, run: Run, duration: Callable[[Instance, Run], float]) -> float:
    """The time at which a run ends if each instance takes a given duration."""
    graph = run.system.graph
    times = {graph.start: 0.0}
    for node in graph.nodes:
        if isinstance(node, JoinNode):
            inputs = sorted(times[signal] for signal in node.inputs if signal in times)
            if len(inputs) >= node.need:
                times[node.fires] = inputs[node.need - 1]
        elif node.trigger in times:
            instance, began = world.instances[node.index], times[node.trigger]
            for signal in (node.started, node.succeeded, node.failed):
                if signal & run.fired:
                    takes = 0.0 if signal == node.started else duration(instance, run)
                    times[signal] = began + takes
    return times[graph.success if run.completed else graph.failure]


def energy(world: World) -> Range | None:
    """The least and the greatest energy of a run, over all scenarios."""
    if not any(one.described and one.described.energy for one in world.reachable):
        return None
    sums = []
    for run in world.runs:
        taken = [
            one.bounds(one.described.energy)
            for one in world.instances
            if one.described and one.described.energy and run.fired & one.node.trigger
        ]
        sums.append((sum(low for low, _ in taken), sum(high for _, high in taken)))
    greatest = max(high for _, high in sums)
    return min(low for low, _ in sums), None if isinf(greatest) else greatest


def overlaps(world: World) -> set[tuple[str, str, str]]:
    """The pairs of instances that can hold a resource at one instant, and the resource."""
    candidates = free_overlaps(world)
    if not any(one.described and one.described.duration for one in world.instances):
        return candidates
    results: set[tuple[str, str, str]] = set()
    for run in world.runs:
        for history in histories(world, run):
            results |= holding(world, history.now) & candidates
            if results == candidates:
                return results
    return results


def orphans(world: World) -> set[str]:
    """The instances that can be active when the plan completes, in time that durations allow."""
    results: set[str] = set()
    for run in world.runs:
        if not run.completed:
            continue
        candidates = {path for now in moments(run) if now.over for path in now.active}
        for history in histories(world, run):
            if candidates <= results:
                break
            if history.now.over:
                results |= history.now.active
    return results


@dataclass(frozen=True, slots=True)
class History:
    """An order of events up to an instant. Instants are numbered from 0, the start.

    ``began`` and ``ended`` tell the number of the instant of the trigger and of the outcome.
    """

    now: Moment
    instants: int
    began: dict[str, int]
    ended: dict[str, int]


def histories(world: World, run: Run) -> Iterator[History]:
    """All orders of events, up to complete or give_up, that durations within the bounds allow."""
    first = moment(run, frozenset())
    todo = [History(first, 1, dict.fromkeys(sorted(first.active), 0), {})]
    while todo:
        history = todo.pop()
        if not possible(world, run, history):
            continue
        yield history
        if history.now.over:
            continue
        for now in steps(run, history.now):
            at = history.instants
            ended = dict.fromkeys(sorted(now.delivered - history.now.delivered), at)
            began = {path: at for path in sorted(now.active) if path not in history.began}
            todo.append(
                History(now, at + 1, {**history.began, **began}, {**history.ended, **ended})
            )


def possible(world: World, run: Run, history: History) -> bool:
    """Whether there are times for the instants of a history.

    Only differences of times are bounded: t(j) - t(i) is at most, or less than, some number. That
    has a solution unless some cycle of such bounds adds up to less than 0, or to 0 if one of them
    is strict. Bellman and Ford find such a cycle: the sums of bounds along paths never settle.

    The sums are whole numbers. All bounds are multiples of one unit, and a unit counts for more
    than everything smaller in a cycle. What takes 0 seconds at most takes at most epsilon, which
    counts for less than a unit and for more than all strict bounds of a cycle, each of which takes
    1 away.
    """
    count = history.instants
    taken = {path: spans(world.instance(path), run) for path in history.began}
    unit = lcm(*(end.as_integer_ratio()[1] for span in taken.values() for end in span if end < inf))
    epsilon = 3 * count + len(taken) + 1  # the bounds: one to two for an instant, one for a span
    most: list[tuple[int, int, int]] = []

    def bound(late: int, early: int, number: float, *, strict: bool, tiny: bool = False) -> None:
        above, below = number.as_integer_ratio()
        whole = above * (unit // below) * epsilon**2
        most.append((late, early, whole + tiny * epsilon - strict))

    for number in range(1, count):
        bound(number - 1, number, 0.0, strict=True)
    for path, began in history.began.items():
        low, high = taken[path]
        if path in history.ended:
            bound(began, history.ended[path], -low, strict=low == 0)
            if not isinf(high):
                bound(history.ended[path], began, high, strict=False, tiny=high == 0)
        elif not isinf(high) and run.scenario[path] != HANG:
            # it is yet to end
            bound(count - 1, began, high, strict=True, tiny=high == 0)
    sums = [0] * count
    for _ in range(count):
        settled = True
        for late, early, entry in most:
            if sums[early] + entry < sums[late]:
                sums[late] = sums[early] + entry
                settled = False
        if settled:
            return True
    return False
