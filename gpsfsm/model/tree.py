"""Behaviour trees as they are written: BehaviorTree.CPP XML, flat, in document order.

What the built-in nodes mean is in ``gpsfsm.model.tree_nodes``; the compiler unfolds a forest into
a plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.model.plan import Attribute

__all__ = ["Forest", "NodeModel", "PortKind", "TreeNode"]

_CATEGORIES = frozenset({"Action", "Condition", "Decorator", "Control"})


class PortKind(StrEnum):
    """The direction of a port. The value is its tag in a TreeNodesModel."""

    INPUT = "input_port"
    OUTPUT = "output_port"
    BOTH = "inout_port"


@dataclass(frozen=True, slots=True, eq=False)
class TreeNode:
    """One element below ``<root>``, or ``<root>`` itself.

    ``index`` is its place in ``Forest.nodes`` (document order, parents first); ``parent`` is -1
    for the root; ``start`` and ``end`` are code point offsets of the start tag; ``path`` is the
    element path, ``/root/BehaviorTree[1]/Sequence[1]``.
    """

    index: int
    tag: str
    parent: int
    children: tuple[int, ...]
    attributes: tuple[Attribute, ...]
    line: int
    column: int
    start: int
    end: int
    path: str

    def attribute(self, name: str) -> Attribute | None:
        """The attribute with this name, or None."""
        for attribute in self.attributes:
            if attribute.name == name:
                return attribute
        return None

    def text(self, name: str) -> str:
        """The source text of the attribute ``name``, "" where there is none."""
        found = self.attribute(name)
        return "" if found is None else found.text

    @property
    def explicit(self) -> bool:
        """Whether the node is written ``<Action ID="MoveTo"/>`` and not ``<MoveTo/>``."""
        return self.tag in _CATEGORIES

    @property
    def identity(self) -> str:
        """The ID of the kind of node that this is ("" where it is missing)."""
        return self.text("ID") if self.explicit else self.tag


@dataclass(frozen=True, slots=True)
class NodeModel:
    """What a TreeNodesModel says of a kind of node; ``line`` is where, 0 if it stands elsewhere."""

    category: str
    ports: Mapping[str, PortKind]
    line: int


@dataclass(frozen=True, slots=True, eq=False)
class Forest:
    """A file of behaviour trees.

    ``version`` is 3 or 4, 0 where the file does not say it. ``trees`` are the indices of the
    BehaviorTree elements by their ID; ``main`` is the one that runs, -1 where it cannot be known.
    ``models`` is None where the file has no TreeNodesModel.
    """

    file: str
    version: int
    nodes: tuple[TreeNode, ...]
    trees: Mapping[str, int]
    main: int
    models: Mapping[str, NodeModel] | None

    def children(self, node: TreeNode) -> list[TreeNode]:
        """The children of a node, in document order."""
        return [self.nodes[child] for child in node.children]
