"""From tokens to the elements of a file of behaviour trees."""

from __future__ import annotations

from typing import TYPE_CHECKING, assert_never

from gpsfsm.model.plan import Attribute
from gpsfsm.model.tree import TreeNode
from gpsfsm.syntax.chars import clip
from gpsfsm.syntax.frames import Frame, Inside
from gpsfsm.syntax.nesting import Nesting
from gpsfsm.syntax.references import decode_value
from gpsfsm.syntax.suppress import Suppression, read_suppression
from gpsfsm.syntax.tokens import Comment, EndTag, Markup, OverLimit, StartTag, TextRun, Token
from gpsfsm.syntax.values import typed

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.syntax.collector import Collector
    from gpsfsm.syntax.limits import Limits
    from gpsfsm.syntax.tokens import Fault

__all__ = ["TreeReader"]

_MAX_SUPPRESSIONS = 10_000


class TreeReader:
    """Takes tokens in order; afterwards the elements are known.

    ``broken``: the text is not well-formed; ``fatal``: its elements cannot be known; ``over``: a
    limit was hit; ``deepest``: the greatest depth of nesting.
    """

    def __init__(self, text: str, limits: Limits, collector: Collector) -> None:
        self.text, self.limits, self.collector = text, limits, collector
        self.broken = self.fatal = self.over = False
        self.deepest = 0
        self.suppressions: list[Suppression] = []
        self._pending: list[tuple[tuple[str, ...], str, int]] = []
        self._nesting = Nesting(collector)
        self._tags: list[tuple[StartTag, int, str, tuple[Attribute, ...]]] = []
        self._children: list[list[int]] = []
        self._swallowed = False

    def read(self, tokens: Iterable[Token]) -> tuple[TreeNode, ...]:
        """Read all tokens; the elements in document order, the root first."""
        for token in tokens:
            match token:
                case StartTag():
                    self._start(token)
                case EndTag():
                    self._end(token)
                case TextRun():
                    self._text(token)
                case Comment():
                    self._comment(token)
                case Markup():
                    self._faults(token.faults)
                    self._swallowed |= token.swallowed
                case OverLimit():
                    self._over(token.start, token.message, token.option)
                case _:
                    assert_never(token)
            if self.collector.exhausted and not self.over:
                self._over(token.start, "the text has too many errors to be a tree", "")
            if self.over:
                break
        if not self.over and self._nesting.frames:
            self.broken = self.fatal = True
            if not self._swallowed:
                self._nesting.unfinished(self.text)
        self._attach("")
        return tuple(map(self._node, range(len(self._tags))))

    def _start(self, tag: StartTag) -> None:
        frames = self._nesting.frames
        depth = len(frames) + 1
        if len(self._tags) >= self.limits.max_elements:
            message = f"the text has more than {self.limits.max_elements:,} elements"
            self._over(tag.start, message, "max-elements")
            return
        if depth > self.limits.max_depth:
            message = f"elements are nested more than {self.limits.max_depth:,} deep"
            self._over(tag.start, message, "max-depth")
            return
        self.deepest = max(self.deepest, depth)
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

    def _attributes(self, tag: StartTag, path: str) -> tuple[Attribute, ...]:
        """The attributes, decoded and typed; what is wrong with the tag is reported."""
        faults: list[Fault] = list(tag.faults)
        found: list[Attribute] = []
        for name, start, value_start, value_end in tag.attributes:
            value = decode_value(self.text[value_start:value_end], value_start, faults)
            line, column = self.collector.lines.position(start)
            found.append(Attribute(name, value, typed(value), line, column))
        if faults:
            self.broken = True
            self.fatal |= not tag.closed
            self.collector.add_faults(faults, path)
        return tuple(found)

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

    def _comment(self, comment: Comment) -> None:
        self._faults(comment.faults)
        self._swallowed |= comment.end == comment.body_end
        found = read_suppression(self.text[comment.start + 4 : comment.body_end])
        if found and len(self.suppressions) + len(self._pending) < _MAX_SUPPRESSIONS:
            self._pending.append((*found, comment.start))

    def _faults(self, faults: list[Fault]) -> None:
        if faults:
            self.broken = True
            frames = self._nesting.frames
            self.collector.add_faults(faults, frames[-1].path if frames else "")

    def _over(self, start: int, message: str, option: str) -> None:
        self.over = True
        hint = "gpsfsm stops reading here; "
        hint += f"raise --{option} if the tree is meant to be like this" if option else "correct it"
        self.collector.add("GP103", start, 1, message=message, hint=hint)

    def _attach(self, scope: str) -> None:
        """The suppression comments read last cover the element at ``scope``, "" for none."""
        for rules, reason, start in self._pending:
            location = self.collector.location(start, scope)
            self.suppressions.append(Suppression(rules, reason, location, scope))
        self._pending.clear()

    def _node(self, index: int) -> TreeNode:
        tag, parent, path, attributes = self._tags[index]
        line, column = self.collector.lines.position(tag.start)
        children = tuple(self._children[index])
        return TreeNode(
            index, tag.name, parent, children, attributes, line, column, tag.start, tag.end, path
        )
