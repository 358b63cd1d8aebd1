"""Scripts of trees that may throw, and attributes, elements and texts that nothing reads.

An exception leaves the tick, and with it the tree ends.

A script throws if it reads a key that does not exist, assigns with ``=`` to one, or gives a key a
value of another type (BehaviorTree.CPP, blackboard.h). Which keys exist, and of which type, is not
followed. So a script is known not to throw only if it assigns literals with ``:=`` to keys that
nothing else in the files writes, except other scripts with literals of the same type.

    <Script code="tries := 0"/> … <Script code="tries := 3"/>      cannot throw
    <Script code="tries := 0"/> … <Script code="tries := 'x'"/>    both may: the type depends
BehaviorTree.CPP skips what it does not read, and so does the compiler, which says so. Left out is
what a finding names already, and what people or their tools note down: names, ``_uid``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip
from gpsfsm.model.tree import BUILTINS, NAV2, PortKind, builtin_of, is_reference
from gpsfsm.syntax.scripts import SPECIAL, is_script, read_script
from gpsfsm.syntax.tree_nodes import is_unread_script, special_name

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

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
    """True for a SetBlackboard that throws, or whose value is an entry that may be missing."""
    ports = [node.attribute(each) for each in ("value", "output_key")]
    unsure = any(each is None or is_reference(each.text) for each in ports)
    return node.identity == "SetBlackboard" and unsure


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


_NOTED: Final = frozenset({"_description", "_fullpath", "_uid"})
_SHARED: Final = frozenset({"_autoremap", "__autoremap", "__shared_blackboard"})
_LONGEST: Final = 60
_PORTS: Final = frozenset(PortKind)
_READ: Final[Mapping[str, frozenset[str]]] = {
    "root": frozenset({"BTCPP_format", "main_tree_to_execute"}),
    "tree": frozenset({"ID", "name", *_NOTED}),
    "models": frozenset(),
    "model": frozenset({"ID", "editable"}),
    "port": frozenset({"name", "type", "default", "description"}),
    "include": frozenset({"path", "ros_pkg"}),
}
"""The attributes that are read, or noted down, of what is no node of a tree."""
_BELOW_ROOT: Final = {"BehaviorTree": "tree", "TreeNodesModel": "models", "include": "include"}
_INSIDE: Final = {"tree": "node", "node": "node", "models": "model"}


def unread(forest: Forest, texts: Sequence[int]) -> Iterator[Approximation]:
    """All that nothing reads of a forest; ``texts`` are the elements that hold text."""
    roles: dict[int, str] = {}
    holding = frozenset(texts)
    for node in forest.nodes:
        role = roles[node.index] = _role(node, roles.get(node.parent, ""))
        if role == "unread":
            yield _skipped(f"element {node.tag}", node)
            continue
        if node.index in holding and role not in ("port", ""):
            yield _skipped(f"text in {node.tag}", node)
        yield from _attributes(node, role, forest)


def _role(node: TreeNode, around: str) -> str:
    """The part that an element plays; "" for what is inside something that is told as a whole."""
    if node.parent < 0:
        return "root" if node.tag == "root" else "tree"
    if around == "root":
        return _BELOW_ROOT.get(node.tag, "unread" if node.tag == "Metadata" else "")
    if around == "model":
        return "port" if node.tag in _PORTS else ""
    return _INSIDE.get(around, "unread" if around in ("models", "port", "include") else "")


def _attributes(node: TreeNode, role: str, forest: Forest) -> Iterator[Approximation]:
    for each in node.attributes if role else ():
        name, cause = each.name, Cause.NO_MEANING
        if role != "node":
            skipped = name not in _READ[role]
        elif name.startswith("_"):
            skipped = not _is_special(node, name, each.text, forest.version)
        else:
            skipped, cause = _is_of_another_nav2(node, name, forest), Cause.VERSION
        if skipped:
            yield _skipped(f"attribute {name}", node, cause)


def _is_special(node: TreeNode, name: str, text: str, version: int) -> bool:
    """True for an attribute with ``_`` that is read, noted down, or that GP824 reports."""
    if name in _SHARED and (version == 3 or name in SPECIAL):
        return node.identity in ("SubTree", "SubTreePlus")
    if name in SPECIAL:
        return True
    return version != 3 and bool(special_name(name, version) or is_unread_script(name, text))


def _is_of_another_nav2(node: TreeNode, name: str, forest: Forest) -> bool:
    """True for a port that Nav2's node does not have, as far as it is known here."""
    if node.tag not in NAV2 or node.tag in (forest.models or ()) or name == "name":
        return False
    builtin = builtin_of(node.tag, len(node.children))
    return builtin is not None and name not in builtin.ports


def _skipped(construct: str, node: TreeNode, cause: Cause = Cause.NO_MEANING) -> Approximation:
    return Approximation(Reading.SKIPPED, clip(construct, _LONGEST), node.location, cause)
