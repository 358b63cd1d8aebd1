"""States with named outcomes, and the rules by which concurrences of them end."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any, Final

from gpsfsm.model.plan import Location
from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from gpsfsm.compile.machines import Place

MOST_COMBINATIONS: Final = 64
RAISED: Final = ""
"""The outcome of a container that ends by an exception."""
NOTHING: Final = "\0"  # which no file can contain
"""The outcome of an ``exclusive`` concurrence without a default, if no rule holds."""
UNNAMED: Final = "*"
"""All outcomes of which no rule of a concurrence speaks."""
Rules = list[tuple[str, Mapping[str, str]]]
"""Outcomes of a concurrence, and for which outcomes of its states."""


@dataclass(slots=True)
class State:
    """A state, or a container with ``states`` in it.

    ``transitions`` name a state beside it, or an outcome of the container around it, by outcome.
    ``kind`` is what the file calls it; ``parallel`` containers are concurrences, whose ``rules``
    say (outcome, outcomes by state) in their order, and ``default`` what else.

    ``open``: how the file leaves open which further outcomes a state has. In a container that goes
    ``by_name``, an outcome without a transition leads to the state of that name. ``exclusive``: a
    concurrence raises where several of its outcomes hold, or where a rule asks for the outcome of a
    state that has ended with NOTHING.
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
    rules: Rules = field(default_factory=list)
    rules_before: Rules | None = None  # of other versions
    default: str = ""
    undeclared: tuple[str, ...] = ()  # outcomes that only its class can tell
    marks: tuple[Approximation, ...] = ()  # of the leaf itself
    open: Cause | None = None
    by_name: bool = False
    exclusive: bool = False

    def over(self, cause: Cause) -> Approximation:
        """The report that it is over-approximated."""
        location = Location(self.place.line, self.place.column, clip(f"/machine/{self.name}", 200))
        return Approximation(Reading.OVER, clip(self.name, 60), location, cause)


def combinations(state: State) -> list[tuple[str, ...]]:
    """The combinations of outcomes, in the order of the states; none if they are too many.

    Outcomes of which no rule speaks count as one.
    """
    named: list[list[str]] = []
    size = 1
    for each in state.states:
        spoken = [items[each.name] for _, items in state.rules if each.name in items]
        declared = list(dict.fromkeys((*each.outcomes, *each.transitions, *each.undeclared)))
        rows = list(dict.fromkeys(spoken))
        if each.open or not declared or any(outcome not in rows for outcome in declared):
            rows.append(UNNAMED)
        if may_raise(each):
            rows += (RAISED, *ends_with_nothing(each))
        named.append(rows)
        size *= len(rows)
    return list(product(*named)) if 0 < size <= MOST_COMBINATIONS else []


def results(state: State, combination: tuple[str, ...]) -> list[str]:
    """The outcomes of a concurrence at a combination, in all versions of the engine."""
    if RAISED in combination:
        return [RAISED]
    here = {each.name: outcome for each, outcome in zip(state.states, combination, strict=True)}
    ends: dict[str, None] = {}
    for rules in (state.rules, *(() if state.rules_before is None else (state.rules_before,))):
        held = [outcome for outcome, items in rules if items.items() <= here.items()]
        several = state.exclusive and len({*held}) > 1
        ends[RAISED if several else (*held, state.default or NOTHING)[0]] = None
    for _, items in state.rules:  # a rule is given up at the first item that differs, in any order
        differing = {here[name] for name, wanted in items.items() if here[name] != wanted}
        if NOTHING in differing:
            ends = {**(ends if len(differing) > 1 else {}), RAISED: None}
    return list(ends)


def may_raise(state: State) -> bool:
    """True for what ends by an exception if rules of a concurrence in it are not clear."""
    return state.exclusive or any(map(may_raise, state.states))


def ends_with_nothing(state: State) -> list[str]:
    """NOTHING, if a concurrence can end so."""
    return [NOTHING] if state.exclusive and not state.default else []


def said(outcomes: Iterable[str]) -> str:
    """Outcomes, as the name of a node says them."""
    words = {RAISED: "an exception", NOTHING: "no outcome"}
    return ", ".join(words.get(each, each) for each in outcomes)


def needed(rules: Rules) -> Rules:
    """The rules without those that hold only where an earlier one does.

    >>> [outcome for outcome, _ in needed([("a", {"X": "ok"}), ("b", {"X": "ok", "Y": "ok"})])]
    ['a']
    """
    kept: Rules = []
    for outcome, items in rules:
        if not any(earlier.items() <= items.items() for _, earlier in kept):
            kept.append((outcome, items))
    return kept


def in_conflict(rules: Rules) -> bool:
    """True if two rules with different outcomes can begin to hold by one end of one state."""
    return any(
        outcome != other
        and items.items() & those.items()
        and all(those.get(name, wanted) == wanted for name, wanted in items.items())
        for number, (outcome, items) in enumerate(rules)
        for other, those in rules[:number]
    )
