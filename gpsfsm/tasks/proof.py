"""The proof that a plan keeps its task: z3 refutes all departures from it in one question.

The problem (``proof_encoding``) holds more runs than there are where instances run side by side.
So a solution of it is no run yet. Its scenario is played; a run that leaves the task convicts the
search of a mistake, and otherwise nothing is said.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.encode import symbols_of
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.analysis.solver import add_text
from gpsfsm.model.event import Event, Outcome
from gpsfsm.tasks.counterexample import Plays, left_at_end, left_by
from gpsfsm.tasks.monitor import Violation
from gpsfsm.tasks.proof_encoding import Departures
from gpsfsm.workers import Z3_MB, require_memory

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.compile import Compiled
    from gpsfsm.tasks.counterexample import Left, Move, Trail
    from gpsfsm.tasks.monitor import Demand, Monitor

_PER_CHARACTER = 10
"""The cost of a character that z3 reads, in its steps."""

LOGIC = "QF_FD"
"""The fastest of the solvers that benchmarks/task_proofs.py compares, on small plans and large."""


def problem_text(
    compiled: Compiled, constraints: Constraints, demands: Sequence[Demand]
) -> tuple[Departures, str]:
    """The problem of all demands, and its text in SMT-LIB. Raises TooLargeError."""
    departures = Departures(compiled.automaton, constraints, demands)
    text = "\n".join(f"(assert {assertion})" for assertion in departures.problem())
    declared = "".join(f"(declare-const {name} Bool)" for name in symbols_of(text))
    return departures, f"{declared}\n{text}"


def suspect(
    compiled: Compiled, constraints: Constraints, demands: Sequence[Demand], *, rlimit: int
) -> tuple[Outcome, ...] | None:
    """A scenario in which a demand may be left; None: z3 proves that no run leaves any of them.

    Raises InconclusiveError at the limit, and TooLargeError where the problem has too many states.
    """
    departures, text = problem_text(compiled, constraints, demands)
    if _PER_CHARACTER * len(text) > rlimit:
        raise InconclusiveError
    require_memory(Z3_MB, module="z3")
    import z3

    solver = z3.SolverFor(LOGIC)
    solver.set("random_seed", 0)
    solver.set("ctrl_c", False)
    solver.set("rlimit", rlimit)
    add_text(solver, text)
    answer = solver.check()
    if answer == z3.unsat:
        return None
    if answer == z3.unknown:
        raise InconclusiveError
    return _outcomes(z3, solver.model(), departures)


def _outcomes(z3: Any, model: Any, departures: Departures) -> tuple[Outcome, ...]:
    true = {each.name() for each in model.decls() if z3.is_true(model[each])}
    named = departures.encoding.named.items()
    return tuple(
        next((one for one, letter in named if f"{letter}{number}" in true), Outcome.FAILED)
        for number in range(len(departures.automaton.runners))
    )


def played(
    compiled: Compiled,
    constraints: Constraints,
    monitor: Monitor,
    outcomes: Sequence[Outcome],
) -> Left | None:
    """The run of a scenario in document order, if it leaves the task: as far as to there."""
    plays = Plays(compiled, constraints)
    position, state = plays.first(), monitor.start
    trail: Trail = None
    while True:
        left = left_at_end(plays, monitor, position, state, trail)
        if left is not None:
            return left if _agree(left, outcomes) else None
        if position.end is not None and not position.waiting:
            return None
        move = next((each for each in plays.moves(position) if _fits(each, outcomes)), None)
        if move is None:
            return None
        trail = (trail, *move)
        after = monitor.after(state, *move)
        if isinstance(after, Violation):
            return left_by(after, trail)
        if after is None:
            return None
        position, state = plays.after(position, move), after


def _agree(left: Left, outcomes: Sequence[Outcome]) -> bool:
    return all(outcomes[number] is outcome for number, outcome in left.outcomes.items())


def _fits(move: Move, outcomes: Sequence[Outcome]) -> bool:
    """True if the scenario has it so."""
    event, number = move
    outcome = outcomes[number]
    if event is Event.STARTED:
        return outcome is not Outcome.NO_START
    if event is Event.FAILED:
        return outcome in (Outcome.FAILED, Outcome.NO_START)
    return event.value == outcome.value
