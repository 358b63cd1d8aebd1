"""Overlaps: two runner instances that hold the same resource at the same time.

Two instances are active at once in some run if and only if there is a scenario that triggers both
while the outcomes of both are held back (semantics, section 8.4): up to the instant at which both
are active, neither has ended. Where durations are declared, a clock has the last word.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.counterexamples import necessary
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.decisions.orphans import too_late
from gpsfsm.analysis.encode import conjunction, negation
from gpsfsm.analysis.proof.refutation import Refutation, UnprovedError
from gpsfsm.analysis.solver import InconclusiveError
from gpsfsm.analysis.structure import Can, Paths
from gpsfsm.analysis.timing.pairs import Row, candidates, is_parallel, leaving, ranges_of
from gpsfsm.compile import UnitKind
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.evaluate import Evaluator, OutcomeOf, Run
    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.analysis.timing.meeting import Clock
    from gpsfsm.compile import Compiled, Units


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
        resource: [
            number
            for number in numbers
            if structure.reached[unit_of[number]] and not structure.late[unit_of[number]]
        ]
        for resource, numbers in holders.items()
    }
    ranges = ranges_of(compiled)
    paths = Paths(structure)
    clock = structure.clock
    if clock is not None:
        meets = _Meets(paths, ranges)
        return _search(
            compiled,
            in_time,
            ranges,
            lambda one, other: meets(one, other) and clock.meet(one, other),
        )
    pairs: list[tuple[int, str, int, int]] = []
    for resource, held in in_time.items():
        pairs += ((block, resource, *pair) for block, pair in _side_by_side(structure, held))
        for first in held:
            for block, second in _left_behind(paths, unit_of[first], held, ranges):
                pairs.append((block, resource, first, second))
    return _first_pairs(pairs)


def by_solver(solver: Solver) -> Answer:
    """Ask for the first pair of each parallel control, unless the graph orders the two."""
    compiled, clock = solver.compiled, solver.clock
    holders = _holders(compiled)
    if not holders:
        return ()
    may_meet = _MayMeet(solver)

    def meet(first: int, second: int) -> bool:
        if not may_meet(first, second):
            return False
        untimed = (
            may_meet.shown(first, second) or (solver.decide([_overlap(solver, first, second)])[0])
        )
        if not untimed:
            return False
        return clock is None or clock.meet(first, second)

    return _search(compiled, holders, ranges_of(compiled), meet)


def _search(
    compiled: Compiled,
    holders: Mapping[str, Sequence[int]],
    ranges: Sequence[tuple[int, int]],
    meet: Callable[[int, int], bool],
) -> Answer:
    """Try the pairs of each parallel control in order until one is found."""
    overlaps: list[tuple[int, str, int, int]] = []
    count = 0
    for resource, numbers in holders.items():
        for block, rows in candidates(compiled, numbers, ranges).items():
            for first, second in _pairs(numbers, rows):
                count += 1
                if count > _MAX_PAIRS:
                    raise InconclusiveError
                if meet(first, second):
                    overlaps.append((block, resource, first, second))
                    break
    return _first_pairs(overlaps)


def _pairs(numbers: Sequence[int], rows: Iterable[Row]) -> Iterator[tuple[int, int]]:
    for row in rows:
        for place in range(row.start, row.end):
            yield row.first, numbers[place]


def _holders(compiled: Compiled) -> dict[str, list[int]]:
    """The numbers of the instances that hold a resource, by resource; several only."""
    holders: dict[str, list[int]] = {}
    for number, binding in enumerate(compiled.bindings):
        for resource in binding.provider.resources if binding is not None else ():
            holders.setdefault(resource, []).append(number)
    return {name: numbers for name, numbers in sorted(holders.items()) if len(numbers) > 1}


def _first_pairs(pairs: Iterable[tuple[int, str, int, int]]) -> Answer:
    """The first pair of each control and resource, in document order of the pairs."""
    best: dict[tuple[int, str], tuple[int, int]] = {}
    for block, resource, first, second in pairs:
        key = block, resource
        best[key] = min(best.get(key, (first, second)), (first, second))
    overlaps = [Overlap(block, resource, *pair) for (block, resource), pair in best.items()]
    return tuple(sorted(overlaps, key=lambda each: (each.first, each.second, each.resource)))


# -- by structure ---------------------------------------------------------------------------


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
        if _goes_on(units, parent, can):
            place = bisect_left(held, ranges[child][1])
            if place < len(held) and held[place] < ranges[parent][1]:
                yield leaving(units, blocks), held[place]
        if is_parallel(units, parent):
            blocks.append(parent)


def _goes_on(units: Units, parent: int, can: Can) -> bool:
    """True if what follows in a sequence or recovery can be triggered while a child is active."""
    kind = units.kinds[parent]
    return (kind is UnitKind.SEQUENCE and can.succeed) or (kind is UnitKind.GUARD and can.fail)


class _Meets:
    """True if two instances meet where durations are free, the first one before the second."""

    def __init__(self, paths: Paths, ranges: Sequence[tuple[int, int]]) -> None:
        self._paths = paths
        self._ranges = ranges
        self._first = -1
        self._steps: list[tuple[int, Can]] = []

    def __call__(self, first: int, second: int) -> bool:
        units = self._paths.units
        if first != self._first:
            unit = self._paths.structure.unit_of[first]
            self._first = first
            self._steps = [(parent, can) for _, parent, can in self._paths.while_active(unit)]
        for parent, can in self._steps:
            low, high = self._ranges[parent]
            if low <= second < high:
                return is_parallel(units, parent) or _goes_on(units, parent, can)
        return False


# -- by z3 ----------------------------------------------------------------------------------


class _MayMeet:
    """True if two instances may both be triggered before either ends, at the widest estimate."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver
        self._node = solver.automaton.runner_node
        self._causes: dict[int, Mapping[int, Outcome]] = {}
        self._alone: dict[int, Run] = {}

    def __call__(self, first: int, second: int) -> bool:
        if self._node(second) not in self._run(first).triggered:
            return False
        if self._node(first) not in self._run(second).triggered:
            return False
        wanted = self._wanted(first, second)
        if wanted is None:
            return False
        run = self._solver.evaluator.possibly(wanted, withheld=(first, second))
        return self._both(run, first, second)

    def shown(self, first: int, second: int) -> bool:
        """True if the plainest scenario shows that they meet."""
        if UnitKind.EMPTY in self._solver.compiled.units.kinds:
            return False  # one of them might be triggered too late
        wanted = self._wanted(first, second) or {}
        size = len(self._solver.automaton.runners)
        plain = tuple(wanted.get(number, Outcome.SUCCEEDED) for number in range(size))
        if not self._solver.constraints.admit(plain):
            return False
        run = self._solver.evaluator.run(plain.__getitem__, withheld=(first, second))
        return self._both(run, first, second)

    def _both(self, run: Run, first: int, second: int) -> bool:
        return self._node(first) in run.triggered and self._node(second) in run.triggered

    def _wanted(self, first: int, second: int) -> Mapping[int, Outcome] | None:
        """The outcomes that trigger both; None if they contradict each other."""
        one, other = self._cause(first), self._cause(second)
        if any(other.get(number, outcome) is not outcome for number, outcome in one.items()):
            return None
        return {**one, **other}

    def _cause(self, number: int) -> Mapping[int, Outcome]:
        if number not in self._causes:
            self._causes[number] = necessary(self._solver.automaton, self._node(number))
        return self._causes[number]

    def _run(self, number: int) -> Run:
        if number not in self._alone:
            self._alone[number] = self._solver.evaluator.possibly(
                self._cause(number), withheld=(number,)
            )
        return self._alone[number]


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

    def failing(structure: Structure) -> Iterator[int]:
        yield from structure.failing_before(structure.unit_of[first])
        yield from structure.failing_before(structure.unit_of[second])

    def shows(evaluator: Evaluator, outcome_of: OutcomeOf) -> bool:
        triggered = evaluator.run(outcome_of, withheld=(first, second)).triggered
        return all(evaluator.automaton.runner_node(n) in triggered for n in (first, second))

    if clock is not None:
        return Claim(
            meet=(first, second),
            more=lambda solver: clock.term(solver, first, second),
            failing=failing,
            shows=lambda _, outcome_of: clock.shows_meeting(outcome_of, first, second),
            through=clock.with_clocks,
        )
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


