"""An interpreter of YASMIN's XML, written from its factory and its core (version 6.1.1).

It shares nothing with the reader: it walks the elements, and enumerates what each state may return.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

if TYPE_CHECKING:
    from collections.abc import Iterator
    from xml.etree.ElementTree import Element

Configuration = tuple[Any, ...]
Move = tuple[str, Any, tuple[str, str]]
"""What a step leads to ("at" a configuration, the "end", "raise"), and which state ended how."""
_STATES = ("State", "StateMachine", "Concurrence", "OrthogonalState", "Region")
_PARALLEL = ("Concurrence", "OrthogonalState")
_MOST = 600


class TooManyError(Exception):
    """There are more configurations than are looked at."""


class Interpreter:
    """The runs of a machine; ``undeclared``: with the outcomes that only a class can declare.

    ``steps``: by configuration, which states end how, and what follows; an outcome in place of a
    configuration is the end. ``entered``: the states that runs enter.
    """

    def __init__(self, text: str, *, undeclared: bool) -> None:
        self.root = ElementTree.fromstring(text)  # noqa: S314  (our own text)
        self.complete = self.root.get("{urn:gpsfsm}complete") == "true"
        self.undeclared = undeclared
        self.entered: set[str] = set()
        self.parents = {child: each for each in self.root.iter() for child in each}
        self._known: dict[tuple[Element, Configuration], list[Move]] = {}
        self.first = self._enter(self.root)
        self.steps: dict[Configuration, set[tuple[tuple[str, str], Configuration | str]]] = {}
        pending = [self.first]
        while pending:
            at = pending.pop()
            if at not in self.steps:
                self.steps[at] = {
                    (who, what if kind != "raise" else "an exception")
                    for kind, what, who in self._moves(self.root, at)
                }
                pending += (what for _, what in self.steps[at] if not isinstance(what, str))
            if len(self.steps) > _MOST:
                raise TooManyError

    @property
    def endless(self) -> bool:
        """True if a run goes on for ever."""
        import networkx

        graph = networkx.DiGraph(
            (at, target)
            for at, row in self.steps.items()
            for _, target in row
            if not isinstance(target, str)
        )
        return not networkx.is_directed_acyclic_graph(graph)

    # -- elements ---------------------------------------------------------------------------

    def _is_elsewhere(self, element: Element) -> bool:
        by_name = element.get("file_name") and element.get("package")
        return element.tag in ("StateMachine", "Region") and bool(
            element.get("file_path") or by_name
        )

    def _is_leaf(self, element: Element) -> bool:
        return element.tag == "State" or self._is_elsewhere(element)

    def _states(self, element: Element) -> dict[str, Element]:
        return {each.get("name", ""): each for each in element if each.tag in _STATES}

    def _path(self, element: Element) -> str:
        names, at = [element.get("name", "")], self.parents[element]
        while at in self.parents:
            names.append(at.get("name", ""))
            at = self.parents[at]
        return "/".join(reversed(names))

    def _outcome_maps(self, element: Element) -> dict[str, dict[str, str]]:
        """The last map of each outcome, and in it the last item of each state."""
        maps: dict[str, dict[str, str]] = {}
        for each in element:
            if each.tag in ("OutcomeMap", "Outcome"):
                key, inner = (
                    ("outcome", "Item") if each.tag == "OutcomeMap" else ("to", "Transition")
                )
                items = (item for item in each if item.tag == inner)
                maps[each.get(key, "")] = {
                    item.get("state", ""): item.get("outcome", "") for item in items
                }
        return maps

    def _transitions(self, element: Element) -> dict[str, str]:
        return {
            each.get("from", ""): each.get("to", "") for each in element if each.tag == "Transition"
        }

    # -- runs -------------------------------------------------------------------------------

    def _enter(self, element: Element) -> Configuration:
        if self._is_leaf(element):
            self.entered.add(self._path(element))
            return ("leaf",)
        states = self._states(element)
        if element.tag in _PARALLEL:
            return tuple(self._enter(each) for each in states.values())
        start = element.get("start_state") or next(iter(states))
        return (start, self._enter(states[start]))

    def _moves(self, element: Element, at: Configuration) -> list[Move]:
        key = element, at
        if key not in self._known:
            self._known[key] = [*self._all_moves(element, at)]
        return self._known[key]

    def _all_moves(self, element: Element, at: Configuration) -> Iterator[Move]:
        if self._is_leaf(element):
            path = self._path(element)
            yield from (("end", outcome, (path, outcome)) for outcome in self._outcomes(element))
        elif element.tag in _PARALLEL:
            yield from self._together(element, at)
        else:
            states = self._states(element)
            here = states[at[0]]
            transitions = self._transitions(here)
            for kind, what, who in self._moves(here, at[1]):
                target = transitions.get(what, what) if kind == "end" else ""
                if kind == "at":
                    yield "at", (at[0], what), who
                elif kind == "end" and target in element.get("outcomes", "").split():
                    yield "end", target, who
                elif kind == "end" and target in states:
                    yield "at", (target, self._enter(states[target])), who
                else:
                    yield "raise", "", who

    def _outcomes(self, element: Element) -> list[str]:
        around = self.parents[element]
        unknown = self.undeclared and (not self.complete or self._is_elsewhere(element))
        names = {*self._transitions(element)}
        if around.tag in _PARALLEL:
            name = element.get("name", "")
            rows = self._outcome_maps(around).values()
            spoken = {items[name] for items in rows if name in items}
            names = spoken | (names if self.complete else set())
            return sorted(names | ({"other"} if unknown or not names else set()))
        if unknown:
            names |= {*around.get("outcomes", "").split(), *self._states(around)}
        return sorted(names)

    def _together(self, element: Element, at: Configuration) -> Iterator[Move]:
        states = self._states(element)
        for number, each in enumerate(states.values()):
            if at[number][0] == "ended":
                continue
            for kind, what, who in self._moves(each, at[number]):
                after = ("ended", what if kind == "end" else None) if kind != "at" else what
                whole = (*at[:number], after, *at[number + 1 :])
                if any(child[0] != "ended" for child in whole):
                    yield "at", whole, who
                else:
                    ends = dict(zip(states, (child[1] for child in whole), strict=True))
                    yield from ((*result, who) for result in self._results(element, ends))

    def _results(self, element: Element, ends: dict[str, Any]) -> set[tuple[str, str]]:
        """The results of a concurrence; the order of the items of a map is that of a hash."""
        if None in ends.values():
            return {("raise", "")}
        maps = self._outcome_maps(element)
        rows = [self._satisfied(items, ends) for items in maps.values()]
        results = set()
        for answers in product(*rows):
            held = [name for name, answer in zip(maps, answers, strict=True) if answer]
            if None in answers or len(held) > 1:
                results.add(("raise", ""))
            else:
                results.add(("end", held[0] if held else element.get("default_outcome", "")))
        return results

    def _satisfied(self, items: dict[str, str], ends: dict[str, Any]) -> list[bool | None]:
        """None: an empty outcome counts as missing, if it is looked up before one that differs."""
        differs = any(ends[name] not in ("", wanted) for name, wanted in items.items())
        missing = any(ends[name] == "" for name in items)
        return [*([None] if missing else []), *([False] if differs else [])] or [True]
