"""GP101, GP104: blanks in tags, tags without an end, end tags that do not fit."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import indentation, line_end, whole_lines
from gpsfsm.syntax.text import WHITE
from gpsfsm.syntax.tokens import EndTag, TextRun

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node

_SPACED = re.compile(rf"<[{WHITE}]++(/?+)[{WHITE}]*+(Plan|Control|Runner)\b")
_RUNNER = "runner"


def propose(draft: Draft) -> Iterator[Fix]:
    """Fixes of tags, in no order."""
    yield from _spaced(draft)
    yield from _end_tags(draft)
    for node in draft.outline.nodes.values():
        if not node.tag.closed:
            yield from _unclosed_tag(draft, node)
        elif node.ended_by is not None:
            yield from _never_closed(draft, node)
        elif node.closing is not None and node.closing.name not in ("", node.name):
            edit = Edit(node.closing.start, node.closing.end, f"</{node.name}>")
            yield Fix("GP101", f"end tag written </{node.name[:40]}>", node.closing.start, (edit,))
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
            yield Fix(rule, f"blanks removed after '<' of {match[2]}", match.start(), (edit,))


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
        yield Fix("GP101", f"end tag written </{node.name[:40]}>", tag.start, (edit,))


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


FIXER = Fixer(
    name="tags",
    rules=("GP101", "GP104"),
    propose=propose,
    safe=(
        "removes blanks after `<`, ends a tag that lacks its `>`, closes a runner that was left "
        "open, writes a misspelt end tag right: no other reading makes a plan of the text"
    ),
    unsafe=(
        "adds the end tag of a control where the indentation ends, and removes an end tag that "
        "closes nothing: what belongs into a control is a guess then"
    ),
)
