"""Elements and units of a plan that is unfolded from a behaviour tree, while they are made."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.compile.units import TreePlan, UnitKind, Units
from gpsfsm.model.plan import Attribute, ControlType, Element, Kind, sharing_lines

if TYPE_CHECKING:
    from gpsfsm.model.tree import TreeNode

__all__ = ["Growth"]

_TYPES = {
    UnitKind.ALL: ControlType.PARALLEL_ALL,
    UnitKind.ANY: ControlType.PARALLEL_ANY,
    UnitKind.COUNT: ControlType.PARALLEL_ANY,
    UnitKind.WAIT: ControlType.PARALLEL_ALL,
}


@dataclass(slots=True)
class Growth:
    """Parents come before their children; ``nodes`` tells the node of each element."""

    elements: list[Element] = field(default_factory=list)
    nodes: list[TreeNode] = field(default_factory=list)
    needs: dict[int, int] = field(default_factory=dict)
    _paths: list[str] = field(default_factory=list)
    _inside: list[list[int]] = field(default_factory=list)
    _uses: dict[int, int] = field(default_factory=dict)
    _kinds: list[UnitKind] = field(default_factory=list)
    _origins: list[int] = field(default_factory=list)
    _children: list[list[int]] = field(default_factory=list)
    _parents: list[int] = field(default_factory=list)

    def element(
        self,
        node: TreeNode,
        parent: int,
        kind: Kind,
        *,
        attributes: tuple[Attribute, ...] | None = None,
        unit: UnitKind = UnitKind.SEQUENCE,
    ) -> int:
        """A new element for a use of a node; its index."""
        index = len(self.elements)
        copy = self._uses[node.index] = self._uses.get(node.index, 0) + 1
        self._paths.append(node.path if copy == 1 else f"{node.path}@{copy}")
        self._inside.append([])
        if parent >= 0:
            self._inside[parent].append(index)
        self.nodes.append(node)
        control_type = _TYPES.get(unit, ControlType.SEQUENTIAL)
        self.elements.append(
            Element(
                index,
                kind,
                parent,
                copy,
                (),
                node.attributes if attributes is None else attributes,
                node.line,
                node.column,
                node.start,
                node.end,
                None if kind is Kind.RUNNER else control_type,
                "" if kind is Kind.RUNNER else node.identity,
            )
        )
        return index

    def unit(self, kind: UnitKind, element: int, parent: int) -> int:
        """A new unit for an element, the last child of its parent; its index."""
        unit = len(self._kinds)
        self._kinds.append(kind)
        self._origins.append(element)
        self._children.append([])
        self._parents.append(parent)
        if parent >= 0:
            self._children[parent].append(unit)
        return unit

    def units(self) -> Units:
        """All units so far."""
        positions = [0] * len(self._kinds)
        for children in self._children:
            for position, child in enumerate(children):
                positions[child] = position
        return Units(
            tuple(self._kinds),
            tuple(self._origins),
            tuple(map(tuple, self._children)),
            tuple(self._parents),
            tuple(positions),
            self.needs,
        )

    def plan(self, file: str) -> TreePlan:
        """The plan of all elements."""
        elements = sharing_lines(
            [
                replace(each, children=tuple(inside))
                for each, inside in zip(self.elements, self._inside, strict=True)
            ]
        )
        return TreePlan(file, elements, None, tuple(self._paths), self.units())
