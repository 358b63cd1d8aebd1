"""Claims: what a scenario must show, in a form that every part can use.

The solver searches a scenario for a claim, the structural pass constructs one, the evaluator
replays it, and the explanation reduces it to the decisions that matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import TRUE, conjunction, negation
from gpsfsm.model.event import End

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.analysis.evaluate import Evaluator, OutcomeOf, Run
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.model.automaton import Signal

__all__ = ["Claim"]


def _nothing(_: Structure) -> Iterable[int]:
    return ()


def _no_more(_: Solver) -> str:
    return TRUE


@dataclass(frozen=True, slots=True)
class Claim:
    """A conjunction about a run.

    ``happens``: these events happen; ``absent``: these nodes are never triggered (a join never
    fires); ``ends``: how the run ends, if that belongs to the claim; ``outlives``: the number of a
    runner that is still active at completion. ``more`` is a further condition on the scenario for
    the solver (a counterfactual). ``failing`` gives, where outcomes are independent, the runners
    that fail in the canonical scenario.
    """

    happens: tuple[Signal, ...] = ()
    absent: tuple[int, ...] = ()
    ends: End | None = None
    outlives: int | None = None
    more: Callable[[Solver], str] = _no_more
    failing: Callable[[Structure], Iterable[int]] = _nothing

    def term(self, solver: Solver) -> str:
        """The claim in the solver's language."""
        encoding, automaton = solver.encoding, solver.automaton
        complete = encoding.triggered(automaton.complete)
        give_up = encoding.triggered(automaton.give_up)
        endings = {
            None: TRUE,
            End.COMPLETED: complete,
            End.GAVE_UP: give_up,
            End.STUCK: conjunction((negation(complete), negation(give_up))),
        }
        return conjunction(
            (
                *(encoding.happens(signal) for signal in self.happens),
                *(negation(encoding.triggered(node)) for node in self.absent),
                endings[self.ends],
                self.more(solver),
            )
        )

    def run(self, evaluator: Evaluator, outcome_of: OutcomeOf) -> Run:
        """The run that the claim speaks of."""
        withheld = () if self.outlives is None else (self.outlives,)
        return evaluator.run(outcome_of, withheld=withheld)

    def holds(self, evaluator: Evaluator, outcome_of: OutcomeOf, ends: End) -> bool:
        """Whether the scenario shows what is claimed and ends as it is said to end."""
        run = self.run(evaluator, outcome_of)
        if self.outlives is not None and evaluator.runner_node(self.outlives) not in run.triggered:
            return False
        return (
            run.ends is ends
            and self.ends in (None, ends)
            and all(signal in run.events for signal in self.happens)
            and not any(node in run.triggered for node in self.absent)
        )
