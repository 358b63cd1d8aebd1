"""Attribute values in tags that have errors, and where a broken value ends."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.syntax.chars import BLANK, NAME_PATTERN, WHITE, clip
from gpsfsm.syntax.tokens import Fault

if TYPE_CHECKING:
    from gpsfsm.syntax.search import Finder

__all__ = ["RawValue", "read_value"]

_W = f"[{WHITE}]"
_UNQUOTED = re.compile(rf"[^{WHITE}<>\"'=]*+")
_CURLS = "\u201c\u201d\u201e\u201f\u2033\u00ab\u00bb\u2018\u2019\u201a\u2032"  # typographic quotes
_CURLED = re.compile(rf"[{_CURLS}]([^{_CURLS}<>]*+)[{_CURLS}]")
_ESCAPED = re.compile(r"\\([\"'])([^\\<>\"']*+)\\[\"']")
_LINE = re.compile(r"[^<>\n\r]*+")
# A value that runs over the end of its tag into the next one: its closing quote is missing.
_TAG_END = re.compile(rf"/?+>{_W}*+<[A-Za-z/!]")
# A value that ends with ' name=' right before the next quote: likewise.
_NEXT_ATTRIBUTE = re.compile(rf"{_W}++{NAME_PATTERN}{_W}*+={_W}*+\Z")
_AFTER_VALUE = re.compile(rf"{_W}|/|>|\Z")
_TAIL = 200
_MAX_FAULTS = 20


class RawValue(NamedTuple):
    """A value from ``start`` to ``stop``; the tag goes on at ``end``."""

    start: int
    stop: int
    end: int
    faults: list[Fault]


def read_value(text: str, start: int, name: str, finder: Finder) -> RawValue | None:
    """The value of the attribute ``name`` that begins at ``start``; None if there is none."""
    quote = text[start : start + 1]
    if quote and quote in "\"'":
        return _quoted(text, start, name, finder)
    for pattern, what in ((_CURLED, "typographic quotes"), (_ESCAPED, "backslashes")):
        match = pattern.match(text, start)
        if match:
            group = match.lastindex or 1
            length = match.end() - start
            message = f"the value of '{clip(name)}' is written with {what}"
            fault = Fault(start, length, message, 'use plain double quotes: "')
            return RawValue(match.start(group), match.end(group), match.end(), [fault])
    return _unquoted(text, start, name)


def _unquoted(text: str, start: int, name: str) -> RawValue | None:
    match = _UNQUOTED.match(text, start)
    stop = match.end() if match else start
    if text.startswith("/>", stop - 1) and stop > start:
        stop -= 1
    # What an '=' follows is the next attribute, not a value.
    blank = BLANK.match(text, stop)
    if stop == start or text.startswith("=", blank.end() if blank else stop):
        return None
    shown = clip(text[start:stop])
    message = f"the value of '{clip(name)}' is not in quotes"
    fault = Fault(start, stop - start, message, f'write {clip(name)}="{shown}"')
    return RawValue(start, stop, stop, [fault])


def _quoted(text: str, start: int, name: str, finder: Finder) -> RawValue:
    first = start + 1
    close = finder.find(text[start], first)
    if close < 0:
        match = _LINE.match(text, first)
        return _missing_quote(text, start, match.end() if match else first, name)
    less = text.find("<", first, close)
    if not _AFTER_VALUE.match(text, close + 1):
        # What ends here is hardly a value: more likely another one begins.
        overrun = _TAG_END.search(text, first, close)
        if overrun:
            return _missing_quote(text, start, overrun.start(), name)
        following = _NEXT_ATTRIBUTE.search(text, max(first, close - _TAIL), close)
        if following:
            return _missing_quote(text, start, following.start(), name)
    faults: list[Fault] = []
    while 0 <= less < close and len(faults) < _MAX_FAULTS:
        message = f"'<' is not allowed in the value of '{clip(name)}'"
        faults.append(Fault(less, 1, message, "write '&lt;'"))
        less = text.find("<", less + 1, close)
    return RawValue(first, close, close + 1, faults)


def _missing_quote(text: str, start: int, stop: int, name: str) -> RawValue:
    if text.startswith("/>", stop - 1) and stop > start + 1:
        stop -= 1
    while stop > start + 1 and text[stop - 1] in WHITE:
        stop -= 1
    quote = text[start]
    message = f"the value of '{clip(name)}' has no closing {quote}"
    fault = Fault(start, stop - start, message, f"add {quote} at its end")
    return RawValue(start + 1, stop, stop, [fault])
