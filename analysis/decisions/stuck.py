"""Runs with a bad end: stuck, or, on an engine without give-up, hanging or aborted.

Stuck: neither completion nor give-up, and nothing more can happen.

Under the default fault model no compiled plan can be stuck (theorem of semantics, section 4).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.decisions.completion import frequency
from gpsfsm.analysis.encode import conjunction, disjunction, negation
from gpsfsm.model.event import End
from gpsfsm.model.report import EngineFacts, Frequency

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Block

Answer = tuple[Frequency, Frequency, Frequency]
"""The frequencies with which a run is stuck, hangs, and aborts the engine."""

_ENDS = (End.STUCK, End.HANG, End.ABORT)


def by_structure(structure: Structure) -> Answer:
    """Never: where every runner that starts also ends, every unit succeeds or fails."""
    del structure
    return Frequency.NEVER, Frequency.NEVER, Frequency.NEVER


def by_solver(solver: Solver) -> Answer:
    """Ask for a scenario that ends in this way, and for one that ends in another way."""
    answers = solver.decide(questions(solver))
    stuck, hangs, aborts = map(frequency, answers[::2], answers[1::2])
    return stuck, hangs, aborts


def questions(solver: Solver) -> list[str]:
    """For each such end, whether a run ends so, and whether a run can end in another way.

    A run that can abort after it has completed can also end before it does.
    """
    encoding = solver.encoding
    complete = encoding.ending(End.COMPLETED)
    terms: list[str] = []
    for end in _ENDS:
        term = encoding.ending(end)
        terms += [term, disjunction((negation(term), complete))]
    return terms


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``stuck``; of an engine also ``engine``."""
    stuck, hangs, aborts = answer or (Frequency.UNKNOWN,) * 3
    traits = compiled.automaton.traits
    if traits.gives_up:
        return {"stuck": stuck}
    return {"stuck": stuck, "engine": EngineFacts(traits.engine, hangs, aborts)}


def stuck_claim(not_waiting: tuple[Block, ...] = ()) -> Claim:
    """A run that is stuck, though none of these blocks waits for ever in it."""

    def none_waits(solver: Solver) -> str:
        encoding = solver.encoding
        return conjunction(
            disjunction((negation(encoding.happens(block.trigger)), encoding.triggered(block.join)))
            for block in not_waiting
        )

    return Claim(ends=End.STUCK, more=none_waits)


def refute(answer: Answer, refutation: Refutation) -> None:
    """Every run ends; on the paper's automaton, of which alone the structural pass speaks."""
    assert answer == (Frequency.NEVER,) * 3
    ends = -refutation.completed, -refutation.gave_up
    refutation.never(refutation.circuit.all((refutation.over, *ends)))


ANALYSIS = Analysis("stuck", by_structure, by_solver, facts, questions, refute, lambda *_: None)
