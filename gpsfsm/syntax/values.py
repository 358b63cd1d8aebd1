"""Attribute values: references such as ``&amp;`` decoded, and types as Fabric reads them."""

from __future__ import annotations

import re
from functools import lru_cache
from math import isinf
from typing import TYPE_CHECKING

from gpsfsm.late import pattern
from gpsfsm.syntax.text import ILLEGAL, clip
from gpsfsm.syntax.tokens import Fault

if TYPE_CHECKING:
    from gpsfsm.model.plan import Value

_BLANKS = " \\t\\n\\r\\v\\f"  # what C's isspace skips before a number
_INTEGER = pattern(rf"[{_BLANKS}]*+([+-]?+)0*+([0-9]*+)")
_FLOAT = pattern(
    rf"[{_BLANKS}]*+[+-]?+(?:"
    r"(?P<hex>0[xX](?:[0-9a-fA-F]++(?:\.[0-9a-fA-F]*+)?+|\.[0-9a-fA-F]++)(?:[pP][+-]?+[0-9]++)?+)"
    r"|(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?+"
    r"|(?P<infinite>(?i:inf(?:inity)?+))|(?P<nan>(?i:nan)(?:\([0-9A-Za-z_]*+\))?+))"
)
_INT64 = 2**63
_CACHED_LENGTH = 80
_NAMED = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}
_REFERENCE = pattern(r"&(?:(lt|gt|amp|quot|apos);|#(?:([0-9]++)|x([0-9A-Fa-f]++));)?+")
_WORD = pattern(r"&#?+[0-9A-Za-z_]*+;?+")
_MAX_FAULTS = 20  # per value: a value of 60,000 ampersands needs no 60,000 messages
_MAX_DIGITS = 7  # U+10FFFF has seven decimal digits


def decode(raw: str, offset: int, faults: list[Fault]) -> str:
    """``raw`` with its references decoded; what is no reference stays as it is written.

    ``offset`` is where ``raw`` begins in the text; errors are appended to ``faults``.

    >>> decode("a &lt; b &#233;", 0, [])
    'a < b é'
    """
    if "&" not in raw:
        return raw
    before = len(faults)

    def replace(match: re.Match[str]) -> str:
        named, decimal, hexadecimal = match.groups()
        if named:
            return _NAMED[named]
        character = _character(decimal, 10) or _character(hexadecimal, 16)
        if character:
            return character
        faults.append(_fault(raw, match, offset))
        if len(faults) - before >= _MAX_FAULTS:
            raise _TooManyError
        return match[0]

    try:
        return _REFERENCE.sub(replace, raw)
    except _TooManyError:
        return raw


def decode_value(raw: str, offset: int, faults: list[Fault]) -> str:
    """An attribute value: white space becomes blanks, as XML has it, then ``decode``."""
    if "\n" in raw or "\r" in raw or "\t" in raw:
        # References come after: an encoded line end (&#10;) is meant and stays one.
        cleaned = raw.replace("\r\n", "\n").replace("\r", " ").replace("\n", " ").replace("\t", " ")
        if "&" in raw:
            decode(raw, offset, faults)  # for the true places of the errors
        return decode(cleaned, offset, [])
    return decode(raw, offset, faults)


def _character(digits: str | None, base: int) -> str:
    """The character of a numeric reference; "" if XML has none of that number."""
    significant = (digits or "").lstrip("0")
    if not significant or len(significant) > _MAX_DIGITS:
        return ""
    number = int(significant, base)
    if number > 0x10FFFF:
        return ""
    character = chr(number)
    return "" if ILLEGAL.match(character) else character


def _fault(raw: str, match: re.Match[str], offset: int) -> Fault:
    start = offset + match.start()
    word = _WORD.match(raw, match.start())
    written = word[0] if word else "&"
    name = written[1:].rstrip(";")
    if written.startswith("&#"):
        return Fault(
            start,
            len(written),
            f"'{clip(written)}' does not denote a character that XML allows",
            "write the character itself, or its code, as in &#233;",
        )
    for entity in ("lt", "gt", "amp", "quot", "apos"):
        if name.startswith(entity) and not written.endswith(";"):
            return Fault(
                start,
                1 + len(entity),
                f"'&{entity}' lacks its semicolon",
                f"write '&{entity};'",
            )
    if name and written.endswith(";"):
        return Fault(
            start,
            len(written),
            f"unknown entity '{clip(written)}': only &lt; &gt; &amp; &quot; &apos; are defined",
            "write the character itself; for a plain '&' write '&amp;'",
        )
    return Fault(start, 1, "a lone '&' is not allowed in XML", "write '&amp;'")


class _TooManyError(Exception):
    """Leaves a value that is full of errors; never leaves this module."""


def typed(text: str) -> Value:
    """The typed reading of an attribute value; never fails.

    Exactly ``true`` or ``false`` is a Boolean; what C's ``strtoll`` reads entirely and within 64
    bits is an integer; what ``strtod`` reads entirely and without overflow is a float; everything
    else is text.

    >>> typed("true"), typed("007"), typed("1e3"), typed("0x1F"), typed("1_000"), typed("")
    (True, 7, 1000.0, 31.0, '1_000', '')
    """
    return _cached(text) if len(text) <= _CACHED_LENGTH else _typed(text)


def _typed(text: str) -> Value:
    if text in ("true", "false"):
        return text == "true"
    if not text or text[-1] not in "0123456789abcdefABCDEF.nNyY)":
        return text  # most text values end here, cheaply
    number = _INTEGER.fullmatch(text)
    # Nineteen digits fit every 64-bit integer, and keep clear of Python's limit on int().
    if number and text[-1] in "0123456789" and len(number[2]) <= 19:
        value = int(number[1] + (number[2] or "0"))
        if -_INT64 <= value < _INT64:
            return value
    match = _FLOAT.fullmatch(text)
    if match is None:
        return text
    if match["nan"]:
        return float("nan")
    return _float(text, match)


def _float(text: str, match: re.Match[str]) -> Value:
    try:
        result = float.fromhex(text.strip()) if match["hex"] else float(text)
    except OverflowError:
        return text
    return text if isinf(result) and not match["infinite"] else result


_cached = lru_cache(maxsize=4096)(_typed)
