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
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any, Final

from gpsfsm.compile.formats.elements import problem
from gpsfsm.compile.machines import Place, ReadMachine, machine_of, mark
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.plan import Location
from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import networkx as nx

    from gpsfsm.model.finding import Problem

MOST_COMBINATIONS: Final = 64
MOST_STATES: Final = 5_000
_DEEPEST: Final = 100
_FAILURE = re.compile(
    r"fail|abort|preempt|cancel|error|timeout|time_out|invalid|lost|reject|denied|"
    r"unreachable|collision|gave_up|give_up|\bno\b|^false$|^not_|_not_|exception|stuck|died|emergency|fatal",
    re.I,
)
_DONE: Final = Event.SUCCEEDED
_RAISED: Final = ""
"""The outcome of a container that ends by an exception."""
_UNNAMED: Final = "*"
"""All outcomes of which no rule of a concurrence speaks."""
Signal = tuple[str, Event]
"""An event of a node of the graph."""


def is_failure(outcome: str) -> bool:
    """True for the name of an outcome that speaks of failure.

    >>> [is_failure(each) for each in ("succeeded", "aborted", "not_found", "outcome1")]
    [False, True, True, False]
    """
    return _FAILURE.search(outcome) is not None


@dataclass(slots=True)
class State:
    """A state, or a container with ``states`` in it.

    ``transitions`` name a state beside it, or an outcome of the container around it, by outcome.
    ``kind`` is what the file calls it; ``parallel`` containers are concurrences, whose ``rules``
    say (outcome, outcomes by state) in their order, and ``default`` what else.

    ``open``: how the file leaves open which further outcomes a state has. In a container that goes
    ``by_name``, an outcome without a transition leads to the state of that name. ``exclusive``: a
    concurrence raises where several of its outcomes hold, or none and there is no default.
    """

    name: str
    place: Place
    kind: str = "State"
    transitions: dict[str, str] = field(default_factory=dict)
    outcomes: tuple[str, ...] = ()
    parameters: dict[str, Any] = field(default_factory=dict)
    states: list[State] = field(default_factory=list)
    initial: str = ""
    container: bool = False
    parallel: bool = False
    early: bool = False
    open_end: bool = False  # a function in the file decides how it ends, and nobody knows how
    rules: list[tuple[str, Mapping[str, str]]] = field(default_factory=list)
    default: str = ""
    open: Cause | None = None
    by_name: bool = False
    exclusive: bool = False

    def over(self, cause: Cause) -> Approximation:
        """The report that it is over-approximated."""
        location = Location(self.place.line, self.place.column, clip(f"/machine/{self.name}", 200))
        return Approximation(Reading.OVER, clip(self.name, 60), location, cause)


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
        raises = state.exclusive and state.default == _RAISED
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
        state.parameters["@node"] = self._node(
            path, state.place, kind="runner", interface=state.kind, parameters=own
        )

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
                scope.outer.ends.setdefault(scope.state.name, []).append((_RAISED, signal))
                return
            scope = scope.outer
        self._connect([signal], "give_up")

    def _outcomes(self, scope: _Scope, state: State) -> None:
        """The outcomes of a state: by its two events, and choices where these are not enough."""
        node = state.parameters["@node"]
        outcomes = list(dict.fromkeys((*state.transitions, *state.outcomes)))
        if not outcomes and not self._has_more(scope, state):
            outcomes = ["done"]
        failures = [each for each in outcomes if is_failure(each)]
        others = [each for each in outcomes if each not in failures]
        if not failures or not others:
            kept = outcomes
            others, failures = (kept[:1], kept[1:]) if len(kept) > 1 else (kept, kept)
        for event, names in ((Event.SUCCEEDED, others), (Event.FAILED, failures)):
            self._among((node, event), scope, state, names)

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
        assert state.open is not None
        over = state.over(state.open)
        if scope.state.parallel:
            name = f"{state.parameters['@node']}: another outcome"
            node = self._node(name, state.place, kind="runner", interface=TICK)
            scope.added.append(node)
            self._leave((node, _DONE), scope, state, _UNNAMED)
        else:
            node = scope.undeclared = scope.undeclared or self._any_of(scope, over)
        self._connect([signal], node)
        mark(self.graph, node, over)

    def _any_of(self, scope: _Scope, over: Approximation) -> str:
        """Choices among all that an outcome without a transition can lead to; the first of them."""
        first, signals = "", list[Signal]()
        for target in dict.fromkeys(self._implicit(scope)):
            of = f"{scope.path or scope.state.name}: undeclared '{target}'"
            taken, other = self._choice(scope, of, scope.state.place, signals)
            mark(self.graph, taken[0], over)
            self._lead(taken, scope, target)
            first, signals = first or taken[0], [other]
        self._lead(other, scope, target)
        return first

    # -- concurrences -----------------------------------------------------------------------

    def _join_all(self, scope: _Scope) -> None:
        """The joins of a concurrence, which are reset when it is entered."""
        state, names = scope.state, scope.path or scope.state.name
        if state.open_end or not self._combinations(scope):
            scope.joins.append(
                self._node(f"{names}: all", state.place, kind="join", need=len(state.states))
            )
            return
        if state.early:
            state.rules = _needed(state.rules)
            for number, (outcome, items) in enumerate(state.rules):
                name = f"{names}: {outcome} ({number + 1})"
                need = max(1, len(items))
                scope.joins.append(self._node(name, state.place, kind="join", need=need))
            for number in range(len(state.rules) if _in_conflict(state.rules) else 0):
                name = f"{names}: first is ({number + 1})"
                scope.firsts.append(self._node(name, state.place, kind="join", need=2))
            return
        for combination in self._combinations(scope):
            name = f"{names}: {', '.join(combination)}"
            need = len(state.states)
            scope.joins.append(self._node(name, state.place, kind="join", need=need))

    def _combinations(self, scope: _Scope) -> list[tuple[str, ...]]:
        """The combinations of outcomes, in the order of the states; none if they are too many.

        Outcomes of which no rule speaks count as one.
        """
        state = scope.state
        named: list[list[str]] = []
        size = 1
        for each in state.states:
            spoken = [items[each.name] for _, items in state.rules if each.name in items]
            declared = list(dict.fromkeys((*each.outcomes, *each.transitions)))
            rows = list(dict.fromkeys(spoken))
            if each.open or not declared or any(outcome not in rows for outcome in declared):
                rows.append(_UNNAMED)
            if _may_raise(each):
                rows.append(_RAISED)
            named.append(rows)
            size *= len(rows)
        return list(product(*named)) if 0 < size <= MOST_COMBINATIONS else []

    def _concurrence(self, scope: _Scope) -> None:
        state, outer = scope.state, scope.outer
        combinations = self._combinations(scope)
        if state.open_end or not combinations:
            self._undecided(scope)
        elif state.early:
            self._early(scope)
        else:
            spoken = [{*rows} - {_UNNAMED} for rows in zip(*combinations, strict=True)]
            for join, combination in zip(scope.joins, combinations, strict=True):
                inputs = [
                    [
                        signal
                        for name, signal in scope.ends.get(each.name, [])
                        if name == outcome or (outcome == _UNNAMED and name not in names)
                    ]
                    for each, outcome, names in zip(state.states, combination, spoken, strict=True)
                ]
                if all(inputs):  # else this never happens, and nothing follows it
                    for signals in inputs:
                        self._connect(signals, join)
                    result = self._result(scope, combination)
                    self._end(scope, outer, (join, Event.SUCCEEDED), result)

    def _result(self, scope: _Scope, combination: tuple[str, ...]) -> str:
        state = scope.state
        here = {each.name: outcome for each, outcome in zip(state.states, combination, strict=True)}
        held = [
            outcome
            for outcome, items in state.rules
            if all(here[name] == wanted for name, wanted in items.items())
        ]
        if _RAISED in combination or (state.exclusive and len({*held}) > 1):
            return _RAISED
        return held[0] if held else state.default

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
            mark(self.graph, early[0], state.over(Cause.CODE))
            for node in (*inside, last[0]):
                self._connect([early], node, "stop")
            self._connect([last], early[0], "stop")
            self._outer(scope).append(early[0])
            signals.append(early)
        for join in scope.joins:
            self._connect(signals, join, "stop")
        outcomes = list(state.outcomes)
        cause = Cause.CODE if state.open_end else Cause.COMBINATIONS
        if _may_raise(state):
            outcomes.append(_RAISED)
        for number, outcome in enumerate(outcomes):
            if number == len(outcomes) - 1:
                for signal in signals:
                    self._end(scope, scope.outer, signal, outcome)
                return
            of = f"{path}: {outcome}"
            taken, other = self._choice(scope.outer, of, state.place, signals)
            mark(self.graph, taken[0], state.over(cause))
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
            name = f"{path}: {outcome or 'an exception'}"
            signal = (self._tick(scope, name, [signal]), _DONE)
        for join in (*scope.joins, *scope.firsts):  # the others wait for nobody any more
            self._connect([signal], join, "stop")
        if outcome == _RAISED:
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


def _may_raise(state: State) -> bool:
    """True for what ends by an exception if rules of a concurrence in it are not clear."""
    return state.exclusive or any(map(_may_raise, state.states))


Rules = list[tuple[str, Mapping[str, str]]]


def _needed(rules: Rules) -> Rules:
    """The rules without those that hold only where an earlier one does.

    >>> [outcome for outcome, _ in _needed([("a", {"X": "ok"}), ("b", {"X": "ok", "Y": "ok"})])]
    ['a']
    """
    kept: Rules = []
    for outcome, items in rules:
        if not any(earlier.items() <= items.items() for _, earlier in kept):
            kept.append((outcome, items))
    return kept


def _in_conflict(rules: Rules) -> bool:
    """True if two rules with different outcomes can begin to hold by one end of one state."""
    return any(
        outcome != other
        and items.items() & those.items()
        and all(those.get(name, wanted) == wanted for name, wanted in items.items())
        for number, (outcome, items) in enumerate(rules)
        for other, those in rules[:number]
    )
