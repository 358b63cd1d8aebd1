"""Edits that keep the layout: whole lines, indentation, quoted values, units that move as a whole.

A unit is an element with the recoveries right behind it.
"""

from __future__ import annotations

import re
from html.entities import html5
from typing import TYPE_CHECKING

from gpsfsm.compile.units import is_recovery
from gpsfsm.fixing.fixer import Edit
from gpsfsm.syntax.text import WHITE
from gpsfsm.syntax.tokens import Comment

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.fixing.draft import Draft, Node
    from gpsfsm.model.plan import Element
    from gpsfsm.syntax.tokens import RawAttribute

QUOTES = "\"'\u201c\u201d\u201e\u201f\u2033\u00ab\u00bb\u2018\u2019\u201a\u2032\\"
"""All that people and programs write around values."""

_REFERENCE = re.compile(
    r"&(?:(?:lt|gt|amp|quot|apos);|#[0-9]{1,7};|#x[0-9A-Fa-f]{1,6};"
    r"|(?P<html>[A-Za-z][A-Za-z0-9]{1,30};)|(?P<cut>lt|gt|amp|quot|apos))?+"
)


def escaped(value: str) -> str:
    """A decoded value as it is written between double quotes."""
    for character, written in (("&", "&amp;"), ("<", "&lt;"), ('"', "&quot;")):
        value = value.replace(character, written)
    return re.sub(r"[\t\r\n]", lambda match: f"&#{ord(match[0])};", value)


def escaped_raw(raw: str, quote: str) -> str:
    """A value as somebody wrote it, with references that XML knows and nothing that ends it.

    Names of HTML characters become their numbers; every other lone ``&`` stands for itself.

    >>> escaped_raw("a & b &lt c&nbsp;d &amp; &x;", '"')
    'a &amp; b &lt; c&#160;d &amp; &amp;x;'
    """

    def replace(match: re.Match[str]) -> str:
        if match["cut"]:
            return f"&{match['cut']};"
        if match["html"]:
            character = html5.get(match["html"], "")
            return "".join(f"&#{ord(c)};" for c in character) or "&amp;" + match["html"]
        return "&amp;" if match[0] == "&" else match[0]

    fixed = _REFERENCE.sub(replace, raw)
    return fixed.replace("<", "&lt;").replace(quote, "&quot;" if quote == '"' else "&apos;")


def line_end(text: str) -> str:
    """The line end that a text uses."""
    place = text.find("\n")
    if place < 0:
        return "\r" if "\r" in text else "\n"
    return "\r\n" if text[place - 1 : place] == "\r" else "\n"


def indentation(text: str, offset: int) -> str | None:
    """The blanks before ``offset`` in its line; None if something else stands there."""
    start = offset
    while start > 0 and text[start - 1] in " \t":
        start -= 1
    return text[start:offset] if start == 0 or text[start - 1] in "\r\n" else None


def whole_lines(text: str, start: int, end: int) -> tuple[int, int]:
    """The span of the whole lines of ``text[start:end]`` if nothing else stands in them.

    With the line end behind them, or the one before them at the end of the text.
    """
    before = indentation(text, start)
    if before is None:
        return start, end
    stop = end
    while stop < len(text) and text[stop] in " \t":
        stop += 1
    if text.startswith("\r\n", stop):
        return start - len(before), stop + 2
    if text[stop : stop + 1] in ("\n", "\r"):
        return start - len(before), stop + 1
    return (start - len(before), stop) if stop == len(text) else (start, end)


def attribute_end(text: str, raw: RawAttribute) -> int:
    """The offset after an attribute, with whatever closes its value."""
    end = raw.value_end
    if text.startswith("\\", end) and text[end + 1 : end + 2] in ("'", '"'):
        return end + 2
    opened, closed = text[raw.value_start - 1], text[end : end + 1]
    return end + 1 if closed and opened in QUOTES and closed in QUOTES else end


def attribute_edit(draft: Draft, raw: RawAttribute, name: str, value: str | None = None) -> Edit:
    """Write another name, and another (decoded) value if one is given, for an attribute."""
    end = raw.start + len(raw.name)
    if value is None:
        return Edit(raw.start, end, name)
    quote = draft.text[raw.value_start - 1]
    if quote not in ("'", '"') or draft.text[raw.value_end : raw.value_end + 1] != quote:
        return Edit(raw.start, attribute_end(draft.text, raw), f'{name}="{escaped(value)}"')
    written = escaped(value).replace("'", "&apos;") if quote == "'" else escaped(value)
    kept = draft.text[end : raw.value_start]
    return Edit(raw.start, raw.value_end, f"{name}{kept}{written}")


def without_attribute(draft: Draft, raw: RawAttribute) -> Edit:
    """Remove an attribute with the white space before it."""
    start = raw.start
    while draft.text[start - 1] in WHITE:
        start -= 1
    return Edit(start, attribute_end(draft.text, raw))


