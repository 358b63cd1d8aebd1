"""The makespan: how long a run takes until it completes or gives up (semantics, section 8.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis.decisions import Analysis
from gpsfsm.analysis.encode import conjunction, disjunction, negation
from gpsfsm.analysis.timing.amounts import (
    UNBOUNDED,
    Amounts,
    Number,
    Range,
    durations,
    plus,
    reached,
    whole,
)
from gpsfsm.analysis.timing.clocks import (
    Clocks,
    RealSolver,
    at_most,
    earliest_bounds,
    greatest,
    latest_bounds,
    times,
    unstarted,
)
from gpsfsm.compile import UnitKind
from gpsfsm.model.event import Outcome
from gpsfsm.model.report import Interval

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.analysis.encode import Encoding, Variant
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled

Answer = tuple[float, float | None] | None
"""The least and the greatest makespan in seconds.

None if no reachable instance declares a duration, or if no run ends.
"""


class _Unit(NamedTuple):
    """The time of a unit from its trigger to its success and to its failure, if it can fail."""

    success: Range
    failure: Range | None


_AT_ONCE: Range = (0, 0)


# -- by structure ---------------------------------------------------------------------------


def by_structure(structure: Structure) -> Answer:
    """Sums along sequences, and the first or the last of what runs side by side."""
    amounts = durations(structure.compiled)
    plan = None if amounts is None else whole(structure, amounts, _Unit, _COMBINED)
    if amounts is None or plan is None:
        return None
    success, failure = plan
    return amounts.interval(_either([success] if failure is None else [success, failure]))


def _sequence(children: Sequence[_Unit]) -> _Unit:
    before = _AT_ONCE
    failures: list[Range] = []
    for child in children:
        if child.failure is not None:
            failures.append(_then(before, child.failure))
        before = _then(before, child.success)
    return _Unit(before, _either(failures) if failures else None)


def _guard(children: Sequence[_Unit]) -> _Unit:
    """It succeeds with the first unit that does, which each unit before it has to let happen."""
    before: Range | None = _AT_ONCE
    successes: list[Range] = []
    for child in children:
        if before is None:
            break
        successes.append(_then(before, child.success))
        before = None if child.failure is None else _then(before, child.failure)
    return _Unit(_either(successes), before)


def _all(children: Sequence[_Unit]) -> _Unit:
    """The last success, or the first failure: at the latest that of one which fails alone."""
    failures = [child.failure for child in children if child.failure is not None]
    return _Unit(
        _last([child.success for child in children]), _either(failures) if failures else None
    )


def _any(children: Sequence[_Unit]) -> _Unit:
    """The first success, or the last failure.

    A unit that cannot fail succeeds in any case; the first of these comes at the latest when it
    does. If all can fail, the latest is that of one which succeeds alone.
    """
    least = min(child.success[0] for child in children)
    certain = [child.success[1] for child in children if child.failure is None]
    most = min(certain) if certain else max(child.success[1] for child in children)
    failures = [child.failure for child in children if child.failure is not None]
    return _Unit((least, most), None if certain else _last(failures))


_COMBINED: Mapping[UnitKind, Callable[[Sequence[_Unit]], _Unit]] = {
    UnitKind.EMPTY: _sequence,
    UnitKind.SEQUENCE: _sequence,
    UnitKind.GUARD: _guard,
    UnitKind.DEAD: lambda _: _Unit(_AT_ONCE, None),  # it is never triggered
    UnitKind.ALL: _all,
    UnitKind.ANY: _any,
}


def _then(one: Range, other: Range) -> Range:
    return plus(one[0], other[0]), plus(one[1], other[1])


def _either(ranges: Iterable[Range]) -> Range:
    ranges = list(ranges)
    return min(least for least, _ in ranges), max(most for _, most in ranges)


def _last(ranges: Iterable[Range]) -> Range:
    ranges = list(ranges)
    return max(least for least, _ in ranges), max(most for _, most in ranges)


# -- z3 -------------------------------------------------------------------------------------


def by_solver(solver: Solver) -> Answer:
    """Search scenarios that end earlier and earlier, or later and later."""
    amounts = durations(solver.compiled)
    if amounts is None or not any(True for _ in reached(solver, amounts)):
        return None
    ends = solver.name(disjunction(_endings(solver, solver.encoding)))
    if not solver.must_check([ends]):
        return None
    some = solver.outcomes()
    least = _least(solver, amounts, some)
    waiting = solver.decide([waits_for_ever(solver, amounts)])[0]
    return amounts.interval((least, UNBOUNDED if waiting else _most(solver, amounts, some)))


def _endings(solver: Solver, run: Encoding | Variant) -> tuple[str, str]:
    automaton = solver.automaton
    return run.triggered(automaton.complete), run.triggered(automaton.give_up)


def _held(solver: Solver, amounts: Amounts) -> Encoding | Variant:
    """The run without the outcomes of the instances that may take for ever."""
    held = [number for number, (_, most) in enumerate(amounts.ranges) if most == UNBOUNDED]
    return solver.without(held) if held else solver.encoding


def waits_for_ever(solver: Solver, amounts: Amounts) -> str:
    """The run ends, but not before some instance that may take as long as it likes."""
    ends = disjunction(_endings(solver, solver.encoding))
    return conjunction((ends, negation(disjunction(_endings(solver, _held(solver, amounts))))))


def _least(solver: Solver, amounts: Amounts, some: Sequence[Outcome]) -> Number:
    automaton = solver.automaton
    shortest = [least for least, _ in amounts.ranges]
    absent = unstarted(solver)
    soonest = [0 if number in absent else least for number, least in enumerate(shortest)]
    bounds = earliest_bounds(automaton, solver.constraints, soonest)
    high, low = (
        int(end_time(solver, some, _heeded(shortest, some))),
        int(min(bounds[node] for node in _ends(solver) if node in bounds)),
    )
    if high <= low:
        return high
    real = RealSolver(solver)
    texts = [
        f"(ite {absent[number]} 0.0 {least}.0)" if number in absent and least else f"{least}.0"
        for number, least in enumerate(shortest)
    ]
    clocks = Clocks(automaton, real.encoding, texts, sense="earliest", inside=bounds)
    real.tell(clocks.definitions)
    real.tell(f"(>= c{node} {least}.0)" for node, least in bounds.items() if node)

    def find(target: int) -> int | None:
        goal = disjunction(
            conjunction((real.encoding.triggered(node), at_most(f"c{node}", -target)))
            for node in _ends(solver)
            if node in bounds
        )
        if not real.must_check([real.name(goal)]):
            return None
        outcomes = real.outcomes()
        return -int(end_time(solver, outcomes, _heeded(shortest, outcomes)))

    return -greatest(-high, -low, find)


def _heeded(shortest: Sequence[Number], outcomes: Sequence[Outcome]) -> list[Number]:
    """The least durations in a scenario: what does not start heeds none."""
    return [
        0 if outcome is Outcome.NO_START else least
        for least, outcome in zip(shortest, outcomes, strict=True)
    ]


def _most(solver: Solver, amounts: Amounts, some: Sequence[Outcome]) -> Number:
    """The latest end, where every run ends without the instances that may take for ever."""
    longest = [most for _, most in amounts.ranges]
    bounds = latest_bounds(solver.automaton, solver.constraints, longest)
    low, high = (
        int(end_time(solver, some, longest)),
        int(max(bounds[node] for node in _ends(solver) if node in bounds)),
    )
    if high <= low:
        return low
    real = RealSolver(solver)
    run = _latest_clocks(real, amounts)

    def find(target: int) -> int | None:
        if not real.must_check([real.name(_later(real, run, f"{target}.0", ">="))]):
            return None
        return int(end_time(solver, real.outcomes(), longest))

    return greatest(low, high, find)


def _ends(solver: Solver) -> tuple[int, int]:
    return solver.automaton.complete, solver.automaton.give_up


def _latest_clocks(real: Solver, amounts: Amounts) -> Encoding | Variant:
    """Tell ``real`` the clocks for the latest run; instances that may take for ever never end."""
    longest = [most for _, most in amounts.ranges]
    bounds = latest_bounds(real.automaton, real.constraints, longest)
    run = _held(real, amounts)
    texts = [f"{most}.0" for most in longest]
    clocks = Clocks(real.automaton, run, texts, sense="latest", inside=bounds)
    real.tell(clocks.definitions)
    real.tell(f"(<= c{node} {most}.0)" for node, most in bounds.items() if node)
    return run


def _later(real: Solver, run: Encoding | Variant, number: str, sign: str) -> str:
    return disjunction(
        conjunction((ended, f"({sign} c{node} {number})"))
        for node, ended in zip(_ends(real), _endings(real, run), strict=True)
    )


def overdue(real: Solver, amounts: Amounts, deadline: float) -> str:
    """The run can end later than ``deadline`` seconds. ``real`` must know real numbers."""
    run = _latest_clocks(real, amounts)
    ended = _endings(real, real.encoding)
    return disjunction(
        (
            conjunction((disjunction(ended), negation(disjunction(_endings(real, run))))),
            _later(real, run, amounts.term(deadline), ">"),
        )
    )


def end_time(solver: Solver, outcomes: Sequence[Outcome], duration: Sequence[Number]) -> Number:
    """The time at which the run of a scenario ends, which must end, if each takes so long."""
    automaton = solver.automaton
    run = solver.evaluator.run(outcomes.__getitem__)
    ended = times(automaton, run, duration.__getitem__)
    return min(ended[node] for node in _ends(solver) if node in ended)


def facts(answer: Answer, compiled: Compiled) -> Mapping[str, Any]:
    """The fact ``makespan``."""
    del compiled
    return {"makespan": None if answer is None else Interval(*answer)}


ANALYSIS = Analysis(
    "makespan",
    by_structure,
    by_solver,
    facts,
    matters=lambda options: options.deadline_s is not None,
)
