"""The gist of a behaviour tree: where it is meant to drive, however it is written (docs/tasks.md).

Only grades rest on it: where the syntax is wrong, or where no automaton expresses the tree.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from gpsfsm.syntax import parse
from gpsfsm.tasks.loose import MAX_DEPTH, Element, elements_of
from gpsfsm.tasks.tree_words import Words

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan
    from gpsfsm.tasks.place_names import PlaceNames

__all__ = ["tree_gist_of"]

_MAX_PARTS = 5_000
_FALLBACK = re.compile(r"(?i:fallback|selector|^priority)")
_BRANCH = re.compile(r"^(?i:IfThenElse|WhileDoElse|If|IfElse)$")
_PARALLEL = re.compile(r"^(?i:Parallel)")
_NOT_RUN = ("TreeNodesModel", "BehaviorTree", "include", "Metadata")
_UNKNOWN = "?"


class _Kind(Enum):
    DRIVE = auto()
    SEQUENCE = auto()
    GUARD = auto()
    PARALLEL = auto()


@dataclass(frozen=True, slots=True)
class _Part:
    """A drive to ``place``, or other parts one after the other, beside or instead of each other."""

    kind: _Kind
    place: str = ""
    parts: tuple[_Part, ...] = ()
    line: int = 1


def tree_gist_of(text: str, places: PlaceNames, file: str = "<text>") -> Plan | None:
    """What a text of behaviour trees means, as a plan; None if it is meant to drive nowhere.

    A drive to a place of the task has the parameter ``place`` with its name, any other drive has
    ``place="?"``. The lines of the plan are those of the text.

    >>> from gpsfsm.tasks.load import read_task
    >>> from gpsfsm.tasks.place_names import PlaceNames
    >>> places = PlaceNames(read_task(b"{places: {Bay: {}}, steps: [{do: Bay}]}"))
    >>> tree = '<root><BehaviorTree><Drive goal="{bay}"/></BehaviorTree></root>'
    >>> [runner.parameters for runner in tree_gist_of(tree, places).runners]
    [{'place': 'Bay'}]
    """
    parts = _Reader(elements_of(text), places).read()
    lines = [line for part in parts for line in _lines(part, places)]
    if not lines:
        return None
    words = "\n".join(["<Plan>", *(line for line, _ in lines), "</Plan>"])
    plan = parse(words, file=file).plan
    if plan is None:
        return None
    numbers = [lines[0][1], *(number for _, number in lines)]
    elements = (replace(each, line=numbers[each.line - 1], column=1) for each in plan.elements)
    return replace(plan, elements=tuple(elements))


class _Reader:
    """Reads the tree that runs, with the trees that it uses put in."""

    def __init__(self, whole: Element, places: PlaceNames) -> None:
        self.places = places
        self.words = Words(places)
        self.left = _MAX_PARTS
        roots = [each for each in whole.descendants() if each.tag == "root"]
        self.root = roots[-1] if roots else whole
        self.trees: dict[str, Element] = {}
        self.tops = [each for each in self.root.descendants() if each.tag == "BehaviorTree"]
        for top in self.tops:
            self.trees.setdefault(top.attributes.get("ID", ""), top)

    def read(self) -> tuple[_Part, ...]:
        """What the tree that runs comes to; nothing, if that is too much."""
        parts = self._children(self._main(), 0)
        return parts if self.left > 0 else ()

    def _main(self) -> Element:
        """The tree that is named, or else the first that no other one uses, or else the first."""
        named = self.trees.get(self.root.attributes.get("main_tree_to_execute", ""))
        if named is not None or not self.tops:
            return named or self.root
        used = {self._tree(each) for top in self.tops for each in top.descendants()}
        free = [top for top in self.tops if top.attributes.get("ID", "") not in used]
        return (free or self.tops)[0]

    def _tree(self, element: Element) -> str | None:
        """The ID of the tree that an element stands for."""
        name = element.tag
        if name in ("SubTree", "SubTreePlus"):
            name = element.attributes.get("ID", "")
        return name if name and name in self.trees else None

    def _children(self, element: Element, depth: int) -> tuple[_Part, ...]:
        if depth > MAX_DEPTH:
            return ()
        return tuple(part for child in element.children for part in self._element(child, depth))

    def _element(self, element: Element, depth: int) -> tuple[_Part, ...]:
        self.left -= 1
        if self.left <= 0 or element.tag in _NOT_RUN:
            return ()
        tree = self._tree(element)
        if tree is not None:
            with self.words.inside(element):
                parts = self._children(self.trees[tree], depth + 1)
            if parts or not self.words.moves(element):
                return self._called(element, parts)
        if element.children:
            parts = self._control(element, depth)
            if parts and all(map(self.words.is_else, element.children)):
                return _guard((self._leaf(element), parts))
            if parts or self.words.is_control(element):
                return self._called(element, parts)
        return self._leaf(element)

    def _control(self, element: Element, depth: int) -> tuple[_Part, ...]:
        name = element.identity
        kind = _Kind.GUARD if _FALLBACK.search(name) else _Kind.SEQUENCE
        if _BRANCH.match(name):
            kind = _Kind.GUARD  # its question is left out
        elif _PARALLEL.match(name):
            kind = _Kind.PARALLEL
        if kind is _Kind.SEQUENCE:
            inner = self._children(element, depth + 1)
            return (_Part(kind, parts=inner),) if inner else ()
        alone = (Element("Sequence", children=[child]) for child in element.children)
        held = tuple(self._children(each, depth + 1) for each in alone)
        return _guard(held) if kind is _Kind.GUARD else _beside(kind, held)

    def _leaf(self, element: Element) -> tuple[_Part, ...]:
        first, other = self.words.drives(element)
        parts = _drives(first, element)
        return _guard((parts, _drives(other, element))) if other else parts

    def _called(self, element: Element, parts: tuple[_Part, ...]) -> tuple[_Part, ...]:
        """Drives to places that nothing names, in an element that names one: they go there."""
        if not parts or any(place for place in _places(parts)):
            return parts
        named = self.words.named(element)
        return _drives(named, element) if len(named) == 1 else parts


def _guard(held: tuple[tuple[_Part, ...], ...]) -> tuple[_Part, ...]:
    return _beside(_Kind.GUARD, held)


def _beside(kind: _Kind, held: tuple[tuple[_Part, ...], ...]) -> tuple[_Part, ...]:
    """One part that holds those that drive somewhere."""
    parts = tuple(_Part(_Kind.SEQUENCE, parts=each) for each in held if each)
    return (_Part(kind, parts=parts),) if parts else ()


def _drives(places: tuple[str, ...], element: Element) -> tuple[_Part, ...]:
    return tuple(_Part(_Kind.DRIVE, place, line=element.line) for place in places)


def _places(parts: tuple[_Part, ...]) -> list[str]:
    """The places of all drives, "" for those that are not known."""
    found: list[str] = []
    pending = list(reversed(parts))
    while pending:
        part = pending.pop()
        if part.kind is _Kind.DRIVE:
            found.append(part.place)
        pending.extend(reversed(part.parts))
    return found


_Line = tuple[str, int]  # of the plan, and where in the text it comes from


def _lines(part: _Part, places: PlaceNames) -> list[_Line]:
    """A part in the words of plans. Parts are nested about as deep as elements are."""
    if part.kind is _Kind.DRIVE:
        interface = quoteattr(places.interface(part.place))
        place = quoteattr(part.place or _UNKNOWN)
        return [(f"<Runner interface={interface} place={place} />", part.line)]
    inner = [_lines(each, places) for each in part.parts]
    if part.kind is _Kind.GUARD:
        first, *rest = inner
        lines = [*first, *(line for each in rest for line in _wrapped("recovery", each))]
        return _wrapped("sequential", lines)
    kind = "sequential" if part.kind is _Kind.SEQUENCE else "parallel_all"
    return _wrapped(kind, [line for each in inner for line in each])


def _wrapped(kind: str, lines: list[_Line]) -> list[_Line]:
    if not lines:
        return []
    return [(f'<Control type="{kind}">', lines[0][1]), *lines, ("</Control>", lines[-1][1])]
