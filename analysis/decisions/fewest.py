"""The fewest failures with which a plan gives up: how much can go wrong before it does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis import minimal
from gpsfsm.analysis.encode import FALSE
from gpsfsm.analysis.registry import Analysis
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

__all__ = ["ANALYSIS"]

Answer = int | None
"""The number of FAILED events in the smallest run that gives up; None if none does."""


def by_structure(structure: Structure) -> Answer:
    """Sums over what must fail together, minima over what may fail alone."""
    return structure.fewest[0] if structure.can_fail[0] else None


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
