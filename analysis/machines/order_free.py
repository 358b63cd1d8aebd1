"""Machines whose runs are fixed by their scenario, decided by z3 without exploring any order.

Where nothing stops, no connections form a cycle and every instance is triggered by one connection
at most, each instance has one visit at most and every event happens once at most. Then the events
of a run follow from the outcomes alone (semantics, 4.3), and the problem text for plans
(``analysis/encode.py``) says which; so ten runners beside each other are ten Booleans, not 59,049
configurations. The automaton of every plan is such a machine.

Which runs end how may depend on the order still: if both ends can be triggered in one scenario, the
first counts. Such a machine is left to the exploration.

Orphans need an instant. ``a3`` and ``b3`` say that 3 has succeeded, or failed, *before* the instant
at which the run completes, ``c3`` and ``d3`` the same for *at* it or before: at most one more.

    start → x, y;  x SUCCEEDED → end      y an orphan: before nothing, at it c of x; y is triggered
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.claims import Claim
from gpsfsm.analysis.counterexamples import candidates, canonical_scenario, explain, plainest
from gpsfsm.analysis.decisions import completion, fewest, reachability
from gpsfsm.analysis.decisions import dangling as dangling_events
from gpsfsm.analysis.decisions.completion import frequency
from gpsfsm.analysis.encode import FALSE, conjunction, disjunction, negation
from gpsfsm.analysis.machines.decide import Answers, DanglingAt, Run, WaitingEffect, WaitingJoin
from gpsfsm.analysis.machines.overlaps import Overlap
from gpsfsm.analysis.options import Budget, InconclusiveError, Purse
from gpsfsm.analysis.solver import Solver
from gpsfsm.compile.instants import (
    COMPLETED,
    FAILED,
    GAVE_UP,
    GOING,
    HANG,
    SUCCEEDED,
    Instants,
    bits,
)
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.report import Frequency

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.counterexamples import Scenario
    from gpsfsm.analysis.encode import Variant
    from gpsfsm.analysis.evaluate import Run as PlayedRun
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Automaton

_STEPS = {Outcome.SUCCEEDED: SUCCEEDED, Outcome.FAILED: FAILED, Outcome.HANG: HANG}
_ENDS = {COMPLETED: End.COMPLETED, GAVE_UP: End.GAVE_UP, GOING: End.STUCK}
_EFFECTS: tuple[tuple[WaitingEffect, End], ...] = (
    ("stuck", End.STUCK),
    ("give_up", End.GAVE_UP),
    ("absorbed", End.COMPLETED),
)


_CANONICAL = 60
"""Runners up to which scenarios are canonical: that takes z3 many questions for each."""

_MOST_TRIED = 8
"""Scenarios that are tried for a join before z3 is asked for one."""


def is_order_free(automaton: Automaton) -> bool:
    """True if the scenario alone says which events happen."""
    import networkx

    if automaton.stops or any(event is Event.STOPPED for _, event, _ in automaton.edges):
        return False
    if any(len(automaton.inputs[node.index]) > 1 for node in automaton.runners):
        return False
    graph: networkx.DiGraph[int] = networkx.DiGraph()
    graph.add_edges_from((source, target) for source, _, target in automaton.edges)
    return bool(networkx.is_directed_acyclic_graph(graph))


class _Halves(NamedTuple):
    """The run before the instant of completion, and that up to it; ``over``: who has ended then."""

    before: Variant
    now: Variant
    over: dict[int, str]


class OrderFree:
    """All questions of semantics 9.4, put to z3. Raises InconclusiveError at a limit."""

    def __init__(
        self, compiled: Compiled, constraints: Constraints, options: AnalysisOptions
    ) -> None:
        self.compiled = compiled
        self.automaton = compiled.automaton
        self.constraints = constraints
        self.rlimit = options.rlimit
        self.most = options.max_scenarios
        self.budget = Budget(options.total_rlimit)
        self.solver = self._solver(self.budget.deciding)
        self.encoding = self.solver.encoding
        self.evaluator = self.solver.evaluator
        self.earlier: deque[Scenario] = deque(maxlen=2)

    def _solver(self, purse: Purse) -> Solver:
        return Solver(self.compiled, self.constraints, rlimit=self.rlimit, purse=purse)

    @cached_property
    def instants(self) -> Instants:
        """The instants of the machine, for the runs that are shown."""
        return Instants(self.automaton)

    @property
    def contradictory(self) -> bool:
        """True if there is no scenario."""
        if self.constraints.separate:
            return False
        contradictory = self.solver.contradictory()
        if contradictory is None:
            raise InconclusiveError
        return contradictory

    def answers(self) -> Answers | None:
        """All answers; None if the order of events decides how runs end."""
        encoding, automaton = self.encoding, self.automaton
        ends = [encoding.triggered(automaton.complete), encoding.triggered(automaton.give_up)]
        stuck = encoding.ending(End.STUCK)
        both, is_stuck, is_not_stuck = self.solver.decide(
            [conjunction(ends), stuck, negation(stuck)]
        )
        if both or self._ends_twice():
            return None
        completes, gives_up = completion.by_solver(self.solver)
        shown = {
            code: self._maximal(encoding.ending(_ENDS[code]))
            for code, possible in (
                (COMPLETED, False),  # no finding shows it
                (GAVE_UP, gives_up in (Frequency.SOMETIMES, Frequency.ALWAYS)),
                (GOING, is_stuck),
            )
            if possible
        }
        return Answers(
            completes=completes,
            gives_up=gives_up,
            stuck=frequency(is_stuck, is_not_stuck),
            endless=Frequency.NEVER,
            completes_if_fair=completes,
            unreachable=reachability.by_solver(self.solver),
            loops=(),
            dangling=tuple(self._dangling()),
            waiting=tuple(self._waiting()),
            orphans=tuple(self._orphans()),
            fewest_failures=fewest.by_solver(self.solver),
            shown=shown,
            configurations=0,
        )

    def _ends_twice(self) -> bool:
        """True if both ends come where an event is compared with the other outcome.

        That need not obey the options. Without these, both ends seldom come: one question.
        """
        usual = frozenset((Outcome.SUCCEEDED, Outcome.FAILED))
        allowed = tuple(outcomes | usual for outcomes in self.constraints.allowed)
        free = replace(self.constraints, allowed=allowed, groups=(), formulas=())
        if free == self.constraints:
            return False
        ends = (self.automaton.complete, self.automaton.give_up)
        solver = Solver(self.compiled, free, rlimit=self.rlimit, purse=self.budget.deciding)
        if not solver.decide([conjunction(map(solver.encoding.triggered, ends))])[0]:
            return False
        terms: list[str] = []
        for number, event, _ in dangling_events.by_solver(self.solver):
            signal = Signal(self.automaton.runner_node(number), event)
            variant = self._otherwise(self.solver, signal)
            both = map(variant.triggered, ends)
            terms.append(conjunction((self.encoding.happens(signal), *both)))
        return any(self.solver.decide(terms))

    # -- events that lead nowhere -----------------------------------------------------------

    def _dangling(self) -> Iterator[DanglingAt]:
        shown = 0
        for number, event, of_plan in dangling_events.by_solver(self.solver):
            signal = Signal(self.automaton.runner_node(number), event)
            effect, run = of_plan, None
            if effect == "dont_care" and self._leaves_stuck(signal):
                effect = "stuck"
            if effect != "dont_care":
                shown += 1
                end = End.STUCK if effect == "stuck" else End.GAVE_UP
                run = () if shown > self.most else self._last(number, signal, end)
            yield DanglingAt(signal, effect, run)

    def _leaves_stuck(self, signal: Signal) -> bool:
        return self.solver.decide([self._ending_otherwise(self.solver, signal, End.STUCK)])[0]

    def _ending_otherwise(self, solver: Solver, signal: Signal, end: End) -> str:
        """With this event the run ends so, and in the same scenario with the other it does not."""
        variant, encoding = self._otherwise(solver, signal), solver.encoding
        parts = (encoding.happens(signal), encoding.ending(end), negation(variant.ending(end)))
        return conjunction(parts)

    def _otherwise(self, solver: Solver, signal: Signal) -> Variant:
        """The run of a scenario with the other outcome in place of an event."""
        encoding = solver.encoding
        triggered = encoding.triggered(signal.node)
        other = Event.SUCCEEDED if signal.event is Event.FAILED else Event.FAILED
        changed = {Signal(signal.node, other): triggered, signal: FALSE}
        variant = encoding.variant(changed)
        solver.tell(variant.definitions)
        return variant

    def _last(self, number: int, signal: Signal, end: End) -> Run:
        """A run that ends so with this event, which comes last: it triggers no instance."""
        outcomes = next(
            (each for each in self._tried(number, signal, end) if self._shows(each, signal, end)),
            None,
        )
        if outcomes is None:
            outcomes = self._scenario(lambda s: self._ending_otherwise(s, signal, end))
        if outcomes is None:
            return ()
        self.earlier.append(outcomes)
        run = self._sequence(outcomes, Claim(happens=(signal,), ends=end))
        others = tuple(step for step in run if step[0] != number)
        return (*others, (number, SUCCEEDED if signal.event is Event.SUCCEEDED else FAILED))

    def _tried(self, number: int, signal: Signal, end: End) -> Iterator[Scenario]:
        """Scenarios in which this event may be what ends the run so."""
        try:
            if signal.event is Event.FAILED:
                claim = Claim(happens=(signal,), ends=end)
                yield from candidates(self.showing, claim, number, tuple(self.earlier))
            else:
                outcomes = plainest(self.solver, number, (number, Outcome.SUCCEEDED))
                yield from () if outcomes is None else (outcomes,)
        except InconclusiveError:
            return

    def _shows(self, outcomes: Scenario, signal: Signal, end: End) -> bool:
        """True if the event comes in this scenario, and the run ends so because of it."""
        number = self.automaton.runner_number(signal.node)
        fails = signal.event is Event.FAILED
        other = Outcome.SUCCEEDED if fails else Outcome.FAILED
        flipped = (*outcomes[:number], other, *outcomes[number + 1 :])
        run = self.evaluator.run(outcomes.__getitem__)
        otherwise = self.evaluator.run(flipped.__getitem__)
        return run.happens(signal) and run.ends is end and otherwise.ends is not end

    # -- joins ------------------------------------------------------------------------------

    def _waiting(self) -> Iterator[WaitingJoin]:
        """The joins that get some of their inputs and never fire."""
        joins = [
            node.index
            for node in self.automaton.nodes
            if node.kind is NodeKind.JOIN and node.need > 1
        ]
        terms = {join: self._waits(join) for join in joins}
        ends = {end: self.encoding.ending(end) for _, end in _EFFECTS}
        questions = [conjunction((terms[join], term)) for join in joins for term in ends.values()]
        answers = iter(self.solver.decide(questions))
        shown = 0
        for join in joins:
            possible = [next(answers) for _ in ends]
            for (effect, end), waits in zip(_EFFECTS, possible, strict=True):
                if waits:
                    shown += 1
                    term = conjunction((terms[join], ends[end]))
                    run = self._keeping(join, end, term) if shown <= self.most else ()
                    yield WaitingJoin(join, effect, run)
                    break

    def _keeping(self, join: int, end: End, term: str) -> Run:
        """A run that ends so, in which the join gets some of its inputs and never fires.

        First those are tried in which one runner that the join waits for ends the other way.
        """
        inputs = self.automaton.inputs[join]
        for node, event in inputs[:_MOST_TRIED]:
            if self.automaton.nodes[node].kind is not NodeKind.RUNNER or event is Event.STARTED:
                continue
            number = self.automaton.runner_number(node)
            other = Outcome.FAILED if event is Event.SUCCEEDED else Outcome.SUCCEEDED
            outcomes = plainest(self.solver, number, (number, other))
            if outcomes is not None:
                run = self.evaluator.run(outcomes.__getitem__)
                waits = any(map(run.happens, inputs)) and join not in run.triggered
                if waits and run.ends is end:
                    return self._sequence(outcomes, None)
        return self._maximal(term)

    def _waits(self, join: int) -> str:
        inputs = disjunction(map(self.encoding.happens, self.automaton.inputs[join]))
        return conjunction((inputs, negation(self.encoding.triggered(join))))

    # -- orphans ----------------------------------------------------------------------------

    def _orphans(self) -> Iterator[tuple[int, Run]]:
        """The instances that are active, or hang, after the instant of completion."""
        automaton = self.automaton
        first = self._played({})
        if automaton.complete in first.triggered:  # every run completes as it begins
            for number, node in enumerate(automaton.runners):
                if node.index in first.triggered:
                    yield number, ()
            return
        halves = self._halves(self.solver)
        complete = automaton.complete
        completing = (negation(halves.before.triggered(complete)), halves.now.triggered(complete))
        terms = [
            conjunction((*completing, halves.now.triggered(node.index), negation(halves.over[n])))
            for n, node in enumerate(automaton.runners)
        ]
        shown = 0
        for number, (term, orphaned) in enumerate(
            zip(terms, self.solver.decide(terms), strict=True)
        ):
            if orphaned:
                shown += 1
                yield number, self._outliving(number, halves, term) if shown <= self.most else ()

    # -- overlaps -----------------------------------------------------------------------------

    def overlaps(self, shared: Mapping[str, int]) -> Iterator[Overlap]:
        """The instances that are active at once, with these resources; ``shared``: as bits.

        That is at an instant before which the run has not ended.
        """
        automaton = self.automaton
        pairs = [
            (first, second, resource)
            for resource, held in shared.items()
            for first, second in combinations(bits(held), 2)
        ]
        begun = self._played({}).triggered
        if automaton.complete in begun or automaton.give_up in begun:
            for first, second, resource in sorted(pairs):
                nodes = map(automaton.runner_node, (first, second))
                if all(node in begun for node in nodes):
                    yield Overlap(first, second, resource, (), ())
            return
        halves = self._halves(self.solver)
        ends = (automaton.complete, automaton.give_up)
        terms = [
            conjunction(
                (
                    *(negation(halves.before.triggered(end)) for end in ends),
                    *(halves.now.triggered(automaton.runner_node(n)) for n in pair[:2]),
                    *(negation(halves.over[n]) for n in pair[:2]),
                )
            )
            for pair in pairs
        ]
        met = [
            (*pair, term)
            for pair, term, meet in zip(pairs, terms, self.solver.decide(terms), strict=True)
            if meet
        ]
        for place, (first, second, resource, term) in enumerate(sorted(met)):
            run, outcomes = self._reaching(halves, term) if place < self.most else ((), ())
            yield Overlap(first, second, resource, run, self._onwards(run, outcomes))

    def _onwards(self, run: Run, outcomes: Sequence[Outcome]) -> Run:
        """The steps of a scenario behind those of a run, up to its end."""
        at = self.instants.first().configuration
        pending, onwards = list(reversed(run)), list[tuple[int, int]]()
        while outcomes and (pending or (at.ended == GOING and at.active)):
            if pending:
                number, outcome = pending.pop()
            else:
                number = next(bits(at.active))
                outcome = _STEPS[outcomes[number]]
                onwards.append((number, outcome))
            if outcome == HANG:
                at = self.instants.hanging(at, number)
            else:
                at = self.instants.after(at, number, outcome).configuration
        return tuple(onwards)

    def _halves(self, solver: Solver) -> _Halves:
        """The run before the instant of completion, and the run up to it."""
        encoding, automaton = solver.encoding, solver.automaton
        numbers = range(len(automaton.runners))

        def variant(succeeds: str, fails: str) -> Variant:
            changed: dict[Signal, str] = {}
            for number in numbers:
                node = automaton.runner_node(number)
                changed[Signal(node, Event.SUCCEEDED)] = f"{succeeds}{number}"
                changed[Signal(node, Event.FAILED)] = f"{fails}{number}"
            return encoding.variant(changed)

        before, now = variant("a", "b"), variant("c", "d")
        solver.tell([*before.definitions, *now.definitions])
        later: list[str] = []
        for number in numbers:
            triggered = before.triggered(automaton.runner_node(number))
            for name, earlier, emits in (
                ("c", "a", encoding.succeeds(number)),
                ("d", "b", encoding.emits_failed(number)),
            ):
                comes, came = f"{name}{number}", f"{earlier}{number}"
                solver.tell([f"(=> {comes} (and {triggered} {emits}))", f"(=> {came} {comes})"])
                later.append(f"(and {comes} (not {came}))")
        if len(later) > 1:
            solver.tell([f"((_ at-most 1) {' '.join(later)})"])
        return _Halves(before, now, {n: disjunction((f"c{n}", f"d{n}")) for n in numbers})

    def _outliving(self, number: int, halves: _Halves, term: str) -> Run:
        """A run up to its completion, at which an instance is active."""
        outcomes = plainest(self.solver, number)
        if outcomes is not None:
            others = {other: each for other, each in enumerate(outcomes) if other != number}
            run = self._until_completed(self._steps(others), number)
            if run is not None:
                return run
        return self._reaching(halves, term)[0]

    def _reaching(self, halves: _Halves, term: str) -> tuple[Run, Sequence[Outcome]]:
        """A run up to an instant that a term is about, and its scenario; nothing at a limit."""
        solver = self.solver
        try:
            possible = solver.must_check([solver.name(term)])
        except InconclusiveError:
            return (), ()
        assert possible, "what was decided to be possible has a scenario"
        outcomes = solver.outcomes()
        over = [n for n in halves.over if solver.holding((f"c{n}", f"d{n}"))]
        last = [n for n in over if not solver.holding((f"a{n}", f"b{n}"))]
        early = {n: outcomes[n] for n in over if n not in last}
        return (*self._steps(early), *((n, _STEPS[outcomes[n]]) for n in last)), outcomes

    def _until_completed(self, run: Run, number: int) -> Run | None:
        """The run up to its completion, if it completes and the instance is active then."""
        at = self.instants.first().configuration
        for place, (other, outcome) in enumerate(run):
            if outcome == HANG:
                at = self.instants.hanging(at, other)
            else:
                at = self.instants.after(at, other, outcome).configuration
            if at.ended == COMPLETED:
                return run[: place + 1] if at.active >> number & 1 else None
        return None

    # -- runs -------------------------------------------------------------------------------

    def _maximal(self, term: str) -> Run:
        """The maximal run of a scenario for a term."""
        outcomes = self._scenario(lambda _: term)
        return () if outcomes is None else self._sequence(outcomes, None)

    def _scenario(self, term: Callable[[Solver], str]) -> Scenario | None:
        """A scenario for what is possible, the canonical one if few run; None at a limit."""
        try:
            if len(self.automaton.runners) <= _CANONICAL:
                solver = self._solver(self.budget.scenarios)
                outcomes = canonical_scenario(solver, term(solver))
                assert outcomes is not None, "what was decided to be possible has a scenario"
                return outcomes
            solver = self.showing
            possible = solver.must_check([solver.name(term(solver))])
        except InconclusiveError:
            return None
        assert possible, "what was decided to be possible has a scenario"
        return solver.outcomes()

    @cached_property
    def showing(self) -> Solver:
        """The problem for scenarios of large machines."""
        return self._solver(self.budget.scenarios)

    def _sequence(self, outcomes: Sequence[Outcome], claim: Claim | None) -> Run:
        """The outcomes that matter to a claim, of those that come; without one, all of them."""
        kept: Iterable[int] = range(len(outcomes))
        if claim is not None and claim.ends is End.GAVE_UP:
            reason = explain(claim, self.evaluator, outcomes.__getitem__, no_start=False)
            kept = reason.decisions
        return self._steps({number: outcomes[number] for number in kept})

    def _steps(self, outcomes: Mapping[int, Outcome]) -> Run:
        """These outcomes as steps, as far as the instances are triggered."""
        run = self._played(outcomes)
        steps: list[tuple[int, int]] = []
        for node in run.triggered:
            if self.automaton.nodes[node].kind is NodeKind.RUNNER:
                number = self.automaton.runner_number(node)
                if number in outcomes:
                    steps.append((number, _STEPS[outcomes[number]]))
        return tuple(steps)

    def _played(self, outcomes: Mapping[int, Outcome]) -> PlayedRun:
        """The events that come while all other outcomes are held back; instances do start."""
        numbers = range(len(self.automaton.runners))
        withheld = [number for number in numbers if number not in outcomes]
        return self.evaluator.run(
            lambda number: outcomes.get(number, Outcome.SUCCEEDED), withheld=withheld
        )
