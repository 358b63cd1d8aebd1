"""Expressions, of which grammars are made: a small language that every format can write.

All texts are ASCII in the end: what is not is written as an escape by the format. As regular
expressions they are in what Python, Rust, ECMAScript and Lark share.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_SPECIAL = re.compile(r"[\\.^$*+?{}\[\]|()/]")


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
    """A reference to the rule of this name."""

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


def regular(part: Expression) -> str:
    """The regular expression; raises ValueError for a name, which none can refer to."""
    if isinstance(part, Literal):
        # Lark takes a backslash before a quotation mark for an escape, even an escaped one
        return _SPECIAL.sub(r"\\\g<0>", part.text).replace("\\\\", "[\\\\]")
    if isinstance(part, Chars):
        return f"[{part.body}]"
    if isinstance(part, Sequence):
        return "".join(_grouped(each, Choice) for each in part.parts)
    if isinstance(part, Choice):
        return "|".join(map(regular, part.parts))
    if isinstance(part, Repeat):
        return _grouped(part.part, Choice, Sequence, Repeat, Literal) + quantifier(part)
    assert isinstance(part, Name)
    raise ValueError(part.name)


def quantifier(part: Repeat) -> str:
    """``?``, ``*``, ``+`` or ``{2,3}``."""
    short = {(0, 1): "?", (0, None): "*", (1, None): "+"}.get((part.least, part.most))
    if short:
        return short
    most = "" if part.most is None else part.most
    return f"{{{part.least}}}" if part.least == part.most else f"{{{part.least},{most}}}"


def _grouped(part: Expression, *kinds: type) -> str:
    written = regular(part)
    single = isinstance(part, Literal) and len(part.text) == 1
    return f"(?:{written})" if isinstance(part, kinds) and not single else written
