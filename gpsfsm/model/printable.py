"""Text that came from a plan, made safe to print.

Control characters could move the cursor or recolour the screen, bidirectional ones could make a
line read as something else, and lone surrogates cannot be encoded: all are written as escapes.
"""

from __future__ import annotations

import re
import unicodedata

from gpsfsm.errors import misused
from gpsfsm.late import pattern

_JOINERS = frozenset("\u200c\u200d")
"""Zero-width (non-)joiner: many scripts and emoji need them, and they can do no harm."""


def printable(text: str) -> str:
    r"""Escape every character that is not plainly visible, as in ``\x1b``.

    >>> printable("red: \x1b[31m")
    'red: \\x1b[31m'
    """
    try:
        if text.isprintable():
            return text
    except AttributeError:
        raise misused("printable", "a text", text) from None
    return "".join(map(_escape, text))


def clip(text: str, limit: int) -> str:
    """Make ``text`` printable, shortened to ``limit`` code points before that."""
    return printable(text if len(text) <= limit else text[: limit - 1] + "…")


_MARKUP = pattern(r"([\\`*_\[\]<>#|~&@$]|:(?! )|(?<=www)\.)", re.IGNORECASE)
"""Characters that could begin something in Markdown; the last two would link an address."""


def plain_markdown(text: str) -> str:
    r"""Write text that every dialect of Markdown shows as it is, also in a table.

    >>> print(plain_markdown("[a](https://b) | <img>"))
    \[a\](https\://b) \| \<img\>
    """
    return _MARKUP.sub(r"\\\1", printable(text))


def _escape(character: str) -> str:
    if character.isprintable() or character in _JOINERS or unicodedata.category(character) == "Zs":
        return character
    code = ord(character)
    if code <= 0xFF:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"
