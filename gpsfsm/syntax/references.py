"""``&amp;`` and its like: decoding, and what is wrong with the others."""

from __future__ import annotations

import re

from gpsfsm.syntax.chars import ILLEGAL, clip
from gpsfsm.syntax.tokens import Fault

__all__ = ["decode", "decode_value"]

_NAMED = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}
_REFERENCE = re.compile(r"&(?:(lt|gt|amp|quot|apos);|#(?:([0-9]++)|x([0-9A-Fa-f]++));)?+")
_WORD = re.compile(r"&#?+[0-9A-Za-z_]*+;?+")
_MAX_FAULTS = 20  # per value: a value of 60,000 ampersands needs no 60,000 messages
_MAX_DIGITS = 7  # U+10FFFF has seven decimal digits


class _TooManyError(Exception):
    """Leaves a value that is full of errors; never leaves this module."""


def decode(raw: str, offset: int, faults: list[Fault]) -> str:
    """``raw`` with its references decoded; what is no reference stays as it is written.

    ``offset`` is where ``raw`` begins in the text; errors are appended to ``faults``.

    >>> decode("a &lt; b &#233;", 0, [])
    'a < b é'
    """
    if "&" not in raw:
        return raw
    known = len(faults)

    def replace(match: re.Match[str]) -> str:
        named, decimal, hexadecimal = match.groups()
        if named:
            return _NAMED[named]
        character = _character(decimal, 10) or _character(hexadecimal, 16)
        if character:
            return character
        faults.append(_fault(raw, match, offset))
        if len(faults) - known >= _MAX_FAULTS:
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
            f"'{clip(written)}' does not stand for a character that XML allows",
            "write the character itself, or its number as in &#233;",
        )
    for known in ("lt", "gt", "amp", "quot", "apos"):
        if name.startswith(known) and not written.endswith(";"):
            return Fault(
                start,
                1 + len(known),
                f"'&{known}' lacks its semicolon",
                f"write '&{known};'",
            )
    if name and written.endswith(";"):
        return Fault(
            start,
            len(written),
            f"'{clip(written)}' is unknown: a plan knows &lt; &gt; &amp; &quot; &apos; only",
            "write the character itself; for a plain '&' write '&amp;'",
        )
    return Fault(start, 1, "a lone '&' is not allowed in XML", "write '&amp;'")
