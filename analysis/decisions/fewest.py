"""The fewest failures with which a plan gives up: how much can go wrong before it does."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis import minimal
from gpsfsm.analysis.encode import FALSE
from gpsfsm.analysis.registry import Analysis
from gpsfsm.analysis.siblings import successes_needed
from gpsfsm.compile import UnitKind
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

__all__ = ["ANALYSIS"]

Answer = int | None
"""The number of FAILED events in the smallest run that gives up; None if none does."""


class _Unit(NamedTuple):
    """The fewest failures among all that a unit triggers, by how it ends; infinite: it cannot."""

    success: float
    failure: float


def by_structure(structure: Structure) -> Answer:
    """Sums over what must fail together, minima over what may fail alone."""
    units = structure.units
    found = [_Unit(0, inf)] * len(units)
    for unit in reversed(range(len(units))):
        children = [found[child] for child in units.children[unit]]
        kind = units.kinds[unit]
        if kind is UnitKind.RUNNER:
            success = 0 if structure.can_succeed[unit] else inf
            found[unit] = _Unit(success, 1 if structure.can_fail[unit] else inf)
        elif kind is UnitKind.NOT:
            found[unit] = _exchanged(children[0])
        elif kind is UnitKind.BRANCH:
            found[unit] = _branch(*children)
        elif kind is UnitKind.SEQUENCE:
            found[unit] = _sequence(children)
        elif kind in (UnitKind.GUARD, UnitKind.DEAD):
            found[unit] = _exchanged(_sequence([_exchanged(child) for child in children]))
        else:
            found[unit] = _parallel(children, successes_needed(units, unit))
    fewest = found[0].failure
    return None if fewest == inf else int(fewest)


def _exchanged(unit: _Unit) -> _Unit:
    return _Unit(unit.failure, unit.success)


def _sequence(children: Sequence[_Unit]) -> _Unit:
    """Each child after the success of the one before; it fails with the first that fails."""
    success, failure = 0.0, inf
    for child in children:
        failure = min(failure, success + child.failure)
        success += child.success
    return _Unit(success, failure)


_FAILS = _Unit(inf, 0)


def _branch(condition: _Unit, then: _Unit, otherwise: _Unit = _FAILS) -> _Unit:
    return _Unit(
        *(
            min(condition.success + one, condition.failure + other)
            for one, other in zip(then, otherwise, strict=True)
        )
    )


def _parallel(children: Sequence[_Unit], needed: int) -> _Unit:
    """All children are triggered, and each goes on to its end."""
    failures = len(children) - needed + 1
    exchanged = [_exchanged(child) for child in children]
    return _Unit(_successes(children, needed), _successes(exchanged, failures))


def _successes(children: Sequence[_Unit], needed: int) -> float:
    """The fewest failures if at least so many children succeed."""
    wanted = needed - sum(child.success <= child.failure for child in children)
    more = sorted(
        child.success - child.failure for child in children if child.success > child.failure
    )
    if wanted > len(more):
        return inf
    return sum(map(min, children)) + sum(more[: max(wanted, 0)])


def by_solver(solver: Solver) -> Answer:
    """Bound the number of FAILED events lower and lower."""
    term = solver.encoding.triggered(solver.automaton.give_up)
    if not solver.decide([term])[0]:
        return None
    failures = [
        solver.encoding.happens(Signal(node.index, Event.FAILED))
        for node in solver.automaton.runners
    ]

    def count() -> int:
        outcomes = solver.outcomes()
        return solver.evaluator.run(outcomes.__getitem__).failures

    return minimal.fewest(
        solver, solver.name(term), [term for term in failures if term != FALSE], count
    )


def facts(answer: Answer, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``fewest_failures_to_give_up``."""
    del compiled
    return {"fewest_failures_to_give_up": answer}


ANALYSIS = Analysis("fewest", by_structure, by_solver, facts)
