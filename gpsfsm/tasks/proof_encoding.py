"""Departures from a task as one problem for z3, which has no solution if the task is kept.

The run of a scenario is told as all analyses tell it: one Boolean for each outcome, one for each
node, "it is triggered" (``analysis.encode``). Beside it go the states of the demands: ``m7_2`` is
"node 7 is not triggered; or when it was, the run had not left the task and the state was number 2".
What is said of them holds of every run:

- from an instance to what its events trigger: the state after its start and its outcome. Where
  several inputs can trigger a node, ``w7_1`` is "its second input did";
- a node that waits for all of its inputs has, besides, a state that can follow upon each of them.

Events beside an instance can change the state while it is active (``settled`` says which those
are, ``following`` what they do); then one of several states follows. The question is whether an
instance can be triggered without a state in which its events are right, or a run can end without
one in which it may. ``g0``: it ends so for demand 0 since something hangs.

As long as one instance is active at a time, no run is added by this. With others beside it there
may be runs in the problem that do not exist. So a solution says nothing, but that there is none
says all. States stand at a node only if they can be there, so the problem grows with the plan and
not with plan and task; and since the states after a node follow from those before whatever the
outcomes are, unit propagation refutes it, from the start on.

Example: ``A; B`` against "A, then B". In the beginning A is due (0); after A, B is (1).

    m0_0;  m0_0 => m1_0;  m1_0 => m2_1 (triggered by the success of A);  m2_1 => m3_2
    t1 and not m1_0,  or t2 and not m2_1,  or t3 and not m3_2, ...:  refuted by propagation
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import TRUE, Encoding, conjunction, disjunction, negation
from gpsfsm.model.automaton import PAPER, NodeKind, Signal
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.tasks.following import Follower, Settled, States, waits
from gpsfsm.tasks.ltlf import TooLargeError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.tasks.following import Letters
    from gpsfsm.tasks.monitor import Demand, MState

_EMITTED = {
    Outcome.SUCCEEDED: Event.SUCCEEDED,
    Outcome.FAILED: Event.FAILED,
    Outcome.NO_START: Event.FAILED,
}
_Courses = dict[Outcome, tuple[States, States]]
"""For each outcome the states after the start, and after what comes last."""


class Departures:
    """The problem of all demands together. Raises TooLargeError where there are too many states."""

    def __init__(
        self, automaton: Automaton, constraints: Constraints, demands: Sequence[Demand]
    ) -> None:
        if automaton.traits != PAPER or automaton.stops:
            raise TooLargeError
        self.automaton = automaton
        self.constraints = constraints
        self.encoding = Encoding(automaton, constraints)
        self.settled = Settled(automaton)
        self.selectors: dict[tuple[int, Signal], list[str]] = {}  # of nodes of several inputs
        self._demands = demands

    def problem(self) -> Iterator[str]:
        """The assertions."""
        encoding = self.encoding
        yield from encoding.scenarios()
        yield from encoding.definitions()
        for node, inputs in enumerate(self.automaton.inputs):
            if len(inputs) > 1:
                names = [f"w{node}_{place}" for place in range(len(inputs))]
                yield f"(=> t{node} {disjunction(names)})"
                for name, signal in zip(names, inputs, strict=True):
                    self.selectors.setdefault((node, signal), []).append(name)
                    yield f"(=> {name} {encoding.happens(signal)})"
        wrong = [self._stuck(negation(self.hanging))]
        first = 0
        for place, demand in enumerate(self._demands):
            along = _Along(self, Follower(demand, self.constraints), first, f"g{place}")
            yield from along.assertions()
            wrong += along.wrong
            first += along.states
        yield disjunction(wrong)

    @property
    def hanging(self) -> str:
        """Some instance hangs."""
        return disjunction(
            conjunction((self.triggers(number + 1), self.encoding.outcome(number, (Outcome.HANG,))))
            for number, allowed in enumerate(self.constraints.allowed)
            if Outcome.HANG in allowed
        )

    def triggers(self, node: int) -> str:
        """The node is triggered."""
        return TRUE if node == 0 else self.encoding.triggered(node)

    def _stuck(self, how: str) -> str:
        """The run goes on for ever, or it is stuck, in this case."""
        ends = (self.automaton.complete, self.automaton.give_up)
        return conjunction((how, *(negation(self.triggers(node)) for node in ends)))

    def stuck(self) -> str:
        """An instance hangs, and so does the run."""
        return self._stuck(self.hanging)


class _Along:
    """One demand along the automaton. ``wrong`` are terms: the task is left."""

    def __init__(self, problem: Departures, follower: Follower, first: int, hangs: str) -> None:
        self._problem = problem
        self._automaton = problem.automaton
        self._encoding = problem.encoding
        self._settled = problem.settled
        self._follower = follower
        self._hangs = hangs
        self._first = first
        self._numbers: dict[MState, int] = {}
        self._at: list[dict[MState, None]] = [{} for _ in self._automaton.nodes]
        self._loose: set[int] = set()
        self._limits: dict[int, dict[Signal, dict[MState, None] | None]] = {}
        self.wrong: list[str] = []

    @property
    def states(self) -> int:
        """The number of states that have been met."""
        return len(self._numbers)

    def assertions(self) -> Iterator[str]:
        """Assertions on the states that hold in every run."""
        start = self._follower.demand.start
        self._at[0][start] = None
        yield self._here(0, start)
        for node in self._automaton.order:
            kind = self._automaton.nodes[node].kind
            yield from self._come(node)
            if kind is NodeKind.RUNNER:
                yield from self._instance(node)
            elif kind in (NodeKind.START, NodeKind.JOIN):
                if waits(self._automaton, node):
                    yield from self._meet(node)
                for state in self._at[node]:
                    states = States((state,))
                    yield from self._lead(Signal(node, Event.SUCCEEDED), state, TRUE, states)
        self._end(End.COMPLETED, self._automaton.complete)
        self._end(End.GAVE_UP, self._automaton.give_up)
        if self._problem.constraints.hang:
            yield f"(=> {self._hangs} {self._problem.stuck()})"
            self.wrong.append(self._hangs)

    def _here(self, node: int, state: MState) -> str:
        number = self._numbers.setdefault(state, len(self._numbers))
        return f"m{node}_{self._first + number}"

    def _must(self, node: int, those: Iterable[MState], how: str = TRUE) -> None:
        """The node must not be triggered in this case without one of these states."""
        missing = negation(disjunction(self._here(node, state) for state in those))
        self.wrong.append(conjunction((self._problem.triggers(node), how, missing)))

    # -- instances ------------------------------------------------------------------------------

    def _instance(self, node: int) -> Iterator[str]:
        allowed = self._problem.constraints.allowed[node - 1]
        beside = self._beside(node, node)
        courses = {state: self._courses(node, state, beside) for state in self._at[node]}
        right: dict[tuple[MState, ...], list[Outcome]] = {}
        for outcome in sorted(allowed):
            those = tuple(state for state in courses if courses[state][outcome][1].right)
            right.setdefault(those, []).append(outcome)
        for those, outcomes in right.items():
            self._must(node, those, self._is(node, outcomes))
        if Outcome.HANG in allowed:
            yield from self._hanging(node, courses)
        for event in Event:
            signal = Signal(node, event)
            for target in dict.fromkeys(self._automaton.outputs.get(signal, ())):
                letters = self._beside(node, target)
                if letters != beside:
                    courses = {state: self._courses(node, state, letters) for state in courses}
                    beside = letters
                for state, taken in courses.items():
                    for how, states in self._after(node, event, taken):
                        yield from self._lead(signal, state, how, states, target)

    def _is(self, node: int, outcomes: Sequence[Outcome]) -> str:
        if set(outcomes) == self._problem.constraints.allowed[node - 1]:
            return TRUE
        return self._encoding.outcome(node - 1, outcomes)

    def _beside(self, node: int, target: int) -> Letters:
        """The events that can come while an instance is active, if ``target`` is triggered."""
        return self._letters(self._settled.beside(node), target)

    def _letters(self, mask: int, target: int) -> Letters:
        if not mask:
            return ()
        return self._follower.letters(
            mask,
            failing=~self._settled.excluded(Event.FAILED, target),
            succeeding=~self._settled.excluded(Event.SUCCEEDED, target),
        )

    def _courses(self, node: int, state: MState, beside: Letters) -> _Courses:
        """The courses that an instance can take that is triggered in this state."""
        follower, number = self._follower, node - 1
        before = follower.closed(States((state,)), beside)
        courses: _Courses = {}
        for outcome in self._problem.constraints.allowed[number]:
            silent = outcome is Outcome.NO_START
            started = follower.own(before, outcome if silent else Event.STARTED, number)
            last = follower.closed(started, beside)
            if outcome is not Outcome.HANG:
                last = follower.own(last, _EMITTED[outcome], number)
            courses[outcome] = started, last
        return courses

    def _after(self, node: int, event: Event, courses: _Courses) -> Iterator[tuple[str, States]]:
        """The states after an event of an instance, each with the case in which it is so."""
        after: dict[States, list[Outcome]] = {}
        for outcome in sorted(courses):
            started, last = courses[outcome]
            if event is Event.STARTED and outcome is not Outcome.NO_START:
                after.setdefault(started, []).append(outcome)
            elif event is not Event.STARTED and _EMITTED.get(outcome) is event:
                after.setdefault(last, []).append(outcome)
        for states, outcomes in after.items():
            yield (self._is(node, outcomes) if len(after) > 1 else TRUE), states

    def _hanging(self, node: int, courses: dict[MState, _Courses]) -> Iterator[str]:
        """The run may end with this instance hanging in some states."""
        hangs = self._encoding.outcome(node - 1, (Outcome.HANG,))
        for state, taken in courses.items():
            last = taken[Outcome.HANG][1]
            if last.right and self._may_end(last, End.STUCK):
                terms = (self._hangs, self._problem.triggers(node), hangs, self._here(node, state))
                yield negation(conjunction(terms))

    # -- from node to node ----------------------------------------------------------------------

    def _lead(
        self, signal: Signal, state: MState, how: str, states: States, only: int | None = None
    ) -> Iterator[str]:
        """The states of the nodes to which an event leads, all of them or one."""
        targets = self._automaton.outputs.get(signal, ()) if only is None else (only,)
        before = conjunction((self._here(signal.node, state), how))
        for target in dict.fromkeys(targets):
            if states.right and states.whole:
                self._at[target] |= dict.fromkeys(states.those)
                first = self._first_input(signal, target)
                after = disjunction(self._here(target, each) for each in states.those)
                yield f"(=> {conjunction((first, before))} {after})"
            else:
                self._loose.add(target)
            if waits(self._automaton, target):
                yield from self._wait(signal, before, states, target)

    def _first_input(self, signal: Signal, target: int) -> str:
        """The node is triggered by this event, though others can do it as well."""
        if len(self._automaton.inputs[target]) == 1:
            return TRUE
        return disjunction(self._problem.selectors[target, signal])

    def _wait(self, signal: Signal, before: str, states: States, target: int) -> Iterator[str]:
        """The states that can be there once all other inputs have come as well."""
        letters = self._letters(self._settled.before(signal, target), target)
        later = self._follower.closed(states, letters)
        limits = self._limits.setdefault(target, {})
        if not (later.right and later.whole):
            limits[signal] = None
            return
        limit = limits.setdefault(signal, {})
        if limit is not None:
            limit |= dict.fromkeys(later.those)
        yield f"(=> {before} {disjunction(self._here(target, each) for each in later.those)})"

    def _come(self, node: int) -> Iterator[str]:
        """If all inputs lead to a state, one of these is there, whichever comes first."""
        inputs = dict.fromkeys(self._automaton.inputs[node])
        if node in self._loose or len(inputs) < 2:
            return
        before = [
            disjunction(self._here(source, state) for state in self._at[source])
            for source, _ in inputs
        ]
        after = disjunction(self._here(node, state) for state in self._at[node])
        yield f"(=> {conjunction(dict.fromkeys(before))} {after})"

    def _meet(self, node: int) -> Iterator[str]:
        """At most one state is there, and it is one that can follow upon each input."""
        limits = self._limits.get(node, {}).values()
        named = dict(self._at[node])
        for limit in limits:
            named |= limit or {}
        if len(named) > 1:
            one = f"((_ at-most 1) {' '.join(self._here(node, each) for each in named)})"
            yield f"(=> {self._problem.triggers(node)} {one})"
        self._at[node] = {
            state: None
            for state in self._at[node]
            if all(limit is None or state in limit for limit in limits)
        }

    def _end(self, end: End, node: int) -> None:
        """The run must not end so in another state; what is triggered at that instant begins."""
        letters = self._letters_of_starts(node)
        right = [
            state
            for state in self._at[node]
            if self._may_end(self._follower.closed(States((state,)), letters), end)
        ]
        self._must(node, right)

    def _letters_of_starts(self, node: int) -> Letters:
        mask = self._settled.open_at(node)
        return self._follower.letters(mask) if mask else ()

    def _may_end(self, states: States, end: End) -> bool:
        demand, stuck = self._follower.demand, end is End.STUCK
        return states.whole and all(
            state is None or demand.at_end(state, end, hanging=stuck) is None
            for state in states.those
        )