def rename(node: Node, name: str) -> tuple[Edit, ...]:
    """Write another name for an element, in both of its tags."""
    first = node.start + 1
    edits = [Edit(first, first + len(node.name), name)]
    if node.closing is not None:
        edits.append(Edit(node.closing.start, node.closing.end, f"</{name}>"))
    return tuple(edits)


def unit_span(draft: Draft, first: Node, last: Node) -> tuple[int, int]:
    """The span of sibling elements, with the comments right before the first of them."""
    start = first.start
    low = first.parent.tag.end if first.parent else 0
    comments = [token for token in draft.tokens if isinstance(token, Comment)]
    for comment in reversed(comments):
        if low <= comment.start < start and not draft.text[comment.end : start].strip(WHITE):
            start = comment.start
    return start, last.stop


def units_of(draft: Draft, parent: Element) -> Iterator[tuple[Element, ...]]:
    """The children of an element by unit: each with the recoveries right behind it.

    Recoveries that come first are units of their own.
    """
    assert draft.plan is not None
    unit: list[Element] = []
    for child in draft.plan.children(parent):
        if unit and not (is_recovery(child) and not is_recovery(unit[0])):
            yield tuple(unit)
            unit = []
        unit.append(child)
    if unit:
        yield tuple(unit)


def nodes_of(draft: Draft, elements: Sequence[Element]) -> list[Node] | None:
    """The spans of elements; None if one of them has none."""
    nodes = [draft.node(element) for element in elements]
    return None if None in nodes else [node for node in nodes if node is not None]


def moved_before(draft: Draft, unit: Sequence[Node], target: Node) -> tuple[Edit, ...]:
    """Move sibling elements, with the comments before them, right before another element."""
    text = draft.text
    start, stop = unit_span(draft, unit[0], unit[-1])
    place, _ = unit_span(draft, target, target)
    block = _reindented(text, start, stop, indentation(text, place))
    return (Edit(*whole_lines(text, start, stop)), _inserted(text, place, block))


def removed(draft: Draft, node: Node) -> Edit:
    """Remove an element, and its lines if nothing else stands there."""
    return Edit(*whole_lines(draft.text, node.start, node.stop))


def unwrapped(draft: Draft, node: Node) -> tuple[Edit, ...]:
    """Remove the tags of an element and keep what is inside."""
    if node.closing is None:
        return ()
    text, closing = draft.text, node.closing
    opened = whole_lines(text, node.tag.start, node.tag.end)
    closed = whole_lines(text, closing.start, closing.end)
    edits = [Edit(*opened), Edit(*closed)]
    outer = indentation(text, node.tag.start)
    inner = indentation(text, node.children[0].start) if node.children else None
    if outer is not None and inner is not None and len(inner) > len(outer):
        extra = inner[len(outer) :]
        for child in node.children:
            before = indentation(text, child.start)
            if before is not None and before.endswith(extra):
                edits.append(Edit(child.start - len(extra), child.start))
    return tuple(edits)


def wrapped(
    draft: Draft, nodes: Sequence[Node], start_tag: str, end_tag: str = "</Control>"
) -> tuple[Edit, ...]:
    """Put sibling elements into a new control."""
    text = draft.text
    start, _ = unit_span(draft, nodes[0], nodes[0])
    stop = nodes[-1].stop
    before = indentation(text, start)
    if before is None:
        return (Edit(start, start, start_tag), Edit(stop, stop, end_tag))
    end = line_end(text)
    deeper = step(text, nodes[0])
    lines = _reindented(text, start, stop, before + deeper)
    whole = f"{start_tag}{end}{before}{deeper}{lines}{end}{before}{end_tag}"
    return (Edit(start, stop, whole),)


def step(text: str, node: Node) -> str:
    """By how much an element is indented deeper than the one around it, four blanks if unclear."""
    mine = indentation(text, node.start)
    around = indentation(text, node.parent.start) if node.parent else None
    if mine and around is not None and mine.startswith(around) and mine != around:
        return mine[len(around) :]
    return "\t" if mine and "\t" in mine else "    "


def _inserted(text: str, place: int, block: str) -> Edit:
    before = indentation(text, place)
    if before is None:
        return Edit(place, place, block)
    line = place - len(before)
    return Edit(line, line, f"{before}{block}{line_end(text)}")


def _reindented(text: str, start: int, stop: int, wanted: str | None) -> str:
    """``text[start:stop]`` with another indentation; as it is where that could change values."""
    block = text[start:stop]
    have = indentation(text, start)
    lines = block.split("\n")
    if wanted is None or have is None or len(lines) == 1 or "\r" in block.replace("\r\n", ""):
        return block
    # Only lines that begin with a tag are indented for sure; others may be inside a value.
    if any(line.strip() and not line.lstrip().startswith("<") for line in lines[1:]):
        return block
    if not all(line.startswith(have) or not line.strip() for line in lines[1:]):
        return block
    rest = (wanted + line[len(have) :] if line.strip() else line for line in lines[1:])
    return "\n".join([lines[0], *rest])
