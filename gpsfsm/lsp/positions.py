"""Places in a text: the editor's lines and code units, and offsets of code points.

Lines end as they do for the front end and for the protocol; Python's ``splitlines`` knows more line
ends than these (U+2028, for one), with which every place below such a character would be wrong.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from typing import Literal

from lsprotocol.types import Position, Range

__all__ = ["Encoding", "Places"]

Encoding = Literal["utf-8", "utf-16", "utf-32"]
"""What a column counts in: bytes, UTF-16 code units or code points."""

_LINE_END = re.compile(r"\r\n|\n|\r")


class Places:
    r"""The places of one text.

    >>> places = Places("one\n\U0001f600 two", "utf-16")
    >>> places.position(6).character, places.offset(Position(1, 3)), places.at(2, 3)
    (3, 6, 6)
    """

    def __init__(self, text: str, encoding: Encoding) -> None:
        self.text = text
        self._encoding = encoding
        self._plain = encoding == "utf-32" or text.isascii()
        self._begins = [0]
        self._stops: list[int] = []
        for found in _LINE_END.finditer(text):
            self._stops.append(found.start())
            self._begins.append(found.end())
        self._stops.append(len(text))

    def offset(self, position: Position) -> int:
        """The offset of an editor's position; the nearest one where there is none."""
        if position.line >= len(self._begins):
            return len(self.text)
        begin, stop = self._begins[position.line], self._stops[position.line]
        if self._plain:
            return min(begin + position.character, stop)
        left = position.character
        for offset in range(begin, stop):
            left -= self._units(self.text[offset])
            if left < 0:
                return offset
        return stop

    def position(self, offset: int) -> Position:
        """The editor's position of an offset."""
        line = bisect_right(self._begins, offset) - 1
        begin = self._begins[line]
        offset = min(offset, self._stops[line])
        if self._plain:
            return Position(line, offset - begin)
        return Position(line, sum(map(self._units, self.text[begin:offset])))

    def range(self, start: int, end: int) -> Range:
        """The editor's range between two offsets."""
        return Range(self.position(start), self.position(max(start, end)))

    def at(self, line: int, column: int) -> int:
        """The offset of a line and a column as findings have them: from 1, in code points."""
        number = min(max(line, 1), len(self._begins)) - 1
        return min(self._begins[number] + max(column, 1) - 1, self._stops[number])

    def line_end(self, offset: int) -> int:
        """The offset where the line of an offset ends."""
        return self._stops[bisect_right(self._begins, offset) - 1]

    def line_begin(self, offset: int) -> int:
        """The offset where the line of an offset begins."""
        return self._begins[bisect_right(self._begins, offset) - 1]

    def _units(self, character: str) -> int:
        code = ord(character)
        if self._encoding == "utf-16":
            return 1 + (code > 0xFFFF)
        if self._encoding == "utf-8":
            return 1 + (code > 0x7F) + (code > 0x7FF) + (code > 0xFFFF)
        return 1
