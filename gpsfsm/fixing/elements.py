"""The elements of a text with their whole spans, also of a text that is not well-formed.

The plan tree knows start tags only and only what is a plan; edits need end tags, and places in
texts that are no plan yet. End tags are matched as the front end matches them.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.syntax.nesting import similar
from gpsfsm.syntax.tokens import Comment, EndTag, Markup, StartTag, TextRun

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.syntax.tokens import RawAttribute

__all__ = ["Node", "Outline", "Piece", "outline"]

Piece = StartTag | EndTag | TextRun | Comment | Markup
"""What a text is made of."""


@dataclass(slots=True, eq=False)
class Node:
    """An element: its tags, and its place among the others.

    ``closing`` is its end tag, None for an empty element and where there is none. ``stop`` is the
    offset after it. ``ended_by`` is the end tag of another element that came first.
    """

    tag: StartTag
    parent: Node | None
    children: list[Node] = field(default_factory=list)
    closing: EndTag | None = None
    stop: int = 0
    ended_by: EndTag | None = None
    unfinished: bool = False

    @property
    def name(self) -> str:
        """The name of the element."""
        return self.tag.name

    @property
    def start(self) -> int:
        """The offset of the element."""
        return self.tag.start

    def attribute(self, name: str) -> RawAttribute | None:
        """The attribute of this name."""
        return next((found for found in self.tag.attributes if found.name == name), None)


@dataclass(slots=True)
class Outline:
    """All elements in document order, by the offset of their start tag, and stray end tags."""

    nodes: dict[int, Node] = field(default_factory=dict)
    superfluous: list[tuple[EndTag, Node | None]] = field(default_factory=list)
    roots: list[Node] = field(default_factory=list)


def outline(tokens: Sequence[Piece]) -> Outline:
    """Match the tags of a text."""
    found = Outline()
    stack: list[Node] = []
    names: Counter[str] = Counter()

    def close(end: int, tag: EndTag | None) -> Node:
        node = stack.pop()
        names[node.name] -= 1
        node.closing, node.stop = tag, end
        return node

    last = 0
    for token in tokens:
        last = token.end
        if isinstance(token, StartTag):
            parent = stack[-1] if stack else None
            node = Node(token, parent, stop=token.end)
            (parent.children if parent else found.roots).append(node)
            found.nodes[token.start] = node
            if not token.empty:
                stack.append(node)
                names[node.name] += 1
        elif isinstance(token, EndTag):
            if not stack:
                found.superfluous.append((token, None))
            elif token.name in ("", stack[-1].name):
                close(token.end, token)
            elif names[token.name] > 0:
                while stack[-1].name != token.name:
                    close(token.start, None).ended_by = token
                close(token.end, token)
            elif similar(token.name, stack[-1].name):
                close(token.end, token)
            else:
                found.superfluous.append((token, stack[-1]))
    while stack:
        close(last, None).unfinished = True
    return found
