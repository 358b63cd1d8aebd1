"""Run all analyses on one plan, with the way of deciding that fits it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.decisions import analyses
from gpsfsm.analysis.decisions.completion import frequency
from gpsfsm.analysis.definitions import Definitions
from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.analysis.options import Budget, Purse
from gpsfsm.analysis.proof.prove import prove
from gpsfsm.analysis.solver import InconclusiveError, Solver
from gpsfsm.analysis.structure import Structure
from gpsfsm.analysis.timing.meeting import Clock, clock_of
from gpsfsm.compile import TreePlan
from gpsfsm.errors import InternalError, UsageError
from gpsfsm.late import dataclass
from gpsfsm.model.automaton import PAPER
from gpsfsm.model.event import End
from gpsfsm.model.report import By, Facts, Frequency, Proof

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.compile import Compiled


ALL_PLAYED = 500
"""Scenarios, or configurations, up to which all are played where options say which there are."""


class Deciders:
    """The ways to decide about one plan, each made when it is first needed."""

    def __init__(
        self, compiled: Compiled, constraints: Constraints, options: AnalysisOptions
    ) -> None:
        self.compiled = compiled
        self.constraints = constraints
        self.options = options
        self.budget = Budget(options.total_rlimit)

    @cached_property
    def evaluator(self) -> Evaluator:
        """Replays scenarios on the automaton."""
        return Evaluator(self.compiled.automaton)

    @cached_property
    def structure(self) -> Structure | None:
        """The structural pass; None where it is not exact or not wanted."""
        wanted = self._exact and self.options.solver != "z3"
        return Structure(self.compiled, self.constraints, self.clock) if wanted else None

    @property
    def _exact(self) -> bool:
        """True if the structural pass is exact."""
        if self.compiled.automaton.traits != PAPER:
            return False
        if self.constraints.independent and self.compiled.units.plain:
            return True
        # What some unit never does, the passes about what capabilities declare do not know.
        if not self.constraints.separate or any(self.compiled.bindings):
            return False
        tree = isinstance(self.compiled.automaton.plan, TreePlan)
        return tree or not self.constraints.no_start  # which chains the units of a plan

    @cached_property
    def definitions(self) -> Definitions:
        """The options as they are defined."""
        return Definitions(self.compiled, self.options)

    @cached_property
    def clock(self) -> Clock | None:
        """The clock of the plan; None where no durations are declared."""
        rlimit, purse = self.options.rlimit, self.budget.deciding
        return clock_of(self.compiled, self.constraints, rlimit=rlimit, purse=purse)

    @cached_property
    def solver(self) -> Solver:
        """The one z3 problem to which all questions are put."""
        budget = self.budget
        solver = self._solver(budget.deciding if self.structure is None else budget.second)
        solver.clock = self.clock
        return solver

    @cached_property
    def contradictory(self) -> bool | None:
        """True if the constraints admit no scenario; None: a limit keeps it open."""
        if self.constraints.separate:
            return False
        return not all(self.constraints.allowed) or self.solver.contradictory()

    def fresh_solver(self) -> Solver:
        """A z3 problem without any questions, for a scenario: reading its models is fast."""
        return self._solver(self.budget.scenarios)

    def _solver(self, purse: Purse) -> Solver:
        return Solver(self.compiled, self.constraints, rlimit=self.options.rlimit, purse=purse)

    @property
    def asks_solver(self) -> bool:
        """True if z3 decides, or proves what the structural pass proposes."""
        return self.options.solver != "structural"

    @property
    def small(self) -> bool:
        """True if z3 may be asked one question after the other, where the structural pass is exact.

        Where it is not, z3 has to be, whatever the size.
        """
        alone = self.structure is None or self.options.solver == "z3"
        runners = len(self.compiled.automaton.runners)
        return self.asks_solver and (alone or runners <= self.options.second_opinion)


@dataclass(frozen=True, slots=True)
class Decided:
    """The answers about one plan.

    ``answers`` are by analysis name; None where a limit was hit (``inconclusive`` names those).
    ``proof``: what they rest on. ``contradictory``: the constraints admit no scenario, so that
    nothing could be decided.
    """

    deciders: Deciders
    answers: Mapping[str, Any] = field(default_factory=dict)
    contradictory: bool = False
    inconclusive: tuple[str, ...] = ()
    proof: Proof = field(default_factory=Proof)

    def facts(self) -> Facts | None:
        """The facts of the contract; None if the constraints are contradictory."""
        if self.contradictory:
            return None
        compiled = self.deciders.compiled
        fields: dict[str, Any] = {}
        for analysis in analyses():
            fields |= analysis.facts(self.answers[analysis.name], compiled)
        return Facts(runners=len(compiled.automaton.runners), **fields)


def decide(compiled: Compiled, constraints: Constraints, options: AnalysisOptions) -> Decided:
    """Decide everything about a compiled plan.

    Raises UsageError if the structural pass is asked for where it is not exact, and InternalError
    if it disagrees with z3, or either with what a few scenarios show by the options' definitions.
    """
    decided = _decided(Deciders(compiled, constraints, options))
    _require_definitions(decided)
    return decided


def _require_definitions(decided: Decided) -> None:
    """Raise InternalError where the definitions of the options give other answers, if a few do."""
    deciders, answers = decided.deciders, decided.answers
    if deciders.definitions.plain or deciders.compiled.automaton.traits != PAPER:
        return
    wanted: Mapping[str, Any] = {}
    with suppress(InconclusiveError):
        contradictory = deciders.definitions.contradictory()
        answered = decided.contradictory or any(each is not None for each in answers.values())
        if answered and contradictory is not decided.contradictory:
            raise InternalError("two ways to decide disagree on whether the options contradict")
        if not decided.contradictory:
            played = _by_scenarios if deciders.constraints.no_start else _by_configurations
            wanted = played(deciders)
    for name, answer in wanted.items():
        current = answers[name]
        if name == "dangling" and current is not None:
            current = {each[:2] for each in current if each.effect == "give_up"}
        if current is not None and current != answer:
            raise InternalError(
                f"two ways to decide disagree on '{name}': {current}, by definition {answer}"
            )


def _by_scenarios(deciders: Deciders) -> dict[str, Any]:
    """Answers of all scenarios, played. Raises InconclusiveError if they are many."""
    ends: set[End] = set()
    triggered: set[int] = set()
    for outcomes in deciders.definitions.scenarios(ALL_PLAYED):
        run = deciders.evaluator.run(outcomes.__getitem__)
        ends.add(run.ends)
        triggered.update(run.triggered)
    completes, gives_up, stuck = (
        frequency(end in ends, ends != {end}) for end in (End.COMPLETED, End.GAVE_UP, End.STUCK)
    )
    runners = deciders.compiled.automaton.runners
    return {
        "completion": (completes, gives_up),
        "stuck": (stuck, Frequency.NEVER, Frequency.NEVER),
        "reachability": tuple(n for n, node in enumerate(runners) if node.index not in triggered),
    }


def _by_configurations(deciders: Deciders) -> dict[str, Any]:
    """Answers of all orders of events. Raises InconclusiveError if they are many."""
    from gpsfsm.analysis.machines.decide import Judge
    from gpsfsm.analysis.machines.plain import Plain
    from gpsfsm.analysis.machines.search import Exploration

    automaton = deciders.compiled.automaton
    plain = Plain(automaton, deciders.definitions, by_scenario=True)
    outcomes = deciders.definitions.outcomes
    judge = Judge(Exploration(automaton, outcomes, limit=ALL_PLAYED, stepper=plain))
    facts = judge.facts()
    timed = judge.tree or deciders.clock is not None  # orders that durations rule out count here
    orphans = {} if timed else {"orphans": tuple(number for number, _ in facts.orphans)}
    return orphans | {
        "completion": (facts.completes, facts.gives_up),
        "stuck": (facts.stuck, Frequency.NEVER, Frequency.NEVER),
        "reachability": facts.unreachable,
        "fewest": facts.fewest_failures,
        "dangling": {
            (automaton.runner_number(each.signal.node), each.signal.event)
            for each in facts.dangling
            if each.effect == "give_up"
        },
    }


def _decided(deciders: Deciders) -> Decided:
    """Decide everything, by the way that fits."""
    options = deciders.options
    if options.solver == "structural" and deciders.structure is None:
        raise UsageError(
            "the structural pass decides independent outcomes only; with --consistent, --faults, "
            "assumptions that tie outcomes together, or capabilities that never succeed or may "
            "hang, use --solver auto or z3"
        )
    if deciders.contradictory is None:
        names = tuple(analysis.name for analysis in analyses())
        return Decided(deciders, dict.fromkeys(names), inconclusive=names)
    if deciders.contradictory:
        return Decided(deciders, contradictory=True)
    structure = deciders.structure
    if structure is not None:
        return _proposed(deciders, structure)
    with suppress(InconclusiveError):  # each analysis will find out for itself
        solver = deciders.solver
        solver.ask([term for analysis in analyses() for term in analysis.questions(solver)])
    answers: dict[str, Any] = {}
    inconclusive: list[str] = []
    for analysis in analyses():
        try:
            answers[analysis.name] = analysis.by_solver(deciders.solver)
        except InconclusiveError:
            answers[analysis.name] = None
            inconclusive.append(analysis.name)
    proof = Proof(dict.fromkeys(answers, By.Z3))
    return Decided(deciders, answers, inconclusive=tuple(inconclusive), proof=proof)


def _proposed(deciders: Deciders, structure: Structure) -> Decided:
    """The answers of the structural pass, proved unless it alone is to decide."""
    answers: dict[str, Any] = {}
    inconclusive: list[str] = []
    for analysis in analyses():
        try:
            answers[analysis.name] = analysis.by_structure(structure)
        except InconclusiveError:
            answers[analysis.name] = None
            inconclusive.append(analysis.name)
    if not deciders.asks_solver:
        reasons = {
            each.name: "--solver structural"
            for each in analyses()
            if each.matters(deciders.options)
        }
        proof = Proof(dict.fromkeys(answers, By.STRUCTURAL), reasons)
    else:
        proof = prove(deciders, answers)
    return Decided(deciders, answers, inconclusive=tuple(inconclusive), proof=proof)
