"""Does a plan fulfil a task? Every demand is decided over all scenarios and orders of events."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.minimal import canonical_scenario
from gpsfsm.analysis.solver import Inconclusive, Solver
from gpsfsm.analysis.words import story
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.finding import Scenario, TraceStep
from gpsfsm.tasks.ltlf import TooLarge
from gpsfsm.tasks.monitor import Matching, RuleMonitor
from gpsfsm.tasks.search import DEFAULT_CONFIGURATIONS, Left, TooMany, search
from gpsfsm.tasks.steps import StepsMonitor

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.tasks.monitor import Monitor
    from gpsfsm.tasks.task import Task

__all__ = ["Decision", "Departure", "decide_task"]

_MAX_DEPARTURES = 20
_MAX_TRACE = 200
_MAX_SPURIOUS = 1_000


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


@dataclass(frozen=True, slots=True)
class Decision:
    """Where a plan leaves a task; ``undecided`` names the demands beyond the limits."""

    departures: tuple[Departure, ...]
    undecided: tuple[str, ...] = ()

    @property
    def fulfilled(self) -> bool | None:
        """Whether the plan fulfils the task in every scenario and order; None: undecided."""
        if self.departures:
            return False
        return None if self.undecided else True


def decide_task(
    compiled: Compiled,
    constraints: Constraints,
    task: Task,
    *,
    most: int = DEFAULT_CONFIGURATIONS,
) -> Decision:
    """Decide all demands of a task, each by itself; ``most`` bounds the search of each."""
    departures: list[Departure] = []
    undecided: list[str] = []
    for name, monitor in _monitors(compiled.automaton, task):
        try:
            departures += _departures(compiled, constraints, monitor, most)
        except (TooMany, TooLarge, Inconclusive):
            undecided.append(name)
    return Decision(tuple(departures), tuple(undecided))


def _monitors(automaton: Automaton, task: Task) -> Iterator[tuple[str, Monitor]]:
    matching = Matching(automaton.plan.runners)
    if task.steps:
        yield "the steps of the task", StepsMonitor(task, matching)
    for rule in task.rules:
        name = f"the rule '{rule.name}' of the task"
        yield name, RuleMonitor(rule, task.patterns, matching)


def _departures(
    compiled: Compiled, constraints: Constraints, monitor: Monitor, most: int
) -> list[Departure]:
    """The first run of each kind, as the search finds them."""
    feasible = _Feasible(compiled, constraints)
    evaluator = Evaluator(compiled.automaton)
    found: dict[tuple[object, ...], Departure] = {}
    spurious = 0
    for left in search(compiled.automaton, constraints, monitor, most=most):
        key = (left.violation.code, *left.violation.about)
        if key in found:
            continue
        scenario = feasible.scenario(left)
        if scenario is None:
            spurious += 1
            if spurious > _MAX_SPURIOUS:
                raise TooMany
            continue
        violation = left.violation
        shown = _scenario(evaluator, left, scenario)
        found[key] = Departure(violation.code, violation.message, shown, violation.runner)
        if len(found) == _MAX_DEPARTURES:
            break
    return list(found.values())


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