# -- proof ----------------------------------------------------------------------------------


def refute(answer: Answer, refutation: Refutation) -> None:
    """No pair before the first of a control is ever active at once, none at all without one."""
    structure, circuit = refutation.structure, refutation.circuit
    holders = _holders(refutation.compiled)
    if not holders:
        return
    _require_simple(structure)
    meets = _Meets(Paths(structure), ranges_of(refutation.compiled))
    timed = structure.clock is not None
    first_pairs = {(each.block, each.resource): (each.first, each.second) for each in answer}
    ranges = ranges_of(refutation.compiled)
    count = 0
    for resource, numbers in holders.items():
        for block, rows in candidates(refutation.compiled, numbers, ranges).items():
            end = first_pairs.get((block, resource), (len(structure.unit_of), 0))
            for row in rows:
                seconds = [n for n in numbers[row.start : row.end] if (row.first, n) < end]
                if timed:  # z3 has said of these that they meet with other durations only
                    seconds = [n for n in seconds if not meets(row.first, n)]
                count += len(seconds)
                if count > _MAX_PAIRS:
                    raise UnprovedError
                others = circuit.any(map(refutation.active, seconds))
                refutation.never(circuit.all((refutation.active(row.first), others)))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run in which both are triggered, and the outcome of neither comes."""
    for each in answer:
        _require_simple(witnesses.structure)
        numbers = each.first, each.second
        failing = overlap_claim(None, *numbers).failing(witnesses.structure)
        nodes = tuple(map(witnesses.automaton.runner_node, numbers))
        witnesses.expect(witnesses.lane(failing, held=numbers), triggered=nodes)


def _require_simple(structure: Structure) -> None:
    """Raise UnprovedError where an instance may be triggered too late."""
    if UnitKind.EMPTY in structure.units.kinds:
        raise UnprovedError


ANALYSIS = Analysis("overlaps", by_structure, by_solver, facts, refute=refute, show=show)
