"""The documents that are open in the editor, and places in them.

Editors count lines and code units, gpsfsm code points. Lines end as they do for the front end and
for the protocol; Python's ``splitlines`` knows more line ends than these (U+2028, for one), with
which every place below such a character would be wrong.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lsprotocol.types import Position, Range, TextDocumentContentChangePartial
from pygls.uris import to_fs_path

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from lsprotocol.types import TextDocumentContentChangeEvent


@dataclass(frozen=True)
class Text:
    """One version of a document. ``file`` is None for one that was never saved."""

    uri: str
    version: int
    content: str
    language: str = ""
    encoding: Encoding = "utf-16"

    @cached_property
    def places(self) -> Places:
        """From the editor's positions to offsets, and back."""
        return Places(self.content, self.encoding)

    @cached_property
    def file(self) -> Path | None:
        """The file in which it is saved."""
        path = to_fs_path(self.uri)
        return Path(path) if path and "\0" not in path else None

    @property
    def marked(self) -> bool:
        """True if it begins with a byte order mark, which findings do not count."""
        return self.content.startswith("\ufeff")

    def changed(self, version: int, changes: Sequence[TextDocumentContentChangeEvent]) -> Text:
        """The version after the changes, which are made one after the other."""
        content, places = self.content, self.places
        for number, change in enumerate(changes):
            if not isinstance(change, TextDocumentContentChangePartial):
                content = change.text
            else:
                places = places if number == 0 else Places(content, self.encoding)
                start, end = places.offset(change.range.start), places.offset(change.range.end)
                content = content[:start] + change.text + content[max(start, end) :]
        return Text(self.uri, version, content, self.language, self.encoding)


@dataclass(slots=True)
class Texts:
    """The documents that are open, by address; ``encoding`` is what was agreed upon."""

    encoding: Encoding = "utf-16"
    _open: dict[str, Text] = field(default_factory=dict)

    def open(self, uri: str, version: int, content: str, language: str) -> Text:
        """A document has been opened."""
        text = self._open[uri] = Text(uri, version, content, language, self.encoding)
        return text

    def change(
        self, uri: str, version: int, changes: Sequence[TextDocumentContentChangeEvent]
    ) -> Text | None:
        """A document has been edited; None if it is not open."""
        text = self._open.get(uri)
        if text is None:
            return None
        self._open[uri] = text = text.changed(version, changes)
        return text

    def close(self, uri: str) -> None:
        """A document has been closed."""
        self._open.pop(uri, None)

    def get(self, uri: str) -> Text | None:
        """The document as it is now; None if it is not open."""
        return self._open.get(uri)

    def __iter__(self) -> Iterator[Text]:
        return iter(list(self._open.values()))


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
        for line_end in _LINE_END.finditer(text):
            self._stops.append(line_end.start())
            self._begins.append(line_end.end())
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
