"""Does a plan fulfil a task? Every demand is decided over all scenarios and orders of events.

``decide_task`` gives departures with their scenarios, ``task_findings`` the findings GP6xx.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, NamedTuple

from gpsfsm.analysis.counterexamples import canonical_scenario
from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.options import DEFAULT_RLIMIT
from gpsfsm.analysis.rules import rule
from gpsfsm.analysis.solver import InconclusiveError, Solver
from gpsfsm.analysis.words import listed, story
from gpsfsm.compile import compile_plan
from gpsfsm.equivalence.comparison import Echo, echo_of
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.finding import Scenario, TraceStep
from gpsfsm.model.story import Vocabulary, remark
from gpsfsm.tasks.counterexample import DEFAULT_MOVES, TooManyError, search
from gpsfsm.tasks.ltlf import TooLargeError, atoms_of
from gpsfsm.tasks.monitor import Matching, RuleMonitor
from gpsfsm.tasks.proof import played, suspect
from gpsfsm.tasks.steps import StepsMonitor
from gpsfsm.tasks.symbolic import leaving_runs, some_run_leaves

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
    hint: str = ""


class Unknown(NamedTuple):
    """A demand that is not decided: values of these names arrive at the instance and decide it."""

    demand: str
    runner: int
    names: tuple[str, ...]


DecidedBy = Literal["replay", "z3", "search"]
"""``replay``: a run is shown that leaves the task. ``z3``: it has proved that there is none.

