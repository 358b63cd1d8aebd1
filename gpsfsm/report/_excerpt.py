"""The line of a plan that a finding is about, clipped around the place, and the carets under it."""

from __future__ import annotations

import re
import unicodedata
from typing import NamedTuple

from gpsfsm.model.printable import printable

__all__ = ["Excerpt", "excerpt", "split_lines"]

_LINE_END = re.compile(r"\r\n|\r|\n")
_MORE = "…"
_TAB = " " * 4
_CONTEXT = 3
"""A clipped line begins this part (one third) of its width before the place."""


class Excerpt(NamedTuple):
    """A source line as it is shown; ``offset`` columns before ``carets`` columns of carets."""

    text: str
    offset: int
    carets: int


def split_lines(source: str) -> list[str]:
    r"""Split a plan text as locations count lines: ended by ``\n``, ``\r\n`` or ``\r``."""
    return _LINE_END.split(source)


def excerpt(line: str, column: int, *, length: int, limit: int) -> Excerpt:
    """Show the part of ``line`` around ``column`` (from 1) that fits into ``limit`` columns.

    A place behind the end of the line gets its caret there.
    """
    at = min(max(column - 1, 0), len(line))
    end = min(at + max(length, 1), len(line))
    # A hostile line may be megabytes long: look only at what could possibly be shown. A character
    # takes at least one column or belongs to one that does; more combining ones are cut off.
    low, high = max(0, at - limit), min(len(line), at + limit)
    cells = [_cell(character) for character in line[low:high]]
    first, last = _window(
        [columns for _, columns in cells], at - low, limit, (low, high, len(line))
    )
    left = _MORE if low + first > 0 else ""
    right = _MORE if low + last < len(line) else ""
    text = left + "".join(shown for shown, _ in cells[first:last]) + right
    offset = len(left) + sum(columns for _, columns in cells[first : at - low])
    carets = sum(columns for _, columns in cells[at - low : min(end - low, last)])
    return Excerpt(text.rstrip(), offset, max(carets, 1))


def _window(
    widths: list[int], at: int, limit: int, bounds: tuple[int, int, int]
) -> tuple[int, int]:
    """Choose the cells to show: all if they fit, else some before ``at`` and what follows."""
    low, high, total = bounds
    if low == 0 and high == total and sum(widths) <= limit:
        return 0, len(widths)
    room = limit - 2 * len(_MORE)
    first, used = at, 0
    enough = room if low == 0 and sum(widths[: at + 1]) <= room // 2 else room // _CONTEXT
    while first > 0 and used + widths[first - 1] <= enough:
        first -= 1
        used += widths[first]
    last = at
    while last < len(widths) and used + widths[last] <= room:
        used += widths[last]
        last += 1
    return first, last


def _cell(character: str) -> tuple[str, int]:
    """Tell how one character of a source line is shown, and how many columns that takes."""
    if character == "\t":
        return _TAB, len(_TAB)
    shown = printable(character)
    if len(shown) > 1:
        return shown, len(shown)
    if character in "\u200c\u200d" or unicodedata.category(character) in ("Mn", "Me"):
        return shown, 0
    return shown, 2 if unicodedata.east_asian_width(character) in ("W", "F") else 1
