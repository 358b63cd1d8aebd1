"""Monitors: what the events of a run mean for a task.

A monitor follows one demand of a task, the steps or a rule, and tells where a run leaves it. It
knows nothing of how runs are found.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from gpsfsm.analysis.words import place
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.story import PLAN_TERMS
from gpsfsm.tasks.ltlf import ENDS, Atom, Tracker, negation
from gpsfsm.tasks.task import Acting

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.model.capability import Binding
    from gpsfsm.model.plan import Element
    from gpsfsm.model.story import Terms
    from gpsfsm.tasks.ltlf import Happening
    from gpsfsm.tasks.task import Pattern, Rule

MState = Hashable
"""The state of a monitor; None: nothing can go wrong any more."""


@dataclass(frozen=True, slots=True)
class Violation:
    """The place at which a run leaves the task.

    ``code`` is the rule of gpsfsm that says so, ``about`` tells violations of one code apart.
    ``message`` says what is wrong, ``closing`` ends the story of the run. ``runner`` is the number
    of the instance at which it shows, None: at the end of the run. ``hint``: what to do, where
    that of the rule does not fit.
    """

    code: str
    about: tuple[object, ...]
    message: str
    closing: str
    runner: int | None = None
    hint: str = ""

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for violations of one kind, of which the plainest is told."""
        return (self.code, *self.about)


class Monitor(Protocol):
    """Follows the runs of one plan."""

    @property
    def start(self) -> MState:
        """The state before the first event."""
        ...

    def after(self, state: MState, event: Event | Outcome, runner: int) -> MState | Violation:
        """The state after an event of the instance with this number, or what is wrong with it.

        NO_START: the instance was triggered and does not start; it will fail later.
        """
        ...

    def at_end(self, state: MState, end: End, *, hanging: bool) -> Violation | None:
        """The violation of this end. ``hanging``: an instance never ends, and so holds it up."""
        ...


class Branching(Protocol):
    """The same demand, but a state may have several states after an event, or none.

    A run leaves the task if some way through the states comes upon a violation; where there is
    none after an event, that way leads nowhere.
    """

    @property
    def start(self) -> MState:
        """The state before the first event."""
        ...

    def letter(self, event: Event | Outcome, runner: int) -> Hashable:
        """Equal for events that lead to the same in every state (NO_START: it will not start)."""
        ...

    def branches(
        self, state: MState, event: Event | Outcome, runner: int
    ) -> Iterator[MState | Violation]:
        """The states after an event."""
        ...

    def at_end(self, state: MState, end: End, *, hanging: bool) -> Violation | None:
        """The violation of this end on this branch."""
        ...


class Demand(Monitor, Protocol):
    """A monitor that can branch as well."""

    def branching(self) -> Branching:
        """The same demand in few states."""
        ...


class Matching:
    """The instances of a plan that a pattern means; asks each pattern once about each action.

    ``bindings``: what is known of the instances. One that is bound counts under the name that it
    has here as well, whatever dialect or semantic interface the plan writes, and with the values
    that it works with. ``terms``: the words for the plan in what is said about it.
    """

    def __init__(
        self,
        runners: Sequence[Element],
        bindings: Sequence[Binding | None] = (),
        terms: Terms = PLAN_TERMS,
    ) -> None:
        self.runners = runners
        self.terms = terms
        self._bindings = bindings or (None,) * len(runners)
        actions: dict[tuple[object, ...], int] = {}
        self._first: list[int] = []
        self._action = [
            actions.setdefault(_action(each, binding), len(actions))
            for each, binding in zip(runners, self._bindings, strict=True)
        ]
        for number, action in enumerate(self._action):
            if action == len(self._first):
                self._first.append(number)
        self._matches: dict[tuple[int, int], bool] = {}
        self._actings: dict[int, Acting] = {}

    def __call__(self, pattern: Pattern, number: int) -> bool:
        """True if the pattern means the instance with this number."""
        key = (id(pattern), self._action[number])
        matches = self._matches.get(key)
        if matches is None:
            matches = self._matches[key] = pattern.means(self._acting(key[1]))
        return matches

    def _acting(self, action: int) -> Acting:
        acting = self._actings.get(action)
        if acting is None:
            first = self._first[action]
            acting = Acting(self.runners[first], self._bindings[first])
            self._actings[action] = acting
        return acting

    def anywhere(self, pattern: Pattern) -> bool:
        """True if the pattern means any instance of the plan."""
        return any(self(pattern, number) for number in self._first)


def _action(runner: Element, binding: Binding | None) -> tuple[object, ...]:
    """Equal only for instances that the same patterns mean."""
    if binding is None:
        return runner.action
    texts = sorted((each.name, each.text) for each in runner.attributes)
    return (*texts, binding.interface.name, id(binding.provider))


