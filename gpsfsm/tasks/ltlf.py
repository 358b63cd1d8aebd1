"""LTLf: linear temporal logic over finite traces (De Giacomo and Vardi, IJCAI 2013).

A formula is kept in negation normal form. What remains to be fulfilled is followed event by event:
a state is a set of alternatives, each a set of formulas that the rest of the trace must fulfil
(a disjunctive normal form, in which an alternative that asks for more than another is left out).
There are finitely many, so this is the deterministic automaton of the formula, made as far as it is
needed. ``parse_formula`` reads formulas as task files write them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from gpsfsm.capabilities.defects import quoted

Happening = Literal["start", "succeeds", "fails", "completes", "gives_up", "stuck"]
OUTCOMES: tuple[Happening, ...] = ("start", "succeeds", "fails")
"""What is said of an action."""
ENDS: tuple[Happening, ...] = ("completes", "gives_up", "stuck")
"""How a run ends: the last event of its trace."""

_MOST = 2_000
"""Alternatives of a state, and states of a formula, beyond which it is not followed."""


class TooLargeError(Exception):
    """The automaton of the formula is too large to be followed."""


@dataclass(frozen=True, slots=True)
class Constant:
    """True or false, whatever comes; also of a trace without events."""

    value: bool


@dataclass(frozen=True, slots=True)
class HasFirst:
    """True of a trace that has a first event (``some``), or of one that has none."""

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


Formula = Constant | HasFirst | Atom | Both | Either | Next | Until | Release


def negation(formula: Formula) -> Formula:
    """The opposite, in negation normal form; depth is that of the formula."""
    match formula:
        case Constant(value):
            return Constant(not value)
        case HasFirst(some):
            return HasFirst(not some)
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
        case Constant() | HasFirst():
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
    """Follows one formula. Raises TooLargeError where its automaton is."""

    def __init__(self, formula: Formula) -> None:
        self._numbers: dict[Formula, int] = {}
        self._formulas: list[Formula] = []
        self._memo: dict[tuple[State, frozenset[Atom]], State] = {}
        self.atoms = atoms_of(formula)
        self.start: State = frozenset({frozenset({self._number(formula)})})

    def after(self, state: State, true: frozenset[Atom]) -> State:
        """The state after an event of which these atoms, and no other ones, are true."""
        key = (state, true)
        reached = self._memo.get(key)
        if reached is None:
            if len(self._memo) >= _MOST:
                raise TooLargeError
            reached = _FALSE
            for alternative in state:
                reached = _or(reached, self._all_after(alternative, true))
            self._memo[key] = reached
        return reached

    def fulfilled(self, state: State) -> bool:
        """True if nothing is left to do if the trace ends here."""
        return any(
            all(_empty(self._formulas[number]) for number in alternative) for alternative in state
        )

    def _number(self, formula: Formula) -> int:
        number = self._numbers.setdefault(formula, len(self._formulas))
        if number == len(self._formulas):
            self._formulas.append(formula)
        return number

    def _all_after(self, alternative: frozenset[int], true: frozenset[Atom]) -> State:
        reached = _TRUE
        for number in sorted(alternative):
            reached = _and(reached, self._after(self._formulas[number], true))
            if not reached:
                break
        return reached

    def _after(self, formula: Formula, true: frozenset[Atom]) -> State:
        """The demands on the rest so that the formula holds of the event and the rest."""
        match formula:
            case Constant(value) | HasFirst(value):
                return _TRUE if value else _FALSE
            case Atom(happening, name, holds):
                return _TRUE if (Atom(happening, name) in true) == holds else _FALSE
            case Both(left, right):
                return _and(self._after(left, true), self._after(right, true))
            case Either(left, right):
                return _or(self._after(left, true), self._after(right, true))
            case Next(part, weak):
                if weak:
                    return frozenset({self._owed(part), self._owed(HasFirst(False))})
                return frozenset({self._owed(part) | self._owed(HasFirst(True))})
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
        raise TooLargeError
    return _least(frozenset(left | right for left in one for right in other))


def _least(alternatives: State) -> State:
    """Without the alternatives that ask for more than another one."""
    if len(alternatives) > _MOST:
        raise TooLargeError
    kept: list[frozenset[int]] = []
    for alternative in sorted(alternatives, key=len):
        if not any(other <= alternative for other in kept):
            kept.append(alternative)
    return frozenset(kept)


def _empty(formula: Formula) -> bool:
    """True if the formula holds of the trace without events."""
    match formula:
        case Constant(value):
            return value
        case HasFirst(some):
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


_MAX_LENGTH = 4_000
_MAX_DEPTH = 100
_MAX_TOKENS = 1_000
_MAX_SIZE = 20_000
"""Parts of a formula: ``<->``, W and M write what stands beside them twice."""
_TOKEN = re.compile(
    r"\s*(?:(?P<sign><->|->|[()!&|])|(?P<quoted>\"[^\"]*\")|(?P<word>(?:(?!->)[^\s()!&|\"<>])+))"
)
_ALWAYS, _NEVER = Constant(True), Constant(False)
_TEMPORAL = ("U", "R", "W", "M")


class MistakeError(Exception):
    """A formula that does not parse; ``position`` is the place in the text, from 0."""

    def __init__(self, position: int, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.position, self.message, self.hint = position, message, hint


def parse_formula(text: str) -> Formula:
    """The formula that a text stands for; raises MistakeError.

    >>> parse_formula("F start(A)") == Until(_ALWAYS, Atom("start", "A"))
    True
    """
    if len(text) > _MAX_LENGTH:
        raise MistakeError(_MAX_LENGTH, f"the formula is longer than {_MAX_LENGTH} characters")
    parser = _Parser(_tokens(text), len(text))
    parsed = parser.equivalence(0)
    parser.finish()
    return parsed


def _tokens(text: str) -> list[tuple[str, int]]:
    tokens: list[tuple[str, int]] = []
    position = 0
    while text[position:].strip():
        match = _TOKEN.match(text, position)
        if match is None or match.lastgroup is None:
            start = position + len(text[position:]) - len(text[position:].lstrip())
            raise MistakeError(start, f"{quoted(text[start : start + 1])} is not allowed here")
        tokens.append((match[match.lastgroup], match.start(match.lastgroup)))
        if len(tokens) > _MAX_TOKENS:
            raise MistakeError(position, f"the formula has more than {_MAX_TOKENS} words and signs")
        position = match.end()
    return tokens


class _Parser:
    def __init__(self, tokens: list[tuple[str, int]], length: int) -> None:
        self._tokens = tokens
        self._length = length
        self._next = 0
        self._sizes: dict[int, tuple[Formula, int]] = {}  # by identity, which they keep alive

    def finish(self) -> None:
        """Nothing must be left."""
        if self._next < len(self._tokens):
            raise self._mistake(
                "the formula continues where it should end", "write & or | before it"
            )

    def equivalence(self, depth: int) -> Formula:
        """``a <-> b``."""
        left = self._implication(depth)
        while self._take("<->"):
            right = self._implication(depth)
            self._check(left, right)
            left = Both(Either(negation(left), right), Either(left, negation(right)))
        return left

    def _implication(self, depth: int) -> Formula:
        left = self._either(depth)
        if self._take("->"):
            return Either(negation(left), self._implication(self._deeper(depth)))
        return left

    def _either(self, depth: int) -> Formula:
        left = self._both(depth)
        while self._take("|"):
            left = Either(left, self._both(depth))
        return left

    def _both(self, depth: int) -> Formula:
        left = self._binary(depth)
        while self._take("&"):
            left = Both(left, self._binary(depth))
        return left

    def _binary(self, depth: int) -> Formula:
        left = self._unary(depth)
        operator = self._peek()
        if operator not in _TEMPORAL:
            return left
        self._next += 1
        right = self._binary(self._deeper(depth))
        self._check(left, right)
        if operator == "U":
            return Until(left, right)
        if operator == "R":
            return Release(left, right)
        if operator == "W":
            return Release(right, Either(left, right))
        return Until(right, Both(left, right))

    def _unary(self, depth: int) -> Formula:
        depth = self._deeper(depth)
        word = self._peek()
        if word == "(":
            self._next += 1
            inner = self.equivalence(depth)
            if not self._take(")"):
                raise self._mistake("a closing bracket is missing", "write )")
            return inner
        prefixes: dict[str, Callable[[Formula], Formula]] = {
            "!": negation,
            "X": lambda part: Next(part, weak=False),
            "WX": lambda part: Next(part, weak=True),
            "F": lambda part: Until(_ALWAYS, part),
            "G": lambda part: Release(_NEVER, part),
        }
        if word is not None and word in prefixes:
            self._next += 1
            return prefixes[word](self._unary(depth))
        return self._atom()

    def _atom(self) -> Formula:
        word = self._peek()
        if word in ("true", "false"):
            self._next += 1
            return Constant(word == "true")
        if word in ENDS:
            self._next += 1
            return Atom(word)
        if word not in OUTCOMES:
            what = (
                "something is missing at the end"
                if word is None
                else f"{quoted(word)} is not an event"
            )
            hint = "write start(NAME), succeeds(NAME), fails(NAME), completes, gives_up or stuck"
            raise self._mistake(what, hint)
        self._next += 1
        if not self._take("("):
            raise self._mistake(f"'{word}' needs a name", f"write {word}(NAME)")
        name = self._peek()
        if name is None or name in ("(", ")", "!", "&", "|", "->", "<->"):
            raise self._mistake(f"'{word}' needs a name", f"write {word}(NAME)")
        self._next += 1
        if not self._take(")"):
            hint = "write ) after the name; put a name with blanks in quotation marks"
            raise self._mistake("a closing bracket is missing", hint)
        return Atom(word, name.strip('"'))

    def _check(self, *parts: Formula) -> None:
        """Refuse parts that are too large to be written twice."""
        if sum(map(self._size, parts)) > _MAX_SIZE:
            raise self._mistake("the formula is too large: <->, W and M are nested in each other")

    def _size(self, formula: Formula) -> int:
        """The number of parts, where those that are shared count each time."""
        entry = self._sizes.get(id(formula))
        if entry is None:
            match formula:
                case Both(left, right) | Either(left, right):
                    size = 1 + self._size(left) + self._size(right)
                case Until(left, right) | Release(left, right):
                    size = 1 + self._size(left) + self._size(right)
                case Next(part, _):
                    size = 1 + self._size(part)
                case _:
                    size = 1
            entry = self._sizes[id(formula)] = formula, size
        return entry[1]

    def _peek(self) -> str | None:
        return self._tokens[self._next][0] if self._next < len(self._tokens) else None

    def _take(self, sign: str) -> bool:
        if self._peek() != sign:
            return False
        self._next += 1
        return True

    def _deeper(self, depth: int) -> int:
        if depth >= _MAX_DEPTH:
            raise self._mistake(f"the formula is nested more than {_MAX_DEPTH} levels deep")
        return depth + 1

    def _mistake(self, message: str, hint: str = "") -> MistakeError:
        there = self._next < len(self._tokens)
        return MistakeError(self._tokens[self._next][1] if there else self._length, message, hint)
