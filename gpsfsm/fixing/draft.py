"""A text in the course of its repair: what fixers see of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.capabilities.library import bind
from gpsfsm.fixing.elements import Node, Outline, Piece, outline
from gpsfsm.model.plan import Element
from gpsfsm.syntax import parse
from gpsfsm.syntax.chars import ILLEGAL
from gpsfsm.syntax.lines import Lines
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.tokens import OverLimit

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.finding import Finding, Related
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import PlanReport
    from gpsfsm.syntax.tokens import RawAttribute

__all__ = ["Draft", "Written"]


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
        """Whether there is a wanted finding of one of these rules."""
        return any(True for _ in self.findings(*rules))

    def attributes(self, rule: str) -> Iterator[Written]:
        """The attributes that findings of a rule are about, as far as their runner is described."""
        for finding in self.findings(rule):
            runner = self.element(finding)
            binding = self.bindings.get(runner.index) if runner else None
            node = self.node(runner) if runner else None
            if runner is None or binding is None or node is None:
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

    @property
    def library(self) -> Library:
        """The capabilities in force."""
        return self.options.described.library

    @cached_property
    def bindings(self) -> Mapping[int, Binding | None]:
        """What is known of each runner, by the index of its element."""
        if self.plan is None:
            return {}
        found = bind(self.plan, self.library)
        return {
            runner.index: binding for runner, binding in zip(self.plan.runners, found, strict=True)
        }

    @cached_property
    def readable(self) -> str:
        """The text with blanks for what XML does not allow: same length, same places."""
        return ILLEGAL.sub(" ", self.text)

    @cached_property
    def tokens(self) -> tuple[Piece, ...]:
        """The tags, comments and texts, as far as a limit allows."""
        found = scan(self.readable, self.options.limits)
        return tuple(token for token in found if not isinstance(token, OverLimit))

    @cached_property
    def outline(self) -> Outline:
        """The elements with their spans."""
        return outline(self.tokens)

    def node(self, place: int | Element) -> Node | None:
        """The element whose start tag begins at an offset."""
        return self.outline.nodes.get(place.start if isinstance(place, Element) else place)

    def around(self, offset: int) -> Node | None:
        """The element in whose start tag an offset is."""
        found = self.outline.nodes.get(offset)
        if found is not None:
            return found
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
