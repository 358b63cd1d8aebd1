"""Overlaps: two runner instances that hold the same resource at the same time.

Two instances are active at once in some run if and only if there is a scenario that triggers both
while the outcomes of both are held back (semantics, section 8.4): up to the instant at which both
are active, neither has ended. Where durations are declared, a clock has the last word.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions.orphans import too_late
from gpsfsm.analysis.encode import conjunction, negation
from gpsfsm.analysis.paths import Paths
from gpsfsm.analysis.registry import Analysis
from gpsfsm.analysis.solver import Inconclusive
from gpsfsm.analysis.timing.meeting import Clock, clock_of
from gpsfsm.analysis.witness import necessary
from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.evaluate import Evaluator, OutcomeOf
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled, Units

__all__ = ["ANALYSIS", "Overlap", "overlap_claim"]


class Overlap(NamedTuple):
    """Instances of one parallel control that hold the same resource at once.

    ``block`` is the unit of the control: the one that holds both, or, where the second instance
    comes later, the one that leaves the first one behind. ``first`` and ``second`` are the numbers
    of the first such pair in document order.
    """

    block: int
    resource: str
    first: int
    second: int


Answer = tuple[Overlap, ...]

_MAX_PAIRS = 20_000
"""Pairs of holders of one resource that are asked for one by one."""


def by_structure(structure: Structure) -> Answer:
    """Units of a parallel control meet; so do those that it leaves behind, and what comes later."""
    compiled = structure.compiled
    holders = _holders(compiled)
    if not holders:
        return ()
    unit_of = structure.unit_of
    in_time = {
        number
        for numbers in holders.values()
        for number in numbers
        if structure.reached[unit_of[number]] and not structure.late[unit_of[number]]
    }
    pairs: list[tuple[int, str, int, int]] = []
    ranges = _ranges(compiled.units, structure.number)
    paths = Paths(structure)
    clock = clock_of(compiled, structure.constraints)
    if clock is not None:
        candidates = {
            resource: _meeting(paths, [number for number in numbers if number in in_time], ranges)
            for resource, numbers in holders.items()
        }
        return _found(compiled, candidates, clock.meet)
    for resource, numbers in holders.items():
        held = [number for number in numbers if number in in_time]
        pairs += ((block, resource, *pair) for block, pair in _side_by_side(structure, held))
        for first in held:
            for block, second in _left_behind(paths, unit_of[first], held, ranges):
                pairs.append((block, resource, first, second))
    return _first_pairs(pairs)


def by_solver(solver: Solver) -> Answer:
    """Ask for the first pair of each parallel control, unless the graph orders the two."""
    compiled = solver.compiled
    candidates = {
        resource: _unordered(solver, numbers) for resource, numbers in _holders(compiled).items()
    }
    clock = clock_of(compiled, solver.constraints, rlimit=solver.rlimit)

    def meet(first: int, second: int) -> bool:
        untimed = solver.decide([_overlap(solver, first, second)])[0]
        return untimed and (clock is None or clock.meet(first, second))

    return _found(compiled, candidates, meet)


def _found(
    compiled: Compiled,
    candidates: Mapping[str, Iterable[tuple[int, int]]],
    meet: Callable[[int, int], bool],
) -> Answer:
    """Try the pairs of each parallel control in order until one is found."""
    found: list[tuple[int, str, int, int]] = []
    told: set[tuple[int, str]] = set()
    for resource, pairs in candidates.items():
        for tried, (first, second) in enumerate(pairs):
            if tried > _MAX_PAIRS:
                raise Inconclusive
            block = _block(compiled, first, second)
            if block < 0 or (block, resource) in told:
                continue  # without a parallel control only one instance is active at a time
            if meet(first, second):
                told.add((block, resource))
                found.append((block, resource, first, second))
    return _first_pairs(found)


def _holders(compiled: Compiled) -> dict[str, list[int]]:
    """The numbers of the instances that hold a resource, by resource; several only."""
    found: dict[str, list[int]] = {}
    for number, binding in enumerate(compiled.bindings):
        for resource in binding.provider.resources if binding is not None else ():
            found.setdefault(resource, []).append(number)
    return {name: numbers for name, numbers in sorted(found.items()) if len(numbers) > 1}


def _first_pairs(pairs: Iterable[tuple[int, str, int, int]]) -> Answer:
    """The first pair of each control and resource, in document order of the pairs."""
    best: dict[tuple[int, str], tuple[int, int]] = {}
    for block, resource, first, second in pairs:
        key = block, resource
        best[key] = min(best.get(key, (first, second)), (first, second))
    overlaps = [Overlap(block, resource, *pair) for (block, resource), pair in best.items()]
    return tuple(sorted(overlaps, key=lambda found: (found.first, found.second, found.resource)))


# -- by structure ---------------------------------------------------------------------------


def _ranges(units: Units, number: Sequence[int]) -> list[tuple[int, int]]:
    """The runner numbers in each unit, as [first, last + 1): a unit is one piece of the text."""
    found = [(-1, -1)] * len(units)
    for unit in reversed(range(len(units))):
        if units.kinds[unit] is UnitKind.RUNNER:
            found[unit] = number[unit], number[unit] + 1
            continue
        inside = [found[child] for child in units.children[unit] if found[child][1] >= 0]
        if inside:
            found[unit] = min(low for low, _ in inside), max(high for _, high in inside)
    return found


def _side_by_side(structure: Structure, held: list[int]) -> Iterator[tuple[int, tuple[int, int]]]:
    """Per parallel control the first pair of holders in different units of it."""
    units = structure.units
    first: dict[int, int] = {structure.unit_of[number]: number for number in held}
    for unit in reversed(range(len(units))):
        inside = sorted(first[child] for child in units.children[unit] if child in first)
        if inside:
            first[unit] = inside[0]
        if len(inside) > 1 and units.kinds[unit] in (UnitKind.ALL, UnitKind.ANY):
            yield unit, (inside[0], inside[1])


def _left_behind(
    paths: Paths, unit: int, held: list[int], ranges: Sequence[tuple[int, int]]
) -> Iterator[tuple[int, int]]:
    """Per parallel control around ``unit`` the first later holder that it may still be active at.

    Yields (control, number).
    """
    units = paths.units
    blocks: list[int] = []
    for child, parent, can in paths.while_active(unit):
        kind = units.kinds[parent]
        goes_on = (kind is UnitKind.SEQUENCE and can.succeed) or (
            kind is UnitKind.GUARD and can.fail
        )
        if goes_on:
            place = bisect_left(held, ranges[child][1])
            if place < len(held) and held[place] < ranges[parent][1]:
                yield _leaving(units, blocks), held[place]
        if _is_parallel(units, parent):
            blocks.append(parent)


def _meeting(
    paths: Paths, held: list[int], ranges: Sequence[tuple[int, int]]
) -> Iterator[tuple[int, int]]:
    """All pairs of holders that meet where durations are free, in document order."""
    units = paths.units
    for place, first in enumerate(held):
        steps = list(paths.while_active(paths.structure.unit_of[first]))
        for second in held[place + 1 :]:
            for _, parent, can in steps:
                low, high = ranges[parent]
                if not low <= second < high:
                    continue
                kind = units.kinds[parent]
                if kind in (UnitKind.ALL, UnitKind.ANY) or (
                    can.succeed if kind is UnitKind.SEQUENCE else can.fail
                ):
                    yield first, second
                break


def _is_parallel(units: Units, unit: int) -> bool:
    return units.kinds[unit] in (UnitKind.ALL, UnitKind.ANY) and len(units.children[unit]) > 1


def _leaving(units: Units, blocks: Sequence[int]) -> int:
    """The control that leaves an instance behind.

    It is the innermost parallel_any around it, or else the innermost parallel_all.
    """
    for block in blocks:
        if units.kinds[block] is UnitKind.ANY:
            return block
    return blocks[0]


def _block(compiled: Compiled, first: int, second: int) -> int:
    """The parallel control of a pair, or -1 where none can make the two overlap."""
    units = compiled.units
    unit_of = _unit_of(compiled)
    above = set(_ancestors(units, unit_of[second]))
    blocks: list[int] = []
    for unit in _ancestors(units, unit_of[first]):
        if unit in above:
            if units.kinds[unit] in (UnitKind.ALL, UnitKind.ANY):
                return unit
            return _leaving(units, blocks) if blocks else -1
        if _is_parallel(units, unit):
            blocks.append(unit)
    return -1


def _unit_of(compiled: Compiled) -> dict[int, int]:
    """The unit of each runner, by number."""
    units = compiled.units
    numbers = {node.origin: number for number, node in enumerate(compiled.automaton.runners)}
    return {
        numbers[units.elements[unit]]: unit
        for unit, kind in enumerate(units.kinds)
        if kind is UnitKind.RUNNER
    }


def _ancestors(units: Units, unit: int) -> Iterator[int]:
    unit = units.parents[unit]
    while unit >= 0:
        yield unit
        unit = units.parents[unit]


# -- by z3 ----------------------------------------------------------------------------------


def _unordered(solver: Solver, numbers: Sequence[int]) -> Iterator[tuple[int, int]]:
    """The pairs that may both be triggered before either ends, at the widest estimate."""
    automaton, evaluator = solver.automaton, solver.evaluator
    nodes = {number: automaton.runner_node(number) for number in numbers}
    causes = {number: necessary(automaton, node) for number, node in nodes.items()}
    alone = {
        number: evaluator.possibly(causes[number], withheld=(number,)).triggered
        for number in numbers
    }
    for place, first in enumerate(numbers):
        for second in numbers[place + 1 :]:
            if nodes[second] not in alone[first] or nodes[first] not in alone[second]:
                continue
            both = causes[first] | causes[second]
            if any(both[number] is not outcome for number, outcome in causes[first].items()):
                continue
            run = evaluator.possibly(both, withheld=(first, second))
            if nodes[first] in run.triggered and nodes[second] in run.triggered:
                yield first, second


def _overlap(solver: Solver, first: int, second: int) -> str:
    """Both are triggered without the outcome of either, and neither comes too late."""
    variant = solver.without((first, second))
    node = solver.automaton.runner_node
    return conjunction(
        (
            variant.triggered(node(first)),
            variant.triggered(node(second)),
            negation(too_late(solver, first)),
            negation(too_late(solver, second)),
        )
    )


def overlap_claim(clock: Clock | None, first: int, second: int) -> Claim:
    """A run in which both instances are active at once; ``clock`` is that of the plan."""
    if clock is not None:
        return Claim(
            meet=(first, second),
            more=lambda solver: clock.term(solver, first, second),
            shows=lambda *_: False,
            through=clock.told,
        )

    def failing(structure: Structure) -> Iterator[int]:
        yield from structure.failing_before(structure.unit_of[first])
        yield from structure.failing_before(structure.unit_of[second])

    def shows(evaluator: Evaluator, outcome_of: OutcomeOf) -> bool:
        triggered = evaluator.run(outcome_of, withheld=(first, second)).triggered
        return all(evaluator.automaton.runner_node(n) in triggered for n in (first, second))

    return Claim(
        meet=(first, second),
        more=lambda solver: _overlap(solver, first, second),
        failing=failing,
        shows=shows,
    )


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """No facts: the findings tell."""
    del answer, compiled
    return {}


ANALYSIS = Analysis("overlaps", by_structure, by_solver, facts)
