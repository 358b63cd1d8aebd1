"""Edits that move whole units of a plan: an element with the recoveries right behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.edit import Edit
from gpsfsm.fixing.layout import indentation, line_end, unit_span, whole_lines
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.fixing.elements import Node
    from gpsfsm.model.plan import Element

__all__ = [
    "is_recovery",
    "moved_before",
    "nodes_of",
    "removed",
    "step",
    "units_of",
    "unwrapped",
    "wrapped",
]


def is_recovery(element: Element) -> bool:
    """Whether an element is a recovery."""
    return element.control_type is ControlType.RECOVERY


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
    found = [draft.node(element) for element in elements]
    return None if None in found else [node for node in found if node is not None]


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


def wrapped(draft: Draft, nodes: Sequence[Node], start_tag: str) -> tuple[Edit, ...]:
    """Put sibling elements into a new control."""
    text = draft.text
    start, _ = unit_span(draft, nodes[0], nodes[0])
    stop = nodes[-1].stop
    before = indentation(text, start)
    if before is None:
        return (Edit(start, start, start_tag), Edit(stop, stop, "</Control>"))
    end = line_end(text)
    deeper = step(text, nodes[0])
    lines = _reindented(text, start, stop, before + deeper)
    whole = f"{start_tag}{end}{before}{deeper}{lines}{end}{before}</Control>"
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
