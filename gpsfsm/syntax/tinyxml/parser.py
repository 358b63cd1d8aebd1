"""From text to the tree of the engines' parser, or to the error that it reports.

The library recurses; here is one loop with a stack of open elements. Two things follow from how it
does it: an end tag is read like a start tag, attributes and all; and an end tag at the outermost
level ends the parsing silently, whatever comes after it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NoReturn

from gpsfsm.errors import InputError
from gpsfsm.model.engine import Content, ContentKind, EngineDocument, EngineElement, Unreadable
from gpsfsm.syntax.limits import DEFAULT_LIMITS
from gpsfsm.syntax.tinyxml.tags import Tag, Wrong, read_tag, skip_space
from gpsfsm.syntax.tinyxml.values import decode, normalized

if TYPE_CHECKING:
    from gpsfsm.syntax.limits import Limits

__all__ = ["MAX_DEPTH", "parse_document"]

MAX_DEPTH = 500
"""Levels, the document being the first, at which the parser gives up."""

_PARSING = "XML_ERROR_PARSING"
_MARKS = (  # in the order in which they are tried; all others are elements
    ("<?", ContentKind.DECLARATION, "?>", "XML_ERROR_PARSING_DECLARATION"),
    ("<!--", ContentKind.COMMENT, "-->", "XML_ERROR_PARSING_COMMENT"),
    ("<![CDATA[", ContentKind.CDATA, "]]>", "XML_ERROR_PARSING_CDATA"),
    ("<!", ContentKind.UNKNOWN, ">", "XML_ERROR_PARSING_UNKNOWN"),
)
_NUL = re.compile("\0")


def parse_document(text: str, limits: Limits = DEFAULT_LIMITS) -> EngineDocument | Unreadable:
    """Read ``text`` as the engines do; never fails on bad input, but says what they say.

    Offsets are code points of ``text``, in which a byte order mark counts. Raises InputError for a
    text with more nodes than ``limits`` allow: what an engine would make of it is not known then.

    >>> parse_document("<Plan><Runner></Plan>").name
    'XML_ERROR_MISMATCHED_ELEMENT'
    """
    nul = _NUL.search(text)
    if nul:  # the text is passed as a C string
        text = text[: nul.start()]
    try:
        return _Parser(text, limits).parse()
    except Wrong as wrong:
        line = text.count("\n", 0, wrong.told) + 1 if wrong.told >= 0 else 0
        return Unreadable(wrong.name, line, wrong.offset, str(wrong))


class _Open:
    """An element whose end tag has not come yet."""

    __slots__ = ("attributes", "children", "index", "parent", "tag")

    def __init__(self, index: int, tag: Tag, parent: int) -> None:
        self.index, self.tag, self.parent = index, tag, parent
        self.children: list[int] = []

    def close(self) -> EngineElement:
        tag = self.tag
        return EngineElement(
            self.index,
            tag.name,
            tuple(tag.attributes),
            self.parent,
            tuple(self.children),
            tag.start,
            tag.end,
        )


class _Parser:
    def __init__(self, text: str, limits: Limits) -> None:
        self._text = text
        self._limits = limits
        self._nodes: list[EngineElement | Content | None] = []
        self._open: list[_Open] = []
        self._roots: list[int] = []
        self._only_declarations = True

    def parse(self) -> EngineDocument:
        text = self._text
        at = skip_space(text, 0)
        at += text.startswith("\ufeff", at)
        if at == len(text):
            raise Wrong("XML_ERROR_EMPTY_DOCUMENT", at, "the text is empty", told=-1)
        while True:
            start = skip_space(text, at)
            if start == len(text):
                break
            found = self._node(at, start)
            if found is None:
                break
            at = found
        if self._open:
            self._ended(self._open[-1].tag)
        nodes = tuple(node for node in self._nodes if node is not None)
        assert len(nodes) == len(self._nodes)
        return EngineDocument(nodes, tuple(self._roots))

    def _ended(self, inner: Tag) -> NoReturn:
        """The text has ended inside an element."""
        # An end right behind the '>' is told as if the wrong end tag had come.
        name = "XML_ERROR_MISMATCHED_ELEMENT" if inner.end == len(self._text) else _PARSING
        raise Wrong(name, inner.start, f"<{inner.name}> is never closed", told=inner.start)

    def _node(self, before: int, start: int) -> int | None:
        """Read the node at ``start``, behind white space from ``before``; None: parsing is over."""
        text = self._text
        if text[start] != "<":
            return self._text_node(before, start)
        if text.startswith(("?", "!"), start + 1):
            return self._marked(start)
        tag = read_tag(text, start, self._limits.max_attributes)
        if tag.closing:
            return self._end_tag(tag)
        index = self._number(start)
        element = _Open(index, tag, self._open[-1].index if self._open else -1)
        if tag.empty:
            self._nodes[index] = element.close()
        else:
            self._nest(element)
        return tag.end

    def _nest(self, element: _Open) -> None:
        self._open.append(element)
        tag = element.tag
        if tag.end < len(self._text) and len(self._open) + 1 >= MAX_DEPTH:
            message = f"the elements are nested {len(self._open)} deep"
            raise Wrong("XML_ELEMENT_DEPTH_EXCEEDED", tag.start, message, told=tag.end)

    def _end_tag(self, tag: Tag) -> int | None:
        if not self._open:
            return None
        element = self._open.pop()
        expected = element.tag
        if tag.name != expected.name:
            message = f"</{tag.name}> does not close <{expected.name}>"
            raise Wrong("XML_ERROR_MISMATCHED_ELEMENT", tag.start, message, told=expected.start)
        self._nodes[element.index] = element.close()
        return tag.end

    def _marked(self, start: int) -> int:
        text = self._text
        mark, kind, end_mark, error = next(
            each for each in _MARKS if text.startswith(each[0], start)
        )
        begin = start + len(mark)
        end = text.find(end_mark, begin)
        if end < 0:
            raise Wrong(error, start, f"'{mark}' has no '{end_mark}' that closes it", told=start)
        if kind is ContentKind.DECLARATION and (self._open or not self._only_declarations):
            message = "a declaration stands behind something else"
            raise Wrong(error, start, message, told=start)
        stop = end + len(end_mark)
        self._add(kind, normalized(text[begin:end]), start, stop)
        return stop

    def _text_node(self, begin: int, start: int) -> int:
        """Text; the white space before it belongs to it."""
        end = self._text.find("<", begin)
        if end < 0:
            message = "no element follows this text"
            raise Wrong("XML_ERROR_PARSING_TEXT", start, message, told=start)
        if end + 1 == len(self._text):
            raise Wrong(_PARSING, end, "nothing follows this '<'", told=start)
        self._add(ContentKind.TEXT, decode(self._text[begin:end]), begin, end)
        return end

    def _add(self, kind: ContentKind, value: str, start: int, end: int) -> None:
        index = self._number(start, declares=kind is ContentKind.DECLARATION)
        parent = self._open[-1].index if self._open else -1
        self._nodes[index] = Content(index, kind, value, parent, start, end)

    def _number(self, start: int, *, declares: bool = False) -> int:
        """The index of a new node below the innermost open element."""
        index = len(self._nodes)
        if index >= self._limits.max_markup:
            allowed = self._limits.max_elements
            line = self._text.count("\n", 0, start) + 1
            raise InputError(
                f"line {line}: the text has too many elements, comments and texts to be read as an "
                f"engine would; raise --max-elements, which is {allowed:,}"
            )
        self._nodes.append(None)
        (self._open[-1].children if self._open else self._roots).append(index)
        self._only_declarations &= declares
        return index
