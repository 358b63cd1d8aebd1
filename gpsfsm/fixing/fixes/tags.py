"""Tags: quotes, signs and references in them, missing and superfluous ones."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import (
    QUOTES,
    attribute_end,
    escaped_raw,
    indentation,
    line_end,
    whole_lines,
)
from gpsfsm.syntax.tags import read_start_tag
from gpsfsm.syntax.text import WHITE, Finder
from gpsfsm.syntax.tokens import EndTag, StartTag, TextRun
from gpsfsm.syntax.values import decode_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node
    from gpsfsm.syntax.tokens import Fault, RawAttribute


_BETWEEN = re.compile(rf"[{WHITE}=,;/{re.escape(QUOTES)}]*+")
_LONE_AND = re.compile(r"&(?![#A-Za-z])")
_LONG_VALUE = re.compile(rf"[{WHITE}]")


def _start_tags(draft: Draft) -> Iterator[Fix]:
    """Quotes, signs and references: one fix per tag whose errors leave no doubt what is meant."""
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
        parts += (_blank(between), _written_attribute(text, raw, value))
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
    return Fix(rule, _title(draft, tag, rule), at, (Edit(tag.start, tag.end, repaired),), safety)


def _title(draft: Draft, tag: StartTag, rule: str) -> str:
    """The change in one line: a tag without other faults had only its references mended."""
    shown = f"<{tag.name[:40]}>"
    if rule == "GP110":
        return "repeated attribute removed"
    if tag.faults:
        return f"syntax of {shown} corrected"
    values = [draft.text[raw.value_start : raw.value_end] for raw in tag.attributes]
    lone = all(
        escaped_raw(value, '"') == _LONE_AND.sub("&amp;", value).replace('"', "&quot;")
        for value in values
    )
    return f"'&' changed to '&amp;' in {shown}" if lone else f"references fixed in {shown}"


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


def _written_attribute(text: str, raw: RawAttribute, value: str) -> str:
    quote = text[raw.value_start - 1]
    kept = quote in ("'", '"') and text[raw.value_start - 2] != "\\"
    quote = quote if kept else '"'
    signs = text[raw.start + len(raw.name) : raw.value_start]
    equals = signs.rstrip("".join(QUOTES))
    equals = equals if equals.count("=") == 1 else "="
    return f"{raw.name}{equals}{quote}{escaped_raw(value, quote)}{quote}"


_SPACED = re.compile(rf"<[{WHITE}]++(/?+)[{WHITE}]*+(Plan|Control|Runner)\b")
_RUNNER = "runner"


def _tags(draft: Draft) -> Iterator[Fix]:
    """Blanks in tags, tags without an end, end tags that do not fit: fixes in no order."""
    yield from _spaced(draft)
    yield from _end_tags(draft)
    for node in draft.outline.nodes.values():
        if not node.tag.closed:
            yield from _unclosed_tag(draft, node)
        elif node.ended_by is not None:
            yield from _never_closed(draft, node)
        elif node.closing is not None and node.closing.name not in ("", node.name):
            edit = Edit(node.closing.start, node.closing.end, f"</{node.name}>")
            yield Fix(
                "GP101", f"end tag changed to </{node.name[:40]}>", node.closing.start, (edit,)
            )
    for tag, top in draft.outline.superfluous:
        beside = top.children[-1] if top and top.children else None
        own = beside is not None and beside.name == tag.name
        own = own and not draft.text[beside.stop : tag.start].strip(WHITE) if beside else False
        safety = Safety.SAFE if own and tag.name.lower() == _RUNNER else Safety.UNSAFE
        edit = Edit(*whole_lines(draft.text, tag.start, tag.end))
        yield Fix("GP101", f"</{tag.name[:40]}> removed", tag.start, (edit,), safety)


def _spaced(draft: Draft) -> Iterator[Fix]:
    for run in draft.tokens:
        if not isinstance(run, TextRun) or run.cdata:
            continue
        for match in _SPACED.finditer(draft.text, run.start, run.end):
            edit = Edit(match.start(), match.start(2), "<" + match[1])
            rule = "GP101" if draft.wants("GP101") else "GP104"
            yield Fix(rule, f"white space removed after '<' of {match[2]}", match.start(), (edit,))


def _end_tags(draft: Draft) -> Iterator[Fix]:
    """End tags that hold more than a name, or lack their '>'."""
    open_at: dict[int, Node] = {
        node.closing.start: node for node in draft.outline.nodes.values() if node.closing
    }
    for tag in draft.tokens:
        if not isinstance(tag, EndTag) or not tag.faults:
            continue
        node = open_at.get(tag.start)
        if node is None:
            continue
        body = draft.text[tag.start + 2 : tag.end].rstrip(">")
        # What else stands in an end tag means nothing; a line end shows that '>' is missing.
        end = tag.end
        if not draft.text.startswith(">", tag.end - 1):
            end = tag.start + 2 + len(body.rstrip(WHITE))
        edit = Edit(tag.start, end, f"</{node.name}>")
        yield Fix("GP101", f"end tag changed to </{node.name[:40]}>", tag.start, (edit,))


def _unclosed_tag(draft: Draft, node: Node) -> Iterator[Fix]:
    """A start tag without its '>'; at the end of the text it is cut off, which is another fix."""
    text, end = draft.text, node.tag.end
    while text[end - 1] in WHITE:
        end -= 1
    leaf = node.name.lower() == _RUNNER
    following = text[node.tag.end :].lstrip(WHITE)
    if not following:
        return
    closed_itself = re.match(rf"</{re.escape(node.name)}[{WHITE}]*>", following) is not None
    ending = "/>" if leaf and not closed_itself else ">"
    title = f"<{node.name[:40]}> ended with '{ending}'"
    yield Fix("GP101", title, node.start, (Edit(end, end, ending),))


def _never_closed(draft: Draft, node: Node) -> Iterator[Fix]:
    """An element that another element's end tag ends."""
    text, tag = draft.text, node.tag
    if node.name.lower() == _RUNNER:
        if text.startswith("/", tag.end - 2):
            return
        end = tag.end - 1
        title = "runner closed with '/>'"
        yield Fix("GP101", title, node.start, (Edit(end, end, "/"),))
        return
    place = _end_by_indentation(draft, node)
    before = indentation(text, node.start)
    written = f"</{node.name}>"
    line = indentation(text, place)
    if before is not None and line is not None:
        place -= len(line)
        written = f"{before}{written}{line_end(text)}"
    title = f"</{node.name[:40]}> added"
    yield Fix("GP101", title, node.start, (Edit(place, place, written),), Safety.UNSAFE)


