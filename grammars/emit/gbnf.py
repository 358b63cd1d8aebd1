"""GBNF: the grammars of llama.cpp, which vLLM and SGLang (xgrammar, llguidance) read as well."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.generation.language_model import Constraint
from gpsfsm.grammars.emit import Format, Notation, escaped
from gpsfsm.grammars.expressions import quantifier
from gpsfsm.grammars.rules import rules_of

if TYPE_CHECKING:
    from gpsfsm.grammars.writable import Alphabet

_NOTATION = Notation(
    literal=escaped,
    chars=lambda part: f"[{part.body}]",
    name=lambda name: name,
    repeat=quantifier,
)


def _emit(words: Alphabet, depth: int) -> str:
    """One rule per line; ``root`` is where GBNF starts."""
    lines = [
        f"{'root' if rule.name == 'start' else rule.name} ::= {_NOTATION.write(rule.body)}\n"
        for rule in rules_of(words, depth)
    ]
    return "".join(lines)


FORMAT = Format("gbnf", "plan.gbnf", _emit, constraint=Constraint.GBNF)
