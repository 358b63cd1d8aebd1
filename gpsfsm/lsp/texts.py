"""The documents that are open in the editor, places in them, and what is at the cursor.

Editors count lines and code units, gpsfsm code points. Lines end as they do for the front end and
for the protocol; Python's ``splitlines`` knows more line ends than these (U+2028, for one), with
which every place below such a character would be wrong.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from html import unescape
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lsprotocol.types import Position, Range, TextDocumentContentChangePartial
from pygls.uris import to_fs_path

from gpsfsm.syntax.text import NAME_PATTERN

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

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


# ---- The cursor in a text that may be half written: the tag, the attribute, the value there ------
# The front end reads whole texts and mends what is wrong with them. While somebody types, the text
# is wrong right where the cursor is, and what counts is what stands before it.


_TOKEN = re.compile(
    r"<!--.*?(?:-->|\Z)|<!\[CDATA\[.*?(?:\]\]>|\Z)|<\?.*?(?:\?>|\Z)|<![^<>]*+>?"
    rf"|<(?P<slash>/?)(?P<name>(?:{NAME_PATTERN})?+)"
    r"(?P<body>(?:[^<>\"']++|\"[^\"<]*+(?:\"|(?=<)|\Z)|'[^'<]*+(?:'|(?=<)|\Z))*+)(?P<end>>?)",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(rf"({NAME_PATTERN})(\s*+=\s*+)?+(?:\"([^\"<]*+)(\"?)|'([^'<]*+)('?))?+")
_NO_NAME = frozenset("<>/=\"'")
"""What no name of an attribute has in it."""
_WORD = re.compile(r"[^\s<>/=\"']*+")
_VALUE_WORD = re.compile(r"[^\s<>=\"']*+")
_SEVERAL = re.compile(r"[=\r\n]")
_MOST_ATTRIBUTES = 1_000


class Where(Enum):
    """The kinds of what would be typed at the cursor."""

    CONTENT = "content"
    TAG = "tag"
    END_TAG = "end tag"
    NAME = "name of an attribute"
    VALUE = "value of an attribute"
    OUTSIDE = "outside"
    """A comment, say."""


@dataclass(frozen=True, slots=True)
class Attribute:
    """An attribute as it is written: the offsets of its name and of its value, without quotes."""

    name: str
    value: str
    start: int
    value_start: int
    value_end: int

    @property
    def name_end(self) -> int:
        """The offset after its name."""
        return self.start + len(self.name)


@dataclass(frozen=True, slots=True)
class Tag:
    """A start tag, from ``start`` to ``end``."""

    name: str
    start: int
    end: int
    attributes: Mapping[str, Attribute] = field(default_factory=dict)

    def value(self, name: str) -> str:
        """The value of an attribute, "" if there is none."""
        attribute = self.attributes.get(name)
        return "" if attribute is None else attribute.value


@dataclass(frozen=True, slots=True)
class Cursor:
    """A place in a text.

    ``start`` and ``end`` are what would be replaced by what is typed here. ``tag`` is the start tag
    around it, ``attribute`` the attribute in it. ``open`` are the elements around it, outermost
    first.
    """

    where: Where
    start: int
    end: int
    tag: Tag | None = None
    attribute: Attribute | None = None
    open: tuple[str, ...] = ()


def cursor_at(text: str, offset: int) -> Cursor:
    """The cursor at an offset.

    >>> cursor_at('<Plan><Runner interface="', 25).where.value
    'value of an attribute'
    """
    stack: list[str] = []
    there: Counter[str] = Counter()
    for token in _TOKEN.finditer(text):
        if token.start() >= offset:
            break
        if offset < token.end() or (offset == token.end() and not _closed(token)):
            return _inside(text, offset, token, tuple(stack))
        _count(token, stack, there)
    return Cursor(Where.CONTENT, offset, offset, open=tuple(stack))


def tag_around(text: str, offset: int) -> int | None:
    """The offset of the start tag that an offset is in; None if it is in none."""
    for token in _TOKEN.finditer(text):
        if token.start() > offset:
            break
        if offset < token.end() and token["name"] and not token["slash"]:
            return token.start()
    return None


def _closed(token: re.Match[str]) -> bool:
    """True if a token has its end; without, what is typed after it still belongs to it."""
    if token["name"] is None:
        return token[0].endswith(">")
    return bool(token["end"])


def _count(token: re.Match[str], stack: list[str], there: Counter[str]) -> None:
    """Keep track of the elements that are open after a token; ``there``: how many of each name."""
    name = token["name"]
    if not name:
        return
    if token["slash"]:
        while there[name]:
            last = stack.pop()
            there[last] -= 1
            if last == name:
                break
    elif not token["body"].endswith("/") and (token["end"] or name != "Runner"):
        stack.append(name)
        there[name] += 1


def _inside(text: str, offset: int, token: re.Match[str], stack: tuple[str, ...]) -> Cursor:
    """The cursor at an offset within a token."""
    if token["name"] is None:
        return Cursor(Where.OUTSIDE, offset, offset, open=stack)
    begin = token.start("name")
    if token["slash"]:
        return Cursor(Where.END_TAG, begin, max(offset, token.end("name")), open=stack)
    tag = _tag(token)
    if offset <= token.end("name"):
        return Cursor(Where.TAG, begin, token.end("name"), tag, open=stack)
    for attribute in tag.attributes.values():
        if attribute.value_start <= offset <= attribute.value_end and attribute.value_start:
            start, end = _replaced(text, offset, attribute)
            return Cursor(Where.VALUE, start, end, tag, attribute, stack)
        if attribute.start <= offset <= attribute.name_end:
            start, end = attribute.start, attribute.name_end
            break
    else:
        attribute, (start, end) = None, _word_at(text, offset, begin)
    if text[start - 1] in _NO_NAME or text[begin:start].rstrip()[-1:] in ("=", "/"):
        return Cursor(Where.OUTSIDE, offset, offset, tag, open=stack)
    return Cursor(Where.NAME, start, end, tag, attribute, stack)


def _word_at(text: str, offset: int, begin: int) -> tuple[int, int]:
    """From where to where a name goes that an offset is in, or at the end of."""
    start = offset
    while start > begin and not (text[start - 1].isspace() or text[start - 1] in _NO_NAME):
        start -= 1
    after = _WORD.match(text, offset)
    return start, after.end() if after else offset


def _replaced(text: str, offset: int, attribute: Attribute) -> tuple[int, int]:
    """The part of a value that is replaced: all of it, but not what belongs to something else.

    A value whose quotation mark is missing goes on to the next one. And editors replace within one
    line only.
    """
    start, end = attribute.value_start, attribute.value_end
    before = max(text.rfind("\n", start, offset), text.rfind("\r", start, offset)) + 1
    value = text[start:end]
    whole = text[end : end + 1] in ('"', "'") and not _SEVERAL.search(value)
    if not whole:
        word = _VALUE_WORD.match(text, offset, end)
        end = offset if word is None else word.end()
    return max(start, before), end


def _tag(token: re.Match[str]) -> Tag:
    attributes: dict[str, Attribute] = {}
    body = token["body"]
    shift = token.start("body")
    for each in islice(_ATTRIBUTE.finditer(body), _MOST_ATTRIBUTES):
        group = 3 if each[3] is not None else 5
        quoted = each[group] is not None
        start, end = each.span(group) if quoted else (-shift, -shift)
        value = unescape(each[group]) if quoted else ""
        attribute = Attribute(each[1], value, shift + each.start(), shift + start, shift + end)
        attributes.setdefault(attribute.name, attribute)
    return Tag(token["name"], token.start(), token.end(), attributes)
