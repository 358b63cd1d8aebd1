"""The text itself: characters of XML 1.0 (fifth edition), lines and columns, and searches.

All patterns of this package use possessive quantifiers: they never backtrack, so that no input
makes them slower than linear. ``a*+b`` refuses "aaaa" after one pass, since ``*+`` gives nothing
back; ``(a*)*b`` would first try every division of the letters.
"""

from __future__ import annotations

import re

from gpsfsm.late import pattern

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
NAME_ASCII = "[A-Za-z_:][A-Za-z0-9_:.-]*+"
"""NAME_PATTERN where all of the text is ASCII: it compiles in a tenth of the time."""
NAME = pattern(NAME_PATTERN)
BLANK = pattern(f"[{WHITE}]*+")
ILLEGAL = pattern("[\0-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
SPACED_TAG = pattern(rf"<[{WHITE}]++/?+[{WHITE}]*+(?:Plan|Control|Runner)\b")
"""A tag that is none, because blanks follow its ``<``."""

OUTERMOST = pattern(
    r"(?:[^<]++|<\?.*?(?:\?>|\Z)|<!--.*?(?:-->|\Z)|<!(?!--)[^<>]*+>|<(?![/A-Za-z_:]))*+"
    r"<(?P<name>[A-Za-z_:][\w:.-]*+)",
    re.DOTALL,
)
"""A text up to the name of its outermost element, whatever stands before that.

A comment without an end ends with the text; else it would be looked for at each place again.
"""

_STRIDE = 4096


def root_name(text: str) -> str:
    """The name of a text's outermost element as it is written, "" where there is none.

    >>> root_name("<?xml version='1.0'?> <!-- <a/> --> <s:b/>"), root_name("no markup at all")
    ('s:b', '')
    """
    first = OUTERMOST.match(text)
    return "" if first is None else first["name"]


def is_json(text: str) -> bool:
    """True for what begins as a JSON object."""
    return text.lstrip().startswith("{")


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


class Lines:
    r"""Line and column of every offset of a text, in code points, from 1.

    Lines end at ``\n``, ``\r\n`` or ``\r``. A table keeps the line of every 4096th offset instead
    of every line's offset: 64 MB of line ends would otherwise make a list of gigabytes.
    ``text`` is as long as the text, but all its lines end with ``\n``.

    >>> Lines("one\r\ntwo").position(5)
    (2, 1)
    """

    def __init__(self, text: str) -> None:
        # The same length, so that offsets stay; only "\n" ends a line afterwards.
        self.text = text.replace("\r\n", " \n").replace("\r", "\n") if "\r" in text else text
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
        return len(self.text[offset : min(self._stop, offset + _STRIDE)].rstrip())

    def offset(self, line: int, column: int) -> int:
        """The offset of a line and column; the nearest one where there is none."""
        begin = 0
        for _ in range(line - 1):
            line_end = self.text.find("\n", begin)
            if line_end < 0:
                break
            begin = line_end + 1
        stop = self.text.find("\n", begin)
        stop = len(self.text) if stop < 0 else stop
        return max(begin, min(begin + column - 1, stop))

    def _seek(self, offset: int) -> None:
        """Remember the line of ``offset``: most questions are about the same line again."""
        text, chunk = self.text, offset // _STRIDE
        while len(self._numbers) <= chunk:
            start = (len(self._numbers) - 1) * _STRIDE
            number = self._numbers[-1] + text.count("\n", start, start + _STRIDE)
            line_end = text.rfind("\n", start, start + _STRIDE)
            self._begins.append(line_end + 1 if line_end >= 0 else self._begins[-1])
            self._numbers.append(number)
        start = chunk * _STRIDE
        self._line = self._numbers[chunk] + text.count("\n", start, offset)
        line_end = text.rfind("\n", start, offset)
        self._begin = line_end + 1 if line_end >= 0 else self._begins[chunk]
        stop = text.find("\n", offset)
        self._stop = len(text) if stop < 0 else stop


class Finder:
    """``str.find`` with a memory: what is absent from some offset on is not searched again.

    Without it a text of a million unclosed quotes would be searched to its end a million times.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._absent: dict[str, int] = {}

    def find(self, needle: str, start: int) -> int:
        """The first offset of ``needle`` from ``start`` on, or -1."""
        absent = self._absent.get(needle)
        if absent is not None and start >= absent:
            return -1
        place = self._text.find(needle, start)
        if place < 0:
            self._absent[needle] = start
        return place


def is_namespace_declaration(name: str) -> bool:
    """True for ``xmlns`` and ``xmlns:prefix``."""
    return name.startswith("xmlns") and (len(name) == 5 or name[5] == ":")
