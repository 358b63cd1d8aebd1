"""How many tokens a text has, about: without the vocabulary of the model nobody knows.

The estimate is meant to be too high rather than too low. Vocabularies of today take three to four
characters of English or XML to a token, one to two of other scripts, and one or two digits.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["conversation_tokens", "estimated_tokens"]

_PER_MESSAGE = 8
"""Tokens that a chat template adds to a message, about."""

_PIECE = re.compile(r"[A-Za-z]+|\d+|[ \t]+|[^\sA-Za-z\d]")
_LETTERS, _DIGITS, _BLANKS = 5, 2, 8
_SHORT = 500


def estimated_tokens(text: str) -> int:
    """About how many tokens a text has; what is not ASCII counts by its bytes in UTF-8, halved."""
    lines = text.split("\n")
    known = (_of_short(line) if len(line) <= _SHORT else _counted(line) for line in lines)
    return len(lines) - 1 + sum(known)


@lru_cache(maxsize=2_000)
def _of_short(line: str) -> int:
    """Remembered: drafts of a prompt have most lines in common."""
    return _counted(line)


def _counted(line: str) -> int:
    total = 0
    for match in _PIECE.finditer(line):
        piece = match.group()
        first = piece[0]
        if first.isascii() and first.isalpha():
            total += -(-len(piece) // _LETTERS)
        elif first.isascii() and first.isdigit():
            total += -(-len(piece) // _DIGITS)
        elif first in " \t":
            total += 0 if piece == " " else -(-len(piece) // _BLANKS)  # a space belongs to a word
        elif first.isascii():
            total += 1
        else:
            total += -(-len(piece.encode("utf-8", "surrogatepass")) // 2)
    return total


def conversation_tokens(texts: Iterable[str]) -> int:
    """About how many tokens messages with these texts have together."""
    return sum(estimated_tokens(text) + _PER_MESSAGE for text in texts)
