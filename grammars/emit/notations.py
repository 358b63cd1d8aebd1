"""Grammars as text, one rule per line: GBNF, and Lark in the dialect of llguidance.

GBNF is read by llama.cpp, and by vLLM and SGLang (xgrammar, llguidance) as well; OpenAI's custom
tools take Lark, with no imports, no templates, no priorities, no look-around, no empty terminals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.generation.language_model import Constraint
from gpsfsm.grammars.emit import Format
from gpsfsm.grammars.expressions import Choice, Literal, Name, Repeat, Sequence, quantifier, regular
from gpsfsm.grammars.rules import rules_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.grammars.expressions import Chars, Expression
    from gpsfsm.grammars.rules import Rule
    from gpsfsm.grammars.writable import Alphabet


@dataclass(frozen=True, slots=True)
class Notation:
    """The spelling of expressions in a format: parts that differ, around those that do not."""

    literal: Callable[[str], str]
    chars: Callable[[Chars], str]
    name: Callable[[str], str]
    repeat: Callable[[Repeat], str]

    def write(self, part: Expression) -> str:
        """The expression on one line."""
        if isinstance(part, Literal):
            return self.literal(part.text)
        if isinstance(part, Name):
            return self.name(part.name)
        if isinstance(part, Sequence):
            return " ".join(self._grouped(each, Choice) for each in part.parts)
        if isinstance(part, Choice):
            return " | ".join(map(self.write, part.parts))
        if isinstance(part, Repeat):
            return self._grouped(part.part, Choice, Sequence) + self.repeat(part)
        return self.chars(part)

    def _grouped(self, part: Expression, *kinds: type) -> str:
        written = self.write(part)
        single = isinstance(part, Sequence) and len(part.parts) == 1
        return f"({written})" if isinstance(part, kinds) and not single else written


def _escaped(text: str) -> str:
    """A text between quotation marks, with the escapes that GBNF and Lark share.

    What is not ASCII stays: engines differ in how they read its escapes.
    """
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


_GBNF = Notation(
    literal=_escaped,
    chars=lambda part: f"[{part.body}]",
    name=lambda name: name,
    repeat=quantifier,
)


def _gbnf(words: Alphabet, depth: int) -> str:
    """One rule per line; ``root`` is where GBNF starts."""
    lines = [
        f"{'root' if rule.name == 'start' else rule.name} ::= {_GBNF.write(rule.body)}\n"
        for rule in rules_of(words, depth)
    ]
    return "".join(lines)


def _no_chars(part: Chars) -> str:
    raise ValueError(part.body)  # only terminals have them


def _lark_repeat(part: Repeat) -> str:
    return "?" if (part.least, part.most) == (0, 1) else f"~{part.least}..{part.most}"


def _lark_notation(tokens: frozenset[str]) -> Notation:
    return Notation(
        literal=_escaped,
        chars=_no_chars,
        name=lambda name: name.upper() if name in tokens else name,
        repeat=_lark_repeat,
    )


def _lark_line(rule: Rule, notation: Notation) -> str:
    if rule.is_token:
        return f"{rule.name.upper()}: /{regular(rule.body)}/\n"
    return f"{rule.name}: {notation.write(rule.body)}\n"


def _lark(words: Alphabet, depth: int) -> str:
    rules = rules_of(words, depth)
    notation = _lark_notation(frozenset(rule.name for rule in rules if rule.is_token))
    return "".join(_lark_line(rule, notation) for rule in rules)


FORMATS = (
    Format("gbnf", "plan.gbnf", _gbnf, constraint=Constraint.GBNF),
    Format("lark", "plan.lark", _lark, constraint=Constraint.LARK),
)
