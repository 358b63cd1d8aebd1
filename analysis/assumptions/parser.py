"""From the text of an assumption to its written form."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from gpsfsm.analysis.assumptions.messages import Mistake
from gpsfsm.analysis.assumptions.written import (
    Claim,
    Compound,
    InterfaceSelector,
    LabelSelector,
    LineSelector,
    PathSelector,
    Quantifier,
    Selector,
    Statement,
    Tally,
    Verb,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lark import Lark, Token

__all__ = ["statement_of"]

_MAX_DEPTH = 50


def statement_of(text: str) -> Statement:
    """Parse ``text``; raises Mistake, or lark's UnexpectedInput where the grammar is violated."""
    return cast("Statement", _parser().parse(text))


@cache
def _parser() -> Lark:
    from lark import Lark  # noqa: PLC0415  (only needed with --assume)

    grammar = Path(__file__).with_name("grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", transformer=_Builder())


_QUANTIFIERS = {"some": "any", "every": "all", "each": "all", "none": "no"}
_NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_STEP = re.compile(r"/(Control|Runner)\[([1-9][0-9]{0,8})\]")


class _Builder:
    """Builds the written form; each method is named after a rule of the grammar."""

    def start(self, parts: list[Any]) -> Statement:
        return cast("Statement", parts[0])

    def forecast(self, parts: list[Any]) -> Statement:
        ever, verb, selectors = parts
        return Claim(Quantifier("all"), selectors, _ever(ever, verb))

    def same(self, parts: list[Any]) -> Statement:
        return Claim(Quantifier("all"), parts[0], Verb("agree"))

    def iff(self, parts: list[Any]) -> Statement:
        return _compound("iff", parts)

    def implies(self, parts: list[Any]) -> Statement:
        return _compound("implies", parts)

    def disjunction(self, parts: list[Any]) -> Statement:
        return _compound("or", parts)

    def exclusion(self, parts: list[Any]) -> Statement:
        return _compound("xor", parts)

    def conjunction(self, parts: list[Any]) -> Statement:
        return _compound("and", parts)

    def negation(self, parts: list[Any]) -> Statement:
        return _compound("not", parts[1:])

    def bare(self, parts: list[Any]) -> Statement:
        selector, (ever, verb) = parts
        every = ever is not None or verb.word == "agree"
        quantifier = Quantifier("all" if every else "the")
        return Claim(quantifier, (selector,), _ever(ever, verb))

    def quantified(self, parts: list[Any]) -> Statement:
        quantifier, chosen, (ever, verb) = parts
        selectors = chosen if isinstance(chosen, tuple) else (chosen,)
        if verb.word == "agree" and quantifier.word != "all":
            wrong = f"'agree' is said of all instances, not of '{quantifier}'"
            raise Mistake(selectors[0].at, wrong)
        return Claim(quantifier, selectors, _ever(ever, verb))

    def tally(self, parts: list[Any]) -> Statement:
        depth = 1 + max(part.depth for part in parts[1:])
        return _bounded(Tally(parts[0], tuple(parts[1:]), depth))

    def quantifier(self, parts: list[Token]) -> Quantifier:
        word = " ".join(parts[0].lower().split())
        number = 0
        if len(parts) > 1:
            written = parts[1].lower()
            number = _NUMBERS.index(written) if written in _NUMBERS else int(written)
        return Quantifier(cast("Any", _QUANTIFIERS.get(word, word)), number)

    def tail(self, parts: list[Any]) -> tuple[Token | None, Verb]:
        if isinstance(parts[-1], Verb):
            return (parts[0] if len(parts) > 1 else None), parts[-1]
        return None, Verb("agree")

    def verb(self, parts: list[Token]) -> Verb:
        if parts[0].type == "NO_START":
            return Verb("start", negated=True)
        word = parts[-1].lower().removesuffix("s")
        return Verb(cast("Any", word), negated=len(parts) > 1)

    def selectors(self, parts: list[Selector]) -> tuple[Selector, ...]:
        return tuple(parts)

    def line(self, parts: list[Token]) -> Selector:
        line, _, column = parts[1].partition(":")
        return LineSelector(int(line), int(column) if column else None, _at(parts[0]))

    def path(self, parts: list[Token]) -> Selector:
        steps = parts[0].removeprefix("/Plan")
        if not parts[0].startswith("/Plan") or _STEP.sub("", steps):
            wrong = "an element path is written like /Plan/Control[1]/Runner[2], counting from 1"
            raise Mistake(_at(parts[0]), wrong)
        found = tuple((tag, int(ordinal)) for tag, ordinal in _STEP.findall(steps))
        return PathSelector(found, _at(parts[0]))

    def label(self, parts: list[Token]) -> Selector:
        return LabelSelector(_unquoted(parts[1]), _at(parts[0]))

    def interface(self, parts: list[Any]) -> Selector:
        parameters = parts[1] if len(parts) > 1 else ()
        literal = parts[0].type == "STRING"
        return InterfaceSelector(_unquoted(parts[0]), parameters, literal, _at(parts[0]))

    def parameters(self, parts: list[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
        return tuple(parts)

    def parameter(self, parts: list[Token]) -> tuple[str, str]:
        return str(parts[0]), _unquoted(parts[1])


def _compound(operator: Any, parts: Sequence[Statement]) -> Statement:
    depth = 1 + max(part.depth for part in parts)
    return _bounded(Compound(operator, tuple(parts), depth))


def _bounded(statement: Tally | Compound) -> Statement:
    if statement.depth > _MAX_DEPTH:
        raise Mistake(0, f"an assumption nests at most {_MAX_DEPTH} levels deep")
    return statement


def _ever(ever: Token | None, verb: Verb) -> Verb:
    never = ever is not None and ever.lower() == "never"
    return replace(verb, negated=verb.negated != never)


def _at(token: Token) -> int:
    return token.start_pos or 0


def _unquoted(token: Token) -> str:
    if token.type != "STRING":
        return str(token)
    return re.sub(r"\\(.)", r"\1", token[1:-1], flags=re.DOTALL)
