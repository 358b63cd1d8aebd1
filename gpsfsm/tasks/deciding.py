"""Does a plan fulfil a task? Every demand is decided over all scenarios and orders of events.

``decide_task`` gives departures with their scenarios, ``task_findings`` the findings GP6xx.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.counterexamples import canonical_scenario
from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.options import DEFAULT_RLIMIT
from gpsfsm.analysis.rules import rule
from gpsfsm.analysis.solver import Inconclusive, Solver
from gpsfsm.analysis.words import listed, story
from gpsfsm.compile import compile_plan
from gpsfsm.equivalence.comparison import Echo, echo_of
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.finding import Scenario, TraceStep
from gpsfsm.model.story import remark
from gpsfsm.tasks.counterexample import DEFAULT_MOVES, TooMany, search
from gpsfsm.tasks.ltlf import TooLarge, atoms_of
from gpsfsm.tasks.monitor import Matching, RuleMonitor
from gpsfsm.tasks.steps import StepsMonitor
from gpsfsm.tasks.symbolic import confirms, leaving_runs

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.options import SolverChoice
    from gpsfsm.compile import Compiled
    from gpsfsm.model.finding import Finding
    from gpsfsm.tasks.counterexample import Left
    from gpsfsm.tasks.machine import Key
    from gpsfsm.tasks.monitor import Demand
    from gpsfsm.tasks.task import Pattern, Task

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
    """The departures of a plan from a task; ``undecided`` names the demands that are left open.

    ``unknown`` says of which of them it is because of values that arrive; the others are beyond
    the limits.
    """

    departures: tuple[Departure, ...]
    undecided: tuple[str, ...] = ()
    unknown: tuple[Unknown, ...] = ()

    @property
    def fulfilled(self) -> bool | None:
        """True if the plan fulfils the task in every scenario and order; None: undecided."""
        if self.departures:
            return False
        return None if self.undecided else True


@dataclass(frozen=True, slots=True)
class Effort:
    """The effort of a decision: ``moves`` bounds each search, ``rlimit`` z3's steps per question.

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
        elif not deciding.departures and (arriving := _unknown(compiled, patterns)) is not None:
            # as the plan is written it does what it should, but that is not what will be done
            undecided.append(name)
            unknown.append(Unknown(name, *arriving))
        departures += deciding.departures.values()
    return Decision(tuple(departures), tuple(undecided), tuple(unknown))


def _demands(compiled: Compiled, task: Task) -> Iterator[tuple[str, Sequence[Pattern], Demand]]:
    """The name of each demand, the patterns of which it speaks, and what follows it."""
    plan = compiled.automaton.plan
    matching = Matching(plan.runners, compiled.bindings, plan.vocabulary.terms)
    if task.steps:
        named = [pattern for step in task.steps for pattern in step.attempts]
        yield "the steps of the task", [*named, *task.allowed], StepsMonitor(task, matching)
    for demand in task.rules:
        name = f"the rule '{demand.name}' of the task"
        spoken = {atom.name for atom in atoms_of(demand.formula)}
        patterns = [pattern for pattern in task.patterns if pattern.name in spoken]
        yield name, patterns, RuleMonitor(demand, task.patterns, matching)


def _unknown(compiled: Compiled, patterns: Sequence[Pattern]) -> tuple[int, tuple[str, ...]] | None:
    """An instance of which what arrives decides whether a pattern means it, and the names.

    What may arrive is unknown in every judgement (semantics, 8.2).
    """
    runners = compiled.automaton.plan.runners
    for number, (binding, runner) in enumerate(zip(compiled.bindings, runners, strict=True)):
        if binding is None or binding.arriving == frozenset():
            continue
        described = [one.name for one in binding.provider.configuration]
        described += (one.name for one in binding.provider.inputs)
        names = tuple(name for name in dict.fromkeys(described) if not binding.settled(name))
        if names and any(pattern.depends_on(runner, names, binding) for pattern in patterns):
            return number, names
    return None


