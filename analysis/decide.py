"""Run all analyses on one plan, with the way of deciding that fits it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.registry import Analysis, analyses
from gpsfsm.analysis.solver import Inconclusive, Solver
from gpsfsm.analysis.structure import Structure
from gpsfsm.errors import InternalError, UsageError
from gpsfsm.model.report import Facts

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.compile import Compiled

__all__ = ["Decided", "decide"]


@dataclass(frozen=True, slots=False)
class Decided:
    """The verdicts on one plan.

    ``answers`` are by analysis name; None where a limit was hit (``inconclusive`` names those).
    ``contradictory``: the constraints admit no scenario, so that nothing could be decided.
    """

    compiled: Compiled
    constraints: Constraints
    options: AnalysisOptions
    answers: Mapping[str, Any]
    contradictory: bool = False
    inconclusive: tuple[str, ...] = ()

    @cached_property
    def evaluator(self) -> Evaluator:
        """Replays scenarios on the automaton."""
        return Evaluator(self.compiled.automaton)

    @cached_property
    def structure(self) -> Structure | None:
        """The structural pass, where it is exact."""
        return Structure(self.compiled, self.constraints) if self.constraints.independent else None

    @cached_property
    def solver(self) -> Solver:
        """A solver for further questions."""
        return Solver(self.compiled, self.constraints, rlimit=self.options.rlimit)

    def facts(self) -> Facts | None:
        """The facts of the contract; None if the constraints are contradictory."""
        if self.contradictory:
            return None
        fields: dict[str, Any] = {}
        for analysis in analyses():
            fields |= analysis.facts(self.answers[analysis.name], self.compiled)
        return Facts(runners=len(self.compiled.automaton.runners), **fields)


def decide(compiled: Compiled, constraints: Constraints, options: AnalysisOptions) -> Decided:
    """Decide everything about a compiled plan.

    Raises UsageError if the structural pass is asked for where it is not exact, and InternalError
    if it disagrees with z3.
    """
    exact = constraints.independent
    if options.solver == "structural" and not exact:
        raise UsageError(
            "the structural pass decides independent outcomes only; with --consistent, --faults "
            "or assumptions that tie outcomes together use --solver auto or z3"
        )
    by_solver = options.solver == "z3" or (
        options.solver == "auto"
        and (not exact or len(compiled.automaton.runners) <= options.second_opinion)
    )
    decided = Decided(compiled, constraints, options, {})
    if by_solver:
        contradictory = not exact and (
            not all(constraints.allowed) or decided.solver.contradictory()
        )
        if contradictory is None:
            return _limited(decided, analyses())
        if contradictory:
            return Decided(compiled, constraints, options, {}, contradictory=True)
    if by_solver:
        decided.solver.ask(
            [term for known in analyses() for term in known.questions(decided.solver)]
        )
    answers: dict[str, Any] = {}
    inconclusive: list[str] = []
    for analysis in analyses():
        try:
            answers[analysis.name] = _answer(
                analysis,
                decided.structure if options.solver != "z3" else None,
                decided.solver if by_solver else None,
            )
        except Inconclusive:
            answers[analysis.name] = None
            inconclusive.append(analysis.name)
    result = Decided(compiled, constraints, options, answers, inconclusive=tuple(inconclusive))
    for name in ("structure", "solver"):  # work already done
        if name in decided.__dict__:
            result.__dict__[name] = decided.__dict__[name]
    return result


def _limited(decided: Decided, names: tuple[Analysis, ...]) -> Decided:
    return Decided(
        decided.compiled,
        decided.constraints,
        decided.options,
        dict.fromkeys(analysis.name for analysis in names),
        inconclusive=tuple(analysis.name for analysis in names),
    )


def _answer(analysis: Analysis, structure: Structure | None, solver: Solver | None) -> Any:
    if structure is None:
        assert solver is not None
        return analysis.by_solver(solver)
    answer = analysis.by_structure(structure)
    if solver is None:
        return answer
    try:
        second = analysis.by_solver(solver)
    except Inconclusive:
        return answer  # the structural answer is exact; the second opinion has none
    if second != answer:
        raise InternalError(
            f"the structural pass and z3 disagree on '{analysis.name}': {answer} and {second}"
        )
    return answer
