"""What grammars are made of: a small language of expressions that every format can write.

All texts are ASCII in the end: what is not is written as an escape by the format.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "Chars",
    "Choice",
    "Expression",
    "Literal",
    "Name",
    "Repeat",
    "Sequence",
    "choice",
    "opt",
]


@dataclass(frozen=True, slots=True)
class Literal:
    """Exactly this text; not empty."""

    text: str


@dataclass(frozen=True, slots=True)
class Chars:
    r"""One character of a class: ``body`` is what stands between ``[`` and ``]``.

    Only ASCII, and only the escapes that regular expressions and GBNF share: ``\xHH``, ``\uHHHH``
    and a backslash before a bracket or a backslash.
    """

    body: str


@dataclass(frozen=True, slots=True)
class Name:
    """What the rule of this name says."""

    name: str


@dataclass(frozen=True, slots=True)
class Sequence:
    """One after the other."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Choice:
    """One of these; at least one."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Repeat:
    """``least`` to ``most`` times (None: any number)."""

    part: Expression
    least: int = 0
    most: int | None = None


Expression = Literal | Chars | Name | Sequence | Choice | Repeat


def choice(parts: list[Expression]) -> Expression:
    """One of these; a choice among one thing is that thing."""
    return parts[0] if len(parts) == 1 else Choice(tuple(parts))


def opt(part: Expression) -> Expression:
    """The part or nothing."""
    return Repeat(part, 0, 1)
