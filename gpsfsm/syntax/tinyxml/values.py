r"""Texts and attribute values: line ends and references, decoded the way the engines' parser does.

It decodes in place, in bytes, and has quirks that change what a runner gets:

- a reference that it does not know stays as it is, but if something before it has become shorter,
  its ``&`` turns into the byte that stood where the decoded text ends;
- the digits of a number are read backwards from the next ``;``, wherever that is, to the nearest
  ``#`` or ``x``; ``&#;`` is the number 0;
- a value ends at its first NUL, and ``&#0;`` is one;
- an ``&#`` at the end of a value loses its ``&``.

``&lt;abc&d`` becomes ``<abcad``: ``&lt;`` has become one byte, so that the reader is three bytes
ahead of the writer; the unknown ``&`` is the fifth byte written, and in the source that is ``a``.
"""

from __future__ import annotations

import re

_ENTITIES = {b"quot": b'"', b"amp": b"&", b"apos": b"'", b"lt": b"<", b"gt": b">"}
_NAMED = re.compile(rb"&(quot|amp|apos|lt|gt);")
_LINE_ENDS = re.compile("\r\n?|\n\r?")
_MAX_CODE_POINT = 0x10FFFF
_WORD = 0xFFFFFFFF  # numbers are read into 32 bits, and the excess is lost
_HEX = {ord(digit): int(digit, 16) for digit in "0123456789abcdefABCDEF"}
_DECIMAL = {ord(digit): int(digit) for digit in "0123456789"}
_PASS = "surrogatepass"  # noqa: S105  (the name of an error handler)
_AMPERSAND, _CR, _LF = b"&\r\n"
_SPECIAL = re.compile(rb"[&\r\n]")


def to_bytes(text: str) -> bytes:
    """The bytes that an engine gets for ``text``; surrogates stand for bytes that are no UTF-8."""
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # other surrogates: from "\ud800" in JSON, for instance
        return b"".join(
            each.encode("utf-8", "surrogateescape" if "\udc80" <= each <= "\udcff" else _PASS)
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
    match = _NAMED.match(data, at)
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
    return chr(total).encode("utf-8", _PASS)
