"""Plans as the original engines read them: with the parser TinyXML-2, release 11.

It takes much that is no XML (text around the plan, bare ``&`` and ``<``, white space where XML has
none) and refuses some that is. What is here behaves the same; ``tests/syntax/tinyxml`` compares it
with the library itself. Texts and their values come first, then the tree of a text or its error,
then the plan in that tree.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from gpsfsm.errors import InputError
from gpsfsm.model.engine import (
    Content,
    ContentKind,
    EngineAttribute,
    EngineDocument,
    EngineElement,
    Unreadable,
)
from gpsfsm.model.plan import Attribute, ControlType, Element, Kind, Plan
from gpsfsm.syntax.source import DEFAULT_LIMITS
from gpsfsm.syntax.text import Lines
from gpsfsm.syntax.values import typed

if TYPE_CHECKING:
    from gpsfsm.syntax.source import Limits

# ---- Texts and attribute values ------------------------------------------------------------------
# The parser decodes references in place, in bytes, and has quirks that change what a runner gets:
#
# - a reference that it does not know stays as it is, but if something before it has become shorter,
#   its ``&`` turns into the byte that stood where the decoded text ends;
# - the digits of a number are read backwards from the next ``;``, wherever that is, to the nearest
#   ``#`` or ``x``; ``&#;`` is the number 0;
# - a value ends at its first NUL, and ``&#0;`` is one;
# - an ``&#`` at the end of a value loses its ``&``.
#
# ``&lt;abc&d`` becomes ``<abcad``: ``&lt;`` has become one byte, so that the reader is three bytes
# ahead of the writer; the unknown ``&`` is the fifth byte written, and in the source that is ``a``.


_ENTITIES = {b"quot": b'"', b"amp": b"&", b"apos": b"'", b"lt": b"<", b"gt": b">"}
_CHARACTERS = re.compile(rb"&(quot|amp|apos|lt|gt);")
_LINE_ENDS = re.compile("\r\n?|\n\r?")
_MAX_CODE_POINT = 0x10FFFF
_WORD = 0xFFFFFFFF  # numbers are read into 32 bits, and the excess is lost
_HEX = {ord(digit): int(digit, 16) for digit in "0123456789abcdefABCDEF"}
_DECIMAL = {ord(digit): int(digit) for digit in "0123456789"}
_SURROGATES = "surrogatepass"
_AMPERSAND, _CR, _LF = b"&\r\n"
_SPECIAL = re.compile(rb"[&\r\n]")


def to_bytes(text: str) -> bytes:
    """The bytes that an engine gets for ``text``; surrogates stand for bytes that are no UTF-8."""
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # other surrogates: from "\ud800" in JSON, for instance
        return b"".join(
            each.encode("utf-8", "surrogateescape" if "\udc80" <= each <= "\udcff" else _SURROGATES)
            for each in text
        )


def to_text(data: bytes) -> str:
    """The text of some bytes; those that are no UTF-8 become surrogates."""
    return data.decode("utf-8", "surrogateescape")


def normalized(raw: str) -> str:
    r"""A text without references: pairs of CR and LF in any order, and single ones, become LF."""
    return _LINE_ENDS.sub("\n", raw) if "\r" in raw else raw


def decode(raw: str) -> str:
    r"""The value of what stands between quotes, or of a text.

    >>> decode("1 &lt; 2 &#233; &c;\r\n"), decode("&lt;abc&d")
    ('1 < 2 é &c;\n', '<abcad')
    """
    if "&" not in raw:
        return normalized(raw)
    data = to_bytes(raw)
    numbers = _Numbers(data)
    out = bytearray()
    at, size = 0, len(data)
    while at < size:
        special = _next_special(data, at)
        out += data[at:special]
        at = special
        if at == size:
            break
        byte = data[at]
        if byte != _AMPERSAND:
            out.append(_LF)
            other = _LF if byte == _CR else _CR
            at += 2 if data[at + 1 : at + 2] == bytes((other,)) else 1
        elif data[at + 1 : at + 2] == b"#":
            character, at = numbers.read(at)
            out += character
        else:
            at = _named(data, at, out)
    value = bytes(out)
    end = value.find(0)
    return to_text(value if end < 0 else value[:end])


def _next_special(data: bytes, at: int) -> int:
    match = _SPECIAL.search(data, at)
    return match.start() if match else len(data)


def _named(data: bytes, at: int, out: bytearray) -> int:
    """A named reference at ``at``, or what is none; where to go on."""
    match = _CHARACTERS.match(data, at)
    if match is None:
        # The reader and the writer step on without a copy. While both are at the same place that
        # keeps the '&'; else the byte stays that the buffer holds there, which is the source's.
        out.append(data[len(out)])
        return at + 1
    out += _ENTITIES[match[1]]
    return match.end()


class _Numbers:
    """The numeric references of one value.

    What a number is depends on the next ``;`` and the base only, so it is remembered: a value of
    many ``&#`` and one ``;`` is read in one go.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._semicolon = -1
        self._read: dict[bool, bytes | None] = {}

    def read(self, at: int) -> tuple[bytes, int]:
        """The bytes that the reference at ``at`` stands for, and where to go on."""
        data = self._data
        if at + 2 >= len(data):
            return b"", at + 1
        is_hex = data[at + 2] == ord("x")
        start = at + 3 if is_hex else at + 2
        if start > self._semicolon:
            place = data.find(b";", start)
            self._semicolon = place if place >= 0 else len(data)
            self._read = {}
        if self._semicolon == len(data) or start >= len(data):
            return b"&", at + 1
        if is_hex not in self._read:
            self._read[is_hex] = _character(data, self._semicolon, is_hex=is_hex)
        character = self._read[is_hex]
        return (b"&", at + 1) if character is None else (character, self._semicolon + 1)


