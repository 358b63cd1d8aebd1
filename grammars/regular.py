"""Expressions as regular expressions, in what Python, Rust, ECMAScript and Lark share."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.grammars.expressions import Chars, Choice, Literal, Name, Repeat, Sequence

if TYPE_CHECKING:
    from gpsfsm.grammars.expressions import Expression

__all__ = ["quantifier", "regular"]

_SPECIAL = re.compile(r"[\\.^$*+?{}\[\]|()/]")


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
