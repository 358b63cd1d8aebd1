"""Elements as text, the way the engines write them into their messages.

Four blanks per level, one line per node; from the first text of an element on, its other children
follow without new lines.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.engine import Content, ContentKind, EngineElement

if TYPE_CHECKING:
    from gpsfsm.model.engine import EngineDocument

__all__ = ["printed"]

_INDENT = "    "
_IN_TEXT = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})
_IN_VALUES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&apos;"})
_MARKS = {
    ContentKind.CDATA: ("<![CDATA[", "]]>"),
    ContentKind.COMMENT: ("<!--", "-->"),
    ContentKind.UNKNOWN: ("<!", ">"),
    ContentKind.DECLARATION: ("<?", "?>"),
}
_NO_TEXT = -1


def printed(document: EngineDocument, *roots: int) -> str:
    """Some nodes of a document with all that is in them."""
    printer = _Printer(document)
    # A stack of what is still to be written; an element is entered at n and left at ~n.
    ahead = list(reversed(roots))
    while ahead:
        index = ahead.pop()
        if index < 0:
            printer.leave(document.element(~index))
            continue
        node = document.nodes[index]
        if isinstance(node, EngineElement):
            printer.enter(node)
            ahead.append(~index)
            ahead.extend(reversed(node.children))
        else:
            printer.content(node)
    return "".join(printer.out)


class _Printer:
    def __init__(self, document: EngineDocument) -> None:
        self.document = document
        self.out: list[str] = []
        self._depth = 0
        self._unsealed = False  # a start tag still lacks its '>'
        self._first = True
        self._text_depth = _NO_TEXT  # the depth of the element in which text was written last

    def enter(self, element: EngineElement) -> None:
        self._new_node()
        self.out.append(f"<{element.tag}")
        for attribute in element.attributes:
            self.out.append(f' {attribute.name}="{attribute.value.translate(_IN_VALUES)}"')
        self._unsealed = True
        self._depth += 1

    def leave(self, element: EngineElement) -> None:
        self._depth -= 1
        if self._unsealed:
            self.out.append("/>")
        else:
            if self._text_depth == _NO_TEXT:
                self.out.append("\n" + _INDENT * self._depth)
            self.out.append(f"</{element.tag}>")
        if self._text_depth == self._depth:
            self._text_depth = _NO_TEXT
        if not self._depth:
            self.out.append("\n")
        self._unsealed = False

    def content(self, node: Content) -> None:
        if node.kind in (ContentKind.TEXT, ContentKind.CDATA):
            self._text_depth = self._depth - 1
            self._seal()
        else:
            self._new_node()
        if node.kind is ContentKind.TEXT:
            self.out.append(node.value.translate(_IN_TEXT))
        else:
            begin, end = _MARKS[node.kind]
            self.out += (begin, node.value, end)

    def _new_node(self) -> None:
        self._seal()
        if self._first:
            self.out.append(_INDENT * self._depth)
        elif self._text_depth == _NO_TEXT:
            self.out.append("\n" + _INDENT * self._depth)
        self._first = False

    def _seal(self) -> None:
        if self._unsealed:
            self._unsealed = False
            self.out.append(">")