def _character(data: bytes, semicolon: int, *, is_hex: bool) -> bytes | None:
    """The character whose number ends at ``semicolon``; None if there is no number."""
    digits = _HEX if is_hex else _DECIMAL
    base, terminator = (16, ord("x")) if is_hex else (10, ord("#"))
    total, weight, at = 0, 1, semicolon - 1
    while data[at] != terminator:
        digit = digits.get(data[at])
        if digit is None:
            return None
        total = (total + weight * digit) & _WORD
        weight = min(weight * base, _MAX_CODE_POINT)
        at -= 1
    if total > _MAX_CODE_POINT:
        return None
    return chr(total).encode("utf-8", _SURROGATES)


# ---- The tree of the text, or its error, and the plan in that tree -------------------------------
# The library recurses; here is one loop with a stack of open elements. Two things follow from how
# it does it: an end tag is read like a start tag, attributes and all; and an end tag at the
# outermost level ends the parsing silently, whatever comes after it.


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
_BLANKS = r"[ \t\n\v\f\r]*+"
_SPACE = re.compile(_BLANKS)

# Whatever is not ASCII may stand in a name.
_NAMED = "[A-Za-z_:\x80-\U0010ffff][A-Za-z0-9_:.\\-\x80-\U0010ffff]*+"
_NAME = re.compile(_NAMED)
_ATTRIBUTE = re.compile(rf"({_NAMED}){_BLANKS}={_BLANKS}(?:\"([^\"]*+)\"|'([^']*+)')")


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
    except WrongError as wrong:
        line = text.count("\n", 0, wrong.line_of) + 1 if wrong.line_of >= 0 else 0
        return Unreadable(wrong.name, line, wrong.offset, str(wrong))


