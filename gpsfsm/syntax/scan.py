"""The tolerant scanner: text → tags, texts, comments, each with its errors.

lxml is the authority on what is well-formed, but it names neither columns nor, after the first
error, what was meant. This scanner does both; a property test holds it against lxml.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.syntax.chars import BLANK, NAME_START, clip
from gpsfsm.syntax.markup import read_bang, read_instruction
from gpsfsm.syntax.search import Finder
from gpsfsm.syntax.tags import read_end_tag, read_start_tag
from gpsfsm.syntax.tokens import Fault, OverLimit, TextRun, Token

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.syntax.limits import Limits

__all__ = ["scan"]

_LONE = rf"<(?![/!?]|{NAME_START})"
_TEXT = re.compile(rf"(?:[^<]++|{_LONE})++")
_LONE_LESS = re.compile(_LONE)
_MAX_FAULTS = 20


def scan(text: str, limits: Limits) -> Iterator[Token]:
    """The tokens of ``text`` in order; blank text is left out. Ends early at a limit."""
    finder = Finder(text)
    pos, size = 0, len(text)
    left = limits.max_markup
    while True:
        blank = BLANK.match(text, pos)
        pos = blank.end() if blank else pos
        if pos >= size:
            return
        left -= 1
        if left < 0:
            message = "the text has too many tags, comments and texts"
            yield OverLimit(pos, message, "max-elements")
            return
        token = _token(text, pos, finder, limits)
        yield token
        if isinstance(token, OverLimit):
            return
        pos = token.end


def _token(text: str, pos: int, finder: Finder, limits: Limits) -> Token:
    """The token at ``pos``, which is not blank."""
    run = _TEXT.match(text, pos)
    if run:
        return TextRun(pos, run.end(), cdata=False, faults=_lone_less(text, pos, run.end()))
    following = text[pos + 1 : pos + 2]
    if following == "/":
        return read_end_tag(text, pos)
    if following == "!":
        return read_bang(text, pos, finder)
    if following == "?":
        return read_instruction(text, pos, finder)
    return read_start_tag(text, pos, finder, limits)


def _lone_less(text: str, start: int, end: int) -> list[Fault]:
    """The errors of '<' that begin no tag."""
    faults: list[Fault] = []
    for match in _LONE_LESS.finditer(text, start, end):
        if len(faults) == _MAX_FAULTS:
            break
        shown = clip(text[match.start() : match.start() + 12])
        message = f"this '<' begins no tag: '{shown}'"
        faults.append(Fault(match.start(), 1, message, "write '&lt;', or remove it"))
    return faults
