"""XML of a format → its elements with their places; nothing in it makes a reader open anything."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.machines import MALFORMED, Place
from gpsfsm.model.finding import Problem
from gpsfsm.model.plan import Location
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.text import ILLEGAL, Lines
from gpsfsm.syntax.token_reader import Collector
from gpsfsm.syntax.trees import TreeReader

if TYPE_CHECKING:
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.source import Limits


class Elements:
    """The elements of a text in document order, the outermost first, and what is wrong with it.

    ``nodes`` is empty where the text cannot be read.
    """

    def __init__(self, text: str, limits: Limits) -> None:
        collector = Collector(Lines(text), limits.max_problems)
        reader = TreeReader(ILLEGAL.sub(" ", text), limits, collector)
        nodes = reader.read(scan(reader.text, limits))
        self.nodes = () if reader.over or reader.fatal or reader.broken else nodes
        self.problems: list[Problem] = list(collector.problems())
        if not self.nodes and not self.problems:
            self.problems.append(problem("there is no element in this text", Location(1, 1)))

    def children(self, node: TreeNode) -> list[TreeNode]:
        """The elements in an element."""
        return [self.nodes[child] for child in node.children]

    def fault(self, node: TreeNode, message: str, hint: str) -> None:
        """Something is wrong with an element."""
        self.problems.append(problem(message, at(node), hint, length=1 + len(node.tag)))


def problem(message: str, location: Location, hint: str = "", *, length: int = 0) -> Problem:
    """A report that a text is no machine."""
    return Problem(MALFORMED, message, location, hint or "docs/machines.md", length)


def at(node: TreeNode) -> Location:
    """The place of an element."""
    return node.location


def place_of(node: TreeNode) -> Place:
    """The place of an element, for a node of a graph."""
    return Place(node.line, node.column, node.start, node.end)
