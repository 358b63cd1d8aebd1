"""What is at a place of a text that may be half written: the tag, the attribute, the value.

The front end reads whole texts and mends what is wrong with them. While somebody types, the text is
wrong right where the cursor is, and what counts is what stands before it.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from enum import Enum
from html import unescape
from itertools import islice
from typing import TYPE_CHECKING

from gpsfsm.syntax.chars import NAME_PATTERN

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["Attribute", "Cursor", "Tag", "Where", "cursor_at", "tag_around"]

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
    """What would be typed at the cursor."""

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
        found = self.attributes.get(name)
        return "" if found is None else found.value


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
    """What is at an offset.

    >>> cursor_at('<Plan><Runner interface="', 25).where.value
    'value of an attribute'
    """
    stack: list[str] = []
    there: Counter[str] = Counter()
    for found in _TOKEN.finditer(text):
        if found.start() >= offset:
            break
        if offset < found.end() or (offset == found.end() and not _closed(found)):
            return _inside(text, offset, found, tuple(stack))
        _count(found, stack, there)
    return Cursor(Where.CONTENT, offset, offset, open=tuple(stack))


def tag_around(text: str, offset: int) -> int | None:
    """Where the start tag begins that an offset is in; None if it is in none."""
    for found in _TOKEN.finditer(text):
        if found.start() > offset:
            break
        if offset < found.end() and found["name"] and not found["slash"]:
            return found.start()
    return None


def _closed(found: re.Match[str]) -> bool:
    """Whether a token has its end; without, what is typed after it still belongs to it."""
    if found["name"] is None:
        return found[0].endswith(">")
    return bool(found["end"])


def _count(found: re.Match[str], stack: list[str], there: Counter[str]) -> None:
    """Keep track of the elements that are open after a token; ``there``: how many of each name."""
    name = found["name"]
    if not name:
        return
    if found["slash"]:
        while there[name]:
            last = stack.pop()
            there[last] -= 1
            if last == name:
                break
    elif not found["body"].endswith("/") and (found["end"] or name != "Runner"):
        stack.append(name)
        there[name] += 1


def _inside(text: str, offset: int, found: re.Match[str], stack: tuple[str, ...]) -> Cursor:
    """What is at an offset within a token."""
    if found["name"] is None:
        return Cursor(Where.OUTSIDE, offset, offset, open=stack)
    begin = found.start("name")
    if found["slash"]:
        return Cursor(Where.END_TAG, begin, max(offset, found.end("name")), open=stack)
    tag = _tag(found)
    if offset <= found.end("name"):
        return Cursor(Where.TAG, begin, found.end("name"), tag, open=stack)
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
    """What of a value is replaced: all of it, but not what belongs to something else.

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


def _tag(found: re.Match[str]) -> Tag:
    attributes: dict[str, Attribute] = {}
    body = found["body"]
    shift = found.start("body")
    for each in islice(_ATTRIBUTE.finditer(body), _MOST_ATTRIBUTES):
        group = 3 if each[3] is not None else 5
        quoted = each[group] is not None
        start, end = each.span(group) if quoted else (-shift, -shift)
        value = unescape(each[group]) if quoted else ""
        attribute = Attribute(each[1], value, shift + each.start(), shift + start, shift + end)
        attributes.setdefault(attribute.name, attribute)
    return Tag(found["name"], found.start(), found.end(), attributes)
