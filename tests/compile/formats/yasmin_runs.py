"""An interpreter of YASMIN's XML, written from its factory and its core (version 6.1.1).

It shares nothing with the reader: it walks the elements, and enumerates what each state may return.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple
from xml.etree import ElementTree

if TYPE_CHECKING:
    from collections.abc import Iterator
    from xml.etree.ElementTree import Element

Configuration = tuple[Any, ...]
RAISED = ("raise", "")
_STATES = ("State", "StateMachine", "Concurrence", "OrthogonalState", "Region")


class Runs(NamedTuple):
    """What runs do: the states entered, the outcomes at the end, and whether one runs for ever."""

    entered: frozenset[str]
    ends: frozenset[str]
    endless: bool


class Interpreter:
    """The runs of a machine; ``undeclared``: with the outcomes that only a class can declare."""

    def __init__(self, text: str, *, undeclared: bool) -> None:
        self.root = ElementTree.fromstring(text)  # noqa: S314  (our own text)
        self.undeclared = undeclared
        self.entered: set[str] = set()
        self.parents = {child: each for each in self.root.iter() for child in each}

    def runs(self) -> Runs:
        """All runs."""
        first = self._enter(self.root)
        steps: dict[Configuration, list[Configuration]] = {}
        ends: set[str] = set()
        pending = [first]
        while pending:
            at = pending.pop()
            if at in steps:
                continue
            steps[at] = []
            for kind, what in self._moves(self.root, at):
                if kind == "at":
                    steps[at].append(what)
                    pending.append(what)
                else:
                    ends.add(what if kind == "end" else "an exception")
        return Runs(frozenset(self.entered), frozenset(ends), _has_cycle(steps))

    def _is_leaf(self, element: Element) -> bool:
        return element.tag == "State" or bool(element.get("file_path"))

    def _states(self, element: Element) -> dict[str, Element]:
        return {each.get("name", ""): each for each in element if each.tag in _STATES}

    def _enter(self, element: Element) -> Configuration:
        if self._is_leaf(element):
            names, at = [element.get("name", "")], self.parents[element]
            while at in self.parents:
                names.append(at.get("name", ""))
                at = self.parents[at]
            self.entered.add("/".join(reversed(names)))
            return ("leaf",)
        states = self._states(element)
        if element.tag in ("Concurrence", "OrthogonalState"):
            return tuple(self._enter(each) for each in states.values())
        start = element.get("start_state") or next(iter(states))
        return (start, self._enter(states[start]))

    def _moves(self, element: Element, at: Configuration) -> Iterator[tuple[str, Any]]:
        if self._is_leaf(element):
            yield from (("end", outcome) for outcome in self._outcomes(element))
        elif element.tag in ("Concurrence", "OrthogonalState"):
            yield from self._together(element, at)
        else:
            states = self._states(element)
            here = states[at[0]]
            transitions = {
                each.get("from"): each.get("to", "") for each in here if each.tag == "Transition"
            }
            for kind, what in self._moves(here, at[1]):
                target = transitions.get(what, what) if kind == "end" else ""
                if kind == "at":
                    yield "at", (at[0], what)
                elif kind == "end" and target in element.get("outcomes", "").split():
                    yield "end", target
                elif kind == "end" and target in states:
                    yield "at", (target, self._enter(states[target]))
                else:
                    yield RAISED

    def _outcomes(self, element: Element) -> list[str]:
        around = self.parents[element]
        if around.tag in ("Concurrence", "OrthogonalState"):
            name = element.get("name")
            items = [item for each in around if each.tag == "OutcomeMap" for item in each]
            spoken = [item.get("outcome", "") for item in items if item.get("state") == name]
            return sorted({*spoken, *(["other"] if self.undeclared or not spoken else [])})
        names = {each.get("from", "") for each in element if each.tag == "Transition"}
        if self.undeclared:
            names |= {*around.get("outcomes", "").split(), *self._states(around)}
        return sorted(names)

    def _together(self, element: Element, at: Configuration) -> Iterator[tuple[str, Any]]:
        states = self._states(element)
        for number, each in enumerate(states.values()):
            if at[number][0] == "ended":
                continue
            for kind, what in self._moves(each, at[number]):
                after = ("ended", what if kind == "end" else None) if kind != "at" else what
                whole = (*at[:number], after, *at[number + 1 :])
                if any(child[0] != "ended" for child in whole):
                    yield "at", whole
                else:
                    yield self._result(element, dict(zip(states, whole, strict=True)))

    def _result(self, element: Element, ends: dict[str, Configuration]) -> tuple[str, str]:
        if any(end[1] is None for end in ends.values()):
            return RAISED
        satisfied = {
            each.get("outcome", "")
            for each in element
            if each.tag == "OutcomeMap"
            and all(ends[item.get("state", "")][1] == item.get("outcome") for item in each)
        }
        if len(satisfied) > 1:
            return RAISED
        outcome = next(iter(satisfied), element.get("default_outcome", ""))
        return ("end", outcome) if outcome else RAISED


def _has_cycle(steps: dict[Configuration, list[Configuration]]) -> bool:
    import networkx

    graph = networkx.DiGraph((at, target) for at, row in steps.items() for target in row)
    return not networkx.is_directed_acyclic_graph(graph)
