"""XML of a format → its elements with their places; nothing in it makes a reader open anything."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.compile.machines import MALFORMED, Place
from gpsfsm.model.finding import Problem
from gpsfsm.model.plan import Location
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.text import ILLEGAL, Lines, clip, is_namespace_declaration
from gpsfsm.syntax.token_reader import Collector
from gpsfsm.syntax.trees import TreeReader

if TYPE_CHECKING:
    from gpsfsm.model.plan import Attribute
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.source import Limits


OWN_PREFIX = "gpsfsm:"
"""The prefix that attributes in gpsfsm's namespace get, whatever a text calls it."""


class Elements:
    """The elements of a text in document order, the outermost first, and what is wrong with it.

    ``nodes`` are those of one language, with local names; they are empty where the text cannot be
    read. ``skipped`` are the elements and attributes of other languages, by the names that they
    have in the text: an element comes with itself, an attribute with the element that has it.

    ``namespace`` is that of the language; to one without ("") a prefix is a part of a name. ``own``
    is the namespace of gpsfsm's attributes.
    """

    def __init__(self, text: str, limits: Limits, namespace: str = "", own: str = "") -> None:
        collector = Collector(Lines(text), limits.max_problems)
        reader = TreeReader(ILLEGAL.sub(" ", text), limits, collector)
        nodes = reader.read(scan(reader.text, limits))
        self.problems: list[Problem] = list(collector.problems())
        self.skipped: list[tuple[TreeNode, str]] = []
        self.nodes: tuple[TreeNode, ...] = ()
        if nodes and not (reader.over or reader.fatal or reader.broken):
            self.nodes = self._of_language(nodes, namespace, own)
        if not self.nodes and not self.problems:
            self.problems.append(problem("there is no element in this text", Location(1, 1)))

    def _of_language(
        self, nodes: tuple[TreeNode, ...], namespace: str, own: str
    ) -> tuple[TreeNode, ...]:
        """The elements of the language, numbered anew; none if the outermost is not among them."""
        scope = _Scope()
        kept: list[tuple[TreeNode, str, tuple[Attribute, ...]]] = []
        numbers = {-1: -1}
        outermost = ""
        for node in nodes:
            self._declared(node, scope)
            if node.parent not in numbers:
                continue  # in an element of another language
            prefix, _, name = node.tag.rpartition(":")
            space = scope.of(prefix)
            if node.parent < 0:
                outermost = space
                if prefix if not namespace else space not in ("", namespace):
                    self._other_language(node, namespace)
                    return ()
            if prefix if not namespace else space != namespace and (space or outermost):
                self.skipped.append((node, node.tag))
                continue
            numbers[node.index] = len(kept)
            kept.append((node, name, self._attributes(node, scope, own)))
        return tuple(
            replace(
                node,
                index=numbers[node.index],
                tag=name,
                parent=numbers[node.parent],
                children=tuple(numbers[each] for each in node.children if each in numbers),
                attributes=attributes,
            )
            for node, name, attributes in kept
        )

    def _declared(self, node: TreeNode, scope: _Scope) -> None:
        """Take in what an element declares; prefixes that nothing declares are reported once."""
        scope.enter(node)
        for name in (node.tag, *(each.name for each in node.attributes)):
            prefix = name.rpartition(":")[0]
            if prefix and not is_namespace_declaration(name) and not scope.of(prefix):
                scope.bound[prefix] = [prefix]
                message = f"the prefix '{clip(prefix)}' is not declared"
                self.fault(node, message, f'add xmlns:{clip(prefix)}="…" to the outermost element')

    def _other_language(self, node: TreeNode, namespace: str) -> None:
        name = node.tag.rpartition(":")[2]
        message = f"the outermost element <{clip(node.tag)}> is not in the namespace '{namespace}'"
        hint = f'write xmlns="{namespace}"'
        if not namespace:
            message = f"the outermost element is <{clip(node.tag)}>, but must be <{name}>"
            hint = "remove the prefix: this format has no namespaces"
        self.fault(node, message, hint)

    def _attributes(self, node: TreeNode, scope: _Scope, own: str) -> tuple[Attribute, ...]:
        """The attributes of an element without those of other languages."""
        kept: list[Attribute] = []
        for each in node.attributes:
            prefix, _, name = each.name.rpartition(":")
            if is_namespace_declaration(each.name):
                continue
            if not prefix:
                kept.append(each)
            elif own and scope.of(prefix) == own:
                kept.append(replace(each, name=f"{OWN_PREFIX}{name}"))
            else:
                self.skipped.append((node, each.name))
        return tuple(kept)

    def children(self, node: TreeNode) -> list[TreeNode]:
        """The elements in an element."""
        return [self.nodes[child] for child in node.children]

    def fault(self, node: TreeNode, message: str, hint: str) -> None:
        """Something is wrong with an element."""
        self.problems.append(problem(message, at(node), hint, length=1 + len(node.tag)))


class _Scope:
    """The namespaces that prefixes stand for ("": none) at the element that was entered last."""

    def __init__(self) -> None:
        self.bound: dict[str, list[str]] = {"": [""], "xml": ["xml"]}
        self._open: list[tuple[int, list[str]]] = [(-1, [])]

    def of(self, prefix: str) -> str:
        """The namespace of a prefix, "" for none."""
        spaces = self.bound.get(prefix)
        return spaces[-1] if spaces else ""

    def enter(self, node: TreeNode) -> None:
        """An element begins; those that are not around it have ended."""
        while self._open[-1][0] != node.parent:
            for prefix in self._open.pop()[1]:
                self.bound[prefix].pop()
        declared = [each for each in node.attributes if is_namespace_declaration(each.name)]
        for each in declared:
            self.bound.setdefault(each.name[6:], []).append(each.text)
        self._open.append((node.index, [each.name[6:] for each in declared]))


def problem(message: str, location: Location, hint: str = "", *, length: int = 0) -> Problem:
    """A report that a text is no machine."""
    return Problem(MALFORMED, message, location, hint or "docs/machines.md", length)


def at(node: TreeNode) -> Location:
    """The place of an element."""
    return node.location


def place_of(node: TreeNode) -> Place:
    """The place of an element, for a node of a graph."""
    return Place(node.line, node.column, node.start, node.end)
