"""Scripts of trees that may throw: an exception leaves the tick, and with it the tree ends.

A script throws if it reads a key that does not exist, assigns with ``=`` to one, or gives a key a
value of another type (BehaviorTree.CPP, blackboard.h). Which keys exist, and of which type, is not
followed. So a script is known not to throw only if it assigns literals with ``:=`` to keys that
nothing else in the files writes, except other scripts with literals of the same type.

    <Script code="tries := 0"/> … <Script code="tries := 3"/>      cannot throw
    <Script code="tries := 0"/> … <Script code="tries := 'x'"/>    both may: the type depends
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from gpsfsm.model.tree import BUILTINS, NAV2, PortKind, is_reference
from gpsfsm.syntax.scripts import is_script, read_script

if TYPE_CHECKING:
    from gpsfsm.model.tree import Forest, TreeNode

AFTERWARDS = ("_onSuccess", "_onFailure", "_post")
"""Scripts that run when a node has ended."""
_ASSIGNED = re.compile(r"\s*+([A-Za-z_]\w*+)\s*+:=\s*+(\S.*?)\s*+", re.S)
_LITERALS: Final = {
    "text": re.compile(r"'[^']*+'"),
    "integer": re.compile(r"[0-9]{1,18}+"),
    "number": re.compile(r"-[0-9]++|-?+[0-9]*+\.[0-9]++"),
    "boolean": re.compile(r"true|false"),
}
_ANY = "any"


@dataclass(frozen=True, slots=True)
class Scripts:
    """The types that the scripts of a forest give to its keys."""

    types: dict[str, set[str]] = field(default_factory=dict)

    @classmethod
    def of(cls, forest: Forest) -> Scripts:
        """Those of all its nodes."""
        scripts = cls()
        for node in forest.nodes:
            for attribute in node.attributes:
                if is_script(node.identity, attribute.name):
                    literals = _literals(attribute.text)
                    for key in read_script(attribute.text).writes:
                        scripts._add(key, literals.get(key, _ANY))
                elif _may_write(forest, node, attribute.name, attribute.text):
                    scripts._add(attribute.text.strip().strip("{}").strip(), _ANY)
                    scripts._add(attribute.name, _ANY)  # of a SubTree: the key inside
        return scripts

    def _add(self, key: str, kind: str) -> None:
        self.types.setdefault(key.removeprefix("@"), set()).add(kind)

    def may_throw(self, text: str) -> bool:
        """True unless it is known that a script does not throw."""
        script = read_script(text)
        if script.fault >= 0 or (script.writes and not _literals(text)):
            return True
        types = (self.types.get(key.removeprefix("@"), {_ANY}) for key in script.writes)
        return bool(script.reads) or any(len(row) > 1 or _ANY in row for row in types)

    def node_may_throw(self, node: TreeNode) -> bool:
        """True if a script of a node, or what it writes, may throw."""
        return reads_blackboard(node) or any(
            is_script(node.identity, each.name) and self.may_throw(each.text)
            for each in node.attributes
        )


def reads_blackboard(node: TreeNode) -> bool:
    """True for a SetBlackboard whose value is an entry that may be missing or empty."""
    ports = ("value", "output_key")
    return node.identity == "SetBlackboard" and any(is_reference(node.text(each)) for each in ports)


def _literals(text: str) -> dict[str, str]:
    """The types of what a script assigns; {} if it does anything else than to assign literals."""
    types: dict[str, str] = {}
    for statement in text.split(";"):
        match = _ASSIGNED.fullmatch(statement)
        literals = (name for name, form in _LITERALS.items() if match and form.fullmatch(match[2]))
        kind = next(literals, "")
        if match is None or not kind or types.setdefault(match[1], kind) != kind:
            return {}
    return types


def _may_write(forest: Forest, node: TreeNode, name: str, text: str) -> bool:
    """True for a port through which a key may be written."""
    if node.identity in ("SetBlackboard", "UnsetBlackboard"):
        return name in ("output_key", "key")
    if not is_reference(text):
        return False
    builtin = BUILTINS.get(node.identity) or NAV2.get(node.identity)
    if builtin is not None:
        return node.identity.startswith(("Loop", "SubTree")) or name.startswith("output")
    model = (forest.models or {}).get(node.identity)
    return model is None or model.ports.get(name) is not PortKind.INPUT
