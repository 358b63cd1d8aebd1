"""Canonical counterexamples: fewest failures, then document order (semantics, section 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import disjunction, negation
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.analysis.solver import Solver

__all__ = ["canonical_scenario", "fewest"]


def fewest(solver: Solver, goal: str, terms: Sequence[str], count: Callable[[], int]) -> int | None:
    """The smallest number of ``terms`` that hold together with the indicator ``goal``.

    ``count`` counts them in the solver's last model. None if ``goal`` cannot hold. Raises
    Inconclusive at a limit.
    """
    if not solver.must_check([goal]):
        return None
    low, high, step = 0, count(), 1
    while low < high:
        middle = min(low + step, high) - 1
        if solver.must_check([goal, _at_most(solver, middle, terms)]):
            high, step = min(middle, count()), 1
        else:
            low, step = middle + 1, step * 2
    return high


def _at_most(solver: Solver, number: int, terms: Sequence[str]) -> str:
    return solver.name(f"((_ at-most {number}) {' '.join(terms)})" if terms else "true")


def canonical_scenario(solver: Solver, term: str) -> tuple[Outcome, ...] | None:
    """The canonical scenario in which ``term`` holds, or None if there is none.

    Among all with the fewest outcomes other than SUCCEEDED the one whose failing instances come
    first in document order, and among those FAILED before NO_START before HANG. Raises
    Inconclusive at a limit.
    """
    size = len(solver.automaton.runners)
    goal = solver.name(term)
    others = [negation(solver.encoding.succeeds(number)) for number in range(size)]
    number = fewest(solver, goal, others, lambda: len(_failing(solver.outcomes())))
    if number is None:
        return None
    fixed = [goal, _at_most(solver, number, others)]
    solver.must_check(fixed)
    outcomes = solver.outcomes()
    settled = -1
    for place in range(number):
        candidate = _failing(outcomes)[place]
        while candidate > settled + 1:
            earlier = solver.name(disjunction(others[settled + 1 : candidate]))
            if not solver.must_check([*fixed, earlier]):
                break
            outcomes = solver.outcomes()
            candidate = _failing(outcomes)[place]
        fixed.append(solver.name(others[candidate]))
        settled = candidate
    return _canonical_kinds(solver, fixed, outcomes)


def _canonical_kinds(
    solver: Solver, fixed: list[str], outcomes: tuple[Outcome, ...]
) -> tuple[Outcome, ...]:
    """Choose the first kind of failure that is possible, instance by instance."""
    kinds = [kind for kind in Outcome if kind in solver.encoding.possible]
    kinds.remove(Outcome.SUCCEEDED)
    for number in _failing(outcomes):
        for kind in kinds:
            name = solver.name(solver.encoding.outcome(number, (kind,)))
            if outcomes[number] is kind:
                fixed.append(name)
                break
            if solver.must_check([*fixed, name]):
                outcomes = solver.outcomes()
                fixed.append(name)
                break
    return outcomes


def _failing(outcomes: tuple[Outcome, ...]) -> list[int]:
    return [number for number, outcome in enumerate(outcomes) if outcome is not Outcome.SUCCEEDED]
