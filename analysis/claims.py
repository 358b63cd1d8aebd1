"""Claims: what a scenario must show, in a form that every part can use.

The solver searches a scenario for a claim, the structural pass constructs one, the evaluator
replays it, and the explanation reduces it to the decisions that matter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import TRUE, conjunction, negation
from gpsfsm.late import dataclass
from gpsfsm.model.event import End, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Mapping

    from gpsfsm.analysis.evaluate import Evaluator, OutcomeOf, Run
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.model.automaton import Signal


def _nothing(_: Structure) -> Iterable[int]:
    return ()


@dataclass(frozen=True, slots=True)
class Claim:
    """A conjunction about a run.

    ``happens``: these events happen; ``absent``: these nodes are never triggered (a join never
    fires); ``ends``: how the run ends, if that belongs to the claim; ``outlives``: the number of a
    runner that is still active at completion; ``meet``: the numbers of runners that are all active
    at one instant, while the outcomes of the runners ``held`` are held back (None: their own);
    ``breaks``: the join at which a second input aborts the engine.
    ``more`` is a further condition on the scenario for the solver (what would have happened
    otherwise, for instance); it is not replayed. ``failing`` gives, where outcomes are independent,
    the runners that fail in the canonical scenario, or in the plainest candidate for it: ``shows``
    tells whether a candidate will do. ``through`` turns the solver's problem into the one in which
    ``more`` can be said, where that needs clocks.
    ``shown`` gives, for a scenario, the claim that explains it, where that is a stronger one.
    """

    happens: tuple[Signal, ...] = ()
    absent: tuple[int, ...] = ()
    ends: End | None = None
    outlives: int | None = None
    meet: tuple[int, ...] = ()
    held: tuple[int, ...] | None = None
    breaks: int | None = None
    more: Callable[[Solver], str] | None = None
    failing: Callable[[Structure], Iterable[int]] = _nothing
    shows: Callable[[Evaluator, OutcomeOf], bool] | None = None
    through: Callable[[Solver], Solver] | None = None
    shown: Callable[[Evaluator, OutcomeOf], Claim] | None = None

    def term(self, solver: Solver) -> str:
        """The claim in the solver's language."""
        encoding = solver.encoding
        return conjunction(
            (
                *(encoding.happens(signal) for signal in self.happens),
                *(negation(encoding.triggered(node)) for node in self.absent),
                TRUE if self.ends is None else encoding.ending(self.ends),
                TRUE if self.breaks is None else encoding.breaks(self.breaks),
                TRUE if self.more is None else self.more(solver),
            )
        )

    def run(self, evaluator: Evaluator, outcome_of: OutcomeOf) -> Run:
        """The run that the claim speaks of."""
        return evaluator.run(outcome_of, withheld=self.withheld)

    @property
    def withheld(self) -> tuple[int, ...]:
        """The runners whose outcome never comes in the run that the claim speaks of."""
        return () if self.outlives is None else (self.outlives,)

    @property
    def held_back(self) -> tuple[int, ...]:
        """The runners whose outcomes are held back until those of ``meet`` are active."""
        return self.meet if self.held is None else self.held

    def holds(
        self,
        evaluator: Evaluator,
        decisions: Mapping[int, Outcome],
        ends: End,
        *,
        happening: Container[int] = (),
    ) -> bool:
        """True if the decisions alone show the claim, however all other outcomes turn out.

        ``happening`` spares a search, and is never believed: see ``Evaluator.prevented``.
        """
        withheld = self.withheld
        automaton = evaluator.automaton
        sure = evaluator.surely(decisions, withheld=withheld)
        absent = list(self.absent)
        if ends in (End.STUCK, End.HANG):
            absent += [automaton.complete, automaton.give_up]
        elif sure.ends is not ends:
            return False
        outlives = self.outlives
        if outlives is not None and automaton.runner_node(outlives) not in sure.triggered:
            return False
        if self.ends not in (None, ends) or not all(map(sure.happens, self.happens)):
            return False
        if self.breaks is not None and self.breaks not in sure.broken:
            return False
        if self.meet:
            before = evaluator.surely(decisions, withheld=self.held_back).triggered
            if not all(automaton.runner_node(number) in before for number in self.meet):
                return False
        if not absent:
            return True
        if ends is End.HANG and evaluator.possibly(decisions, withheld=withheld).broken:
            return False
        return evaluator.prevented(absent, decisions, withheld=withheld, happening=happening)
