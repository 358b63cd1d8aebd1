"""The tolerant scanner: text → tags, texts, comments, declarations, each with its errors.

lxml is the authority on what is well-formed, but it names neither columns nor, after the first
error, what was meant. This scanner does both; a property test holds it against lxml. It reads from
left to right and never goes back: whatever is at a place becomes one token, which ends behind it.

``a < b <Runner x=1>`` becomes
    TextRun  ``a < b ``          fault: this '<' begins no tag
    StartTag ``<Runner x=1>``    fault: the value of 'x' is not in quotes
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.late import pattern
from gpsfsm.syntax.tags import read_end_tag, read_start_tag
from gpsfsm.syntax.text import BLANK, NAME_PATTERN, NAME_START, WHITE, Finder, clip
from gpsfsm.syntax.tokens import Comment, Fault, Markup, OverLimit, TextRun, Token

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.syntax.source import Limits

_LONE = rf"<(?![/!?]|{NAME_START})"
_TEXT = pattern(rf"(?:[^<]++|{_LONE})++")
_TAG = pattern("<[A-Za-z_:/!?]")  # most tokens: told without the whole alphabet of XML
_LONE_LESS = pattern(_LONE)
_SPACED_TAG = pattern(rf"<[{WHITE}]{{1,20}}/?[A-Z][A-Za-z0-9_]*[{WHITE}/>]")
"""A tag but for the space; names of elements begin with a capital, ``a < b`` does not."""
_MAX_FAULTS = 20
_W = f"[{WHITE}]"
_VALUE = r"(?:\"{0}\"|'{0}')"
_DECLARATION = pattern(
    rf"<\?xml{_W}++version{_W}*+={_W}*+{_VALUE.format('1[.][0-9]*+')}"
    rf"(?:{_W}++encoding{_W}*+={_W}*+{_VALUE.format('[A-Za-z][A-Za-z0-9._-]*+')})?+"
    rf"(?:{_W}++standalone{_W}*+={_W}*+{_VALUE.format('(?:yes|no)')})?+{_W}*+\?>"
)
_INSTRUCTION = pattern(rf"<\?({NAME_PATTERN})(?:\?>|{_W})")
_XML_TARGET = pattern(rf"<\?(?i:xml)(?={_W}|\?|>)")
_TO_END = pattern(r"<[^<>]*+>?+")
_DOCTYPE = pattern(r"<!(?i:doctype)")
_DEFINITION = pattern(r"<!(?:ENTITY|ELEMENT|ATTLIST|NOTATION)")
_DOCTYPE_WHOLE = pattern(
    r"<!(?i:doctype)(?:[^\"'\[<>]++|\"[^\"]*+\"|'[^']*+')*+"
    r"(?:\[(?:<!--(?:[^-]++|-(?!->))*+-->|[^\"'\]]|\"[^\"]*+\"|'[^']*+')*+\][^\"'\[<>]*+)?+>"
)
_DOCTYPE_HINT = "remove it: a plan needs no DOCTYPE, and gpsfsm never reads or expands one"


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
        assert token.end > pos  # every token takes something, so the scan ends
        pos = token.end


def _token(text: str, pos: int, finder: Finder, limits: Limits) -> Token:
    """The token at ``pos``, which is not blank."""
    run = None if _TAG.match(text, pos) else _TEXT.match(text, pos)
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
        message = f"this '<' does not begin a tag: '{shown}'"
        hint = spaced_tag_hint(text, match.start()) or "write '&lt;', or remove it"
        faults.append(Fault(match.start(), 1, message, hint))
    return faults


def spaced_tag_hint(text: str, less: int) -> str:
    """The advice for ``< Name``, which is meant as a tag; "" for any other '<'.

    >>> spaced_tag_hint("a < b", 2), spaced_tag_hint("< Runner/>", 0)
    ('', "remove the space after '<'")
    """
    return "remove the space after '<'" if _SPACED_TAG.match(text, less) else ""


def read_bang(text: str, start: int, finder: Finder) -> Comment | TextRun | Markup:
    """The token that begins with ``<!`` at ``start``."""
    if text.startswith("<!--", start):
        return _comment(text, start, finder)
    if text.startswith("<![CDATA[", start):
        end = finder.find("]]>", start + 9)
        if end < 0:
            fault = Fault(start, 9, "a CDATA section is never closed with ']]>'", "remove it")
            return TextRun(start, len(text), cdata=True, faults=[fault])
        return TextRun(start, end + 3, cdata=True, faults=[])
    if _DOCTYPE.match(text, start):
        return _doctype(text, start, finder)
    end = _end_of(_TO_END, text, start)
    shown = clip(text[start:end], 30)
    if _DEFINITION.match(text, start):
        message = f"a plan must not define entities or document types: '{shown}'"
        return Markup(start, end, [Fault(start, end - start, message, _DOCTYPE_HINT, "GP102")])
    if text[start + 2 : start + 5].lower() == "xml":
        hint = 'write an XML declaration as <?xml version="1.0" encoding="UTF-8"?>'
    else:
        hint = "remove it, or write a comment as <!-- like this -->"
    fault = Fault(start, end - start, f"'{shown}' is not XML", hint)
    return Markup(start, end, [fault])


def read_instruction(text: str, start: int, finder: Finder) -> Markup:
    """The token that begins with ``<?``: the XML declaration or a processing instruction."""
    if _XML_TARGET.match(text, start):
        return _declaration(text, start)
    end = finder.find("?>", start + 2)
    if end < 0:
        stop = _end_of(_TO_END, text, start)
        shown = clip(text[start:stop], 30)
        fault = Fault(start, stop - start, f"'{shown}' is never closed with '?>'", "remove it")
        return Markup(start, stop, [fault])
    match = _INSTRUCTION.match(text, start)
    if match and ":" not in match[1]:
        return Markup(start, end + 2, [])
    shown = clip(text[start : end + 2], 30)
    fault = Fault(start, end + 2 - start, f"'{shown}' is not XML", "remove it")
    return Markup(start, end + 2, [fault])


def _end_of(pattern: re.Pattern[str], text: str, start: int) -> int:
    match = pattern.match(text, start)
    return match.end() if match else start + 1


def _comment(text: str, start: int, finder: Finder) -> Comment:
    end = finder.find("-->", start + 4)
    if end < 0:
        fault = Fault(start, 4, "a comment is never closed with '-->'", "add '-->' at its end")
        return Comment(start, len(text), len(text), [fault])
    # One further character: a comment must not end in '--->' either.
    dashes = text.find("--", start + 4, end + 1)
    if dashes < 0:
        return Comment(start, end + 3, end, [])
    message = "'--' is not allowed inside a comment"
    return Comment(start, end + 3, end, [Fault(dashes, 2, message, "write a single dash")])


def _declaration(text: str, start: int) -> Markup:
    match = _DECLARATION.match(text, start)
    if match and start == 0:
        return Markup(start, match.end(), [])
    end = _end_of(_TO_END, text, start)
    if match or (start > 0 and text.startswith("?>", end - 2)):
        message = "an XML declaration is allowed only at the very start of the text"
        hint = "remove it, or remove everything before it, even spaces and empty lines"
    elif not text.startswith("?>", end - 2):
        message = "the XML declaration does not end in '?>'"
        hint = 'write <?xml version="1.0" encoding="UTF-8"?>'
    else:
        message = f"this XML declaration is malformed: '{clip(text[start:end], 60)}'"
        hint = 'write <?xml version="1.0" encoding="UTF-8"?>, or remove it'
    return Markup(start, end, [Fault(start, end - start, message, hint)])


def _doctype(text: str, start: int, finder: Finder) -> Markup:
    message = "a DOCTYPE is not allowed: it can make a parser read files or exhaust its memory"
    match = _DOCTYPE_WHOLE.match(text, start) if finder.find(">", start) >= 0 else None
    if match:
        length = match.end() - start
        return Markup(start, match.end(), [Fault(start, length, message, _DOCTYPE_HINT, "GP102")])
    message += "; this one is never closed either, so the rest cannot be read"
    fault = Fault(start, 9, message, _DOCTYPE_HINT, "GP102")
    return Markup(start, len(text), [fault], swallowed=True)