class _Deciding:
    """Decides one demand; ``departures`` has those, one of each kind."""

    def __init__(
        self, compiled: Compiled, constraints: Constraints, demand: Demand, effort: Effort
    ) -> None:
        self._compiled = compiled
        self._constraints = constraints
        self._demand = demand
        self._effort = effort
        self._feasible = _Feasible(compiled, constraints)
        self._evaluator = Evaluator(compiled.automaton)
        self._first: Left | None = None
        self._followed = True  # and its automaton is not too large
        self.departures: dict[Key, Departure] = {}

    def decided(self) -> bool:
        """Find the departures; False: a limit was met before there was one."""
        solver, moves = self._effort.solver, self._effort.moves
        quick = _QUICK_MOVES + _QUICK_MOVES_PER_RUNNER * len(self._compiled.automaton.runners)
        if solver != "z3" and self._search(min(moves, quick)):
            if solver == "auto":
                self._compare()
            return True
        if solver != "structural" and self._solve():
            return True
        if self.departures or not self._followed or solver == "z3":
            return bool(self.departures)
        return self._search(moves) or bool(self.departures)

    def _search(self, moves: int) -> bool:
        try:
            self._take(search(self._compiled, self._constraints, self._demand, most=moves))
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
                    self._compiled,
                    self._constraints,
                    self._demand,
                    but=self.departures,
                    rlimit=self._effort.rlimit,
                )
            )
        except (TooLarge, Inconclusive):
            return False
        return True

    def _compare(self) -> None:
        """The second opinion."""
        if len(self._compiled.automaton.runners) > self._effort.second_opinion:
            return
        try:
            same = confirms(
                self._compiled,
                self._constraints,
                self._demand,
                self._first,
                rlimit=self._effort.rlimit,
            )
        except (TooLarge, Inconclusive):
            return  # the answer of the search is exact; the second opinion has none
        if not same:
            raise InternalError(
                "the search and z3 disagree on the task: "
                f"{[*self.departures] or 'nothing'} was found"
            )

    def _take(self, runs: Iterator[Left]) -> None:
        """The first run of each kind. Raises TooMany if most cannot be completed."""
        spurious = 0
        for left in runs:
            if len(self.departures) >= _MAX_DEPARTURES:
                return
            violation = left.violation
            if violation.key in self.departures:
                continue
            scenario = self._feasible.scenario(left)
            if scenario is None:
                spurious += 1
                if spurious > _MAX_SPURIOUS:
                    raise TooMany
                continue
            self._first = self._first or left
            shown = _scenario(self._evaluator, left, scenario)
            self.departures[violation.key] = Departure(
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
        """A scenario in which what is open fails as rarely as z3 says to be possible."""
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
    outcome_of = {automaton.runner_node(number): outcome for number, outcome in decisions.items()}
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
        sentences=(
            *story(automaton, signals[:-1] if shows else signals, outcome_of),
            remark(left.violation.closing),
        ),
        vocabulary=plan.vocabulary,
    )


def task_findings(context: Context, task: Task) -> tuple[list[Finding], list[str], list[str]]:
    """The findings GP6xx of a plan, and what could not be decided.

    That is the names of demands beyond the limits, and what is to be said of demands that values
    decide which arrive.
    """
    compiled, plan = context.compiled, context.plan
    findings: list[Finding] = []
    undecided: list[str] = []
    for example in task.not_answers:
        echo = echo_of(compiled, compile_plan(example.plan))
        if echo is Echo.SAME:
            message = (
                f"this {context.terms.whole} does what '{example.name}' does, "
                "which is no answer to the task"
            )
            findings.append(rule("GP609").finding(message, plan.location(0)))
        elif echo is Echo.UNDECIDED:
            undecided.append(f"whether the plan is '{example.name}'")
    constraints = context.deciders.constraints
    options = context.options
    effort = Effort(options.solver, DEFAULT_MOVES, options.rlimit, options.second_opinion)
    decision = decide_task(compiled, constraints, task, effort=effort)
    for departure in decision.departures:
        element = 0 if departure.runner is None else plan.runners[departure.runner].index
        scenario = departure.scenario if context.options.max_scenarios else None
        findings.append(
            rule(departure.rule).finding(
                departure.message,
                plan.location(element),
                scenario=scenario,
                terms=context.terms,
            )
        )
    unclear = [
        f"{each.demand} cannot be decided: what arrives as {listed(list(each.names))} at "
        f"{context.place(plan.runners[each.runner])} counts more than what the plan writes, and "
        "decides whether that action is meant"
        for each in decision.unknown
    ]
    open_ = {each.demand for each in decision.unknown}
    undecided += (name for name in decision.undecided if name not in open_)
    return findings, undecided, unclear
