"""From tokens to the elements of a file of behaviour trees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.tree import TreeNode
from gpsfsm.syntax.chars import clip
from gpsfsm.syntax.frames import Frame, Inside
from gpsfsm.syntax.token_reader import TokenReader

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.model.plan import Attribute
    from gpsfsm.syntax.collector import Collector
    from gpsfsm.syntax.limits import Limits
    from gpsfsm.syntax.tokens import EndTag, StartTag, TextRun, Token

__all__ = ["TreeReader"]


class TreeReader(TokenReader):
    """Takes tokens in order; afterwards the elements are known."""

    noun = "tree"
    declares_namespaces = False

    def __init__(self, text: str, limits: Limits, collector: Collector) -> None:
        super().__init__(text, limits, collector)
        self._tags: list[tuple[StartTag, int, str, tuple[Attribute, ...]]] = []
        self._children: list[list[int]] = []

    def read(self, tokens: Iterable[Token]) -> tuple[TreeNode, ...]:
        """Read all tokens; the elements in document order, the root first."""
        self._take(tokens)
        self._attach("")
        return tuple(map(self._node, range(len(self._tags))))

    def _start(self, tag: StartTag) -> None:
        frames = self._nesting.frames
        if self._too_many(tag, len(self._tags) + 1):
            return
        path, parent = f"/{clip(tag.name)}", -1
        if frames:
            around = frames[-1]
            around.counts[tag.name] = around.counts.get(tag.name, 0) + 1
            path = f"{around.path}{path}[{around.counts[tag.name]}]"
            parent = around.index
        elif self._tags:
            self.broken = self.fatal = True
            message = f"a second outermost element <{clip(tag.name)}>; there must be one only"
            hint = "keep one <root>; --from-response takes the last one of a model's answer"
            self.collector.add(
                "GP101", tag.start, 1 + len(tag.name), message=message, hint=hint, element=path
            )
            return
        attributes = self._attributes(tag, path)
        self._attach(path)
        index = len(self._tags)
        self._tags.append((tag, parent, path, attributes))
        self._children.append([])
        if parent >= 0:
            self._children[parent].append(index)
        if not tag.empty:
            frame = Frame(
                path=path, tag=tag.name, start=tag.start, index=index, inside=Inside.OTHER
            )
            self._nesting.open(frame)

    def _end(self, tag: EndTag) -> None:
        self._faults(tag.faults)
        self._attach("")
        if not self._nesting.end(tag):
            self.broken = self.fatal = True

    def _text(self, run: TextRun) -> None:
        """BehaviorTree.CPP skips text inside elements, and so do we; outside it is an error."""
        self._faults(run.faults)
        if not self._nesting.frames:
            self.broken = True
            shown = clip(self.text[run.start : run.end])
            self.collector.add(
                "GP108",
                run.start,
                run.end - run.start,
                message=f"text outside of <root>: {shown}",
                hint="remove it; --from-response takes the tree out of a model's answer",
            )

    def _node(self, index: int) -> TreeNode:
        tag, parent, path, attributes = self._tags[index]
        line, column = self.collector.lines.position(tag.start)
        children = tuple(self._children[index])
        return TreeNode(
            index, tag.name, parent, children, attributes, line, column, tag.start, tag.end, path
        )
