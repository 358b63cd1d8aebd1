"""GP101, GP110: quotes, signs and references of start tags."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import QUOTES, attribute_end, escaped_raw
from gpsfsm.syntax.tags import read_start_tag
from gpsfsm.syntax.text import WHITE, Finder
from gpsfsm.syntax.tokens import StartTag
from gpsfsm.syntax.values import decode_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.syntax.tokens import Fault, RawAttribute

_BETWEEN = re.compile(rf"[{WHITE}=,;/{re.escape(QUOTES)}]*+")
_LONG_VALUE = re.compile(rf"[{WHITE}]")


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per tag that has errors which leave no doubt what was meant."""
    for tag in draft.tokens:
        if not isinstance(tag, StartTag) or not tag.closed:
            continue
        if tag.faults or _bad_references(draft, tag):
            fix = _repaired(draft, tag)
            if fix is not None:
                yield fix


def _bad_references(draft: Draft, tag: StartTag) -> bool:
    text = draft.readable
    if text.find("&", tag.start, tag.end) < 0:
        return False
    faults: list[Fault] = []
    for raw in tag.attributes:
        decode_value(text[raw.value_start : raw.value_end], raw.value_start, faults)
    return bool(faults)


def _repaired(draft: Draft, tag: StartTag) -> Fix | None:
    """The tag written anew: white space and order stay, only what is wrong is spelt otherwise."""
    text, options = draft.text, draft.options
    rules = {fault.rule for fault in tag.faults}
    duplicates = _duplicates(draft, tag)
    if duplicates is None:
        return None
    position = tag.start + 1 + len(tag.name)
    parts = [text[tag.start : position]]
    unsafe = False
    for raw in sorted([*tag.attributes, *duplicates], key=lambda each: each.start):
        between = text[position : raw.start]
        if not _BETWEEN.fullmatch(between):
            return None  # something stands there whose meaning nobody can tell
        after = attribute_end(text, raw)
        if raw in duplicates:
            position = after
            continue
        value = text[raw.value_start : raw.value_end]
        unsafe |= _guessed(text, raw) and bool(_LONG_VALUE.search(value))
        parts += (_blank(between), _written(text, raw, value))
        position = after
    tail = text[position : tag.end]
    if not _BETWEEN.fullmatch(tail.rstrip(">")):
        return None
    blank = tail[: len(tail) - len(tail.lstrip(WHITE))]
    parts.append(f"{blank}{'/' if tag.empty else ''}>")
    repaired = "".join(parts)
    again = read_start_tag(repaired, 0, Finder(repaired), options.limits)
    if not isinstance(again, StartTag) or again.faults or again.empty is not tag.empty:
        return None
    rule = "GP110" if rules == {"GP110"} else "GP101"
    safety = Safety.UNSAFE if unsafe or _differ(draft, tag, duplicates) else Safety.SAFE
    at = min((fault.start for fault in tag.faults), default=tag.start)
    title = "repeated attribute removed" if rule == "GP110" else f"<{tag.name[:40]}> spelt right"
    return Fix(rule, title, at, (Edit(tag.start, tag.end, repaired),), safety)


def _duplicates(draft: Draft, tag: StartTag) -> list[RawAttribute] | None:
    """The attributes that the front end leaves out, as they would be read alone."""
    repeated: list[RawAttribute] = []
    for fault in tag.faults:
        if fault.rule != "GP110":
            continue
        end = fault.start + fault.length
        alone = f"<a {draft.text[fault.start : end]}/>"
        read = read_start_tag(alone, 0, Finder(alone), draft.options.limits)
        if not isinstance(read, StartTag) or len(read.attributes) != 1 or read.faults:
            return None
        shift = fault.start - 3
        raw = read.attributes[0]
        repeated.append(
            raw._replace(
                start=fault.start,
                value_start=raw.value_start + shift,
                value_end=raw.value_end + shift,
            )
        )
    return repeated


def _differ(draft: Draft, tag: StartTag, duplicates: list[RawAttribute]) -> bool:
    """True if a repeated attribute says something else than the first of its name."""
    text = draft.text
    first = {raw.name: text[raw.value_start : raw.value_end] for raw in tag.attributes}
    return any(first.get(raw.name) != text[raw.value_start : raw.value_end] for raw in duplicates)


def _guessed(text: str, raw: RawAttribute) -> bool:
    """True if the value has no closing quote, so that its end is a guess."""
    opened = text[raw.value_start - 1 : raw.value_start]
    return opened in ("'", '"') and text[raw.value_end : raw.value_end + 1] != opened


def _blank(between: str) -> str:
    """The white space before an attribute, at least one blank."""
    return "".join(character for character in between if character in WHITE) or " "


def _written(text: str, raw: RawAttribute, value: str) -> str:
    quote = text[raw.value_start - 1]
    kept = quote in ("'", '"') and text[raw.value_start - 2] != "\\"
    quote = quote if kept else '"'
    signs = text[raw.start + len(raw.name) : raw.value_start]
    equals = signs.rstrip("".join(QUOTES))
    equals = equals if equals.count("=") == 1 else "="
    return f"{raw.name}{equals}{quote}{escaped_raw(value, quote)}{quote}"


FIXER = Fixer(
    name="start-tags",
    rules=("GP101", "GP110"),
    propose=propose,
    safe=(
        "puts quotes, `=`, blanks and references right where only one reading is left, and drops "
        "an attribute that is repeated with the same value"
    ),
    unsafe=(
        "closes a value of several words where the next attribute begins, and keeps the first of "
        "two attributes of one name that differ: where the value ends, or which counts, is a guess"
    ),
)