def read_elements(text: str, limits: Limits) -> list[tuple[str, int, list[tuple[str, str]]]] | None:
    """The elements of ``text`` as an engine reads them; None if it refuses the text.

    Of each element: the tag, the place of the element around it in this list, and the attributes.

    >>> from gpsfsm.syntax.source import Limits
    >>> read_elements("go <a><b c='&'/></a>", Limits())
    [('a', -1, []), ('b', 0, [('c', '&')])]
    """
    try:
        document = parse_document(text, limits)
    except InputError:
        return None
    if isinstance(document, Unreadable):
        return None
    elements = [each for each in document.nodes if isinstance(each, EngineElement)]
    places = {-1: -1} | {each.index: place for place, each in enumerate(elements)}
    return [
        (each.tag, places[each.parent], [(one.name, one.value) for one in each.attributes])
        for each in elements
    ]


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
            raise WrongError("XML_ERROR_EMPTY_DOCUMENT", at, "the text is empty", line_of=-1)
        while True:
            start = skip_space(text, at)
            if start == len(text):
                break
            after = self._node(at, start)
            if after is None:
                break
            at = after
        if self._open:
            self._ended(self._open[-1].tag)
        nodes = tuple(node for node in self._nodes if node is not None)
        assert len(nodes) == len(self._nodes)
        return EngineDocument(nodes, tuple(self._roots))

    def _ended(self, inner: Tag) -> NoReturn:
        """The text has ended inside an element."""
        # An end right behind the '>' is told as if the wrong end tag had come.
        name = "XML_ERROR_MISMATCHED_ELEMENT" if inner.end == len(self._text) else _PARSING
        raise WrongError(name, inner.start, f"<{inner.name}> is never closed", line_of=inner.start)

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
            raise WrongError("XML_ELEMENT_DEPTH_EXCEEDED", tag.start, message, line_of=tag.end)

    def _end_tag(self, tag: Tag) -> int | None:
        if not self._open:
            return None
        element = self._open.pop()
        expected = element.tag
        if tag.name != expected.name:
            message = f"</{tag.name}> does not close <{expected.name}>"
            raise WrongError(
                "XML_ERROR_MISMATCHED_ELEMENT", tag.start, message, line_of=expected.start
            )
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
            raise WrongError(
                error, start, f"'{mark}' has no '{end_mark}' that closes it", line_of=start
            )
        if kind is ContentKind.DECLARATION and (self._open or not self._only_declarations):
            message = "a declaration stands behind something else"
            raise WrongError(error, start, message, line_of=start)
        stop = end + len(end_mark)
        self._add(kind, normalized(text[begin:end]), start, stop)
        return stop

    def _text_node(self, begin: int, start: int) -> int:
        """Text; the white space before it belongs to it."""
        end = self._text.find("<", begin)
        if end < 0:
            message = "no element follows this text"
            raise WrongError("XML_ERROR_PARSING_TEXT", start, message, line_of=start)
        if end + 1 == len(self._text):
            raise WrongError(_PARSING, end, "nothing follows this '<'", line_of=start)
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


class WrongError(Exception):
    """An error that the parser reports.

    ``name`` is its name of the error; ``line_of`` the offset whose line it reports, -1 for none;
    ``offset`` where the text is wrong.
    """

    def __init__(self, name: str, offset: int, message: str, *, line_of: int) -> None:
        super().__init__(message)
        self.name, self.offset, self.line_of = name, offset, line_of


@dataclass(slots=True)
class Tag:
    """A start tag, an end tag (``closing``) or one that is both (``empty``)."""

    name: str
    start: int
    closing: bool
    attributes: list[EngineAttribute]
    end: int = 0
    empty: bool = False


def skip_space(text: str, at: int) -> int:
    """The offset of the first character from ``at`` that is no white space."""
    match = _SPACE.match(text, at)
    assert match
    return match.end()


def read_tag(text: str, start: int, max_attributes: int) -> Tag:
    """The tag whose ``<`` is at ``start``; raises WrongError.

    Raises InputError for more attributes than ``max_attributes``.
    """
    at = skip_space(text, start + 1)
    closing = text.startswith("/", at)
    name = _NAME.match(text, at + closing)
    if name is None:
        message = "no name of an element follows this '<'"
        raise WrongError("XML_ERROR_PARSING", start, message, line_of=start)
    tag = Tag(name[0], start, closing, [])
    _attributes(text, name.end(), tag, max_attributes)
    return tag


def _attributes(text: str, at: int, tag: Tag, max_attributes: int) -> None:
    """Read on to the end of the tag."""
    names: set[str] = set()
    while True:
        at = skip_space(text, at)
        match = _ATTRIBUTE.match(text, at)
        if match is None:
            break
        name, double, single = match.groups()
        if name in names:
            message = f"<{tag.name}> has the attribute '{name}' twice"
            raise WrongError("XML_ERROR_PARSING_ATTRIBUTE", at, message, line_of=at)
        if len(names) >= max_attributes:
            line = text.count("\n", 0, at) + 1
            raise InputError(
                f"line {line}: <{tag.name}> has more than {max_attributes:,} attributes; raise "
                "--max-attributes if it is meant to"
            )
        names.add(name)
        value = decode(single if double is None else double)
        tag.attributes.append(EngineAttribute(name, value, at, match.end()))
        at = match.end()
    if text.startswith(">", at):
        tag.end = at + 1
    elif text.startswith("/>", at):
        # Also of an end tag: </a/> is an element.
        tag.end, tag.empty, tag.closing = at + 2, True, False
    else:
        _no_end(text, at, tag)


