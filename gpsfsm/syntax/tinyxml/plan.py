"""The plan tree of a text that an engine has accepted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.plan import Attribute, ControlType, Element, Kind, Plan
from gpsfsm.syntax.lines import Lines
from gpsfsm.syntax.values import typed

if TYPE_CHECKING:
    from gpsfsm.model.engine import EngineDocument, EngineElement

__all__ = ["BOM", "plan_of", "position"]

BOM = "\ufeff"
_TYPES = {kind.value: kind for kind in ControlType}
_HOLDERS = (Kind.PLAN, Kind.CONTROL)


def position(text: str, offset: int) -> tuple[int, int]:
    """Line and column of an offset in an engine's text; its byte order mark does not count."""
    shift = len(BOM) if text.startswith(BOM) else 0
    return Lines(text[shift:]).position(max(offset - shift, 0))


def plan_of(
    document: EngineDocument, root: int, text: str, file: str
) -> tuple[Plan, dict[int, int]]:
    """The plan below the element ``root``, and where its elements are in the plan.

    The second result maps indices of ``document`` to indices of ``Plan.elements``. What the engine
    passes over is not in the plan: what is in runners, elements that it does not know, and controls
    whose type it does not know.
    """
    maker = _Maker(text)
    maker.add(document.element(root), -1, 1)
    # Levels of (index in the plan, elements ahead of it), the innermost last.
    levels = [(0, iter(document.elements(document.element(root).children)))]
    counts: list[dict[str, int]] = [{}]
    while levels:
        parent, ahead = levels[-1]
        element = next(ahead, None)
        if element is None:
            levels.pop()
            counts.pop()
            continue
        ordinal = counts[-1][element.tag] = counts[-1].get(element.tag, 0) + 1
        index = maker.add(element, parent, ordinal)
        if index is not None and maker.kinds[index] in _HOLDERS:
            levels.append((index, iter(document.elements(element.children))))
            counts.append({})
    return maker.plan(file), maker.places


class _Maker:
    def __init__(self, text: str) -> None:
        self._shift = len(BOM) if text.startswith(BOM) else 0
        self._lines = Lines(text[self._shift :])
        self._found: list[tuple[EngineElement, int, int]] = []
        self._children: list[list[int]] = []
        self.kinds: list[Kind] = []
        self.places: dict[int, int] = {}

    def add(self, element: EngineElement, parent: int, ordinal: int) -> int | None:
        """The index of a new element of the plan; None if a plan has no such element."""
        if element.tag == Kind.PLAN and parent < 0:
            kind = Kind.PLAN
        elif element.tag == Kind.RUNNER:
            kind = Kind.RUNNER
        elif element.tag == Kind.CONTROL and element.text("type") in _TYPES:
            kind = Kind.CONTROL
        else:
            return None
        index = len(self._found)
        self._found.append((element, parent, ordinal))
        self._children.append([])
        self.kinds.append(kind)
        self.places[element.index] = index
        if parent >= 0:
            self._children[parent].append(index)
        return index

    def plan(self, file: str) -> Plan:
        return Plan(file, tuple(self._element(index) for index in range(len(self._found))))

    def _element(self, index: int) -> Element:
        element, parent, ordinal = self._found[index]
        kind = self.kinds[index]
        control_type = None
        if kind is Kind.PLAN:
            control_type = ControlType.SEQUENTIAL
        elif kind is Kind.CONTROL:
            control_type = _TYPES[element.text("type") or ""]
        line, column = self._lines.position(element.start - self._shift)
        return Element(
            index,
            kind,
            parent,
            ordinal,
            tuple(self._children[index]),
            self._attributes(element),
            line,
            column,
            element.start - self._shift,
            element.end - self._shift,
            control_type,
        )

    def _attributes(self, element: EngineElement) -> tuple[Attribute, ...]:
        attributes = []
        for each in element.attributes:
            line, column = self._lines.position(each.start - self._shift)
            attributes.append(Attribute(each.name, each.value, typed(each.value), line, column))
        return tuple(attributes)