``search``: the search has found none, and z3 has met a limit.
"""


class Basis(NamedTuple):
    """A demand that is decided, and what the answer rests on."""

    demand: str
    decided_by: DecidedBy


@dataclass(frozen=True, slots=True)
class Decision:
    """The departures of a plan from a task; ``undecided`` names the demands that are left open.

    ``unknown`` says of which of them it is because of values that arrive; the others are beyond
    the limits. ``basis`` says of all other demands what decided them, in the order of the task.
    """

    departures: tuple[Departure, ...]
    undecided: tuple[str, ...] = ()
    unknown: tuple[Unknown, ...] = ()
    basis: tuple[Basis, ...] = ()

    @property
    def fulfilled(self) -> bool | None:
        """True if the plan fulfils the task in every scenario and order; None: undecided."""
        if self.departures:
            return False
        return None if self.undecided else True

    @property
    def decided_by(self) -> DecidedBy | None:
        """The ground of ``fulfilled``: one departure is enough, but all demands must be kept.

        ``search`` if z3 has proved but some of them; None: undecided, or nothing is demanded.
        """
        if self.departures:
            return "replay"
        if self.undecided or not self.basis:
            return None
        return "z3" if all(each.decided_by == "z3" for each in self.basis) else "search"


@dataclass(frozen=True, slots=True)
class Effort:
    """The effort of a decision: ``moves`` bounds each search, ``rlimit`` z3's steps per question.

    ``solver``: ``auto`` searches, lets z3 prove that what the search finds kept is kept, and lets
    z3 decide where the search takes too long; ``structural`` searches alone and ``z3`` does not
    search. Where the one proof of all demands is not to be had, z3 is asked about each on plans of
    up to ``second_opinion`` runners.
    """

    solver: SolverChoice = "auto"
    moves: int = DEFAULT_MOVES
    rlimit: int = DEFAULT_RLIMIT
    second_opinion: int = 200


def decide_task(
    compiled: Compiled, constraints: Constraints, task: Task, *, effort: Effort | None = None
) -> Decision:
    """Decide all demands of a task.

    Raises InternalError if the search and z3 disagree.
    """
    effort = effort or Effort()
    departures: list[Departure] = []
    undecided: list[str] = []
    unknown: list[Unknown] = []
    basis: list[Basis] = []
    demands = list(_demands(compiled, task))
    all_ = [_Deciding(compiled, constraints, demand, effort) for _, _, demand in demands]
    _propose(all_, effort)
    for (name, patterns, _), deciding in zip(demands, all_, strict=True):
        decided_by = deciding.decided()
        if decided_by is None:
            undecided.append(name)
        elif not deciding.departures and (arriving := _unknown(compiled, patterns)) is not None:
            # as the plan is written it does what it should, but that is not what will be done
            undecided.append(name)
            unknown.append(Unknown(name, *arriving))
        else:
            basis.append(Basis(name, decided_by))
        departures += deciding.departures.values()
    return Decision(tuple(departures), tuple(undecided), tuple(unknown), tuple(basis))


def _propose(all_: Sequence[_Deciding], effort: Effort) -> None:
    """Search for departures; what seems to be kept is put to z3, all demands together.

    What the search gives up may be kept, too. If it is not, the rest is asked about without it.
    """
    if effort.solver != "z3":
        for each in all_:
            each.search_quickly()
    if effort.solver == "structural":
        return
    kept = [each for each in all_ if each.seems_kept]
    if kept and not _proved(kept, effort):
        searched = [each for each in kept if each.searched]
        if searched and len(searched) < len(kept):
            _proved(searched, effort)


def _proved(kept: Sequence[_Deciding], effort: Effort) -> bool:
    """True if z3 proves that no run leaves any of these demands. Raises InternalError."""
    compiled, constraints = kept[0].compiled, kept[0].constraints
    demands = [each.demand for each in kept]
    try:
        scenario = suspect(compiled, constraints, demands, rlimit=effort.rlimit)
        if scenario is not None:
            for each in kept:
                if each.searched and played(compiled, constraints, each.demand, scenario):
                    raise each.disagreement()
            return False
    except (TooLargeError, InconclusiveError):
        return False
    for each in kept:
        each.proved = True
    return True


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
        self.compiled = compiled
        self.constraints = constraints
        self.demand = demand
        self._effort = effort
        self._feasible = _Feasible(compiled, constraints)
        self._evaluator = Evaluator(compiled.automaton)
        self._followed = True  # and its automaton is not too large
        self.searched = False  # to the end
        self.proved = False
        self.departures: dict[Key, Departure] = {}

    @property
    def seems_kept(self) -> bool:
        """True if no departure has been met."""
        return self._followed and not self.departures

    def search_quickly(self) -> None:
        """Search as far as is enough where one thing happens after the other."""
        quick = _QUICK_MOVES + _QUICK_MOVES_PER_RUNNER * len(self.compiled.automaton.runners)
        self.searched = self._search(min(self._effort.moves, quick))

    def decided(self) -> DecidedBy | None:
        """The ground of the answer; None: a limit was met before there was one."""
        solver = self._effort.solver
        if self.proved:
            return "z3"
        if self.searched:
            confirmed = not self.departures and solver == "auto" and self._confirmed()
            return self._decided_by("z3" if confirmed else "search")
        if solver != "structural" and self._solve():
            return self._decided_by("z3")
        if self.departures or not self._followed or solver == "z3":
            return "replay" if self.departures else None
        searched = self._search(self._effort.moves)
        return self._decided_by("search") if searched or self.departures else None

    def _decided_by(self, kept: DecidedBy) -> DecidedBy:
        return "replay" if self.departures else kept

    def disagreement(self) -> InternalError:
        """The search has found nothing, and z3 has."""
        return InternalError("the search and z3 disagree on the task: nothing was found")

    def _search(self, moves: int) -> bool:
        try:
            self._take(search(self.compiled, self.constraints, self.demand, most=moves))
        except (TooManyError, InconclusiveError):
            return False
        except TooLargeError:
            self._followed = False
            return False
        return True

    def _solve(self) -> bool:
        try:
            self._take(
                leaving_runs(
                    self.compiled,
                    self.constraints,
                    self.demand,
                    but=self.departures,
                    rlimit=self._effort.rlimit,
                )
            )
        except (TooLargeError, InconclusiveError):
            return False
        return True

    def _confirmed(self) -> bool:
        """True if z3 agrees that no run leaves the demand. Raises InternalError if some run does.

        The problem that is put to it holds the runs that there are, and no others.
        """
        if len(self.compiled.automaton.runners) > self._effort.second_opinion:
            return False
        rlimit = self._effort.rlimit
        try:
            if some_run_leaves(self.compiled, self.constraints, self.demand, rlimit=rlimit):
                raise self.disagreement()
        except (TooLargeError, InconclusiveError):
            return False
        return True

    def _take(self, runs: Iterator[Left]) -> None:
        """The first run of each kind. Raises TooManyError if most cannot be completed."""
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
                    raise TooManyError
                continue
            shown = _scenario(self._evaluator, left, scenario)
            self.departures[violation.key] = Departure(
                violation.code, violation.message, shown, violation.runner, violation.hint
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
            TraceStep(event, place.element, place.line, place.file)
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


class TaskFindings(NamedTuple):
    """The findings GP6xx of a plan, and what could not be decided.

    ``undecided`` are the names of demands beyond the limits, ``unclear`` is what is to be said of
    demands that values decide which arrive. ``basis``: what decided the others.
    """

    findings: list[Finding]
    undecided: list[str]
    unclear: list[str]
    basis: tuple[Basis, ...]


def task_findings(context: Context, task: Task) -> TaskFindings:
    """Judge a plan by a task."""
    compiled, plan = context.compiled, context.plan
    findings: list[Finding] = []
    undecided: list[str] = []
    for example in task.not_answers:
        echo = echo_of(compiled, compile_plan(example.plan))
        if echo is Echo.SAME:
            message = (
                f"this {context.terms.whole} does what '{example.name}' does, "
                "which is not an answer to the task"
            )
            findings.append(rule("GP609").finding(message, plan.location(0)))
        elif echo is Echo.UNDECIDED:
            undecided.append(f"whether the plan does what '{example.name}' does")
    findings += _misused_nodes(context, task)
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
                hint=departure.hint,
                scenario=scenario,
                terms=context.terms,
            )
        )
    unclear = [
        f"{each.demand} cannot be decided: an incoming {listed(list(each.names))} replaces the "
        f"one that the plan writes for {context.place(plan.runners[each.runner])}, and whether "
        "the action matches depends on it"
        for each in decision.unknown
    ]
    open_ = {each.demand for each in decision.unknown}
    undecided += (name for name in decision.undecided if name not in open_)
    return TaskFindings(findings, undecided, unclear, decision.basis)


def _misused_nodes(context: Context, task: Task) -> Iterator[Finding]:
    """The nodes of a behaviour tree that the task has in another form, each place once.

    The tag is the end of the element path: ``Action`` in ``…/Action[2]`` where the file has
    ``<Action ID="MoveTo"/>``, ``MoveTo`` where it has ``<MoveTo/>``.
    """
    if context.plan.vocabulary is not Vocabulary.TREE:
        return
    compact = {node.name for node in task.nodes if node.compact}
    seen: set[tuple[int, int]] = set()
    for runner in context.plan.runners:
        location = context.plan.location(runner)
        tag = location.element.rpartition("/")[2].partition("[")[0]
        place = location.line, location.column
        if runner.interface in compact and tag != runner.interface and place not in seen:
            seen.add(place)
            name = runner.interface
            message = f'the task writes this node as <{name}>, not as <{tag} ID="{name}">'
            yield rule("GP610").finding(message, location, hint=f"write <{name} …/>")
