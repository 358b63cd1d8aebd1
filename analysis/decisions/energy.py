"""Energy: what all instances that a run triggers take together (semantics, section 8.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import disjunction
from gpsfsm.analysis.timing.amounts import (
    UNBOUNDED,
    Amounts,
    Number,
    Range,
    energies,
    plus,
    reached,
    whole,
)
from gpsfsm.analysis.timing.clocks import RealSolver, greatest
from gpsfsm.compile import UnitKind
from gpsfsm.model.report import Interval

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled
    from gpsfsm.model.event import Outcome

Answer = tuple[float, float | None] | None
"""The least and the greatest energy in joules; None if no reachable instance declares any."""


class _Unit(NamedTuple):
    """The energy of all that a unit triggers, until nothing is left to do.

    One range for the runs in which it succeeds and one for those in which it fails, if it can.
    """

    success: Range | None
    failure: Range | None


_NOTHING: Range = (0, 0)


def by_structure(structure: Structure) -> Answer:
    """Sums over what is triggered together, bounds over what is not."""
    amounts = energies(structure.compiled)
    plan = None if amounts is None else whole(structure, amounts, _Unit, _COMBINED)
    if amounts is None or plan is None:
        return None
    most = _either(plan.success, plan.failure)
    assert most is not None  # every unit can succeed
    return amounts.interval(most)


def _sequence(children: Sequence[_Unit]) -> _Unit:
    """Each child after the success of the one before; it fails with the first that fails."""
    before: Range | None = _NOTHING
    failure: Range | None = None
    for child in children:
        failure = _either(failure, _both(before, child.failure))
        before = _both(before, child.success)
    return _Unit(before, failure)


def _guard(children: Sequence[_Unit]) -> _Unit:
    """Each child after the failure of the one before: a sequence with the roles exchanged."""
    return _exchanged(_sequence([_exchanged(child) for child in children]))


def _all(children: Sequence[_Unit]) -> _Unit:
    """All children are triggered, and each goes on to its end."""
    success: Range | None = _NOTHING
    failure: Range | None = None  # of those so far at least one has failed
    for child in children:
        failure = _either(
            _both(failure, _either(child.success, child.failure)), _both(success, child.failure)
        )
        success = _both(success, child.success)
    return _Unit(success, failure)


def _any(children: Sequence[_Unit]) -> _Unit:
    return _exchanged(_all([_exchanged(child) for child in children]))


_COMBINED: Mapping[UnitKind, Callable[[Sequence[_Unit]], _Unit]] = {
    UnitKind.EMPTY: _sequence,
    UnitKind.SEQUENCE: _sequence,
    UnitKind.GUARD: _guard,
    UnitKind.DEAD: _guard,
    UnitKind.ALL: _all,
    UnitKind.ANY: _any,
}


def _exchanged(unit: _Unit) -> _Unit:
    return _Unit(unit.failure, unit.success)


def _both(one: Range | None, other: Range | None) -> Range | None:
    """One after or beside the other."""
    if one is None or other is None:
        return None
    return plus(one[0], other[0]), plus(one[1], other[1])


def _either(one: Range | None, other: Range | None) -> Range | None:
    """One or the other."""
    if one is None or other is None:
        return other if one is None else one
    return min(one[0], other[0]), max(one[1], other[1])


# -- z3 -------------------------------------------------------------------------------------


def by_solver(solver: Solver) -> Answer:
    """Search scenarios that take less and less, or more and more."""
    amounts = energies(solver.compiled)
    if amounts is None:
        return None
    taking = list(reached(solver, amounts))
    if not taking:
        return None
    least = {number: amounts.ranges[number][0] for number in taking}
    most = {number: amounts.ranges[number][1] for number in taking}
    solver.must_check([])
    plain = solver.outcomes()
    real = RealSolver(solver)
    lowest = -_greatest(real, {number: -weight for number, weight in least.items()}, plain)
    if UNBOUNDED in most.values():
        return amounts.interval((lowest, UNBOUNDED))
    return amounts.interval((lowest, _greatest(real, most, plain)))


def _greatest(solver: RealSolver, weights: Mapping[int, Number], plain: tuple[Outcome, ...]) -> int:
    """The greatest sum of the weights of triggered instances; ``plain`` is some scenario."""
    declared = {number: int(weight) for number, weight in weights.items() if weight}
    sums = _sum(solver, declared)

    def find(target: int) -> int | None:
        if not solver.must_check([solver.name(f"(>= {sums} {_real(target)})")]):
            return None
        return _taken(solver, solver.outcomes(), declared)

    bound = sum(weight for weight in declared.values() if weight > 0)
    return greatest(_taken(solver, plain, declared), bound, find)


def _sum(solver: Solver, weights: Mapping[int, int]) -> str:
    automaton = solver.automaton
    terms = (
        f"(ite {solver.encoding.triggered(automaton.runner_node(number))} {_real(weight)} 0.0)"
        for number, weight in weights.items()
    )
    return f"(+ 0.0 {' '.join(terms)})"


def _real(number: int) -> str:
    return f"{number}.0" if number >= 0 else f"(- {-number}.0)"


def _taken(solver: Solver, outcomes: Sequence[Outcome], weights: Mapping[int, int]) -> int:
    run = solver.evaluator.run(outcomes.__getitem__)
    return sum(
        weight
        for number, weight in weights.items()
        if solver.automaton.runner_node(number) in run.triggered
    )


def over_limit(solver: Solver, amounts: Amounts, limit: float) -> str:
    """A run takes more than ``limit`` joules, or any amount. ``solver`` must know real numbers."""
    encoding, automaton = solver.encoding, solver.automaton
    weights = {number: amounts.ranges[number][1] for number in amounts.declared}
    endless = [number for number, weight in weights.items() if weight == UNBOUNDED]
    finite = {number: int(weight) for number, weight in weights.items() if weight != UNBOUNDED}
    return disjunction(
        (
            *(encoding.triggered(automaton.runner_node(number)) for number in endless),
            f"(> {_sum(solver, finite)} {amounts.term(limit)})",
        )
    )


def facts(answer: Answer, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``energy``."""
    del compiled
    return {"energy": None if answer is None else Interval(*answer)}


ANALYSIS = Analysis(
    "energy",
    by_structure,
    by_solver,
    facts,
    matters=lambda options: options.energy_limit_j is not None,
)
