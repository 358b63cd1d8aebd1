"""Who is active when, where durations are declared (semantics, sections 5.5 and 8.4).

Every node has a clock, durations lie between their bounds, and z3 looks for outcomes and times at
which two instances are active, or one is when the plan completes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import FALSE, conjunction, disjunction, negation
from gpsfsm.analysis.options import DEFAULT_RLIMIT
from gpsfsm.analysis.solver import Solver
from gpsfsm.analysis.timing.amounts import UNBOUNDED, Amounts, durations
from gpsfsm.analysis.timing.clocks import Clocks, RealSolver, earliest_bounds, free_durations
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.compile import Compiled

__all__ = ["Clock", "clock_of"]


def clock_of(
    compiled: Compiled, constraints: Constraints, *, rlimit: int = DEFAULT_RLIMIT
) -> Clock | None:
    """The clock of a plan; None if no declared duration says anything."""
    amounts = durations(compiled)
    if amounts is None or all(bounds == (0, UNBOUNDED) for bounds in amounts.ranges):
        return None
    return Clock(compiled, constraints, amounts, rlimit)


class Clock:
    """Asks z3 about instants; the problem is made when it is first needed."""

    def __init__(
        self, compiled: Compiled, constraints: Constraints, amounts: Amounts, rlimit: int
    ) -> None:
        self._compiled = compiled
        self._constraints = constraints
        self._amounts = amounts
        self._rlimit = rlimit
        self._solver: RealSolver | None = None

    def meet(self, first: int, second: int) -> bool:
        """Whether in some run both are active at one instant, before it ends.

        Raises Inconclusive at a limit.
        """
        solver = self._made()
        return solver.decide([self.term(solver, first, second)])[0]

    def outlives(self, number: int) -> bool:
        """Whether in some run the instance is active when the plan completes.

        Raises Inconclusive at a limit.
        """
        solver = self._made()
        return solver.decide([self.outliving(solver, number)])[0]

    def _made(self) -> RealSolver:
        if self._solver is None:
            self._solver = self.told(Solver(self._compiled, self._constraints, rlimit=self._rlimit))
        return self._solver

    def told(self, solver: Solver) -> RealSolver:
        """A problem with clocks for all nodes that may be triggered."""
        real = RealSolver(solver)
        ranges = self._amounts.ranges
        terms, assertions = free_durations(ranges)
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
