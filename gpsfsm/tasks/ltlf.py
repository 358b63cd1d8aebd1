"""LTLf: linear temporal logic over finite traces (De Giacomo and Vardi, IJCAI 2013).

A formula is kept in negation normal form. What remains to be fulfilled is followed event by event:
a state is a set of alternatives, each a set of formulas that the rest of the trace must fulfil
(a disjunctive normal form, in which an alternative that asks for more than another is left out).
There are finitely many, so this is the deterministic automaton of the formula, made as far as it is
needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

__all__ = [
    "ENDS",
    "OUTCOMES",
    "Atom",
    "Both",
    "Constant",
    "Either",
    "Formula",
    "Known",
    "Next",
    "Release",
    "State",
    "TooLarge",
    "Tracker",
    "Until",
    "atoms_of",
    "negation",
]

Happening = Literal["start", "succeeds", "fails", "completes", "gives_up", "stuck"]
OUTCOMES: tuple[Happening, ...] = ("start", "succeeds", "fails")
"""What is said of an action."""
ENDS: tuple[Happening, ...] = ("completes", "gives_up", "stuck")
"""How a run ends: the last event of its trace."""

_MOST = 2_000
"""Alternatives of a state, and states of a formula, beyond which it is not followed."""


class TooLarge(Exception):  # noqa: N818  (not an error: an answer of its own)
    """The automaton of the formula is too large to be followed."""


@dataclass(frozen=True, slots=True)
class Constant:
    """True or false, whatever comes; also of a trace without events."""

    value: bool


@dataclass(frozen=True, slots=True)
class Known:
    """Whether the trace has a first event."""

    some: bool


@dataclass(frozen=True, slots=True)
class Atom:
    """The first event is this happening of an action that the name stands for; "*": of any.

    ``holds`` False is the opposite, of a trace that has a first event.
    """

    happening: Happening
    name: str = ""
    holds: bool = True


@dataclass(frozen=True, slots=True)
class Both:
    """Both hold."""

    left: Formula
    right: Formula


@dataclass(frozen=True, slots=True)
class Either:
    """At least one holds."""

    left: Formula
    right: Formula


@dataclass(frozen=True, slots=True)
class Next:
    """The part holds after the first event; ``weak``: or nothing comes after it."""

    part: Formula
    weak: bool


@dataclass(frozen=True, slots=True)
class Until:
    """``right`` holds at some time, and ``left`` until then."""

    left: Formula
    right: Formula


@dataclass(frozen=True, slots=True)
class Release:
    """``right`` holds up to and including the time at which ``left`` does, or to the end."""

    left: Formula
    right: Formula


Formula = Constant | Known | Atom | Both | Either | Next | Until | Release


def negation(formula: Formula) -> Formula:
    """The opposite, in negation normal form; depth is that of the formula."""
    match formula:
        case Constant(value):
            return Constant(not value)
        case Known(some):
            return Known(not some)
        case Atom(happening, name, holds):
            return Atom(happening, name, not holds)
        case Both(left, right):
            return Either(negation(left), negation(right))
        case Either(left, right):
            return Both(negation(left), negation(right))
        case Next(part, weak):
            return Next(negation(part), not weak)
        case Until(left, right):
            return Release(negation(left), negation(right))
        case Release(left, right):
            return Until(negation(left), negation(right))


def atoms_of(formula: Formula) -> set[Atom]:
    """The atoms that occur, as such or negated."""
    match formula:
        case Atom(happening, name, _):
            return {Atom(happening, name)}
        case Constant() | Known():
            return set()
        case Next(part, _):
            return atoms_of(part)
        case Both(left, right) | Either(left, right) | Until(left, right) | Release(left, right):
            return atoms_of(left) | atoms_of(right)


State = frozenset[frozenset[int]]
"""Alternatives, each the numbers of the formulas that the rest of the trace must fulfil."""

_TRUE: State = frozenset({frozenset()})
_FALSE: State = frozenset()

Holds = Callable[[Atom], bool]


class Tracker:
    """Follows one formula. Raises TooLarge where its automaton is."""

    def __init__(self, formula: Formula) -> None:
        self._numbers: dict[Formula, int] = {}
        self._formulas: list[Formula] = []
        self._memo: dict[tuple[State, frozenset[Atom]], State] = {}
        self.atoms = atoms_of(formula)
        self.start: State = frozenset({frozenset({self._number(formula)})})

    def after(self, state: State, true: frozenset[Atom]) -> State:
        """The state after an event of which these atoms, and no other ones, are true."""
        key = (state, true)
        found = self._memo.get(key)
        if found is None:
            if len(self._memo) >= _MOST:
                raise TooLarge
            found = _FALSE
            for alternative in state:
                found = _or(found, self._all_after(alternative, true))
            self._memo[key] = found
        return found

    def fulfilled(self, state: State) -> bool:
        """Whether nothing is left to do if the trace ends here."""
        return any(
            all(_empty(self._formulas[number]) for number in alternative) for alternative in state
        )

    def _number(self, formula: Formula) -> int:
        number = self._numbers.setdefault(formula, len(self._formulas))
        if number == len(self._formulas):
            self._formulas.append(formula)
        return number

    def _all_after(self, alternative: frozenset[int], true: frozenset[Atom]) -> State:
        found = _TRUE
        for number in sorted(alternative):
            found = _and(found, self._after(self._formulas[number], true))
            if not found:
                break
        return found

    def _after(self, formula: Formula, true: frozenset[Atom]) -> State:
        """What the rest must fulfil so that the formula holds of the event and the rest."""
        match formula:
            case Constant(value) | Known(value):
                return _TRUE if value else _FALSE
            case Atom(happening, name, holds):
                return _TRUE if (Atom(happening, name) in true) == holds else _FALSE
            case Both(left, right):
                return _and(self._after(left, true), self._after(right, true))
            case Either(left, right):
                return _or(self._after(left, true), self._after(right, true))
            case Next(part, weak):
                if weak:
                    return frozenset({self._owed(part), self._owed(Known(False))})
                return frozenset({self._owed(part) | self._owed(Known(True))})
            case Until(left, right):
                on = _and(self._after(left, true), frozenset({self._owed(formula)}))
                return _or(self._after(right, true), on)
            case Release(left, right):
                on = _or(self._after(left, true), frozenset({self._owed(formula)}))
                return _and(self._after(right, true), on)

    def _owed(self, formula: Formula) -> frozenset[int]:
        return frozenset({self._number(formula)})


def _or(one: State, other: State) -> State:
    return _least(one | other)


def _and(one: State, other: State) -> State:
    if len(one) * len(other) > _MOST:
        raise TooLarge
    return _least(frozenset(left | right for left in one for right in other))


def _least(alternatives: State) -> State:
    """Without the alternatives that ask for more than another one."""
    if len(alternatives) > _MOST:
        raise TooLarge
    kept: list[frozenset[int]] = []
    for alternative in sorted(alternatives, key=len):
        if not any(other <= alternative for other in kept):
            kept.append(alternative)
    return frozenset(kept)


def _empty(formula: Formula) -> bool:
    """Whether the formula holds of the trace without events."""
    match formula:
        case Constant(value):
            return value
        case Known(some):
            return not some
        case Atom() | Until():
            return False
        case Both(left, right):
            return _empty(left) and _empty(right)
        case Either(left, right):
            return _empty(left) or _empty(right)
        case Next(_, weak):
            return weak
        case Release():
            return True
