"""Does a plan fulfil a task? Every demand is decided over all scenarios and orders of events."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.minimal import canonical_scenario
from gpsfsm.analysis.options import DEFAULT_RLIMIT
from gpsfsm.analysis.solver import Inconclusive, Solver
from gpsfsm.analysis.words import story
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.finding import Scenario, TraceStep
from gpsfsm.tasks.ltlf import TooLarge, atoms_of
from gpsfsm.tasks.monitor import Matching, RuleMonitor
from gpsfsm.tasks.search import DEFAULT_MOVES, TooMany, search
from gpsfsm.tasks.steps import StepsMonitor
from gpsfsm.tasks.symbolic import confirms, leaving_runs

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.options import SolverChoice
    from gpsfsm.compile import Compiled
    from gpsfsm.tasks.leaving import Left
    from gpsfsm.tasks.machine import Key
    from gpsfsm.tasks.monitor import Demand
    from gpsfsm.tasks.task import Pattern, Task

__all__ = ["Decision", "Departure", "Effort", "Unknown", "decide_task"]

_MAX_DEPARTURES = 20
_MAX_TRACE = 200
_MAX_SPURIOUS = 1_000
_QUICK_MOVES = 5_000
_QUICK_MOVES_PER_RUNNER = 10
"""Moves of the search before z3 is asked: enough where one thing happens after the other."""


@dataclass(frozen=True, slots=True)
class Departure:
    """A way in which the plan leaves the task, with the plainest scenario in which it does.

    ``rule`` is the code of a rule; ``runner`` the number of the instance at which it shows, None:
    at the end of the run.
    """

    rule: str
    message: str
    scenario: Scenario
    runner: int | None


class Unknown(NamedTuple):
    """A demand that is not decided: values of these names arrive at the instance and decide it."""

    demand: str
    runner: int
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Decision:
    """Where a plan leaves a task; ``undecided`` names the demands of which that is not known.

    ``unknown`` says of which of them it is because of values that arrive; the others are beyond
    the limits.
    """

    departures: tuple[Departure, ...]
    undecided: tuple[str, ...] = ()
    unknown: tuple[Unknown, ...] = ()

    @property
    def fulfilled(self) -> bool | None:
        """Whether the plan fulfils the task in every scenario and order; None: undecided."""
        if self.departures:
            return False
        return None if self.undecided else True


@dataclass(frozen=True, slots=True)
class Effort:
    """How to decide: ``moves`` bounds each search, ``rlimit`` z3's steps per question.

    ``solver``: ``auto`` searches, asks z3 for a second opinion on plans of up to
    ``second_opinion`` runners, and lets z3 decide where the search takes too long; ``structural``
    searches alone and ``z3`` does not search.
    """

    solver: SolverChoice = "auto"
    moves: int = DEFAULT_MOVES
    rlimit: int = DEFAULT_RLIMIT
    second_opinion: int = 200


def decide_task(
    compiled: Compiled, constraints: Constraints, task: Task, *, effort: Effort | None = None
) -> Decision:
    """Decide all demands of a task, each by itself.

    Raises InternalError if the search and z3 disagree.
    """
    departures: list[Departure] = []
    undecided: list[str] = []
    unknown: list[Unknown] = []
    for name, patterns, demand in _demands(compiled, task):
        deciding = _Deciding(compiled, constraints, demand, effort or Effort())
        if not deciding.decided():
            undecided.append(name)
        elif not deciding.found and (told := _unknown(compiled, patterns)) is not None:
            # as the plan is written it does what it should, but that is not what will be done
            undecided.append(name)
            unknown.append(Unknown(name, *told))
        departures += deciding.found.values()
    return Decision(tuple(departures), tuple(undecided), tuple(unknown))


def _demands(compiled: Compiled, task: Task) -> Iterator[tuple[str, Sequence[Pattern], Demand]]:
    """The name of each demand, the patterns of which it speaks, and what follows it."""
    matching = Matching(compiled.automaton.plan.runners, compiled.bindings)
    if task.steps:
        named = [pattern for step in task.steps for pattern in step.attempts]
        yield "the steps of the task", [*named, *task.allowed], StepsMonitor(task, matching)
    for rule in task.rules:
        name = f"the rule '{rule.name}' of the task"
        spoken = {atom.name for atom in atoms_of(rule.formula)}
        patterns = [pattern for pattern in task.patterns if pattern.name in spoken]
        yield name, patterns, RuleMonitor(rule, task.patterns, matching)


def _unknown(compiled: Compiled, patterns: Sequence[Pattern]) -> tuple[int, tuple[str, ...]] | None:
    """An instance of which what arrives decides whether a pattern means it, and the names.

    What may arrive is unknown in every judgement (semantics, 8.2).
    """
    runners = compiled.automaton.plan.runners
    for number, (binding, runner) in enumerate(zip(compiled.bindings, runners, strict=True)):
        if binding is None or binding.arriving == frozenset():
            continue
        known = [one.name for one in binding.provider.configuration]
        known += (one.name for one in binding.provider.inputs)
        names = tuple(name for name in dict.fromkeys(known) if not binding.settled(name))
        if names and any(pattern.depends_on(runner, names, binding) for pattern in patterns):
            return number, names
    return None


class _Deciding:
    """Decides one demand; ``found`` are the departures, one of each kind."""

    def __init__(
        self, compiled: Compiled, constraints: Constraints, demand: Demand, effort: Effort
    ) -> None:
        self._automaton = compiled.automaton
        self._constraints = constraints
        self._demand = demand
        self._effort = effort
        self._feasible = _Feasible(compiled, constraints)
        self._evaluator = Evaluator(compiled.automaton)
        self._first: Left | None = None
        self._followed = True  # and its automaton is not too large
        self.found: dict[Key, Departure] = {}

    def decided(self) -> bool:
        """Find the departures; False: a limit was met before there was one."""
        solver, moves = self._effort.solver, self._effort.moves
        quick = _QUICK_MOVES + _QUICK_MOVES_PER_RUNNER * len(self._automaton.runners)
        if solver != "z3" and self._search(min(moves, quick)):
            if solver == "auto":
                self._compare()
            return True
        if solver != "structural" and self._solve():
            return True
        if self.found or not self._followed or solver == "z3":
            return bool(self.found)
        return self._search(moves) or bool(self.found)

    def _search(self, moves: int) -> bool:
        try:
            self._take(search(self._automaton, self._constraints, self._demand, most=moves))
        except (TooMany, Inconclusive):
            return False
        except TooLarge:
            self._followed = False
            return False
        return True

    def _solve(self) -> bool:
        try:
            self._take(
                leaving_runs(
                    self._automaton,
                    self._constraints,
                    self._demand,
                    but=self.found,
                    rlimit=self._effort.rlimit,
                )
            )
        except (TooLarge, Inconclusive):
            return False
        return True

    def _compare(self) -> None:
        """The second opinion."""
        if len(self._automaton.runners) > self._effort.second_opinion:
            return
        try:
            same = confirms(
                self._automaton,
                self._constraints,
                self._demand,
                self._first,
                rlimit=self._effort.rlimit,
            )
        except (TooLarge, Inconclusive):
            return  # the answer of the search is exact; the second opinion has none
        if not same:
            raise InternalError(
                f"the search and z3 disagree on the task: {[*self.found] or 'nothing'} was found"
            )

    def _take(self, runs: Iterator[Left]) -> None:
        """The first run of each kind. Raises TooMany if most cannot be completed."""
        spurious = 0
        for left in runs:
            if len(self.found) >= _MAX_DEPARTURES:
                return
            violation = left.violation
            if violation.key in self.found:
                continue
            scenario = self._feasible.scenario(left)
            if scenario is None:
                spurious += 1
                if spurious > _MAX_SPURIOUS:
                    raise TooMany
                continue
            self._first = self._first or left
            shown = _scenario(self._evaluator, left, scenario)
            self.found[violation.key] = Departure(
                violation.code, violation.message, shown, violation.runner
            )


class _Feasible:
    """Completes what a run decides to a scenario that the constraints admit."""

    def __init__(self, compiled: Compiled, constraints: Constraints) -> None:
        self._compiled = compiled
        self._constraints = constraints
        self._group = {number: group for group in constraints.groups for number in group}

    def scenario(self, left: Left) -> tuple[Outcome, ...] | None:
        """A scenario in which the run is possible; None: there is none. What is open succeeds."""
        constraints = self._constraints
        if constraints.formulas:
            return self._solved(left.outcomes)
        decided = dict(left.outcomes)
        for number, outcome in left.outcomes.items():
            decided |= dict.fromkeys(self._group.get(number, ()), outcome)
        ranks = {outcome: rank for rank, outcome in enumerate(Outcome)}
        for number, allowed in enumerate(constraints.allowed):
            if number not in decided:
                group = self._group.get(number, (number,))
                common = allowed.intersection(*(constraints.allowed[one] for one in group))
                decided |= dict.fromkeys(group, min(common, key=lambda each: ranks[each]))
        outcomes = tuple(decided[number] for number in range(len(constraints.allowed)))
        if not constraints.admit(outcomes):
            raise InternalError("a run that leaves the task obeys no scenario")
        return outcomes

    def _solved(self, decided: dict[int, Outcome]) -> tuple[Outcome, ...] | None:
        """What is open fails as rarely as z3 finds it to be possible."""
        solver = self._solver
        terms = [solver.encoding.outcome(at, (outcome,)) for at, outcome in decided.items()]
        return canonical_scenario(solver, conjunction(terms))

    @cached_property
    def _solver(self) -> Solver:
        return Solver(self._compiled, self._constraints)


def _scenario(evaluator: Evaluator, left: Left, outcomes: tuple[Outcome, ...]) -> Scenario:
    """The run as it is told; raises InternalError if it does not replay."""
    automaton = evaluator.automaton
    signals = [Signal(automaton.runner_node(number), event) for event, number in left.events]
    run = evaluator.run(outcomes.__getitem__)
    if not all(map(run.happens, signals)):
        raise InternalError("a scenario does not replay as it was claimed")
    decisions = dict(left.outcomes)
    if evaluator.surely(decisions).ends is not run.ends:
        nodes = (node for node in run.triggered if automaton.nodes[node].kind is NodeKind.RUNNER)
        decisions |= {node - 1: outcomes[node - 1] for node in nodes}
    plan = automaton.plan
    shows = left.events[-1:] == ((Event.STARTED, left.violation.runner),)
    known = {automaton.runner_node(number): outcome for number, outcome in decisions.items()}
    return Scenario(
        outcomes=tuple(
            (plan.path(plan.runners[number]), decisions[number]) for number in sorted(decisions)
        ),
        ends=run.ends,
        trace=tuple(
            TraceStep(event, place.element, place.line)
            for event, number in left.events[-_MAX_TRACE:]
            for place in (plan.location(plan.runners[number]),)
        ),
        trace_truncated=len(left.events) > _MAX_TRACE,
        story=story(
            automaton, signals[:-1] if shows else signals, (left.violation.closing,), known
        ),
    )
