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

NAME_START = (
    ":A-Z_a-z\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u02ff\u0370-\u037d\u037f-\u1fff"
    "\u200c-\u200d\u2070-\u218f\u2c00-\u2fef\u3001-\ud7ff\uf900-\ufdcf\ufdf0-\ufffd"
    "\U00010000-\U000effff"
)
NAME_PATTERN = f"[{NAME_START}][{NAME_START}\\-.0-9\u00b7\u0300-\u036f\u203f-\u2040]*+"

NAME = re.compile(NAME_PATTERN)
BLANK = re.compile(f"[{WHITE}]*+")
ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

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
