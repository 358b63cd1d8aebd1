"""Runners of a machine that hold one exclusive resource at once (semantics, 8.4 and 9.4).

Every configuration that a run reaches, up to the instant at which it ends, says who is active.
Durations count as free, also where some are declared: nobody is said to be safe who may not be.

    A STARTED → B, both hold the base     configuration 0: A and B active; the run to it is empty
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.machines.exact import ExactPart
from gpsfsm.compile.instants import GOING, bits

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from gpsfsm.analysis.machines.decide import Run
    from gpsfsm.analysis.machines.search import Exploration, Step
    from gpsfsm.model.capability import Binding

MOST = 50
"""So many pairs are named; more of them say nothing new."""


class Overlap(NamedTuple):
    """Two instances, by number, that hold a resource at once after the steps ``shown``.

    ``then``: the fewest steps to an end or a standstill from there; () also if there is none.
    ``sure``: the run is exact (semantics, 9.6).
    """

    first: int
    second: int
    resource: str
    shown: Run
    then: Run
    sure: bool = True


def weighed_overlaps(
    exploration: Exploration, bindings: Sequence[Binding | None], inexact: Collection[int]
) -> tuple[Overlap, ...]:
    """As ``overlaps_in``, with exact runs where there are any."""
    overlaps = overlaps_in(exploration, bindings)
    if not (inexact and overlaps):
        return overlaps
    exact = {each[:3]: each for each in overlaps_in(ExactPart(exploration, inexact), bindings)}
    return tuple(exact.get(each[:3], each._replace(sure=False)) for each in overlaps)


def held_twice(bindings: Sequence[Binding | None]) -> dict[str, int]:
    """The resources that several instances hold, with these as bits."""
    holders: dict[str, int] = {}
    for number, binding in enumerate(bindings):
        for resource in () if binding is None else binding.provider.resources:
            holders[resource] = holders.get(resource, 0) | 1 << number
    return {resource: held for resource, held in holders.items() if held.bit_count() > 1}


def overlaps_in(
    exploration: Exploration, bindings: Sequence[Binding | None]
) -> tuple[Overlap, ...]:
    """The overlaps by their instances, each with a shortest run."""
    shared = held_twice(bindings)
    onwards = _onwards(exploration)
    overlaps: dict[tuple[int, int, str], Overlap] = {}
    for at, last, active in _up_to_the_end(exploration):
        for resource, held in shared.items():
            for first, second in combinations(bits(active & held), 2):
                key = first, second, resource
                if key not in overlaps and len(overlaps) < MOST:
                    shown = (*exploration.path(at), *last)
                    then = () if last else _followed(onwards, at)
                    overlaps[key] = Overlap(*key, shown, then)
    return tuple(overlaps[key] for key in sorted(overlaps))


def _onwards(exploration: Exploration) -> dict[int, Step]:
    """For each configuration from which an end can be reached the first step of a shortest way."""
    sources: dict[int, list[tuple[int, Step]]] = {}
    for at in range(exploration.reached):
        for step in exploration.steps[at]:
            sources.setdefault(step.target, []).append((at, step))
    configurations = exploration.configurations
    ready = [
        at
        for at in range(exploration.reached)
        if configurations[at].ended != GOING or not configurations[at].active
    ]
    seen, onwards = set(ready), {}
    for target in ready:  # grows while it is read
        for at, step in sources.get(target, ()):
            if at not in seen:
                seen.add(at)
                onwards[at] = step
                ready.append(at)
    return onwards


def _followed(onwards: dict[int, Step], at: int) -> Run:
    steps: list[tuple[int, int]] = []
    while at in onwards:
        steps.append((onwards[at].number, onwards[at].outcome))
        at = onwards[at].target
    return tuple(steps)


def _up_to_the_end(exploration: Exploration) -> Iterator[tuple[int, Run, int]]:
    """A configuration, the steps that lead on from it, and who is active, or hangs, after them.

    In breadth-first order; what is active after the instant of the end does not count.
    """
    for at, configuration in enumerate(exploration.configurations[: exploration.reached]):
        if at == 0 or configuration.ended == GOING:
            yield at, (), configuration.active | configuration.hanging
        if configuration.ended != GOING:
            continue
        for step in exploration.steps[at]:
            after = exploration.configurations[step.target]
            if after.ended != GOING:
                last = ((step.number, step.outcome),)
                yield at, last, after.active | after.hanging
