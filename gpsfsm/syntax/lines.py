"""From offsets to lines and columns."""

from __future__ import annotations

__all__ = ["Lines"]

_STRIDE = 4096


class Lines:
    r"""Line and column of every offset of a text, in code points, from 1.

    Lines end at ``\n``, ``\r\n`` or ``\r``. A table keeps the line of every 4096th offset instead
    of every line's offset: 64 MB of line ends would otherwise make a list of gigabytes.

    >>> Lines("one\r\ntwo").position(5)
    (2, 1)
    """

    def __init__(self, text: str) -> None:
        # The same length, so that offsets stay; only "\n" ends a line afterwards.
        self._text = text.replace("\r\n", " \n").replace("\r", "\n") if "\r" in text else text
        self._numbers = [1]
        self._begins = [0]
        self._line, self._begin, self._stop = 1, 0, -1

    def position(self, offset: int) -> tuple[int, int]:
        """Line and column of ``offset``."""
        if not self._begin <= offset <= self._stop:
            self._seek(offset)
        return self._line, offset - self._begin + 1

    def rest(self, offset: int) -> int:
        """The number of code points from ``offset`` to the end of its line."""
        self.position(offset)
        return len(self._text[offset : min(self._stop, offset + _STRIDE)].rstrip())

    def offset(self, line: int, column: int) -> int:
        """The offset of a line and column; the nearest one where there is none."""
        begin = 0
        for _ in range(line - 1):
            found = self._text.find("\n", begin)
            if found < 0:
                break
            begin = found + 1
        stop = self._text.find("\n", begin)
        stop = len(self._text) if stop < 0 else stop
        return max(begin, min(begin + column - 1, stop))

    def _seek(self, offset: int) -> None:
        """Remember the line of ``offset``: most questions are about the same line again."""
        text, chunk = self._text, offset // _STRIDE
        while len(self._numbers) <= chunk:
            start = (len(self._numbers) - 1) * _STRIDE
            number = self._numbers[-1] + text.count("\n", start, start + _STRIDE)
            found = text.rfind("\n", start, start + _STRIDE)
            self._begins.append(found + 1 if found >= 0 else self._begins[-1])
            self._numbers.append(number)
        start = chunk * _STRIDE
        self._line = self._numbers[chunk] + text.count("\n", start, offset)
        found = text.rfind("\n", start, offset)
        self._begin = found + 1 if found >= 0 else self._begins[chunk]
        stop = text.find("\n", offset)
        self._stop = len(text) if stop < 0 else stop
