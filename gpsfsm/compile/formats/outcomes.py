"""Machines of states with named outcomes (SMACH, FlexBE, YASMIN) → a graph of networkx.

A state is a runner. Names of outcomes tell how it ends: those that speak of failure are FAILED, all
others SUCCEEDED. Where several outcomes of one kind lead to different states, choices tell them
apart. Entering a container enters its first state, and what its states lead to outside is looked up
in its own transitions; so containers leave no node behind.

    NAV {arrived: SAY, blocked: ASK, lost: failed}      nodes: NAV, "NAV: blocked" (a choice)
    NAV SUCCEEDED → SAY;  NAV FAILED → the choice;  it SUCCEEDED → ASK, FAILED → give_up

The states of a *concurrence* are entered together. For each combination of their outcomes there is
a join that waits for it; the first rule of the outcome map that holds in a combination says how the
concurrence ends. Where there are more than ``MOST_COMBINATIONS``, a choice takes their place. With
``early``, a rule ends the concurrence as soon as it holds, and stops the others.

A state whose class is not in the file may have outcomes that the file does not name (``open``):
those of its container, or in a concurrence one of which no rule speaks. They enter inexact nodes.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

from gpsfsm.compile.formats.elements import problem
from gpsfsm.compile.formats.states import (
    NOTHING,
    RAISED,
    UNNAMED,
    State,
    combinations,
    ends_with_nothing,
    in_conflict,
    may_raise,
    needed,
    results,
    said,
)
from gpsfsm.compile.machines import Place, ReadMachine, machine_of, mark
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.plan import Location
from gpsfsm.model.precision import Cause
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import networkx as nx

    from gpsfsm.model.finding import Problem
    from gpsfsm.model.precision import Approximation

MOST_STATES: Final = 5_000
_DEEPEST: Final = 100
_FAILURE = re.compile(
    r"fail|abort|preempt|cancel|error|timeout|time_out|invalid|lost|reject|denied|"
    r"unreachable|collision|gave_up|give_up|\bno\b|^false$|^not_|_not_|exception|stuck|died|emergency|fatal",
    re.I,
)
_DONE: Final = Event.SUCCEEDED
Signal = tuple[str, Event]
"""An event of a node of the graph."""


def is_failure(outcome: str) -> bool:
    """True for the name of an outcome that speaks of failure.

    >>> [is_failure(each) for each in ("succeeded", "aborted", "not_found", "outcome1")]
    [False, True, True, False]
    """
    return _FAILURE.search(outcome) is not None


def machine_from(
    top: State, file: str, approximations: Iterable[Approximation] = ()
) -> ReadMachine:
    """The machine of an outermost container, or what is wrong with it.

    ``approximations``: what a reader says of constructs that are no states.
    """
    writer = _Writer(top)
    if writer.problems:
        return None, tuple(writer.problems)
    return machine_of(writer.graph, file=file, places=writer.places, approximations=approximations)


class _Scope:
    """A container in its place: its states by name, and the scope around it."""

    def __init__(self, state: State, outer: _Scope | None, path: str) -> None:
        self.state, self.outer, self.path = state, outer, path
        self.inner: dict[str, _Scope] = {}
        self.states = {each.name: each for each in state.states}
        self.joins: list[str] = []  # to be reset when the container is entered
        self.ends: dict[str, list[tuple[str, Signal]]] = {}  # of a concurrence: by state
        self.firsts: list[str] = []  # of a concurrence with conflicts: joins that choose a rule
        self.added: list[str] = []  # choices and ticks of its states and of its own end
        self.undeclared = ""  # the node at which a state has ended as no transition says


class _Writer:
    def __init__(self, top: State) -> None:
        import networkx

        self.graph: nx.MultiDiGraph[Any] = networkx.MultiDiGraph()
        self.places: dict[Any, Place] = {}
        self.problems: list[Problem] = []
        self.top = _Scope(top, None, "")
        self.scopes = [self.top]
        self._check()
        if self.problems:
            return
        self._node("begin", top.place, kind="start")
        self._node("complete", top.place, kind="complete")
        self._node("give_up", top.place, kind="give_up")
        for scope in self.scopes:
            for state in scope.state.states:
                if not state.container:
                    self._leaf(scope, state)
        for scope in self.scopes:
            if scope.state.parallel:
                self._join_all(scope)
        self._enter(("begin", Event.SUCCEEDED), self.top)
        for scope in self.scopes:
            for state in scope.state.states:
                if not state.container:
                    self._outcomes(scope, state)
        for scope in reversed(self.scopes):
            if scope.state.parallel:
                self._concurrence(scope)

    def _fault(self, state: State, message: str, hint: str) -> None:
        place = state.place
        location = Location(place.line, place.column, clip(f"/machine/{state.name}", 200))
        self.problems.append(problem(message, location, hint))

    # -- what is wrong ----------------------------------------------------------------------

    def _check(self) -> None:
        count = 0
        for scope in self.scopes:  # it grows
            state = scope.state
            if scope.path.count("/") > _DEEPEST or count > MOST_STATES:
                self._fault(state, "the machine is too large", "check its parts by themselves")
                return
            self._check_container(scope)
            for each in state.states:
                count += 1
                path = f"{scope.path}/{each.name}" if scope.path else each.name
                self._check_transitions(scope, each)
                if each.container:
                    scope.inner[each.name] = inner = _Scope(each, scope, path)
                    self.scopes.append(inner)

    def _check_container(self, scope: _Scope) -> None:
        state = scope.state
        if len(scope.states) < len(state.states):
            names = [each.name for each in state.states]
            twice = next(each for each in reversed(state.states) if names.count(each.name) > 1)
            self._fault(twice, f"there are two states {twice.name!r} here", "rename one of them")
        if not state.states:
            self._fault(state, f"there is no state in {state.name!r}", "add the first state")
        elif not state.parallel and not state.initial:
            state.initial = state.states[0].name
        elif not state.parallel and state.initial not in scope.states:
            message = f"{state.name!r} begins with {state.initial!r}, which is none of its states"
            self._fault(state, message, "name one of its states as the first one")
        for outcome, items in state.rules:
            for name in items:
                if name not in scope.states:
                    message = f"the outcome map of {state.name!r} names {name!r}, which it lacks"
                    self._fault(state, message, "name one of its states")
            self._check_outcome(state, outcome, "the outcome map leads to")
        raises = ends_with_nothing(state)
        if state.parallel and not state.open_end and not state.early and not raises:
            self._check_outcome(state, state.default, "by default it ends with")

    def _check_outcome(self, state: State, outcome: str, what: str) -> None:
        if outcome not in state.outcomes:
            message = f"{what} {outcome!r}, which is not an outcome of {state.name!r}"
            self._fault(state, message, "declare the outcome")

    def _check_transitions(self, scope: _Scope, state: State) -> None:
        around = scope.state
        if around.parallel:
            return
        for outcome in state.outcomes:
            named = outcome in around.outcomes or (around.by_name and outcome in scope.states)
            if outcome not in state.transitions and named:
                state.transitions[outcome] = outcome  # as SMACH connects it
            elif outcome not in state.transitions:
                message = f"no transition takes the outcome {outcome!r} of {state.name!r}"
                self._fault(state, message, "add the transition, or remove the outcome")
        for outcome, written in state.transitions.items():
            target = state.transitions[outcome] = written or outcome
            if target not in scope.states and target not in around.outcomes:
                message = (
                    f"the outcome {outcome!r} of {state.name!r} leads to {target!r}, which is no "
                    "state here and no outcome of what is around it"
                )
                self._fault(state, message, "correct the name, or add the state")
        if not (state.transitions or state.outcomes or state.container or state.open):
            message = f"nothing follows {state.name!r}"
            self._fault(state, message, "add its transitions")

    # -- nodes ------------------------------------------------------------------------------

    def _node(self, name: str, place: Place, **data: Any) -> str:
        unique, number = clip(name, 180), 2
        while unique in self.graph:
            unique, number = f"{clip(name, 180)}#{number}", number + 1
        self.graph.add_node(unique, **data)
        self.places[unique] = place
        return unique

    def _leaf(self, scope: _Scope, state: State) -> None:
        path = f"{scope.path}/{state.name}" if scope.path else state.name
        own = {key: each for key, each in state.parameters.items() if not key.startswith("@")}
        state.parameters["@node"] = node = self._node(
            path, state.place, kind="runner", interface=state.kind, parameters=own
        )

        mark(self.graph, node, *state.marks)
        around: _Scope | None = scope
        while around is not None and around.state.kind != "PriorityContainer":
            around = around.outer
        while around is not None and not around.state.parallel:
            around = around.outer
        if around is not None:  # the others beside the container do not wait
            self._mark(node, state, Cause.PRIORITY)

    def _choice(
        self, scope: _Scope | None, of: str, place: Place, signals: list[Signal]
    ) -> tuple[Signal, Signal]:
        name = self._node(
            of, place, kind="runner", interface=CHOICE, parameters={"of": clip(of, 200)}
        )
        if scope is not None:
            scope.added.append(name)
        self._connect(signals, name)
        return (name, Event.SUCCEEDED), (name, Event.FAILED)

    def _connect(self, signals: list[Signal], target: str, action: str = "trigger") -> None:
        for source, event in signals:
            self.graph.add_edge(source, target, event=event.value, action=action)

    # -- entering and leaving ---------------------------------------------------------------

    def _enter(self, signal: Signal, scope: _Scope, state: State | None = None) -> None:
        """An event enters a state of a container, or the container itself."""
        pending: list[tuple[_Scope, State | None]] = [(scope, state)]
        while pending:
            around, each = pending.pop()
            if each is not None and not each.container:
                self._connect([signal], each.parameters["@node"])
                continue
            inside = around if each is None else around.inner[each.name]
            for join in (*inside.joins, *inside.firsts):
                self._connect([signal], join, "stop")
            if inside.state.parallel:
                pending += ((inside, child) for child in reversed(inside.state.states))
            else:
                pending.append((inside, inside.states[inside.state.initial]))

    def _leave(self, signal: Signal, scope: _Scope, state: State, outcome: str) -> None:
        """A state ends with an outcome: what it leads to, up through the containers around it."""
        if scope.state.parallel:
            scope.ends.setdefault(state.name, []).append((outcome, signal))
        else:
            self._lead(signal, scope, state.transitions[outcome])

    def _lead(self, signal: Signal, scope: _Scope, target: str) -> None:
        """To a state of a container, or out of it by one of its outcomes."""
        if target in scope.states:
            self._enter(signal, scope, scope.states[target])
        elif scope.outer is None:
            self._connect([signal], "give_up" if is_failure(target) else "complete")
        else:
            self._leave(signal, scope.outer, scope.state, target)

    def _raise(self, signal: Signal, scope: _Scope) -> None:
        """A container ends by an exception: so does all around it, once concurrences have ended."""
        while scope.outer is not None:
            if scope.outer.state.parallel:
                scope.outer.ends.setdefault(scope.state.name, []).append((RAISED, signal))
                return
            scope = scope.outer
        self._connect([signal], "give_up")

    def _outcomes(self, scope: _Scope, state: State) -> None:
        """The outcomes of a state: by its two events, and choices where these are not enough."""
        node = state.parameters["@node"]
        besides = [each for each in state.undeclared if each not in state.outcomes]
        every = list(dict.fromkeys((*state.transitions, *state.outcomes)))
        outcomes = [each for each in every if each not in besides]
        if not outcomes:  # nobody knows any
            outcomes, besides = every, []
            if state.undeclared:
                self._mark(node, state, Cause.UNDECLARED)
            if not outcomes and not self._has_more(scope, state):
                outcomes = ["done"]
        failures = [each for each in outcomes if is_failure(each)]
        others = [each for each in outcomes if each not in failures]
        if not failures or not others:
            kept = outcomes
            others, failures = (kept[:1], kept[1:]) if len(kept) > 1 else (kept, kept)
        for event, names in ((Event.SUCCEEDED, others), (Event.FAILED, failures)):
            signal = (node, event)
            for each in besides:
                targets = [state.transitions.get(name, name) for name in names]
                if is_failure(each) is (event is Event.FAILED) and (
                    state.transitions.get(each, each) not in targets
                ):
                    signal = self._besides(signal, scope, state, each)
            self._among(signal, scope, state, names)

    def _besides(self, signal: Signal, scope: _Scope, state: State, outcome: str) -> Signal:
        """An outcome that the state may have or not: its way is marked, not what else it does."""
        of = f"{state.parameters['@node']}: {outcome}"
        taken, other = self._choice(scope, of, state.place, [signal])
        tick = self._node(f"{of} perhaps", state.place, kind="runner", interface=TICK)
        scope.added.append(tick)
        self._connect([taken], tick)
        self._mark(tick, state, Cause.UNDECLARED)
        self._leave((tick, _DONE), scope, state, outcome)
        return other

    def _mark(self, node: str, state: State, cause: Cause) -> None:
        mark(self.graph, node, state.over(cause))

    def _among(self, signal: Signal, scope: _Scope, state: State, outcomes: list[str]) -> None:
        """One of several outcomes; those that lead to the same place need no choice."""
        groups: dict[str, list[str]] = {}
        for outcome in outcomes:
            key = outcome if scope.state.parallel else state.transitions[outcome]
            groups.setdefault(key, []).append(outcome)
        rows = list(groups.values())
        more = self._has_more(scope, state)
        path = state.parameters["@node"]
        for number, names in enumerate(rows):
            if number == len(rows) - 1 and not more:
                self._leave(signal, scope, state, names[0])
                return
            of = f"{path}: {' or '.join(names)}"
            taken, signal = self._choice(scope, of, state.place, [signal])
            self._leave(taken, scope, state, names[0])
        self._undeclared(signal, scope, state)

    def _has_more(self, scope: _Scope, state: State) -> bool:
        """True if a state may end as the file does not say, and that leads anywhere else."""
        if scope.state.parallel:
            return bool(state.open) and any(state.name in items for _, items in scope.state.rules)
        declared = {*state.transitions, *state.transitions.values()}
        return bool(state.open) and not declared.issuperset(self._implicit(scope))

    def _implicit(self, scope: _Scope) -> tuple[str, ...]:
        """The states and outcomes that an outcome without a transition can lead to."""
        around = scope.state
        return (*around.outcomes, *(scope.states if around.by_name else ()))

    def _undeclared(self, signal: Signal, scope: _Scope, state: State) -> None:
        """An outcome that is not in the file; what it leads to is one choice for all states."""
        if scope.state.parallel:
            name = f"{state.parameters['@node']}: another outcome"
            node = self._node(name, state.place, kind="runner", interface=TICK)
            scope.added.append(node)
            self._leave((node, _DONE), scope, state, UNNAMED)
        else:
            node = scope.undeclared = scope.undeclared or self._any_of(scope, state)
        self._connect([signal], node)
        self._mark(node, state, state.open or Cause.UNDECLARED)

    def _any_of(self, scope: _Scope, state: State) -> str:
        """Choices among all that an outcome without a transition can lead to; the first of them."""
        first, signals = "", list[Signal]()
        for target in dict.fromkeys(self._implicit(scope)):
            of = f"{scope.path or scope.state.name}: undeclared '{target}'"
            taken, other = self._choice(scope, of, scope.state.place, signals)
            self._mark(taken[0], state, state.open or Cause.UNDECLARED)
            self._lead(taken, scope, target)
            first, signals = first or taken[0], [other]
        self._lead(other, scope, target)
        return first

    # -- concurrences -----------------------------------------------------------------------

    def _join_all(self, scope: _Scope) -> None:
        """The joins of a concurrence, which are reset when it is entered."""
        state, names = scope.state, scope.path or scope.state.name
        if state.open_end or not combinations(state):
            scope.joins.append(
                self._node(f"{names}: all", state.place, kind="join", need=len(state.states))
            )
            return
        if state.early:
            state.rules = needed(state.rules)
            for number, (outcome, items) in enumerate(state.rules):
                name = f"{names}: {outcome} ({number + 1})"
                need = max(1, len(items))
                scope.joins.append(self._node(name, state.place, kind="join", need=need))
            for number in range(len(state.rules) if in_conflict(state.rules) else 0):
                name = f"{names}: first is ({number + 1})"
                scope.firsts.append(self._node(name, state.place, kind="join", need=2))
            return
        for combination in combinations(state):
            name = f"{names}: {said(combination)}"
            need = len(state.states)
            scope.joins.append(self._node(name, state.place, kind="join", need=need))

    def _concurrence(self, scope: _Scope) -> None:
        state = scope.state
        rows = combinations(state)
        if state.open_end or not rows:
            self._undecided(scope)
        elif state.early:
            self._early(scope)
        else:
            spoken = [{*column} - {UNNAMED} for column in zip(*rows, strict=True)]
            for join, combination in zip(scope.joins, rows, strict=True):
                inputs = [
                    [
                        signal
                        for name, signal in scope.ends.get(each.name, [])
                        if name == outcome or (outcome == UNNAMED and name not in names)
                    ]
                    for each, outcome, names in zip(state.states, combination, spoken, strict=True)
                ]
                if all(inputs):  # else this never happens, and nothing follows it
                    for signals in inputs:
                        self._connect(signals, join)
                    self._ended(scope, join, combination)

    def _ended(self, scope: _Scope, join: str, combination: tuple[str, ...]) -> None:
        """A concurrence ends with the outcome of a combination, as any version of its engine."""
        signal = (join, _DONE)
        result, *others = results(scope.state, combination)
        for other in others:
            of = f"{scope.path or scope.state.name}: {said((*combination, other))}"
            tick = self._tick(scope, f"{of} or not", [signal])
            taken, signal = self._choice(scope.outer, of, scope.state.place, [(tick, _DONE)])
            self._mark(taken[0], scope.state, Cause.VERSION)
            self._end(scope, scope.outer, taken, other)
        self._end(scope, scope.outer, signal, result)

    def _early(self, scope: _Scope) -> None:
        """Each rule has a join, and ends the concurrence as soon as it holds.

        Several may begin to hold at one instant; the first in the list counts. So each has a second
        join, for "it holds" and "a moment has passed". One that fires resets those of later rules:
        they forget that theirs holds.
        """
        inside = list(self._runners(scope))
        path, ends = scope.path or scope.state.name, list(scope.joins)
        for join, (_, items) in zip(scope.joins, scope.state.rules, strict=True):
            for name, wanted in items.items():
                self._connect(
                    [signal for each, signal in scope.ends.get(name, []) if each == wanted], join
                )
            for node in inside:
                self._connect([(join, _DONE)], node, "stop")
        if scope.firsts:
            signals = [(join, _DONE) for join in scope.joins]
            moment = self._tick(scope, f"{path}: a condition holds", signals)
            ends = scope.firsts
            for number, (join, first) in enumerate(zip(scope.joins, ends, strict=True)):
                self._connect([(join, _DONE), (moment, _DONE)], first)
                for later in ends[number + 1 :]:
                    self._connect([(first, _DONE)], later, "stop")
        by_outcome: dict[str, list[Signal]] = {}
        for end, (outcome, _) in zip(ends, scope.state.rules, strict=True):
            by_outcome.setdefault(outcome, []).append((end, _DONE))
        for outcome, signals in by_outcome.items():
            tick = self._tick(scope, f"{path}: {outcome}", signals)
            self._end(scope, scope.outer, (tick, _DONE), outcome)

    def _undecided(self, scope: _Scope) -> None:
        """Any outcome, once all have ended; or earlier, if a function of the file says so.

        Only one of the two may lead on: so the last end passes a moment, which the earlier end
        stops, and which stops the question for an earlier end.
        """
        state, join = scope.state, scope.joins[0]
        ends = [signal for rows in scope.ends.values() for _, signal in rows]
        path = scope.path or state.name
        self._connect(ends, join)
        last = (self._tick(scope, f"{path}: all have ended", [(join, _DONE)]), _DONE)
        signals: list[Signal] = [last]
        if state.open_end:
            inside = list(self._runners(scope))
            early, _ = self._choice(None, f"{path}: this ends all others", state.place, ends)
            self._mark(early[0], state, Cause.CODE)
            for node in (*inside, last[0]):
                self._connect([early], node, "stop")
            self._connect([last], early[0], "stop")
            self._outer(scope).append(early[0])
            signals.append(early)
        for join in scope.joins:
            self._connect(signals, join, "stop")
        outcomes = list(state.outcomes)
        cause = Cause.CODE if state.open_end else Cause.COMBINATIONS
        if may_raise(state):
            outcomes += (RAISED, *ends_with_nothing(state))
        for number, outcome in enumerate(outcomes):
            if number == len(outcomes) - 1:
                for signal in signals:
                    self._end(scope, scope.outer, signal, outcome)
                return
            of = f"{path}: {said([outcome])}"
            taken, other = self._choice(scope.outer, of, state.place, signals)
            self._mark(taken[0], state, cause)
            self._end(scope, scope.outer, taken, outcome)
            signals = [other]

    def _outer(self, scope: _Scope) -> list[str]:
        """The nodes of the end of a concurrence: they belong to what is around it."""
        return [] if scope.outer is None else scope.outer.added

    def _tick(self, scope: _Scope, name: str, signals: list[Signal]) -> str:
        """A moment that passes before what a join causes, else it could cause itself at once."""
        tick = self._node(name, scope.state.place, kind="runner", interface=TICK)
        self._outer(scope).append(tick)
        self._connect(signals, tick)
        return tick

    def _end(self, scope: _Scope, outer: _Scope | None, signal: Signal, outcome: str) -> None:
        path = scope.path or scope.state.name
        if self.graph.nodes[signal[0]]["kind"] == "join":  # else it could cause itself at once
            name = f"{path}: {said([outcome])}"
            signal = (self._tick(scope, name, [signal]), _DONE)
        for join in (*scope.joins, *scope.firsts):  # the others wait for nobody any more
            self._connect([signal], join, "stop")
        lost = outcome == NOTHING and not (outer and outer.state.parallel)
        if outcome == RAISED or lost:
            self._raise(signal, scope)
        elif outer is None:
            self._connect([signal], "give_up" if is_failure(outcome) else "complete")
        else:
            self._leave(signal, outer, scope.state, outcome)

    def _runners(self, scope: _Scope) -> Iterator[str]:
        """The nodes of all states in a container, and what was added for their outcomes."""
        pending = [scope]
        while pending:
            inside = pending.pop()
            yield from inside.added
            for each in inside.state.states:
                if each.container:
                    pending.append(inside.inner[each.name])
                else:
                    yield each.parameters["@node"]
