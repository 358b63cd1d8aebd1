"""The states of a statechart, and which are entered: appendix D of the W3C's SCXML, for a judge."""

from __future__ import annotations

import xml.etree.ElementTree as ET  # what is read here was written by tests
from collections.abc import Iterable
from dataclasses import dataclass

from tests.compile.formats.statechart_content import SCXML

_STATES = ("state", "parallel", "final", "history")
Configuration = frozenset[int]
History = tuple[tuple[int, Configuration], ...]


@dataclass(frozen=True)
class Transition:
    """A transition, with the numbers of its source and its targets."""

    source: int
    events: tuple[str, ...]
    targets: tuple[int, ...]
    cond: str | None
    internal: bool
    number: int
    content: tuple[ET.Element, ...] = ()

    def matches(self, event: str | None) -> bool:
        """True if it is enabled by the event (None: by none), as far as its names say."""
        if event is None or not self.events:
            return event is None and not self.events
        words = event.split(".")
        return any(each == [] or words[: len(each)] == each for each in map(tokens, self.events))


def tokens(descriptor: str) -> list[str]:
    """The tokens that the name of an event has to begin with."""
    return [each for each in descriptor.split(".") if each not in ("", "*")]


class Tree:
    """The states of a chart in document order; state 0 is the root."""

    def __init__(self, text: str) -> None:
        self.tags: list[str] = []
        self.names: list[str] = []
        self.parents: list[int] = []
        self.children: list[list[int]] = []  # without histories
        self.histories: list[list[int]] = []
        self.elements: list[ET.Element] = []
        self._add(ET.fromstring(text.removeprefix("\ufeff")), -1)  # noqa: S314
        self.numbers = {name: number for number, name in enumerate(self.names) if name}
        self.transitions: list[list[Transition]] = []
        count = 0
        for number in range(len(self.elements)):
            self.transitions.append(self._transitions(number, count))
            count += len(self.transitions[-1])
        self.initial = [self._initial(number) for number in range(len(self.tags))]

    def _add(self, element: ET.Element, parent: int) -> None:
        number = len(self.tags)
        self.tags.append(element.tag.removeprefix(SCXML))
        self.names.append(element.get("id", ""))
        self.parents.append(parent)
        self.children.append([])
        self.histories.append([])
        self.elements.append(element)
        if parent >= 0:
            rows = self.histories if self.tags[number] == "history" else self.children
            rows[parent].append(number)
        for child in element:
            if child.tag in {f"{SCXML}{tag}" for tag in _STATES}:
                self._add(child, number)

    def _transitions(self, number: int, count: int) -> list[Transition]:
        found = enumerate(self.inside(number, "transition"))
        return [self._transition(number, each, count + at) for at, each in found]

    def _transition(self, source: int, element: ET.Element, number: int) -> Transition:
        return Transition(
            source,
            tuple(element.get("event", "").split()),
            tuple(self.numbers[name] for name in element.get("target", "").split()),
            element.get("cond"),
            element.get("type") == "internal",
            number,
            tuple(element),
        )

    def _initial(self, number: int) -> Transition:
        """What leads into a state: by an element, by an attribute, or to its first child."""
        for each in self.inside(number, "initial"):
            for way in each.findall(f"{SCXML}transition"):
                return self._transition(number, way, -1)
        named = self.elements[number].get("initial", "").split()
        targets = [self.numbers[name] for name in named] or self.children[number][:1]
        return Transition(number, (), tuple(targets), None, internal=False, number=-1)

    def inside(self, state: int, tag: str) -> list[ET.Element]:
        """The elements of a name in a state."""
        return self.elements[state].findall(f"{SCXML}{tag}")

    def ancestors(self, state: int) -> list[int]:
        """The states around a state, the innermost first, with the root."""
        rows = []
        while state:
            state = self.parents[state]
            rows.append(state)
        return rows

    def is_atomic(self, state: int) -> bool:
        """True for states without states in them."""
        return not self.children[state]

    def is_compound(self, state: int) -> bool:
        """True for the root, and states (no parallels) with states in them."""
        return bool(self.children[state]) and self.tags[state] != "parallel"

    def is_final(self, configuration: Configuration, state: int) -> bool:
        """isInFinalState."""
        if self.tags[state] == "parallel":
            return all(self.is_final(configuration, each) for each in self.children[state])
        return any(
            self.tags[each] == "final" and each in configuration for each in self.children[state]
        )

    def end(self, at: Configuration) -> int | None:
        """The final state of the root that is active."""
        return next(
            (each for each in at if self.tags[each] == "final" and not self.parents[each]), None
        )

    def active(self, at: Iterable[int]) -> frozenset[str]:
        """The names of states."""
        return frozenset(self.names[each] for each in at) - {""}

    def acting(self, at: Configuration) -> frozenset[str]:
        """The atomic states of a configuration."""
        return frozenset(
            self.names[each] for each in at if self.is_atomic(each) and self.tags[each] != "final"
        )


class Entry:
    """computeEntrySet: the states to be entered, and whose defaults are taken."""

    def __init__(self, tree: Tree, history: History) -> None:
        self.tree = tree
        self.history = dict(history)
        self.states: set[int] = set()
        self.defaults: set[int] = set()
        self.contents: dict[int, tuple[ET.Element, ...]] = {}  # of histories, by their parents

    def descendants(self, state: int) -> None:
        """addDescendantStatesToEnter."""
        tree = self.tree
        if tree.tags[state] == "history":
            targets = sorted(self.history.get(state, ()))
            if not targets:
                (way,) = tree.transitions[state]
                self.contents[tree.parents[state]] = way.content
                targets = list(way.targets)
            self._all(targets, tree.parents[state])
            return
        self.states.add(state)
        if tree.is_compound(state):
            self.defaults.add(state)
            self._all(tree.initial[state].targets, state)
        elif tree.tags[state] == "parallel":
            self._regions(state)

    def _all(self, targets: Iterable[int], around: int) -> None:
        rows = list(targets)
        for each in rows:
            self.descendants(each)
        for each in rows:
            self.ancestors(each, around)

    def ancestors(self, state: int, around: int) -> None:
        """addAncestorStatesToEnter."""
        for each in self.tree.ancestors(state):
            if each == around:
                break
            self.states.add(each)
            if self.tree.tags[each] == "parallel":
                self._regions(each)

    def _regions(self, parallel: int) -> None:
        for child in self.tree.children[parallel]:
            rows = self.states
            if not any(child == row or child in self.tree.ancestors(row) for row in rows):
                self.descendants(child)
