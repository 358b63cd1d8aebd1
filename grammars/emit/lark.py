"""Lark, in the dialect of llguidance: what OpenAI's custom tools take.

One rule per line; no imports, no templates, no priorities, no look-around, no empty terminals.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.generation.language_model import Constraint
from gpsfsm.grammars.emit import Format, Notation, escaped
from gpsfsm.grammars.expressions import regular
from gpsfsm.grammars.rules import rules_of

if TYPE_CHECKING:
    from gpsfsm.grammars.expressions import Chars, Repeat
    from gpsfsm.grammars.rules import Rule
    from gpsfsm.grammars.writable import Alphabet


def _chars(part: Chars) -> str:
    raise ValueError(part.body)  # only terminals have them


def _repeat(part: Repeat) -> str:
    return "?" if (part.least, part.most) == (0, 1) else f"~{part.least}..{part.most}"


def _notation(tokens: frozenset[str]) -> Notation:
    return Notation(
        literal=escaped,
        chars=_chars,
        name=lambda name: name.upper() if name in tokens else name,
        repeat=_repeat,
    )


def _line(rule: Rule, notation: Notation) -> str:
    if rule.is_token:
        return f"{rule.name.upper()}: /{regular(rule.body)}/\n"
    return f"{rule.name}: {notation.write(rule.body)}\n"


def _emit(words: Alphabet, depth: int) -> str:
    rules = rules_of(words, depth)
    notation = _notation(frozenset(rule.name for rule in rules if rule.is_token))
    return "".join(_line(rule, notation) for rule in rules)


FORMAT = Format("lark", "plan.lark", _emit, constraint=Constraint.LARK)
