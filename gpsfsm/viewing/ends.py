"""On which line elements end: for showing what belongs to a control, not for any verdict."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.model.plan import Element

__all__ = ["last_lines", "line_starts"]


def line_starts(text: str) -> list[int]:
    r"""The offsets at which the lines of a text begin; lines end at a line feed only.

    >>> line_starts("a\nb")
    [0, 2]
    """
    starts = [0]
    at = text.find("\n")
    while at >= 0:
        starts.append(at + 1)
        at = text.find("\n", at + 1)
    return starts


def last_lines(elements: Sequence[Element], text: str) -> list[int]:
    """Per element the line on which it ends; linear in the text.

    Elements of behaviour trees may stand anywhere in the text, so that of theirs nothing but the
    start tag is known: that is where they end.
    """
    starts = line_starts(text)
    ends = [element.end for element in elements]
    if not any(element.tag for element in elements):
        _close(elements, text, ends)
    return [
        max(element.line, bisect_right(starts, max(end - 1, 0)))
        for element, end in zip(elements, ends, strict=True)
    ]


def _close(elements: Sequence[Element], text: str, ends: list[int]) -> None:
    """From the last element to the first: behind the last child follows the end tag."""
    nothing_from = len(text)  # no end tag is at or behind this offset
    for element in reversed(elements):
        if text[element.end - 2 : element.end] == "/>":
            continue
        at = ends[element.children[-1]] if element.children else element.end
        at = max(at, element.end)
        if at >= nothing_from:
            continue
        found = _end_tag(text, at)
        if found < 0:
            nothing_from = at
            continue
        ends[element.index] = found


def _end_tag(text: str, at: int) -> int:
    """The offset behind the next end tag that is in no comment; -1 if there is none."""
    while True:
        tag = text.find("</", at)
        if tag < 0:
            return -1
        comment = text.find("<!--", at, tag)
        if comment < 0:
            close = text.find(">", tag)
            return len(text) if close < 0 else close + 1
        at = text.find("-->", comment + 4)
        if at < 0:
            return -1
