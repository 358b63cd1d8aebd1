"""What a rule sees: the plan, its automaton, the verdicts, and scenarios on demand."""

from __future__ import annotations

from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis import words
from gpsfsm.analysis.blocks import Waiting, waiting_blocks
from gpsfsm.analysis.buffers import BufferFindings, buffer_findings
from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.decisions.dangling import DanglingEvent, dangling_claim
from gpsfsm.analysis.explain import explain
from gpsfsm.analysis.flow.prompts import Prompts, prompts_of
from gpsfsm.analysis.flow.values import Values
from gpsfsm.analysis.minimal import canonical_scenario
from gpsfsm.analysis.solver import Inconclusive
from gpsfsm.capabilities.library import EMPTY
from gpsfsm.compile import UnitKind
from gpsfsm.errors import InternalError
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.finding import Related, Scenario, TraceStep

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.analysis.decide import Decided
    from gpsfsm.analysis.evaluate import OutcomeOf
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.model.plan import Element

__all__ = ["Context"]

_MAX_TRACE = 200
_MAX_EVENTS = 1_500_000
"""Events replayed for all scenarios of a plan. Only plans of thousands of runners come near."""


class Context:
    """The verdicts on one plan, ready to be turned into findings."""

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
        self._told: dict[str, int] = {}
        self._spent = 0

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
        found = [0] * len(self.plan.runners)
        for unit, kind in enumerate(self.units.kinds):
            if kind is UnitKind.RUNNER:
                found[self.numbers[self.units.elements[unit]]] = unit
        return found

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
        """The join deadlocks to report. Raises Inconclusive at a limit."""
        return waiting_blocks(self)

    def runners_in(self, unit: int) -> list[int]:
        """The numbers of the runner instances in a unit, in document order."""
        found: list[int] = []
        pending = [unit]
        while pending:
            current = pending.pop()
            if self.units.kinds[current] is UnitKind.RUNNER:
                found.append(self.numbers[self.units.elements[current]])
            pending.extend(self.units.children[current])
        return sorted(found)

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
        """Whether some run triggers a unit. Raises Inconclusive at a limit."""
        if self.deciders.structure is not None:
            return self.deciders.structure.reached
        solver = self.deciders.solver
        triggers = self.compiled.triggers
        return solver.decide([solver.encoding.happens(signal) for signal in triggers])

    @cached_property
    def unreached_roots(self) -> Sequence[int]:
        """The outermost units that no run triggers, in document order."""
        found = [
            unit
            for unit, parent in enumerate(self.units.parents)
            if not self.reached[unit] and (parent < 0 or self.reached[parent])
        ]
        return sorted(found, key=lambda unit: self.element_of(unit).index)

    @cached_property
    def values(self) -> Values:
        """What arrives at each runner instance."""
        return Values(self.compiled)

    @cached_property
    def prompts(self) -> Prompts | None:
        """The instances that prompt a model; None if there are none."""
        return prompts_of(self.compiled)

    @cached_property
    def buffers(self) -> BufferFindings:
        """What is wrong with the prompt buffers, each cause once."""
        return buffer_findings(self)

    # -- scenarios --------------------------------------------------------------------------

    def scenario(self, rule: str, claim: Claim, closing: Sequence[str] = ()) -> Scenario | None:
        """The canonical scenario for a claim, reduced and replayed.

        None after ``max_scenarios`` of this rule, after so many events that time and output would
        no longer be linear in the size of the plan, if the solver reached its limit, or if only
        the solver could find it and the plan is large. Raises InternalError if it does not replay.
        """
        told = self._told.get(rule, 0)
        if told >= self.options.max_scenarios or self._spent > _MAX_EVENTS:
            return None
        self._told[rule] = told + 1
        try:
            outcome_of = self._canonical(claim)
        except Inconclusive:
            return None
        if outcome_of is None:
            return None
        no_start = self.deciders.constraints.no_start
        evaluator = self.deciders.evaluator
        if claim.shown is not None:
            claim = claim.shown(evaluator, outcome_of)
        found = explain(claim, evaluator, outcome_of, no_start=no_start)
        decisions = {number: outcome_of(number) for number in found.decisions}
        self._spent += found.steps + len(decisions)
        if not claim.holds(evaluator, decisions, found.ends):
            raise InternalError("a scenario does not replay as it was claimed")
        steps = tuple(
            TraceStep(signal.event, place.element, place.line)
            for signal in found.trace[-_MAX_TRACE:]
            for place in (self.plan.location(self.automaton.nodes[signal.node].origin),)
        )
        known = {
            self.automaton.runner_node(number): outcome for number, outcome in decisions.items()
        }
        return Scenario(
            outcomes=tuple(
                (self.plan.path(self.runner(number)), outcome)
                for number, outcome in decisions.items()
            ),
            ends=found.ends,
            trace=steps,
            trace_truncated=len(found.trace) > _MAX_TRACE,
            story=words.story(self.automaton, found.trace[: found.told], closing, known),
        )

    def triggering(self, rule: str, number: int, closing: Sequence[str] = ()) -> Scenario | None:
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
        found = self.scenario(rule, claim, closing)
        plain = found is None or all(outcome is Outcome.SUCCEEDED for _, outcome in found.outcomes)
        return None if plain else found

    def possible(self, claim: Claim) -> bool:
        """Whether any scenario shows the claim. Raises Inconclusive at a limit."""
        if self.deciders.structure is not None and claim.ends is End.STUCK:
            return False
        solver = self.deciders.solver
        return solver.decide([claim.term(solver)])[0]

    def possible_event(self, found: DanglingEvent) -> bool:
        """Whether a dangling event ever happens. Raises Inconclusive at a limit."""
        structure = self.deciders.structure
        if structure is not None:
            unit = structure.unit_of[found.runner]
            succeeds = found.event is Event.SUCCEEDED
            able = structure.can_succeed if succeeds else structure.can_fail
            return structure.reached[unit] and able[unit]
        return self.possible(dangling_claim(self.automaton, found))

    def _canonical(self, claim: Claim) -> OutcomeOf | None:
        """The full scenario: from the structural pass where it is exact, else from z3.

        None if only z3 could tell and is not to be asked: it would take too long.
        """
        structure = self.deciders.structure
        if structure is not None:
            failing = frozenset(claim.failing(structure))
            plainest = partial(structure.outcome, failing=failing)
            if claim.shows is None or claim.shows(self.deciders.evaluator, plainest):
                return plainest
            if not self.deciders.asks_solver:
                return None
        solver = self.deciders.fresh_solver()  # the other one is full of answered questions
        if claim.through is not None:
            solver = claim.through(solver)
        outcomes = canonical_scenario(solver, claim.term(solver))
        if outcomes is None or not self.deciders.constraints.admit(outcomes):
            raise InternalError("a claim that was decided to hold has no scenario")
        return outcomes.__getitem__
