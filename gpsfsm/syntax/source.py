"""Texts of plans as bytes: encodings, errors where one does not fit, limits on hostile input."""

from __future__ import annotations

import codecs
from dataclasses import fields

from gpsfsm.errors import InputError, UsageError, misused
from gpsfsm.late import dataclass, pattern
from gpsfsm.syntax.text import Lines
from gpsfsm.syntax.tokens import Fault

# Names of encodings as XML declarations write them, and Python's codecs. A list of what is
# allowed: Python knows codecs (UTF-7, punycode, …) with which a text can hide what it says.
_ENCODINGS = {
    "utf-8": "utf-8",
    "utf8": "utf-8",
    "utf-16": "utf-16",
    "utf-16le": "utf-16-le",
    "utf-16be": "utf-16-be",
    "us-ascii": "ascii",
    "ascii": "ascii",
    "iso-8859-1": "latin-1",
    "latin1": "latin-1",
    "iso-8859-15": "iso-8859-15",
    "windows-1252": "cp1252",
    "cp1252": "cp1252",
}
_BOMS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_UTF32 = (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE, b"<\0\0\0", b"\0\0\0<")
_DECLARED = pattern(rb"<\?xml[^>]{0,200}?\sencoding\s*=\s*[\"']([^\"'<>]{0,40})[\"']")
_HINT = "save the file as UTF-8"


@dataclass(frozen=True, slots=True)
class Source:
    """A text without its byte order mark; ``text`` is None where there is none to read.

    ``fault`` is what is wrong with it, at (``line``, ``column``); ``over`` tells of a limit.
    """

    text: str | None
    fault: Fault | None = None
    line: int = 1
    column: int = 1
    over: bool = False


def read_source(data: str | bytes, limits: Limits) -> Source:
    """The text of ``data``, decoded by byte order mark or XML declaration, else as UTF-8."""
    if _too_long(data, limits):
        message = f"the text is longer than {limits.max_bytes:,} bytes"
        hint = "raise --max-bytes if the plan is meant to be that long"
        return Source(None, Fault(0, 0, message, hint, "GP103"), over=True)
    if isinstance(data, str):
        return Source(data.removeprefix("\ufeff"))
    if data.startswith(_UTF32):
        return Source(None, _fault(0, 0, "the text is UTF-32, which gpsfsm cannot read"))
    encoding = _by_mark(data)
    if encoding:
        return _decode(data, encoding)
    match = _DECLARED.match(data.lstrip(b" \t\r\n")[:400])
    declared = match[1].decode("ascii", "replace").strip() if match else "utf-8"
    codec = _ENCODINGS.get(declared.lower().replace("_", "-"))
    if codec is None:
        message = f"the text declares the encoding '{declared}', which gpsfsm cannot read"
        return _at(data, declared, None, message)
    if codec.startswith("utf-16"):
        # The declaration could be read byte by byte, so the text is anything but UTF-16.
        decoded = _decode(data, "utf-8")
        message = f"the text declares the encoding '{declared}', but is not encoded in it"
        return decoded if decoded.fault else _at(data, declared, decoded.text, message)
    return _decode(data, codec)


def _too_long(data: str | bytes, limits: Limits) -> bool:
    if len(data) > limits.max_bytes:
        return True
    if isinstance(data, bytes) or data.isascii() or 4 * len(data) <= limits.max_bytes:
        return False
    return len(data.encode("utf-8", "surrogatepass")) > limits.max_bytes


def _by_mark(data: bytes) -> str:
    """The encoding that the first bytes give away."""
    for mark, encoding in _BOMS:
        if data.startswith(mark):
            return encoding
    # A '<' in UTF-16 without a byte order mark (XML 1.0, appendix F).
    if data[:2] == b"<\0":
        return "utf-16-le"
    return "utf-16-be" if data[:2] == b"\0<" else ""


def _decode(data: bytes, encoding: str) -> Source:
    try:
        return Source(data.decode(encoding).removeprefix("\ufeff"))
    except UnicodeDecodeError as error:
        before = data[: error.start].decode(encoding, "replace").removeprefix("\ufeff")
        line, column = Lines(before).position(len(before))
        byte = f"0x{data[error.start]:02X}"
        name = {"utf-16-le": "UTF-16", "utf-16-be": "UTF-16", "cp1252": "windows-1252"}
        shown = name.get(encoding, encoding.upper())
        message = f"the byte {byte} (byte {error.start + 1:,} of the text) is not valid {shown}"
        hint = _HINT
        if encoding == "utf-8":
            hint += ', or declare its encoding: <?xml version="1.0" encoding="windows-1252"?>'
        return Source(None, _fault(0, 0, message, hint), line, column)


def _at(data: bytes, declared: str, text: str | None, message: str) -> Source:
    """A problem at the name of the encoding in the XML declaration."""
    head = data[:600].decode("latin-1")
    start = head.find(declared, head.find("encoding"))
    line, column = Lines(head).position(max(start, 0))
    return Source(text, _fault(0, len(declared), message), line, column)


def _fault(start: int, length: int, message: str, hint: str = _HINT) -> Fault:
    return Fault(start, length, message, hint, "GP116")


_CANDIDATES = (
    ("utf-8", b""),
    ("utf-8", codecs.BOM_UTF8),
    ("utf-16-le", codecs.BOM_UTF16_LE),
    ("utf-16-be", codecs.BOM_UTF16_BE),
    ("utf-16-le", b""),
    ("utf-16-be", b""),
    ("latin-1", b""),
    ("iso-8859-15", b""),
    ("cp1252", b""),
)


def encoded(text: str, original: bytes, was: str) -> bytes:
    """``text`` as bytes, in the encoding in which ``was`` is the text of ``original``.

    Raises InputError where the bytes would not be read as ``text`` again.
    """
    limits = Limits(max_bytes=max(4 * len(text) + 4, 1))
    for codec, mark in _CANDIDATES:
        if not original.startswith(mark) or not _same(was, original[len(mark) :], codec):
            continue
        try:
            data = mark + text.encode(codec)
        except UnicodeEncodeError:
            continue
        if read_source(data, limits).text == text:
            return data
    raise InputError("the fixed text cannot be written in the encoding of the file")


def _same(text: str, data: bytes, codec: str) -> bool:
    try:
        return text.encode(codec) == data
    except UnicodeEncodeError:
        return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The limits of the parser. A larger plan is not parsed, and finding GP103 says why.

    ``max_attributes`` is per element, ``max_attribute_length`` in code points of the source, and
    ``max_problems`` the number of problems that are listed per rule.

    >>> Limits(max_depth=5).max_elements
    250000
    """

    max_bytes: int = 64 * 1024 * 1024
    max_depth: int = 200
    max_elements: int = 250_000
    max_attributes: int = 200
    max_attribute_length: int = 65_536
    max_problems: int = 100

    def __post_init__(self) -> None:
        """Refuse limits that would refuse every plan."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, int) or isinstance(value, bool):
                raise misused("Limits", f"a whole number as {field.name}", value)
            if value < 1:
                raise UsageError(f"the limit {field.name} must be at least 1")

    @property
    def max_markup(self) -> int:
        """The most tags, comments and texts, which ``max_elements`` does not limit."""
        return 4 * self.max_elements + 1000


DEFAULT_LIMITS = Limits()
