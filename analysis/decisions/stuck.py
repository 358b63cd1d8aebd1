"""Stuck runs: neither completion nor give-up, and nothing more can happen.

Under the default fault model no compiled plan can be stuck (theorem of semantics, section 4).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions.completion import frequency
from gpsfsm.analysis.encode import conjunction, disjunction, negation
from gpsfsm.analysis.registry import Analysis
from gpsfsm.model.event import End
from gpsfsm.model.report import Frequency

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Block

__all__ = ["ANALYSIS", "stuck_claim"]

Answer = Frequency


def by_structure(structure: Structure) -> Answer:
    """Where every runner that starts also ends, every unit succeeds or fails."""
    del structure
    return Frequency.NEVER


def by_solver(solver: Solver) -> Answer:
    """Ask for a scenario that ends in neither way, and for one that ends in some way."""
    stuck, ends = solver.decide(questions(solver))
    return frequency(stuck, ends)


def questions(solver: Solver) -> list[str]:
    """Whether it ends in neither way, and whether it ends in some way."""
    complete = solver.encoding.triggered(solver.automaton.complete)
    give_up = solver.encoding.triggered(solver.automaton.give_up)
    return [
        conjunction((negation(complete), negation(give_up))),
        disjunction((complete, give_up)),
    ]


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``stuck``."""
    del compiled
    return {"stuck": answer or Frequency.UNKNOWN}


def stuck_claim(not_waiting: tuple[Block, ...] = ()) -> Claim:
    """A run that is stuck, though none of these blocks waits for ever in it."""

    def none_waits(solver: Solver) -> str:
        encoding = solver.encoding
        return conjunction(
            disjunction((negation(encoding.happens(block.trigger)), encoding.triggered(block.join)))
            for block in not_waiting
        )

    return Claim(ends=End.STUCK, more=none_waits)


ANALYSIS = Analysis("stuck", by_structure, by_solver, facts, questions)
