"""Reachability: which runner instances no run triggers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.decisions import Analysis

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

Answer = tuple[int, ...]
"""The numbers of the unreachable runner instances."""


def by_structure(structure: Structure) -> Answer:
    """A unit of a recovery is reached only if all that is before it can fail."""
    return tuple(
        number for number, unit in enumerate(structure.unit_of) if not structure.reached[unit]
    )


def by_solver(solver: Solver) -> Answer:
    """Ask for a scenario that triggers the instance."""
    reached = solver.decide(questions(solver))
    return tuple(number for number, is_reached in enumerate(reached) if not is_reached)


def questions(solver: Solver) -> list[str]:
    """True if the instance is triggered, for each."""
    return [solver.encoding.triggered(node.index) for node in solver.automaton.runners]


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``unreachable``."""
    plan = compiled.automaton.plan
    return {"unreachable": tuple(plan.path(plan.runners[number]) for number in answer or ())}


ANALYSIS = Analysis("reachability", by_structure, by_solver, facts, questions)
