"""Mutations: small changes of a plan, of the kind that language models make.

A mutation changes a tree of nodes, which is written as text again. No step recurses over the plan.
A module of this package lists its kinds of changes as ``OPERATORS``; a new one may be a new file.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.model.plan import Element, Plan

_CONTROL_CHARACTERS = {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}


@dataclass(slots=True, eq=False)
class Node:
    """An element as it is written."""

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    children: list[Node] = field(default_factory=list)


class Tree:
    """A plan as nodes. ``nodes`` and ``parents`` go by the index of the element in the plan.

    A completion runner that ends the plan is no element of it; it is written all the same, for
    without it another one that stands before it would be taken for the end.
    """

    def __init__(self, plan: Plan) -> None:
        self.nodes: list[Node] = []
        self._parents: list[int] = []
        end = plan.dropped_completion
        self._end = [] if end is None else [_node(end)]
        for element in plan.elements:
            node = _node(element)
            self.nodes.append(node)
            self._parents.append(element.parent)
            if element.parent >= 0:
                self.nodes[element.parent].children.append(node)

    @property
    def root(self) -> Node:
        """The plan itself."""
        return self.nodes[0]

    def place(self, index: int) -> tuple[list[Node], int]:
        """The list that an element stands in, and its place there; not for the root."""
        node, siblings = self.nodes[index], self.nodes[self._parents[index]].children
        return siblings, next(place for place, each in enumerate(siblings) if each is node)

    def __str__(self) -> str:
        return written(replace(self.root, children=[*self.root.children, *self._end]))


def _node(element: Element) -> Node:
    return Node(element.kind.value, {each.name: each.text for each in element.attributes})


def written(root: Node) -> str:
    r"""The text of a plan, one element per line.

    >>> written(Node("Plan", {}, [Node("Runner", {"interface": 'a/"Go"'})]))
    '<Plan>\n  <Runner interface=\'a/"Go"\'/>\n</Plan>\n'
    """
    lines: list[str] = []
    todo: list[tuple[int, Node | str]] = [(0, root)]
    while todo:
        depth, node = todo.pop()
        indent = "  " * min(depth, 40)
        if isinstance(node, str):
            lines.append(f"{indent}</{node}>")
            continue
        attributes = "".join(
            f" {name}={quoteattr(text, _CONTROL_CHARACTERS)}"
            for name, text in node.attributes.items()
        )
        lines.append(f"{indent}<{node.tag}{attributes}{'>' if node.children else '/>'}")
        if node.children:
            todo.append((depth, node.tag))
            todo += [(depth + 1, child) for child in reversed(node.children)]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class Mutation:
    """A change: ``element`` is the index of the element that it is about.

    ``summary`` says in one line what is changed; ``change`` does it, once, to a fresh tree, or to
    the rows of a machine.
    """

    operator: str
    element: int
    summary: str
    change: Callable[[Any], None]


@dataclass(frozen=True, slots=True)
class Operator:
    """A kind of change; ``mutations`` gives all of them for a plan, in document order."""

    name: str
    mutations: Callable[[Plan], Iterator[Mutation]]


@cache
def operators() -> tuple[Operator, ...]:
    """All operators, in the order of their names.

    >>> [operator.name for operator in operators()]
    ['control-type', 'drop', 'parameter', 'rename', 'renest', 'replace', 'swap']
    """
    names = (each.name for each in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    listed = (operator for module in modules for operator in module.OPERATORS)
    return tuple(sorted(listed, key=lambda operator: operator.name))
