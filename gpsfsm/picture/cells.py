"""The tree of cells: which node and which control stands beside, below or inside which other.

A cell is a node, a control with its units and joins, or a unit with the recoveries that guard it.
Cells are kept in one list, every parent before its children, so that sizes are found in a loop
backwards and places in a loop forwards, for any depth.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, auto
from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.plan import ControlType, Element, Kind
from gpsfsm.model.tree_nodes import Meaning
from gpsfsm.picture.polarity import meaning_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.automaton import Automaton

__all__ = ["Cell", "Flow", "grow"]


class Flow(Enum):
    """How the children of a cell stand to each other. NODE: a cell without children.

    DOWN: one below the other, each triggered by the success of the one before. BESIDE: side by
    side, all triggered at once. ACROSS: side by side, each triggered by the failure of the one
    before. GUARD: a unit, then its recoveries, and the joins below. PLAN: as DOWN, without border.
    """

    NODE = auto()
    DOWN = auto()
    BESIDE = auto()
    ACROSS = auto()
    GUARD = auto()
    PLAN = auto()


_ALTERNATIVES = (Meaning.FALLBACK, Meaning.REACTIVE_FALLBACK, Meaning.RETRY)
_PARALLEL = (ControlType.PARALLEL_ALL, ControlType.PARALLEL_ANY)


@dataclass(slots=True)
class Cell:
    """A cell. ``x`` and ``y`` are its spine and its top, first relative to the parent's.

    The spine is the vertical line on which a cell is entered and left; ``left`` and ``right`` are
    what lies beside it. ``entry`` is how far below the top the first node's middle is. ``tracks``
    are the left and right sides of the columns (or rows: top and bottom) into which the children
    are folded, relative to spine and top, and ``track`` is that in which the cell stands.
    """

    parent: int
    flow: Flow
    element: int = -1
    node: int = -1
    children: list[int] = field(default_factory=list)
    joins: list[int] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0
    left: float = 0.0
    right: float = 0.0
    height: float = 0.0
    entry: float = 0.0
    tracks: list[tuple[float, float]] = field(default_factory=list)
    track: int = 0


def grow(automaton: Automaton) -> list[Cell]:
    """All cells of an automaton; the first one is the plan's."""
    return _Growth(automaton).grow()


class _Growth:
    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self.plan = automaton.plan
        self.cells: list[Cell] = []
        self.cell_of: dict[int, int] = {}
        self.runners: dict[int, list[int]] = {}
        self.joins: dict[int, list[int]] = {}
        for node in automaton.nodes:
            if node.kind is NodeKind.RUNNER:
                self.runners.setdefault(node.origin, []).append(node.index)
            elif node.kind is NodeKind.JOIN:
                origin = self.plan.elements[node.origin]
                control = origin.parent if origin.kind is Kind.RUNNER else origin.index
                self.joins.setdefault(control, []).append(node.index)

    def grow(self) -> list[Cell]:
        self._add(Flow.PLAN, -1, element=0)
        self.cell_of[0] = 0
        for element in self.plan.elements:
            if element.kind is not Kind.RUNNER:
                self._fill(element)
        return self.cells

    def _add(self, flow: Flow, parent: int, *, element: int = -1, node: int = -1) -> int:
        index = len(self.cells)
        self.cells.append(Cell(parent, flow, element, node))
        return index

    def _fill(self, element: Element) -> None:
        """The children and joins of a control, whose cell is there already."""
        cell = self.cell_of[element.index]
        first = cell == 0
        if first:
            self._node(cell, 0)
        meaning = meaning_of(element)
        for number, unit in enumerate(self._units(element, meaning)):
            inside = cell
            if len(unit) > 1:
                inside = self._add(Flow.GUARD, cell)
                self.cells[cell].children.append(inside)
            for child in unit:
                self._child(inside, child)
            if len(unit) > 1 and not (meaning is Meaning.BRANCH and number):
                for recovery in unit[1:]:
                    self._joins(inside, recovery.index)
        self._joins(cell, element.index)
        if first:
            self._node(cell, self.automaton.complete)
            if self.automaton.traits.gives_up:
                self._node(cell, self.automaton.give_up, join=True)

    def _units(self, element: Element, meaning: Meaning | None) -> Iterator[list[Element]]:
        """A child with the recoveries that follow it; both branches of an IfThenElse."""
        children = list(self.plan.children(element))
        if meaning is Meaning.BRANCH:
            yield children[:1]
            yield children[1:]
            return
        unit: list[Element] = []
        for child in children:
            if unit and child.control_type is ControlType.RECOVERY:
                unit.append(child)
                continue
            if unit:
                yield unit
            # A recovery that nothing precedes guards nothing; the next one does not guard it.
            dead = child.control_type is ControlType.RECOVERY
            unit = [] if dead else [child]
            if dead:
                yield [child]
        if unit:
            yield unit

    def _child(self, cell: int, child: Element) -> None:
        if child.kind is Kind.RUNNER:
            for node in self.runners.get(child.index, ()):
                self._node(cell, node)
            return
        self.cell_of[child.index] = self._add(_flow(child), cell, element=child.index)
        self.cells[cell].children.append(self.cell_of[child.index])

    def _joins(self, cell: int, element: int) -> None:
        for node in self.joins.pop(element, ()):
            self._node(cell, node, join=True)

    def _node(self, cell: int, node: int, *, join: bool = False) -> None:
        found = self._add(Flow.NODE, cell, node=node)
        (self.cells[cell].joins if join else self.cells[cell].children).append(found)


def _flow(element: Element) -> Flow:
    if element.control_type is ControlType.RECOVERY or meaning_of(element) in _ALTERNATIVES:
        return Flow.ACROSS
    return Flow.BESIDE if element.control_type in _PARALLEL else Flow.DOWN
