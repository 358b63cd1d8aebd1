"""The ports of nodes: what they are called in a SubTree, and what they hold."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.model.plan import NOT_PARAMETERS, Attribute
from gpsfsm.model.tree_nodes import is_reference

if TYPE_CHECKING:
    from gpsfsm.model.tree import TreeNode

__all__ = ["EMPTY_SCOPE", "Scope", "leaf_attributes", "number", "scope_of"]

_NUMBER = re.compile(r"[ \t]*+[+-]?+[0-9]{1,9}[ \t]*+")
_SHARED = ("__shared_blackboard", "__autoremap", "_autoremap")


@dataclass(frozen=True, slots=True)
class Scope:
    """What the blackboard of a SubTree takes from outside: texts by key.

    ``outer`` is the scope outside where all other keys are shared with it, else None.
    """

    given: Mapping[str, str] = field(default_factory=dict)
    outer: Scope | None = None

    def text(self, text: str) -> str:
        """A value as it is written in the main tree; a reference that nothing fills stays."""
        scope: Scope | None = self
        if not is_reference(text):
            return text
        key = text.strip()[1:-1].strip()
        while scope is not None:
            if key in scope.given:
                return scope.given[key]
            scope = scope.outer
        return text


EMPTY_SCOPE = Scope()


def scope_of(node: TreeNode, outer: Scope, version: int) -> Scope:
    """The scope inside a SubTree, from what its node hands over.

    In version 3 a SubTree names the key outside without braces; SubTreePlus, and version 4, write
    a key in braces and anything else as a text. ``{=}`` is the key of the same name.
    """
    given: dict[str, str] = {}
    shared = any(node.text(name).strip().lower() in ("true", "1") for name in _SHARED)
    for attribute in node.attributes:
        name, text = attribute.name, attribute.text
        if name in ("ID", "name") or name.startswith("_"):
            continue
        if text.strip() == "{=}":
            text = f"{{{name}}}"
        elif version == 3 and node.tag == "SubTree" and not is_reference(text):
            text = f"{{{text.strip()}}}"
        given[name] = outer.text(text)
    return Scope(given, outer if shared else None)


def leaf_attributes(node: TreeNode, scope: Scope, use: int) -> tuple[Attribute, ...]:
    """The attributes of the runner that a leaf is: its ID as interface and provider, its ports.

    A value from the blackboard that the file does not give is like no other value, so that two
    uses are never taken for the same action. Ports that are called like what is no parameter of a
    runner keep their place under another name.
    """
    identity = node.identity
    found = [
        Attribute(name, identity, identity, node.line, node.column)
        for name in ("interface", "provider")
    ]
    for each in node.attributes:
        if each.name == "name":
            found.append(each)
        elif not (each.name == "ID" or each.name.startswith("_")):
            name = f"port.{each.name}" if each.name in NOT_PARAMETERS else each.name
            text = scope.text(each.text)
            value = each.value if text == each.text else text
            if is_reference(text):
                value = f"{text} of {node.path}, use {use}"
            found.append(replace(each, name=name, text=text, value=value))
    return tuple(found)


def number(node: TreeNode, port: str, scope: Scope) -> int | None:
    """The whole number that a port holds; None if there is none that the file tells."""
    text = scope.text(node.text(port))
    return int(text) if _NUMBER.fullmatch(text) else None
