"""Completion and give-up: in which runs the plan completes, and in which it gives up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import disjunction, negation
from gpsfsm.model.event import End
from gpsfsm.model.report import Frequency

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

Answer = tuple[Frequency, Frequency]
"""The frequencies with which the plan completes, and gives up."""


def frequency(possible: bool, avoidable: bool) -> Frequency:
    """From "some run does it" and "some run does not" to always, sometimes, never."""
    if not possible:
        return Frequency.NEVER
    return Frequency.SOMETIMES if avoidable else Frequency.ALWAYS


def by_structure(structure: Structure) -> Answer:
    """It completes in the runs in which it succeeds, and gives up in those in which it fails."""
    succeeds, fails = structure.can_succeed[0], structure.can_fail[0]
    return frequency(succeeds, fails), frequency(fails, succeeds)


def by_solver(solver: Solver) -> Answer:
    """Ask for a scenario with the ending, and for one without."""
    done, not_done, gave_up, not_gave_up = solver.decide(questions(solver))
    return frequency(done, not_done), frequency(gave_up, not_gave_up)


def questions(solver: Solver) -> list[str]:
    """True if it completes, does not complete, gives up, does not give up."""
    encoding = solver.encoding
    complete, give_up = encoding.ending(End.COMPLETED), encoding.ending(End.GAVE_UP)
    fails = disjunction((negation(complete), encoding.ending(End.ABORT)))
    return [complete, fails, give_up, negation(give_up)]


def facts(answer: Answer | None, compiled: Compiled) -> Mapping[str, Any]:
    """The facts ``completes`` and ``gives_up``."""
    del compiled
    completes, gives_up = answer or (Frequency.UNKNOWN, Frequency.UNKNOWN)
    return {"completes": completes, "gives_up": gives_up}


def give_up_claim() -> Claim:
    """A run that gives up."""
    return Claim(ends=End.GAVE_UP, failing=lambda structure: structure.failing(0))


def refute(answer: Answer, refutation: Refutation) -> None:
    """No run ends in a way that is never taken, or without one that always is."""
    for frequency_, end in zip(answer, (refutation.completed, refutation.gave_up), strict=True):
        if frequency_ is Frequency.NEVER:
            refutation.never(end)
        elif frequency_ is Frequency.ALWAYS:
            refutation.never(refutation.circuit.all((refutation.over, -end)))


def show(answer: Answer, witnesses: Witnesses) -> None:
    """A run with each end that there is, and one without each that is not always there."""
    structure, automaton = witnesses.structure, witnesses.automaton
    ends = automaton.complete, automaton.give_up
    to_end = structure.succeeding, structure.failing
    for place, frequency_ in enumerate(answer):
        if frequency_ is not Frequency.NEVER:
            witnesses.expect(witnesses.lane(to_end[place](0)), triggered=(ends[place],))
        if frequency_ is Frequency.SOMETIMES:
            witnesses.expect(witnesses.lane(to_end[1 - place](0)), absent=(ends[place],))


ANALYSIS = Analysis("completion", by_structure, by_solver, facts, questions, refute, show)