_HAPPENINGS: dict[Event, Happening] = {
    Event.STARTED: "start",
    Event.SUCCEEDED: "succeeds",
    Event.FAILED: "fails",
}
_END_ATOMS = {
    end: frozenset({Atom(happening)})
    for end, happening in zip((End.COMPLETED, End.GAVE_UP, End.STUCK), ENDS, strict=True)
}


def end_words(end: End, terms: Terms) -> str:
    """A plan and the end of its run: ``the plan completes``."""
    verbs = {End.COMPLETED: "completes", End.GAVE_UP: terms.gives_up, End.STUCK: "is stuck"}
    return f"the {terms.whole} {verbs[end]}"


class RuleMonitor:
    """Follows a rule. Raises TooLargeError where its automaton is."""

    def __init__(self, rule: Rule, patterns: Sequence[Pattern], matching: Matching) -> None:
        self._rule = rule
        self._tracker = Tracker(rule.formula)
        self._matching = matching
        self._patterns = {pattern.name: pattern for pattern in patterns}
        self._letters: dict[tuple[Event, int], frozenset[Atom]] = {}

    @property
    def start(self) -> MState:
        """The rule as it is."""
        return self._tracker.start

    def branching(self) -> Branching:
        """The ways in which the opposite of the rule can come true."""
        return _Opposite(self._rule, self)

    def after(self, state: MState, event: Event | Outcome, runner: int) -> MState | Violation:
        """The rest of the rule, which speaks of events: a start that does not come is none."""
        assert isinstance(state, frozenset)
        if isinstance(event, Outcome):
            return state
        rest = self._tracker.after(state, self.letter(event, runner))
        if rest:
            return None if frozenset() in rest else rest
        closing = "this breaks the rule"
        if event is Event.STARTED:
            closing = f"{place(self._matching.runners[runner])} starts, which breaks the rule"
        return self.violation(closing, runner)

    def at_end(self, state: MState, end: End, *, hanging: bool) -> Violation | None:
        """The violation, if something of the rule is left."""
        del hanging
        assert isinstance(state, frozenset)
        if self._tracker.fulfilled(self._tracker.after(state, _END_ATOMS[end])):
            return None
        ends = end_words(end, self._matching.terms)
        return self.violation(f"{ends}, but the rule is not fulfilled", None)

    def violation(self, closing: str, runner: int | None) -> Violation:
        """The rule is broken."""
        rule = self._rule
        named = "" if rule.name == rule.phrase else f" '{rule.name}'"
        message = f"a run breaks a rule of the task{named}: {rule.phrase}"
        return Violation("GP608", (rule.line, rule.name), message, closing, runner)

    def letter(self, event: Event, runner: int) -> frozenset[Atom]:
        """The atoms that are true of an event."""
        key = (event, runner)
        atoms = self._letters.get(key)
        if atoms is None:
            happening = _HAPPENINGS[event]
            atoms = self._letters[key] = frozenset(
                atom
                for atom in self._tracker.atoms
                if atom.happening == happening and self._means(atom.name, runner)
            )
        return atoms

    def _means(self, name: str, runner: int) -> bool:
        return name == "*" or self._matching(self._patterns[name], runner)


class _Opposite:
    """The alternatives of the opposite of a rule, each followed by itself.

    One alternative has few ways to go on: that it holds from some event on is a choice made once.
    So there are mostly no circles in it, even where the automaton of the rule has some.
    """

    def __init__(self, rule: Rule, monitor: RuleMonitor) -> None:
        self._tracker = Tracker(negation(rule.formula))
        self._monitor = monitor

    @property
    def start(self) -> MState:
        (only,) = self._tracker.start
        return only

    def letter(self, event: Event | Outcome, runner: int) -> Hashable:
        return self._monitor.letter(event, runner) if isinstance(event, Event) else None

    def branches(
        self, state: MState, event: Event | Outcome, runner: int
    ) -> Iterator[MState | Violation]:
        assert isinstance(state, frozenset)
        if not isinstance(event, Event):
            yield state
            return
        after = self._tracker.after(frozenset({state}), self._monitor.letter(event, runner))
        for alternative in sorted(after, key=sorted):
            yield alternative or self._monitor.violation("this breaks the rule", runner)

    def at_end(self, state: MState, end: End, *, hanging: bool) -> Violation | None:
        del hanging
        assert isinstance(state, frozenset)
        tracker = self._tracker
        if not tracker.fulfilled(tracker.after(frozenset({state}), _END_ATOMS[end])):
            return None
        return self._monitor.violation("the rule is not fulfilled", None)
