"""Activity at instants, where durations are declared (semantics, sections 5.5 and 8.4).

Every node has a clock, durations lie between their bounds, and z3 looks for outcomes and times at
which two instances are active, or one is when the plan completes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.counterexamples import necessary
from gpsfsm.analysis.encode import FALSE, conjunction, disjunction, negation
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.options import DEFAULT_RLIMIT
from gpsfsm.analysis.solver import Solver
from gpsfsm.analysis.timing.amounts import UNBOUNDED, Amounts, Number, durations
from gpsfsm.analysis.timing.clocks import (
    Clocks,
    RealSolver,
    earliest_bounds,
    free_durations,
    times,
    unstarted,
)
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.evaluate import OutcomeOf
    from gpsfsm.analysis.options import Purse
    from gpsfsm.compile import Compiled


def clock_of(
    compiled: Compiled,
    constraints: Constraints,
    *,
    rlimit: int = DEFAULT_RLIMIT,
    purse: Purse | None = None,
) -> Clock | None:
    """The clock of a plan; None if no declared duration says anything.

    ``purse`` holds the steps for all that is asked of it.
    """
    amounts = durations(compiled)
    if amounts is None or all(bounds == (0, UNBOUNDED) for bounds in amounts.ranges):
        return None
    return Clock(compiled, constraints, amounts, rlimit=rlimit, purse=purse)


class Clock:
    """Answers about instants.

    Mostly some durations within the bounds settle a question: the plainest scenario is played with
    the shortest durations, and the longest for the instances that are asked about. Only where that
    shows nothing z3 is asked; its problem is made when it is first needed.
    """

    def __init__(
        self,
        compiled: Compiled,
        constraints: Constraints,
        amounts: Amounts,
        *,
        rlimit: int,
        purse: Purse | None,
    ) -> None:
        self._compiled = compiled
        self._constraints = constraints
        self._amounts = amounts
        self._rlimit = rlimit
        self._purse = purse
        self._automaton = compiled.automaton
        self._solver: RealSolver | None = None
        self._inside: Mapping[int, object] = {}
        self._evaluator = Evaluator(self._automaton)
        # In so small a part of the unit of the amounts that all durations of 0 together, which last
        # one or, among themselves, "long", are less than a unit.
        size = len(amounts.ranges) + 1
        part = size * size
        self._shortest = [least * part or 1 for least, _ in amounts.ranges]
        finite = [most for _, most in amounts.ranges if most != UNBOUNDED]
        long = 2 * (sum(self._shortest) + part * (int(sum(finite)) + 1)) + 1
        self._longest = [
            long if most == UNBOUNDED else most * part or size for _, most in amounts.ranges
        ]

    def meet(self, first: int, second: int) -> bool:
        """True if in some run both are active at one instant, before it ends.

        Raises InconclusiveError at a limit.
        """
        plain = self._plainest(first, second)
        if plain is not None and self.shows_meeting(plain, first, second):
            return True
        solver = self._made()
        return solver.decide([self.term(solver, first, second)])[0]

    def outlives(self, number: int) -> bool:
        """True if in some run the instance is active when the plan completes.

        Raises InconclusiveError at a limit.
        """
        plain = self._plainest(number)
        if plain is not None and self.shows_outliving(plain, number):
            return True
        solver = self._made()
        return solver.decide([self.outliving(solver, number)])[0]

    def shows_meeting(self, outcome_of: OutcomeOf, first: int, second: int) -> bool:
        """True if a scenario shows that two instances meet, with the durations tried here."""
        times = self._times(outcome_of, (first, second))
        node = self._automaton.runner_node
        one, other = times.get(node(first)), times.get(node(second))
        if one is None or other is None:
            return False
        ends = [
            times[end]
            for end in (self._automaton.complete, self._automaton.give_up)
            if end in times
        ]
        return (
            other < self._end(one, first, outcome_of)
            and one < self._end(other, second, outcome_of)
            and all(max(one, other) <= end for end in ends)
        )

    def shows_outliving(self, outcome_of: OutcomeOf, number: int) -> bool:
        """True if a scenario shows an orphan, with the durations tried here."""
        times = self._times(outcome_of, (number,))
        began = times.get(self._automaton.runner_node(number))
        completed = times.get(self._automaton.complete)
        if began is None or completed is None:
            return False
        return began <= completed < self._end(began, number, outcome_of)

    def _end(self, began: Number, number: int, outcome_of: OutcomeOf) -> Number:
        hangs = outcome_of(number) is Outcome.HANG
        return UNBOUNDED if hangs else began + self._longest[number]

    def _times(self, outcome_of: OutcomeOf, numbers: Sequence[int]) -> Mapping[int, Number]:
        run = self._evaluator.run(outcome_of)

        def duration(number: int) -> Number:
            return (self._longest if number in numbers else self._shortest)[number]

        return times(self._automaton, run, duration)

    def _plainest(self, *numbers: int) -> OutcomeOf | None:
        """The scenario in which nothing fails but what must, so that these are triggered."""
        wanted: dict[int, Outcome] = {}
        for number in numbers:
            for other, outcome in necessary(
                self._automaton, self._automaton.runner_node(number)
            ).items():
                if wanted.setdefault(other, outcome) is not outcome:
                    return None
        size = len(self._automaton.runners)
        plain = tuple(wanted.get(other, Outcome.SUCCEEDED) for other in range(size))
        return plain.__getitem__ if self._constraints.admit(plain) else None

    def _made(self) -> RealSolver:
        if self._solver is None:
            solver = Solver(
                self._compiled, self._constraints, rlimit=self._rlimit, purse=self._purse
            )
            self._solver = self.with_clocks(solver)
        return self._solver

    def with_clocks(self, solver: Solver) -> RealSolver:
        """A problem with clocks for all nodes that may be triggered."""
        real = RealSolver(solver)
        ranges = self._amounts.ranges
        terms, assertions = free_durations(ranges, unstarted(real))
        inside = earliest_bounds(real.automaton, self._constraints, [least for least, _ in ranges])
        clocks = Clocks(real.automaton, real.encoding, terms, sense="exact", inside=inside)
        real.tell([*assertions, *clocks.definitions])
        self._inside = inside
        return real

    def term(self, solver: Solver, first: int, second: int) -> str:
        """Both are triggered, neither ends before the other starts, and the run ends later."""
        encoding, automaton = solver.encoding, solver.automaton
        one, other = automaton.runner_node(first), automaton.runner_node(second)
        ends = [node for node in (automaton.complete, automaton.give_up) if node in self._inside]
        return conjunction(
            (
                encoding.triggered(one),
                encoding.triggered(other),
                self._before_end(solver, one, second, other),
                self._before_end(solver, other, first, one),
                *(
                    disjunction(
                        (
                            negation(encoding.triggered(end)),
                            f"(and (<= c{one} c{end}) (<= c{other} c{end}))",
                        )
                    )
                    for end in ends
                ),
            )
        )

    def outliving(self, solver: Solver, number: int) -> str:
        """The plan completes at an instant at which the instance is active."""
        encoding, automaton = solver.encoding, solver.automaton
        node, complete = automaton.runner_node(number), automaton.complete
        if complete not in self._inside:
            return FALSE
        return conjunction(
            (
                encoding.triggered(node),
                encoding.triggered(complete),
                f"(<= c{node} c{complete})",
                self._before_end(solver, complete, number, node),
            )
        )

    @staticmethod
    def _before_end(solver: Solver, node: int, number: int, active: int) -> str:
        """``node`` is triggered before instance ``number`` (node ``active``) has its outcome."""
        in_time = f"(< c{node} (+ c{active} d{number}))"
        if not solver.constraints.hang:
            return in_time
        return disjunction((solver.encoding.outcome(number, (Outcome.HANG,)), in_time))
