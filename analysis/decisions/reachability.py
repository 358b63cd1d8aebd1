"""Reachability: which runner instances no run triggers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.decisions import Analysis

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.proof.witnesses import Witnesses
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


def refute(answer: Answer, refutation: Refutation) -> None:
    """None of the others is ever triggered."""
    node = refutation.automaton.runner_node
    refutation.never(*(refutation.snapshot.fired[node(number)] for number in answer))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run for each that is not triggered where nothing fails."""
    structure, unreachable = witnesses.structure, frozenset(answer)
    for number, unit in enumerate(structure.unit_of):
        node = witnesses.automaton.runner_node(number)
        if number not in unreachable and not witnesses.plain.triggered[node]:
            witnesses.expect(witnesses.lane(structure.failing_before(unit)), triggered=(node,))


ANALYSIS = Analysis("reachability", by_structure, by_solver, facts, questions, refute, show)