def _no_end(text: str, at: int, tag: Tag) -> NoReturn:
    """Raise WrongError: at ``at`` a tag neither ends nor has an attribute that is whole."""
    name = _NAME.match(text, at)
    if name is None:
        message = f"the tag <{tag.name}> does not end here"
        if at == len(text):
            message = f"the text ends inside the tag <{tag.name}>"
        raise WrongError("XML_ERROR_PARSING_ELEMENT", at, message, line_of=tag.start)
    sign = skip_space(text, name.end())
    quote = skip_space(text, sign + 1)
    what = f"the attribute '{name[0]}' of <{tag.name}>"
    if not text.startswith("=", sign):
        message = f"no '=' follows {what}"
    elif not text.startswith(('"', "'"), quote):
        message = f"the value of {what} is not in quotes"
    else:
        message = f"the quotes around the value of {what} are never closed"
    raise WrongError("XML_ERROR_PARSING_ATTRIBUTE", at, message, line_of=at)


BOM = "\ufeff"
_TYPES = {kind.value: kind for kind in ControlType}
_HOLDERS = (Kind.PLAN, Kind.CONTROL)


def position(text: str, offset: int) -> tuple[int, int]:
    """Line and column of an offset in an engine's text; its byte order mark does not count."""
    shift = len(BOM) if text.startswith(BOM) else 0
    return Lines(text[shift:]).position(max(offset - shift, 0))


def plan_of(
    document: EngineDocument, root: int, text: str, file: str
) -> tuple[Plan, dict[int, int]]:
    """The plan below the element ``root``, and where its elements are in the plan.

    The second result maps indices of ``document`` to indices of ``Plan.elements``. What the engine
    passes over is not in the plan: what is in runners, elements that it does not know, and controls
    whose type it does not know.
    """
    maker = _Maker(text)
    maker.add(document.element(root), -1, 1)
    # Levels of (index in the plan, elements ahead of it), the innermost last.
    levels = [(0, iter(document.elements(document.element(root).children)))]
    counts: list[dict[str, int]] = [{}]
    while levels:
        parent, ahead = levels[-1]
        element = next(ahead, None)
        if element is None:
            levels.pop()
            counts.pop()
            continue
        ordinal = counts[-1][element.tag] = counts[-1].get(element.tag, 0) + 1
        index = maker.add(element, parent, ordinal)
        if index is not None and maker.kinds[index] in _HOLDERS:
            levels.append((index, iter(document.elements(element.children))))
            counts.append({})
    return maker.plan(file), maker.places


class _Maker:
    def __init__(self, text: str) -> None:
        self._shift = len(BOM) if text.startswith(BOM) else 0
        self._lines = Lines(text[self._shift :])
        self._entries: list[tuple[EngineElement, int, int]] = []
        self._children: list[list[int]] = []
        self.kinds: list[Kind] = []
        self.places: dict[int, int] = {}

    def add(self, element: EngineElement, parent: int, ordinal: int) -> int | None:
        """The index of a new element of the plan; None if a plan has no such element."""
        if element.tag == Kind.PLAN and parent < 0:
            kind = Kind.PLAN
        elif element.tag == Kind.RUNNER:
            kind = Kind.RUNNER
        elif element.tag == Kind.CONTROL and element.text("type") in _TYPES:
            kind = Kind.CONTROL
        else:
            return None
        index = len(self._entries)
        self._entries.append((element, parent, ordinal))
        self._children.append([])
        self.kinds.append(kind)
        self.places[element.index] = index
        if parent >= 0:
            self._children[parent].append(index)
        return index

    def plan(self, file: str) -> Plan:
        return Plan(file, tuple(self._element(index) for index in range(len(self._entries))))

    def _element(self, index: int) -> Element:
        element, parent, ordinal = self._entries[index]
        kind = self.kinds[index]
        control_type = None
        if kind is Kind.PLAN:
            control_type = ControlType.SEQUENTIAL
        elif kind is Kind.CONTROL:
            control_type = _TYPES[element.text("type") or ""]
        line, column = self._lines.position(element.start - self._shift)
        return Element(
            index,
            kind,
            parent,
            ordinal,
            tuple(self._children[index]),
            self._attributes(element),
            line,
            column,
            element.start - self._shift,
            element.end - self._shift,
            control_type,
        )

    def _attributes(self, element: EngineElement) -> tuple[Attribute, ...]:
        attributes = []
        for each in element.attributes:
            line, column = self._lines.position(each.start - self._shift)
            attributes.append(Attribute(each.name, each.value, typed(each.value), line, column))
        return tuple(attributes)
