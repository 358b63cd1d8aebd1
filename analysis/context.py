"""The context of a rule: the plan, its automaton, the verdicts, and scenarios on demand."""

from __future__ import annotations

from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis import words
from gpsfsm.analysis.causes import BufferFindings, Waiting, buffer_findings, waiting_blocks
from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.counterexamples import canonical_scenario, explain
from gpsfsm.analysis.decisions.dangling import DanglingEvent, dangling_claim
from gpsfsm.analysis.evaluate import KEPT
from gpsfsm.analysis.flow import Prompts, Values, prompts_of
from gpsfsm.analysis.solver import InconclusiveError
from gpsfsm.capabilities.library import EMPTY
from gpsfsm.compile import UnitKind
from gpsfsm.errors import InternalError
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.finding import Related, Scenario, TraceStep
from gpsfsm.model.story import Sentence, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.analysis.decide import Decided
    from gpsfsm.analysis.evaluate import OutcomeOf
    from gpsfsm.analysis.on_engine import OnEngine
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.model.automaton import Automaton, Signal
    from gpsfsm.model.plan import Element, Plan

_MAX_TRACE = 200
_MAX_EVENTS = 1_500_000
"""Events replayed for all scenarios of a plan. Only plans of thousands of runners come near."""


class Context:
    """The verdicts on one plan, ready to be turned into findings.

    ``terms`` are the words for what was checked. ``engine`` is the plan on the engine that is to
    run it, where that is asked for and what the paper says of the plan is told.
    """

    def __init__(self, decided: Decided, capabilities: Capabilities = EMPTY) -> None:
        self.deciders = decided.deciders
        self.options = self.deciders.options
        self.clock = self.deciders.clock
        self.compiled = self.deciders.compiled
        self.units = self.compiled.units
        self.bindings = self.compiled.bindings
        self.capabilities = capabilities
        self.automaton = self.compiled.automaton
        self.plan = self.automaton.plan
        self.answers: Mapping[str, Any] = decided.answers
        self.inconclusive = decided.inconclusive
        self.proof = decided.proof
        self.terms = self.plan.vocabulary.terms
        self.engine: OnEngine | None = None
        self._scenarios: dict[str, int] = {}
        self._spent = 0
        self._latest: dict[frozenset[int], OutcomeOf] = {}
        # What scenarios share is made once, by functions that do not refer back to this object.
        self._path = cache(partial(_runner_path, self.plan))
        self._step = cache(partial(_trace_step, self.automaton))
        self._actor = cache(partial(words.actor, self.plan))

    # -- the plan ---------------------------------------------------------------------------

    def runner(self, number: int) -> Element:
        """The runner instance with this number in document order."""
        return self.plan.runners[number]

    def element_of(self, unit: int) -> Element:
        """The element that a unit stands for; of a guard, the element that is guarded."""
        while self.units.kinds[unit] is UnitKind.GUARD:
            unit = self.units.children[unit][0]
        return self.plan.elements[self.units.elements[unit]]

    @cached_property
    def numbers(self) -> Mapping[int, int]:
        """From element index to the number of the runner instance."""
        return {runner.index: number for number, runner in enumerate(self.plan.runners)}

    @cached_property
    def unit_of_runner(self) -> Sequence[int]:
        """The unit of each runner instance."""
        units = [0] * len(self.plan.runners)
        for unit, kind in enumerate(self.units.kinds):
            if kind is UnitKind.RUNNER:
                units[self.numbers[self.units.elements[unit]]] = unit
        return units

    @cached_property
    def unit_of_element(self) -> Mapping[int, int]:
        """From element index to the unit that stands for it (not the guards)."""
        return {
            element: unit
            for unit, element in enumerate(self.units.elements)
            if self.units.kinds[unit] not in (UnitKind.GUARD, UnitKind.DEAD)
        }

    @cached_property
    def waiting(self) -> tuple[Waiting, ...]:
        """The join deadlocks to report. Raises InconclusiveError at a limit."""
        return waiting_blocks(self)

    def runners_in(self, unit: int) -> list[int]:
        """The numbers of the runner instances in a unit, in document order."""
        numbers: list[int] = []
        pending = [unit]
        while pending:
            current = pending.pop()
            if self.units.kinds[current] is UnitKind.RUNNER:
                numbers.append(self.numbers[self.units.elements[current]])
            pending.extend(self.units.children[current])
        return sorted(numbers)

    def around(self, unit: int) -> Iterator[int]:
        """The units around a unit, from the inside."""
        unit = self.units.parents[unit]
        while unit >= 0:
            yield unit
            unit = self.units.parents[unit]

    def related(self, element: Element, message: str = "") -> Related:
        """A related place."""
        return Related(self.plan.location(element), message)

    def place(self, element: Element) -> str:
        """An element with its line, as messages name it."""
        return words.place(element)

    # -- what units can do ------------------------------------------------------------------

    @cached_property
    def reached(self) -> Sequence[bool]:
        """True if some run triggers a unit. Raises InconclusiveError at a limit."""
        if self.deciders.structure is not None:
            return self.deciders.structure.reached
        solver = self.deciders.solver
        triggers = self.compiled.triggers
        return solver.decide([solver.encoding.happens(signal) for signal in triggers])

    @cached_property
    def unreached_roots(self) -> Sequence[int]:
        """The outermost units that no run triggers, in document order."""
        roots = [
            unit
            for unit, parent in enumerate(self.units.parents)
            if not self.reached[unit] and (parent < 0 or self.reached[parent])
        ]
        return sorted(roots, key=lambda unit: self.element_of(unit).index)

    @cached_property
    def values(self) -> Values:
        """The values that arrive at each runner instance."""
        return Values(self.compiled)

    @cached_property
    def prompts(self) -> Prompts | None:
        """The instances that prompt a model; None if there are none."""
        return prompts_of(self.compiled)

    @cached_property
    def buffers(self) -> BufferFindings:
        """The defects of the prompt buffers, each cause once."""
        return buffer_findings(self)

    # -- scenarios --------------------------------------------------------------------------

    def scenario(self, rule: str, claim: Claim, *closing: Statement | Sentence) -> Scenario | None:
        """The canonical scenario for a claim, reduced and replayed; ``closing`` ends its story.

        None after ``max_scenarios`` of this rule, after so many events that time and output would
        no longer be linear in the size of the plan, if the solver reached its limit, or if only
        the solver could find it and the plan is large. Raises InternalError if it does not replay.
        """
        shown = self._scenarios.get(rule, 0)
        if shown >= self.options.max_scenarios or self._spent > _MAX_EVENTS:
            return None
        self._scenarios[rule] = shown + 1
        try:
            outcome_of = self._canonical(claim)
        except InconclusiveError:
            return None
        if outcome_of is None:
            return None
        numbers = range(len(self.plan.runners))
        if not self.deciders.definitions.admit([outcome_of(number) for number in numbers]):
            raise InternalError("a scenario does not obey the options")
        no_start = self.deciders.constraints.no_start
        evaluator = self.deciders.evaluator
        if claim.shown is not None:
            claim = claim.shown(evaluator, outcome_of)
        explanation = explain(claim, evaluator, outcome_of, no_start=no_start)
        trace = explanation.trace
        decisions = {number: outcome_of(number) for number in explanation.decisions}
        self._spent += explanation.steps + len(decisions)
        happening = explanation.happening
        if not claim.holds(evaluator, decisions, explanation.ends, happening=happening):
            raise InternalError("a scenario does not replay as it was claimed")
        steps = tuple(map(self._step, trace[-_MAX_TRACE:]))
        by_node = {
            self.automaton.runner_node(number): outcome for number, outcome in decisions.items()
        }
        story = words.story(self.automaton, trace[: explanation.story_length], by_node, self._actor)
        ending = (each if isinstance(each, Sentence) else Sentence(each) for each in closing)
        return Scenario(
            outcomes=tuple((self._path(number), outcome) for number, outcome in decisions.items()),
            ends=explanation.ends,
            trace=steps,
            trace_truncated=len(trace) > _MAX_TRACE,
            sentences=(*story, *ending),
            vocabulary=self.plan.vocabulary,
        )

    def triggering(self, rule: str, number: int) -> Scenario | None:
        """The canonical scenario that triggers a runner instance; None if nothing need fail."""
        node = self.automaton.runner_node(number)
        claim = Claim(
            meet=(number,),
            more=lambda solver: solver.encoding.triggered(node),
            failing=lambda s: s.failing_before(s.unit_of[number]),
        )
        structure = self.deciders.structure
        if structure is not None and not any(True for _ in claim.failing(structure)):
            return None
        scenario = self.scenario(rule, claim)
        plain = scenario is None or all(
            outcome is Outcome.SUCCEEDED for _, outcome in scenario.outcomes
        )
        return None if plain else scenario

    def possible(self, claim: Claim) -> bool:
        """True if any scenario shows the claim. Raises InconclusiveError at a limit."""
        if self.deciders.structure is not None and claim.ends is End.STUCK:
            return False
        solver = self.deciders.solver
        return solver.decide([claim.term(solver)])[0]

    def possible_event(self, event: DanglingEvent) -> bool:
        """True if a dangling event ever happens. Raises InconclusiveError at a limit."""
        structure = self.deciders.structure
        if structure is not None:
            unit = structure.unit_of[event.runner]
            succeeds = event.event is Event.SUCCEEDED
            able = structure.can_succeed if succeeds else structure.can_fail
            return structure.reached[unit] and able[unit]
        return self.possible(dangling_claim(self.automaton, event))

    @cached_property
    def _plain(self) -> Sequence[Outcome]:
        """The outcomes where nothing fails but what must."""
        structure = self.deciders.structure
        assert structure is not None, "only the structural pass proposes scenarios"
        return [structure.outcome(number, ()) for number in range(len(self.plan.runners))]

    def _plainest(self, structure: Structure, failing: frozenset[int]) -> OutcomeOf:
        """The scenario in which these fail and nothing else does that need not.

        The same object for the same runners, so that the evaluator can keep its runs.
        """
        outcome_of = self._latest.pop(failing, None)
        if outcome_of is None:
            outcomes = list(self._plain)
            for number in failing:
                outcomes[number] = structure.outcome(number, failing)
            outcome_of = tuple(outcomes).__getitem__
            if len(self._latest) == KEPT:
                del self._latest[next(iter(self._latest))]
        self._latest[failing] = outcome_of
        self.deciders.evaluator.keep(outcome_of)
        return outcome_of

    def _canonical(self, claim: Claim) -> OutcomeOf | None:
        """The full scenario: from the structural pass where it is exact, else from z3.

        None if only z3 could tell and is not to be asked: it would take too long.
        """
        structure = self.deciders.structure
        if structure is not None:
            plainest = self._plainest(structure, frozenset(claim.failing(structure)))
            if claim.shows is None or claim.shows(self.deciders.evaluator, plainest):
                return plainest
            if not self.deciders.small:
                return None
        solver = self.deciders.fresh_solver()  # the other one is full of answered questions
        if claim.through is not None:
            solver = claim.through(solver)
        outcomes = canonical_scenario(solver, claim.term(solver))
        if outcomes is None or not self.deciders.constraints.admit(outcomes):
            raise InternalError("a claim that was decided to hold has no scenario")
        return outcomes.__getitem__


def _runner_path(plan: Plan, number: int) -> str:
    return plan.path(plan.runners[number])


def _trace_step(automaton: Automaton, signal: Signal) -> TraceStep:
    place = automaton.plan.location(automaton.nodes[signal.node].origin)
    return TraceStep(signal.event, place.element, place.line, place.file)
