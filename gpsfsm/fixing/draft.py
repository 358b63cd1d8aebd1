"""A text in the course of its repair: what fixers see of it.

The plan tree knows start tags only and only what is a plan; edits need end tags, and places in
texts that are no plan yet. So ``Outline`` holds the elements with their whole spans, also of a text
that is not well-formed; end tags are matched as the front end matches them.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.capabilities.library import bind
from gpsfsm.compile.plan_text import holds_trees
from gpsfsm.model.plan import Element
from gpsfsm.syntax import parse
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.text import ILLEGAL, Lines
from gpsfsm.syntax.token_reader import similar
from gpsfsm.syntax.tokens import Comment, EndTag, Markup, OverLimit, StartTag, TextRun

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.finding import Finding, Related
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import PlanReport
    from gpsfsm.syntax import Limits
    from gpsfsm.syntax.tokens import RawAttribute

Piece = StartTag | EndTag | TextRun | Comment | Markup
"""What a text is made of."""


def pieces_of(text: str, limits: Limits) -> tuple[Piece, ...]:
    """The tags, comments and texts, as far as a limit allows."""
    return tuple(token for token in scan(text, limits) if not isinstance(token, OverLimit))


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
        return next((raw for raw in self.tag.attributes if raw.name == name), None)


@dataclass(slots=True)
class Outline:
    """All elements in document order, by the offset of their start tag, and stray end tags."""

    nodes: dict[int, Node] = field(default_factory=dict)
    superfluous: list[tuple[EndTag, Node | None]] = field(default_factory=list)
    roots: list[Node] = field(default_factory=list)


def outline(tokens: Sequence[Piece]) -> Outline:
    """Match the tags of a text."""
    result = Outline()
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
            (parent.children if parent else result.roots).append(node)
            result.nodes[token.start] = node
            if not token.empty:
                stack.append(node)
                names[node.name] += 1
        elif isinstance(token, EndTag):
            if not stack:
                result.superfluous.append((token, None))
            elif token.name in ("", stack[-1].name):
                close(token.end, token)
            elif names[token.name] > 0:
                while stack[-1].name != token.name:
                    close(token.start, None).ended_by = token
                close(token.end, token)
            elif similar(token.name, stack[-1].name):
                close(token.end, token)
            else:
                result.superfluous.append((token, stack[-1]))
    while stack:
        close(last, None).unfinished = True
    return result


class Written(NamedTuple):
    """An attribute of a described runner: where it is, how it is written, what it says."""

    at: int
    raw: RawAttribute
    value: str
    binding: Binding


@dataclass(frozen=True)
class Draft:
    """A decoded text with its report; ``wanted`` are the findings that may be fixed."""

    text: str
    report: PlanReport
    wanted: tuple[Finding, ...]
    options: CheckOptions

    def findings(self, *rules: str) -> Iterator[Finding]:
        """The wanted findings of these rules, in document order."""
        return (finding for finding in self.wanted if finding.rule in rules)

    def wants(self, *rules: str) -> bool:
        """True if there is a wanted finding of one of these rules."""
        return any(True for _ in self.findings(*rules))

    def elements(self, *rules: str) -> Iterator[tuple[Finding, Element]]:
        """The wanted findings of these rules with their elements, where there is a plan."""
        for finding in self.findings(*rules):
            element = self.element(finding)
            if element is not None:
                yield finding, element

    def attributes(self, rule: str) -> Iterator[Written]:
        """The attributes that findings of a rule are about, as far as their runner is described."""
        for finding, runner in self.elements(rule):
            binding, node = self.bindings.get(runner.index), self.node(runner)
            if binding is None or node is None:
                continue
            at = self.offset(finding)
            raw = next((each for each in node.tag.attributes if each.start == at), None)
            value = runner.text(raw.name) if raw else None
            if raw is not None and value is not None:
                yield Written(at, raw, value, binding)

    def offset(self, place: Finding | Related) -> int:
        """The offset of a finding or of a related place."""
        return self._lines.offset(place.location.line, place.location.column)

    def line(self, offset: int) -> int:
        """The line of an offset, from 1."""
        return self._lines.position(offset)[0]

    @cached_property
    def _lines(self) -> Lines:
        return Lines(self.text)

    @cached_property
    def plan(self) -> Plan | None:
        """The plan, None where it cannot be known."""
        options = self.options
        return parse(self.text, limits=options.limits, from_response=options.from_response).plan

    @cached_property
    def trees(self) -> bool:
        """True if the text is read as behaviour trees."""
        options = self.options
        return options.trees and holds_trees(self.text, from_response=options.from_response)

    @property
    def library(self) -> Library:
        """The capabilities in force."""
        return self.options.described.library

    @cached_property
    def bindings(self) -> Mapping[int, Binding | None]:
        """The bindings of the runners, by the index of their elements."""
        if self.plan is None:
            return {}
        bound = bind(self.plan, self.library)
        return {
            runner.index: binding for runner, binding in zip(self.plan.runners, bound, strict=True)
        }

    @cached_property
    def readable(self) -> str:
        """The text with blanks for what XML does not allow: same length, same places."""
        return ILLEGAL.sub(" ", self.text)

    @cached_property
    def tokens(self) -> tuple[Piece, ...]:
        """The tags, comments and texts, as far as a limit allows."""
        return pieces_of(self.readable, self.options.limits)

    @cached_property
    def outline(self) -> Outline:
        """The elements with their spans."""
        return outline(self.tokens)

    def node(self, place: int | Element) -> Node | None:
        """The element whose start tag begins at an offset."""
        return self.outline.nodes.get(place.start if isinstance(place, Element) else place)

    def around(self, offset: int) -> Node | None:
        """The element in whose start tag an offset is."""
        node = self.outline.nodes.get(offset)
        if node is not None:
            return node
        inside = (n for n in self.outline.nodes.values() if n.tag.start <= offset < n.tag.end)
        return next(inside, None)

    @cached_property
    def _by_path(self) -> Mapping[str, Element]:
        if self.plan is None:
            return {}
        return {self.plan.path(element): element for element in self.plan.elements}

    def element(self, place: Finding | Related) -> Element | None:
        """The element of the plan that a finding or a related place names."""
        return self._by_path.get(place.location.element)
