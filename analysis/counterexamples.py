"""Counterexamples from z3, and the decisions in a scenario that matter.

The canonical one has the fewest failures, and of these the first in document order (semantics,
section 5). To ask z3 whether something would have gone otherwise takes a second copy of the run in
the problem, for every runner. Mostly one scenario is proof enough, and the evaluator plays both
runs. Where none of the ``candidates`` convinces, the copy is asked for after all.

``explain`` goes on from a full scenario. The idea is that of Lohmann and Fahland ("Where did I go
wrong?", BPM 2014): report the decisions that lead to the problem, not the path. Here they are what
remains of the run when it is followed backwards from the claim: an event needs its runner's outcome
and trigger, a join the inputs that made it fire, and a node that never comes the inputs that it
would have needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import disjunction, negation
from gpsfsm.analysis.evaluate import Reasons, code_of, signal_of
from gpsfsm.errors import InternalError
from gpsfsm.late import dataclass
from gpsfsm.model.automaton import Automaton, NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Iterator, Sequence

    from gpsfsm.analysis.claims import Claim
    from gpsfsm.analysis.evaluate import Evaluator, OutcomeOf, Run
    from gpsfsm.analysis.solver import Solver

Scenario = tuple[Outcome, ...]
"""All outcomes, by runner number."""


def necessary(automaton: Automaton, node: int) -> dict[int, Outcome]:
    """Outcomes, by runner number, without which the node is never triggered.

    Not all of them: joins of which one input is enough are not looked behind. FAILED stands for
    NO_START too.
    """
    outcomes: dict[int, Outcome] = {}
    seen = {node}
    pending = [node]
    while pending:
        current = pending.pop()
        inputs = automaton.inputs[current]
        if (automaton.nodes[current].need or 1) < len(inputs):
            continue
        for source, event in inputs:
            if automaton.nodes[source].kind is NodeKind.RUNNER and event is not Event.STARTED:
                outcomes[automaton.runner_number(source)] = Outcome(event.value)
            if source not in seen:
                seen.add(source)
                pending.append(source)
    return outcomes


def plainest(solver: Solver, number: int, *others: tuple[int, Outcome]) -> Scenario | None:
    """The scenario in which nothing fails but what must, so that the instance is triggered.

    ``others`` are outcomes that are wanted besides. None if the constraints do not admit it.
    """
    wanted = necessary(solver.automaton, solver.automaton.runner_node(number)) | dict(others)
    size = len(solver.automaton.runners)
    plain = tuple(wanted.get(other, Outcome.SUCCEEDED) for other in range(size))
    return plain if solver.constraints.admit(plain) else None


def candidates(
    solver: Solver, claim: Claim, number: int, earlier: Iterable[Scenario]
) -> Iterator[Scenario]:
    """Scenarios in which the claim about a failure of this instance may hold.

    First the one in which nothing fails but what must, then ``earlier`` ones with this failure,
    then one that z3 finds for the claim, less the failures that do not matter; none if there is
    none. Raises InconclusiveError at a limit.
    """
    plain = plainest(solver, number, (number, Outcome.FAILED))
    if plain is not None:
        yield plain
    for scenario in earlier:
        changed = (*scenario[:number], Outcome.FAILED, *scenario[number + 1 :])
        if solver.constraints.admit(changed):
            yield changed
    if not solver.must_check([solver.name(claim.term(solver))]):
        return
    outcomes = solver.outcomes()
    reason = explain(
        claim, solver.evaluator, outcomes.__getitem__, no_start=solver.constraints.no_start
    )
    decisive = set(reason.decisions)
    plain = tuple(
        outcome if other in decisive else Outcome.SUCCEEDED
        for other, outcome in enumerate(outcomes)
    )
    if solver.constraints.admit(plain):
        yield plain
    yield outcomes


def fewest(solver: Solver, goal: str, terms: Sequence[str], count: Callable[[], int]) -> int | None:
    """The smallest number of ``terms`` that hold together with the indicator ``goal``.

    ``count`` counts them in the solver's last model. None if ``goal`` cannot hold. Raises
    InconclusiveError at a limit.
    """
    if not solver.must_check([goal]):
        return None
    low, high, step = 0, count(), 1
    while low < high:
        middle = min(low + step, high) - 1
        if solver.must_check([goal, _at_most(solver, middle, terms)]):
            high, step = min(middle, count()), 1
        else:
            low, step = middle + 1, step * 2
    return high


def _at_most(solver: Solver, number: int, terms: Sequence[str]) -> str:
    return solver.name(f"((_ at-most {number}) {' '.join(terms)})" if terms else "true")


def canonical_scenario(solver: Solver, term: str) -> tuple[Outcome, ...] | None:
    """The canonical scenario in which ``term`` holds, or None if there is none.

    Among all with the fewest outcomes other than SUCCEEDED the one whose failing instances come
    first in document order, and among those FAILED before NO_START before HANG. Raises
    InconclusiveError at a limit.
    """
    size = len(solver.automaton.runners)
    goal = solver.name(term)
    others = [negation(solver.encoding.succeeds(number)) for number in range(size)]
    number = fewest(solver, goal, others, lambda: len(_failing(solver.outcomes())))
    if number is None:
        return None
    fixed = [goal, _at_most(solver, number, others)]
    solver.must_check(fixed)
    outcomes = solver.outcomes()
    settled = -1
    for place in range(number):
        candidate = _failing(outcomes)[place]
        while candidate > settled + 1:
            earlier = solver.name(disjunction(others[settled + 1 : candidate]))
            if not solver.must_check([*fixed, earlier]):
                break
            outcomes = solver.outcomes()
            candidate = _failing(outcomes)[place]
        fixed.append(solver.name(others[candidate]))
        settled = candidate
    return _canonical_kinds(solver, fixed, outcomes)


def _canonical_kinds(
    solver: Solver, fixed: list[str], outcomes: tuple[Outcome, ...]
) -> tuple[Outcome, ...]:
    """Choose the first kind of failure that is possible, instance by instance."""
    kinds = [kind for kind in Outcome if kind in solver.encoding.possible]
    kinds.remove(Outcome.SUCCEEDED)
    for number in _failing(outcomes):
        for kind in kinds:
            name = solver.name(solver.encoding.outcome(number, (kind,)))
            if outcomes[number] is kind:
                fixed.append(name)
                break
            if solver.must_check([*fixed, name]):
                outcomes = solver.outcomes()
                fixed.append(name)
                break
    return outcomes


def _failing(outcomes: tuple[Outcome, ...]) -> list[int]:
    return [number for number, outcome in enumerate(outcomes) if outcome is not Outcome.SUCCEEDED]


@dataclass(frozen=True, slots=True)
class Explanation:
    """``decisions``: runner numbers whose outcome matters; ``trace``: needed events in order.

    The first ``story_length`` events of the trace make the story; what follows only brings the run
    to its end.
    """

    decisions: tuple[int, ...]
    trace: tuple[Signal, ...]
    story_length: int
    ends: End
    steps: int  # the events of the whole run: what it cost to find out
    happening: Container[int]  # their codes


def explain(
    claim: Claim, evaluator: Evaluator, outcome_of: OutcomeOf, *, no_start: bool
) -> Explanation:
    """The decisions and events that the claim rests on; ``no_start``: runners may not start.

    Raises InternalError if the scenario lacks an event of the claim.
    """
    run = claim.run(evaluator, outcome_of)
    if not all(map(run.happens, claim.happens)):
        raise InternalError("a scenario does not replay as it was claimed")
    search = _Search(evaluator, run, outcome_of, no_start)
    search.end()
    automaton = evaluator.automaton
    for signal in claim.happens:
        search.event(code_of(signal))
    for node in claim.absent:
        search.absence(node)
    if claim.outlives is not None:
        node = automaton.runner_node(claim.outlives)
        search.active(node)
    if claim.breaks is not None:
        search.breaking(claim.breaks)
    if run.ends is End.ABORT:
        deadly = run.broken.intersection(automaton.deadly)
        if claim.breaks not in deadly:
            search.breaking(min(deadly))
    search.finish()
    decisions, trace = search.decisions, search.in_order
    if claim.through is not None:  # how long anything takes may matter for what is claimed
        decisions |= _all_triggered(evaluator, run).difference(claim.withheld)
    story_length = len(trace)
    if claim.meet:
        meeting = _meeting(claim, evaluator, outcome_of, no_start)
        decisions |= meeting.decisions
        first = meeting.in_order
        trace = [*first, *(code for code in trace if code not in meeting.trace)]
        story_length = len(first if claim.held is None else trace)
    return Explanation(
        decisions=tuple(sorted(decisions)),
        trace=tuple(map(signal_of, trace)),
        story_length=story_length,
        ends=run.ends,
        steps=len(run),
        happening=run.order,
    )


def _all_triggered(evaluator: Evaluator, run: Run) -> set[int]:
    """The numbers of all runners that a run triggers."""
    automaton = evaluator.automaton
    return {
        automaton.runner_number(node)
        for node in run.triggered
        if automaton.nodes[node].kind is NodeKind.RUNNER
    }


def _meeting(claim: Claim, evaluator: Evaluator, outcome_of: OutcomeOf, no_start: bool) -> _Search:
    """The search for what makes the runners of ``claim.meet`` active at once."""
    held = evaluator.run(outcome_of, withheld=claim.held_back)
    search = _Search(evaluator, held, outcome_of, no_start)
    for number in claim.meet:
        node = evaluator.automaton.runner_node(number)
        if node not in held.triggered:
            raise InternalError("a scenario does not replay as it was claimed")
        search.active(node)
    search.finish()
    return search


class _Search:
    """The search from a claim back to the start; events are their codes, as the evaluator's."""

    def __init__(
        self, evaluator: Evaluator, run: Run, outcome_of: OutcomeOf, no_start: bool
    ) -> None:
        self.evaluator = evaluator
        self.automaton = evaluator.automaton
        self.run = run
        self.outcome_of = outcome_of
        self.no_start = no_start
        self.decisions: set[int] = set()
        self.trace: set[int] = set()
        self._seen: set[int] = set()  # twice the node, and one more if it is why it comes
        self._pending: list[int] = []

    def end(self) -> None:
        """Ask why the run ends as it does, if that needs no breaking join.

        Many claims are about the same run, so it keeps the answer. No other question may be open.
        """
        if self.run.ends is End.ABORT:
            return
        reasons = self.run.reasons
        if reasons is None:
            if self.run.ends is End.COMPLETED:
                self.node(self.automaton.complete)
            elif self.run.ends is End.GAVE_UP:
                self.node(self.automaton.give_up)
            else:
                self.absence(self.automaton.complete)
                self.absence(self.automaton.give_up)
            self.finish()
            sets = (self.decisions, self.trace, self._seen)
            self.run.reasons = Reasons(*map(frozenset, sets))
        else:
            self.decisions, self.trace, self._seen = map(set, reasons)

    @property
    def in_order(self) -> list[int]:
        """The trace in the order of the run."""
        return sorted(self.trace, key=self.run.order.__getitem__)

    def node(self, node: int) -> None:
        """Ask why the node is triggered."""
        self._push(2 * node + 1)

    def absence(self, node: int) -> None:
        """Ask why the node is never triggered."""
        self._push(2 * node)

    def breaking(self, join: int) -> None:
        """Ask why a second input comes at the join."""
        order = self.run.order
        came = sorted(
            (code for code in self.evaluator.sources[join] if code in order), key=order.__getitem__
        )
        loops = join in self.automaton.traits.looping  # then it is its own second input
        for code in came[: 1 if loops and self.automaton.nodes[join].need == 1 else 2]:
            self.event(code)

    def _push(self, question: int) -> None:
        if question not in self._seen:
            self._seen.add(question)
            self._pending.append(question)

    def finish(self) -> None:
        """Follow everything backwards to the start."""
        while self._pending:
            node, present = divmod(self._pending.pop(), 2)
            if present:
                self._follow(node)
            else:
                self._follow_absence(node)

    def _need(self, node: int) -> int:
        need = self.automaton.nodes[node].need or 1
        return min(need, 2) if node in self.automaton.traits.breaking else need

    def _follow(self, node: int) -> None:
        """Ask why the inputs came that made the node come: the first so many of the run."""
        order = self.run.order
        came = [code for code in self.evaluator.sources[node] if code in order]
        if len(came) > 1 and (need := self._need(node)) < len(came):
            came = sorted(came, key=order.__getitem__)[:need]
        for code in came:
            self.event(code)

    def _follow_absence(self, node: int) -> None:
        """Ask why so many inputs never come that the others are too few."""
        sources = self.evaluator.sources[node]
        enough = max(0, len(sources) - self._need(node) + 1)
        for code in sources if enough else ():
            if code not in self.run.order:
                self._missing(code)
                enough -= 1
                if not enough:
                    break

    def event(self, code: int) -> None:
        """Ask why the event happens."""
        node = code >> 2
        kind = self.automaton.nodes[node].kind
        if kind is NodeKind.START:
            return
        if kind is NodeKind.RUNNER:
            self.trace.add(code)
            if code & 3 or self.no_start:  # STARTED is 0
                self.decisions.add(self.automaton.runner_number(node))
            self.active(node)
            return
        self.node(node)

    def active(self, node: int) -> None:
        """Ask why the runner is triggered. Its STARTED, if it came, belongs to the trace."""
        started = node * 4
        if started in self.run.order:
            self.trace.add(started)
        self.node(node)

    def _missing(self, code: int) -> None:
        """Ask why the event never happens."""
        node = code >> 2
        if self.automaton.nodes[node].kind is not NodeKind.RUNNER:
            self.absence(node)
            return
        if node not in self.run.triggered:
            self.absence(node)  # so its outcome does not matter
            return
        number = self.automaton.runner_number(node)
        self.decisions.add(number)
        emitted = self.evaluator.emitted(number, self.outcome_of(number))
        codes = (node * 4 + event for event in emitted)
        self.trace.update(filter(self.run.order.__contains__, codes))
        self.active(node)
