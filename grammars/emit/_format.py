"""What a format of grammars is, and what formats share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.grammars.expressions import Choice, Literal, Name, Repeat, Sequence

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.generation.language_model import Constraint
    from gpsfsm.grammars.expressions import Chars, Expression
    from gpsfsm.grammars.writable import Alphabet

__all__ = ["Format", "Notation", "escaped"]


@dataclass(frozen=True, slots=True)
class Format:
    """A way to write a grammar. It has one of two functions.

    ``emit`` writes the plans over an alphabet to a depth, for a server that speaks ``constraint``;
    ``fixed`` gives the schema of all plans, whatever the capabilities. ``file`` is the name of the
    file that is shipped.
    """

    name: str
    file: str
    emit: Callable[[Alphabet, int], str] | None = None
    fixed: Callable[[], str] | None = None
    constraint: Constraint | None = None


@dataclass(frozen=True, slots=True)
class Notation:
    """How a format writes an expression: parts that differ, around those that do not."""

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


def escaped(text: str) -> str:
    """A text between quotation marks, with the escapes that GBNF and Lark share.

    What is not ASCII stays: engines differ in how they read its escapes.
    """
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
