"""Reading LTLf formulas as they are written in task files.

From the loosest to the tightest: ``<->``, ``->`` (to the right), ``|``, ``&``, ``U R W M`` (to the
right), then ``!``, ``X`` (next), ``WX`` (weak next), ``F`` (some time), ``G`` (always). Atoms:
``start(NAME)``, ``succeeds(NAME)``, ``fails(NAME)``, ``completes``, ``gives_up``, ``stuck``,
``true``, ``false``. A name with blanks stands in quotation marks; ``*`` is any action.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from gpsfsm.capabilities.defects import quoted
from gpsfsm.tasks.ltlf import (
    ENDS,
    OUTCOMES,
    Atom,
    Both,
    Constant,
    Either,
    Formula,
    Next,
    Release,
    Until,
    negation,
)

__all__ = ["Mistake", "parse_formula"]

_MAX_LENGTH = 4_000
_MAX_DEPTH = 100
_MAX_TOKENS = 1_000
_MAX_SIZE = 20_000
"""Parts of a formula: ``<->``, W and M write what stands beside them twice."""
_TOKEN = re.compile(
    r"\s*(?:(?P<sign><->|->|[()!&|])|(?P<quoted>\"[^\"]*\")|(?P<word>(?:(?!->)[^\s()!&|\"<>])+))"
)
_TRUE, _FALSE = Constant(True), Constant(False)
_TEMPORAL = ("U", "R", "W", "M")


class Mistake(Exception):  # noqa: N818  (it becomes a defect of the file)
    """A formula that does not parse; ``position`` is the place in the text, from 0."""

    def __init__(self, position: int, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.position, self.message, self.hint = position, message, hint


def parse_formula(text: str) -> Formula:
    """The formula that a text stands for; raises Mistake.

    >>> parse_formula("F start(A)") == Until(_TRUE, Atom("start", "A"))
    True
    """
    if len(text) > _MAX_LENGTH:
        raise Mistake(_MAX_LENGTH, f"the formula is longer than {_MAX_LENGTH} characters")
    parser = _Parser(_tokens(text), len(text))
    found = parser.equivalence(0)
    parser.finish()
    return found


def _tokens(text: str) -> list[tuple[str, int]]:
    found: list[tuple[str, int]] = []
    position = 0
    while text[position:].strip():
        match = _TOKEN.match(text, position)
        if match is None or match.lastgroup is None:
            start = position + len(text[position:]) - len(text[position:].lstrip())
            raise Mistake(start, f"{quoted(text[start : start + 1])} has no meaning here")
        found.append((match[match.lastgroup], match.start(match.lastgroup)))
        if len(found) > _MAX_TOKENS:
            raise Mistake(position, f"the formula has more than {_MAX_TOKENS} words and signs")
        position = match.end()
    return found


class _Parser:
    def __init__(self, tokens: list[tuple[str, int]], length: int) -> None:
        self._tokens = tokens
        self._length = length
        self._next = 0
        self._sizes: dict[int, tuple[Formula, int]] = {}  # by identity, which they keep alive

    def finish(self) -> None:
        """Nothing must be left."""
        if self._next < len(self._tokens):
            raise self._mistake("the formula goes on where it should end", "write & or | before it")

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
            "F": lambda part: Until(_TRUE, part),
            "G": lambda part: Release(_FALSE, part),
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
                "something is missing at the end" if word is None else f"{quoted(word)} is no event"
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
            hint = "write ) after the name; a name with blanks stands in quotation marks"
            raise self._mistake("a closing bracket is missing", hint)
        return Atom(word, name.strip('"'))

    def _check(self, *parts: Formula) -> None:
        """What is about to be written twice must be small."""
        if sum(map(self._size, parts)) > _MAX_SIZE:
            raise self._mistake("the formula is too large: <->, W and M stand inside each other")

    def _size(self, formula: Formula) -> int:
        """The number of parts, where those that are shared count each time."""
        known = self._sizes.get(id(formula))
        if known is None:
            match formula:
                case Both(left, right) | Either(left, right):
                    size = 1 + self._size(left) + self._size(right)
                case Until(left, right) | Release(left, right):
                    size = 1 + self._size(left) + self._size(right)
                case Next(part, _):
                    size = 1 + self._size(part)
                case _:
                    size = 1
            known = self._sizes[id(formula)] = formula, size
        return known[1]

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

    def _mistake(self, message: str, hint: str = "") -> Mistake:
        there = self._next < len(self._tokens)
        return Mistake(self._tokens[self._next][1] if there else self._length, message, hint)