def _end_by_indentation(draft: Draft, node: Node) -> int:
    """The probable end of an element: before the first that is not indented deeper."""
    assert node.ended_by is not None
    own = indentation(draft.text, node.start)
    if own is not None:
        for child in node.children:
            its = indentation(draft.text, child.start)
            if its is not None and len(its) <= len(own):
                return child.start
    return node.ended_by.start


def _truncated_plan(draft: Draft) -> Iterator[Fix]:
    """A text that ends too early: close what is open, leave out a tag that is cut off."""
    nodes = [node for node in draft.outline.nodes.values() if node.unfinished]
    last = draft.tokens[-1] if draft.tokens else None
    cut = isinstance(last, StartTag) and not last.closed
    if cut and last is not None:
        nodes = [node for node in nodes if node.start != last.start]
        inside = draft.outline.nodes[last.start].parent
        if inside is None:
            return
    if not nodes:
        return
    text = draft.text
    end = len(text.rstrip(WHITE)) if not cut or last is None else last.start
    while end > 0 and text[end - 1] in WHITE:
        end -= 1
    written = ""
    for node in reversed(nodes):
        before = indentation(text, node.start)
        written += (
            f"</{node.name}>" if before is None else f"{line_end(text)}{before}</{node.name}>"
        )
    edit = Edit(end, len(text) if cut else end, written + (line_end(text) if cut else ""))
    title = "open elements closed" + (", truncated tag removed" if cut else "")
    yield Fix("GP101", title, end, (edit,), Safety.UNSAFE)


FIXERS = (
    Fixer(
        name="start-tags",
        trees=True,
        rules=("GP101", "GP110"),
        propose=_start_tags,
        safe=(
            "corrects quotes, `=`, spaces and references where only one reading is possible, and "
            "drops an attribute that is repeated with the same value"
        ),
        unsafe=(
            "closes a value of several words where the next attribute begins, and keeps the first "
            "of two attributes with the same name but different values: where the value ends, or "
            "which value counts, is a guess"
        ),
    ),
    Fixer(
        name="tags",
        trees=True,
        rules=("GP101", "GP104"),
        propose=_tags,
        safe=(
            "removes spaces after `<`, ends a tag that lacks its `>`, closes a runner that was "
            "left open, and corrects a misspelt end tag: no other reading makes the text a plan"
        ),
        unsafe=(
            "adds the end tag of a control where the indentation ends, and removes an end tag that "
            "closes nothing: which elements belong in the control is a guess"
        ),
    ),
    Fixer(
        name="truncated-plan",
        trees=True,
        rules=("GP101",),
        propose=_truncated_plan,
        unsafe=(
            "closes the open elements of a text that ends too early, and removes a tag that is cut "
            "off: the missing rest is lost"
        ),
    ),
)
