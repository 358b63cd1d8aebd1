"""The character classes of XML 1.0 (fifth edition), as parts of regular expressions.

All patterns of this package use possessive quantifiers: they never backtrack, so that no input
makes them slower than linear.
"""

from __future__ import annotations

import re

__all__ = [
    "BLANK",
    "ILLEGAL",
    "NAME",
    "NAME_PATTERN",
    "NAME_START",
    "SPACED_TAG",
    "WHITE",
    "clip",
    "strip",
]

WHITE = " \t\r\n"
"""The white space of XML. A no-break space is text."""

# Both classes say what does not belong to a name: to compile a class takes the longer the more
# characters it lists, and of those that do not there are five times fewer.
_NEVER = (
    "/;-@\\[-^`{-\u00b6\u00b8-\u00bf\u00d7\u00f7\u037e\u2000-\u200b\u200e-\u203e\u2041-\u206f"
    "\u2190-\u2bff\u2ff0-\u3000\ud800-\uf8ff\ufdd0-\ufdef\ufffe-\uffff\U000f0000-\U0010ffff"
)
NAME_START = f"[^\0-9\u00b7\u0300-\u036f\u203f-\u2040{_NEVER}]"
NAME_PATTERN = f"{NAME_START}[^\0-,{_NEVER}]*+"

NAME = re.compile(NAME_PATTERN)
BLANK = re.compile(f"[{WHITE}]*+")
ILLEGAL = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")

SPACED_TAG = re.compile(rf"<[{WHITE}]++/?+[{WHITE}]*+(?:Plan|Control|Runner)\b")
"""A tag that is none, because blanks follow its ``<``."""


def strip(text: str) -> str:
    r"""``text`` without the XML white space around it.

    >>> strip(" a\u00a0 ") == "a\u00a0"
    True
    """
    return text.strip(WHITE)


def clip(text: str, length: int = 40) -> str:
    r"""``text`` on one line and not longer than ``length``, for messages.

    >>> clip("go to the\n   door", 8)
    'go to t…'
    """
    # Cut first: the text can be megabytes long.
    joined = " ".join(text[: 4 * length].split())
    if len(joined) > length or len(text) > 4 * length:
        return joined[: length - 1] + "…"
    return joined
