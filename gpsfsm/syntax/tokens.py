"""Tokens of a text, with their faults. All numbers are code point offsets; ends are exclusive."""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """One error of the text itself, already repaired by the scanner."""

    start: int
    length: int
    message: str
    hint: str
    rule: str = "GP101"


class RawAttribute(NamedTuple):
    """An attribute; ``value_start`` and ``value_end`` enclose the value without its quotes."""

    name: str
    start: int
    value_start: int
    value_end: int


class StartTag(NamedTuple):
    """``<name …>`` or ``<name …/>``; ``closed`` is False where the final ``>`` is missing."""

    start: int
    end: int
    name: str
    attributes: list[RawAttribute]
    empty: bool
    faults: list[Fault]
    closed: bool = True


class EndTag(NamedTuple):
    """``</name>``; the name is "" where it cannot be read."""

    start: int
    end: int
    name: str
    faults: list[Fault]


class TextRun(NamedTuple):
    """Text that is not blank, from its first character on; or a CDATA section."""

    start: int
    end: int
    cdata: bool
    faults: list[Fault]


class Comment(NamedTuple):
    """``<!-- … -->``; ``body_end`` is where the words end."""

    start: int
    end: int
    body_end: int
    faults: list[Fault]


class Markup(NamedTuple):
    """A processing instruction, XML declaration, DOCTYPE or something that is none of these.

    ``swallowed`` tells that it has no end, so that the rest of the text belongs to it.
    """

    start: int
    end: int
    faults: list[Fault]
    swallowed: bool = False


class OverLimit(NamedTuple):
    """A limit was hit; the scan ends here."""

    start: int
    message: str
    option: str


Token = StartTag | EndTag | TextRun | Comment | Markup | OverLimit
