"""The tree of cells: which node and which control stands beside, below or inside which other.

A cell is a node, a control with its units and joins, or a unit with the recoveries that guard it.
Cells are kept in one list, every parent before its children, so that sizes are found in a loop
backwards and places in a loop forwards, for any depth. Rows of a large plan may be divided into
parts, which the page can fold as it folds controls:

    a plan of 3,000 runners    start, 60 parts of 50 runners each, the join, complete, give up

What the plan's structure tells of joins is here, too: which of them collect failures, so that what
leads on from them is drawn as a failure.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, auto
from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Event
from gpsfsm.model.plan import ControlType, Element, Kind
from gpsfsm.model.tree import BUILTINS, Meaning
from gpsfsm.picture.shapes import caption

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.model.automaton import Automaton, Node, Signal


class Flow(Enum):
    """The arrangement of the children of a cell. NODE: a cell without children.

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
_LARGE = 2_500
"""Above so many nodes, long rows are divided."""
_LEAST_PART = 50
_MOST_PARTS = 150


@dataclass(slots=True)
class Cell:
    """A cell. ``x`` and ``y`` are its spine and its top, first relative to the parent's.

    The spine is the vertical line on which a cell is entered and left; ``left`` and ``right`` are
    what lies beside it. ``label`` is that of a control or a part. ``entry`` is how far below the
    top the first node's middle is. ``tracks`` are the left and right sides of the columns (or rows:
    top and bottom) into which the children are folded, relative to spine and top, and ``track`` is
    that in which the cell stands.
    """

    parent: int
    flow: Flow
    element: int = -1
    node: int = -1
    label: str = ""
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


def grow(automaton: Automaton, *, parts: bool = False) -> list[Cell]:
    """All cells of an automaton, in the order of the plan; the first one is the plan's.

    With ``parts``, long rows of a large plan are divided.
    """
    cells = _Growth(automaton).grow()
    if parts and len(automaton.nodes) > _LARGE:
        for number in range(len(cells)):
            if len(cells[number].children) > 2 * _LEAST_PART:
                _divide(automaton, cells, number)
    return _in_order(cells)


def _divide(automaton: Automaton, cells: list[Cell], number: int) -> None:
    """Put the children of a cell into parts; start and complete stay outside."""
    cell = cells[number]
    if cell.flow is Flow.GUARD:
        return
    ends = (0, automaton.complete) if cell.flow is Flow.PLAN else ()
    inside = [child for child in cell.children if cells[child].node not in ends]
    size = max(_LEAST_PART, -(-len(inside) // _MOST_PARTS))
    flow = Flow.DOWN if cell.flow is Flow.PLAN else cell.flow
    parts = []
    for start in range(0, len(inside), size):
        children = inside[start : start + size]
        for child in children:
            cells[child].parent = len(cells)
        parts.append(len(cells))
        label = _part_label(automaton, cells, children)
        cells.append(Cell(number, flow, label=label, children=children))
    before, after = cell.children[: len(ends) // 2], cell.children[len(inside) + len(ends) // 2 :]
    cell.children = [*before, *parts, *after]


def _part_label(automaton: Automaton, cells: Sequence[Cell], children: Sequence[int]) -> str:
    lines = []
    for child in (children[0], children[-1]):
        cell = cells[child]
        while cell.children:
            cell = cells[cell.children[0]]
        if cell.node >= 0:
            origin = automaton.nodes[cell.node].origin
            lines.append(automaton.plan.elements[origin].line)
    return f"lines {lines[0]} \u2013 {lines[1]}" if len(lines) > 1 else f"{len(children)} units"


def _in_order(cells: Sequence[Cell]) -> list[Cell]:
    """The cells as the plan has them: each before its children, and these before its joins."""
    order: list[int] = []
    stack = [0]
    while stack:
        order.append(stack.pop())
        cell = cells[order[-1]]
        stack += reversed([*cell.children, *cell.joins])
    place = {number: at for at, number in enumerate(order)}
    for cell in cells:
        cell.parent = place[cell.parent] if cell.parent >= 0 else -1
        cell.children = [place[child] for child in cell.children]
        cell.joins = [place[join] for join in cell.joins]
    return [cells[number] for number in order]


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
        self.cells[self.cell_of[child.index]].label = caption(child)
        self.cells[cell].children.append(self.cell_of[child.index])

    def _joins(self, cell: int, element: int) -> None:
        for node in self.joins.pop(element, ()):
            self._node(cell, node, join=True)

    def _node(self, cell: int, node: int, *, join: bool = False) -> None:
        index = self._add(Flow.NODE, cell, node=node)
        (self.cells[cell].joins if join else self.cells[cell].children).append(index)


def _flow(element: Element) -> Flow:
    if element.control_type is ControlType.RECOVERY or meaning_of(element) in _ALTERNATIVES:
        return Flow.ACROSS
    return Flow.BESIDE if element.control_type in _PARALLEL else Flow.DOWN


_SWAPPING = (Meaning.INVERT, Meaning.FORCE_FAILURE)
_FORCING = (Meaning.FORCE_SUCCESS, Meaning.FORCE_FAILURE)


def meaning_of(element: Element) -> Meaning | None:
    """The meaning of a node of a behaviour tree; None for what the file itself has named."""
    builtin = BUILTINS.get(element.tag)
    return builtin.meaning if builtin else None


def failing_joins(automaton: Automaton) -> frozenset[int]:
    """The joins that collect failures.

    The control of a join tells it, but for parallels, which have a join for either: there, and on
    engines, the inputs tell.
    """
    failing: set[int] = set()
    for node in automaton.nodes:
        if node.kind is NodeKind.JOIN:
            fails = _by_control(automaton, node)
            if fails is None:
                inputs = automaton.inputs[node.index]
                failures = sum(_fails(automaton, failing, signal, node) for signal in inputs)
                fails = 2 * failures > len(inputs)
            if fails:
                failing.add(node.index)
    return frozenset(failing)


def _by_control(automaton: Automaton, join: Node) -> bool | None:
    element = automaton.plan.elements[join.origin]
    meaning = meaning_of(element)
    if not automaton.traits.gives_up or meaning is Meaning.BRANCH:
        return None
    if meaning in _FORCING or meaning in _ALTERNATIVES:
        return False
    if element.control_type is ControlType.RECOVERY:
        return False
    sequential = element.control_type in (ControlType.SEQUENTIAL, None)
    return True if sequential and element.kind is not Kind.RUNNER else None


def _fails(automaton: Automaton, failing: set[int], signal: Signal, join: Node) -> bool:
    """True if a signal tells the control of the join that something in it has failed."""
    fails = signal.event is Event.FAILED or signal.node in failing
    elements = automaton.plan.elements
    index = automaton.nodes[signal.node].origin
    while index > join.origin:
        if meaning_of(elements[index]) in _SWAPPING:
            fails = not fails
        index = elements[index].parent
    return fails
