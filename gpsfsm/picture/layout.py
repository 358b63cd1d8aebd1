"""Where everything of an automaton's picture stands; linear, for any depth.

The layout follows the plan and not the graph: controls are boxes, what follows stands below what
it follows, alternatives stand beside what they recover, and units of a parallel beside each other
with their join below. So a picture looks as the plan reads, also with 10,000 runners.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.picture.arranging import arrange
from gpsfsm.picture.cells import Cell, Flow, grow
from gpsfsm.picture.shapes import Box, caption

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton

__all__ = ["Group", "Layout", "layout"]


@dataclass(frozen=True, slots=True)
class Group:
    """The box of a control. ``element`` is its index in ``Plan.elements``.

    ``parent`` is the index of the group around it, -1 at the outermost level, whose ``depth`` is 0.
    """

    element: int
    parent: int
    label: str
    box: Box
    depth: int


@dataclass(frozen=True, slots=True)
class Layout:
    """Boxes of all nodes, by index of the node, and of all controls inside the plan, in its order.

    ``group_of`` is per node the index of the innermost group around it, -1 for none. ``size`` is
    that of the whole picture. Boxes of nodes do not overlap, and what is in a group lies inside it.
    A node that is not drawn, which is give_up on an engine that does not give up, has an empty box.
    ``cells`` is what the edges are routed by.
    """

    nodes: tuple[Box, ...]
    groups: tuple[Group, ...]
    group_of: tuple[int, ...]
    size: tuple[float, float]
    cells: tuple[Cell, ...]


def layout(automaton: Automaton) -> Layout:
    """Lay out an automaton; the same for the same plan."""
    cells = grow(automaton)
    arrange(automaton, cells)
    controls = [cell.element for cell in cells if _is_group(cell)]
    number = {element: place for place, element in enumerate(sorted(controls))}
    nodes = [Box(0.0, 0.0, 0.0, 0.0)] * len(automaton.nodes)
    group_of = [-1] * len(automaton.nodes)
    groups: dict[int, Group] = {}
    inner: list[int] = []  # per cell the innermost group that it is in, itself included
    for cell in cells:
        around = inner[cell.parent] if cell.parent >= 0 else -1
        if cell.flow is Flow.NODE:
            nodes[cell.node] = _node_box(cell)
            group_of[cell.node] = around
        elif _is_group(cell):
            depth = groups[around].depth + 1 if around >= 0 else 0
            label = caption(automaton.plan.elements[cell.element])
            outer, around = around, number[cell.element]
            groups[around] = Group(cell.element, outer, label, _box(cell), depth)
        inner.append(around)
    return Layout(
        nodes=tuple(nodes),
        groups=tuple(groups[place] for place in range(len(groups))),
        group_of=tuple(group_of),
        size=_box(cells[0])[2:],
        cells=tuple(cells),
    )


def _is_group(cell: Cell) -> bool:
    return cell.flow not in (Flow.NODE, Flow.PLAN, Flow.GUARD)


def _box(cell: Cell) -> Box:
    return Box(_round(cell.x - cell.left), _round(cell.y), *map(_round, _size(cell)))


def _size(cell: Cell) -> tuple[float, float]:
    return cell.left + cell.right, cell.height


def _node_box(cell: Cell) -> Box:
    """Without the place at its right that is kept for the name of an event."""
    return Box(
        _round(cell.x - cell.left), _round(cell.y), _round(2 * cell.left), _round(cell.height)
    )


def _round(value: float) -> float:
    return round(value, 1)
