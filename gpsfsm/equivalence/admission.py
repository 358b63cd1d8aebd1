"""The outcomes that an observer may give to two plans under assumptions.

Each assumption speaks of each plan by itself. Outcomes may be given if, in either plan, what has
been given so far can be completed to a scenario that its assumptions admit.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.analysis.assumptions import parse_assumption, runners, to_smt
from gpsfsm.analysis.constraints import Constraints, constraints_of
from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.solver import Solver
from gpsfsm.errors import AssumptionError, GpsfsmError
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from gpsfsm.compile import Compiled

Outcomes = tuple[tuple[int, Event], ...]
"""Instances of one plan with the outcomes that they have been given, ascending."""

_OUTCOME = {Event.SUCCEEDED: Outcome.SUCCEEDED, Event.FAILED: Outcome.FAILED}
_MAX_NAME = 200


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One plan: its scenarios, and the instances whose outcomes depend on each other."""

    compiled: Compiled
    constraints: Constraints
    tied: frozenset[int]
    solver: list[Solver] = field(default_factory=list)
    memo: dict[Outcomes, bool] = field(default_factory=dict)

    def admits(self, outcomes: Outcomes) -> bool:
        """True if some scenario has these outcomes of tied instances."""
        if outcomes not in self.memo:
            encoding = self._z3.encoding
            terms = [encoding.outcome(number, (_OUTCOME[event],)) for number, event in outcomes]
            (self.memo[outcomes],) = self._z3.decide([conjunction(terms)])
        return self.memo[outcomes]

    @property
    def _z3(self) -> Solver:
        if not self.solver:  # z3 is loaded where it is needed
            self.solver.append(Solver(self.compiled, self.constraints))
        return self.solver[0]

    @property
    def contradictory(self) -> bool:
        if not all(self.constraints.allowed):
            return True
        return bool(self.tied) and self._z3.contradictory() is True


@dataclass(frozen=True, slots=True, eq=False)
class Admission:
    """The assumptions on both plans."""

    sides: tuple[_Side, _Side]

    def permits(self, side: int, number: int, event: Event) -> bool:
        """True if the instance has this outcome in some scenario, if it is not tied to others."""
        return _OUTCOME[event] in self.sides[side].constraints.allowed[number]

    def tied(self, side: int, number: int) -> bool:
        """True if the outcome of this instance depends on others."""
        return number in self.sides[side].tied

    @property
    def any_tied(self) -> bool:
        """True if outcomes depend on each other in either plan."""
        return any(side.tied for side in self.sides)

    def admits(self, side: int, outcomes: Iterable[tuple[int, Event]]) -> bool:
        """True if a scenario has these outcomes. Raises InconclusiveError if z3 meets its limit."""
        tied = self.sides[side].tied
        return self.sides[side].admits(tuple(sorted(each for each in outcomes if each[0] in tied)))

    def terms(self, side: int, succeeds: Callable[[int], str]) -> Iterator[str]:
        """SMT-LIB terms for the scenarios; ``succeeds`` names the outcome of a tied instance."""
        constraints = self.sides[side].constraints

        def atom(number: int, outcomes: frozenset[Outcome]) -> str:
            good, bad = Outcome.SUCCEEDED in outcomes, Outcome.FAILED in outcomes
            if good is bad:
                return "true" if good else "false"
            return succeeds(number) if good else f"(not {succeeds(number)})"

        for number in sorted(self.sides[side].tied):
            yield atom(number, constraints.allowed[number])
        for group in constraints.groups:
            yield f"(= {' '.join(map(succeeds, group))})"
        for formula in constraints.formulas:
            yield to_smt(formula, atom)


def admission_of(
    first: Compiled, second: Compiled, assumptions: Iterable[str], *, consistent: bool
) -> Admission:
    """Bind the assumptions to both plans.

    Raises AssumptionError for one that does not parse or select, and GpsfsmError where no scenario
    is left.
    """
    texts = tuple(assumptions)
    for text in texts:
        parse_assumption(text)  # what is wrong with the text itself is wrong with no plan
    sides = []
    for compiled in (first, second):
        plan = compiled.automaton.plan
        name = clip(plan.file, _MAX_NAME)
        try:
            constraints = constraints_of(plan, consistent=consistent, assumptions=texts)
        except AssumptionError as error:
            raise AssumptionError(
                f"{name}: {error}", summary=f"{name}: {error.summary}", hint=error.hint
            ) from error
        tied = {number for formula in constraints.formulas for number in runners(formula)}
        tied.update(number for group in constraints.groups for number in group)
        side = _Side(compiled, constraints, frozenset(tied))
        if side.contradictory:
            raise GpsfsmError(
                f"{name}: the assumptions and options admit no scenario of this plan; drop or "
                "correct one of them"
            )
        sides.append(side)
    return Admission((sides[0], sides[1]))
