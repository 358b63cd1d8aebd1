"""The nodes of a behaviour tree: their models (TreeNodesModel), IDs, children, ports, numbers."""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import TYPE_CHECKING

from gpsfsm.model.plan import line_words
from gpsfsm.model.tree import (
    BUILTINS,
    NAV2_CONDITIONS,
    RESERVED,
    Builtin,
    Meaning,
    NodeModel,
    PortKind,
    TreeNode,
    is_reference,
)
from gpsfsm.syntax.scripts import PORTS, SPECIAL, is_script, read_script
from gpsfsm.syntax.text import clip

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from gpsfsm.model.plan import Attribute
    from gpsfsm.syntax.token_reader import Collector

# ---- The nodes of a behaviour tree: their models (TreeNodesModel), IDs, children, ports, numbers -


_NUMBER = re.compile(r"[ \t]*+[+-]?+[0-9]{1,9}[ \t]*+")
_NUMBER_OF_4 = re.compile(r"-?+[0-9]{1,9}[ \t]*+")
_MEANT = re.compile(r"\s*+\+?+(-?+[0-9]{1,9})(?:\.0*+)?+\s*+")
QUOTE = re.compile("[\"']")
_MOST_PORTS = 5
_OLD_PARALLEL = frozenset({"threshold", "success_threshold", "failure_threshold"})
_NEW_PARALLEL = frozenset({"success_count", "failure_count"})
_SUCCESSORS = {
    "threshold": "success_count",
    "success_threshold": "success_count",
    "failure_threshold": "failure_count",
    "success_count": "success_threshold",
    "failure_count": "failure_threshold",
}
"""Ports by the name that they have in the other version."""
OTHER_NAMES = {
    "SequenceStar": ("SequenceWithMemory", True),
    "FallbackStar": ("Fallback", False),
    "SequenceWithMemory": ("SequenceStar", True),
    "SubTreePlus": ("SubTree", True),
    "RetryUntilSuccesful": ("RetryUntilSuccessful", True),
}
"""Nodes by the name that they have in the other version, and whether they do the same there."""
_NEEDED = {"RetryUntilSuccessful", "RetryUntilSuccesful", "Repeat", "Delay"}
_UNSIGNED = {"msec", "delay_msec"}
_LONGEST = 60
_OF_SUBTREES = ("__shared_blackboard", "__autoremap")
"""Attributes that version 3 has; version 4 takes ``_autoremap`` and ignores them."""
_DIGITS = re.compile("[0-9]+")
_OPERATOR = re.compile(r":=|[=!<>]=|&&|\|\||\w\s*[<>]\s*\w")
_CATEGORIES = ("Action", "Condition", "Decorator", "Control", "SubTree")
PORT_TAGS = {kind.value: kind for kind in PortKind}


def models_of(nodes: Sequence[TreeNode], collector: Collector) -> Mapping[str, NodeModel] | None:
    """The models of all TreeNodesModel elements by ID; None if there is no such element."""
    models: dict[str, NodeModel] = {}
    described = False
    for root in nodes:
        for child in root.children if root.parent < 0 else ():
            if nodes[child].tag == "TreeNodesModel":
                described = True
                here: set[str] = set()
                for index in nodes[child].children:
                    _model(nodes, nodes[index], models, here, collector=collector)
    return models if described else None


def _model(
    nodes: Sequence[TreeNode],
    node: TreeNode,
    models: dict[str, NodeModel],
    here: set[str],
    *,
    collector: Collector,
) -> None:
    """Take in a model; ``here`` are the names in the TreeNodesModel in which it is."""
    name = node.text("ID")
    if node.tag not in _CATEGORIES:
        message = f"<{clip(node.tag)}> is not a kind of node"
        hint = f"use {', '.join(_CATEGORIES[:-1])} or {_CATEGORIES[-1]}"
        tell(collector, "GP814", node, message=message, hint=hint)
        return
    if not name:
        message = f"this <{node.tag}> of the TreeNodesModel has no ID"
        tell(collector, "GP807", node, message=message, hint='add the name of the node: ID="…"')
        return
    if name in RESERVED:
        message = f"'{clip(name)}' is the name of a built-in node, which your own nodes cannot have"
        tell(collector, "GP804", node, message=message, hint="choose another ID")
        return
    first = models.get(name)
    if first is not None and name in here:
        where = line_words(f"line {first.line}", first.file)
        message = f"'{clip(name)}' is described twice, first on {where}"
        tell(collector, "GP806", node, message=message, hint="keep one of the descriptions")
        return
    here.add(name)
    ports: dict[str, PortKind] = {}
    for index in node.children:
        port = nodes[index]
        kind = PORT_TAGS.get(port.tag)
        if kind is None:
            message = f"<{clip(port.tag)}> is not a port: BehaviorTree.CPP does not read it"
            hint = "write <input_port>, <output_port> or <inout_port>, in lower case"
            tell(collector, "GP814", port, message=message, hint=hint)
        elif not port.text("name"):
            message = "this port has no name"
            tell(collector, "GP807", port, message=message, hint='add its name: name="…"')
        else:
            ports[port.text("name")] = kind
    if first is None:
        models[name] = NodeModel(node.tag, ports, node.line, node.file)
    elif (first.category, first.ports) != (node.tag, ports):
        where = line_words(f"line {first.line}", first.file)
        message = f"'{clip(name)}' is described differently on {where}"
        tell(collector, "GP806", node, message=message, hint="keep one of the descriptions")


def refers_to(
    node: TreeNode, trees: Mapping[str, int], models: Mapping[str, NodeModel] | None
) -> str | None:
    """The ID of the tree that a node stands for; None if it stands for none."""
    if node.tag in ("SubTree", "SubTreePlus"):
        return node.text("ID")
    compact = not node.explicit and node.tag in trees and node.tag not in BUILTINS
    return node.tag if compact and node.tag not in (models or ()) else None


class NodeRules:
    """The rules of single nodes."""

    def __init__(
        self,
        nodes: Sequence[TreeNode],
        version: int,
        trees: Mapping[str, int],
        models: Mapping[str, NodeModel] | None,
        *,
        collector: Collector,
    ) -> None:
        self.nodes, self.version, self.trees = nodes, version, trees
        self.models, self.collector = models, collector
        self._names: dict[str, TreeNode] = {}  # of the SubTree nodes of a tree

    def check(self, top: TreeNode) -> None:
        """Report what is wrong in a tree."""
        self._names.clear()
        if len(top.children) != 1:
            hint = "put the nodes into a <Sequence>" if top.children else "add a node to it"
            self._count(top, "a tree has exactly one child", hint)
        pending = list(reversed(top.children))
        while pending:
            node = self.nodes[pending.pop()]
            pending.extend(reversed(node.children))
            self._node(node)

    def _tell(self, rule: str, node: TreeNode, message: str, hint: str) -> None:
        tell(self.collector, rule, node, message=message, hint=hint)

    def _count(self, node: TreeNode, what: str, hint: str) -> None:
        self._tell("GP805", node, f"{what}, but this one has {len(node.children) or 'none'}", hint)

    def _node(self, node: TreeNode) -> None:
        name = node.identity
        if not name:
            message = f"this <{node.tag}> has no ID, so it names no node"
            self._tell("GP807", node, message, 'add the name of the node: ID="…"')
            return
        self._scripts(node, name)
        self._special(node)
        builtin = BUILTINS.get(name)
        if builtin is None:
            self._custom(node, name)
            return
        self._children(node, name, builtin)
        if name == "ReactiveSequence" and self.version == 4:
            self._explicit(node)
        if builtin.version and self.version and builtin.version != self.version:
            message = f"BehaviorTree.CPP {self.version} has no node <{name}>"
            hint = f"it belongs to version {builtin.version}: {_other_name(name)}"
            self._tell("GP817", node, message, hint)
        if builtin.meaning is Meaning.SUBTREE:
            self._subtree(node)
        else:
            self._ports(node, name, builtin)

    def _scripts(self, node: TreeNode, name: str) -> None:
        """Report scripts that are none, at the character where that shows."""
        if self.version == 3:
            return
        for attribute in node.attributes:
            if not is_script(name, attribute.name):
                continue
            if not attribute.text and attribute.name in PORTS.values():
                continue  # the engine loads it: to it, the port is not there
            script = read_script(attribute.text)
            fault = script.fault
            if fault < 0:
                continue
            collector = self.collector.of(node.file)
            lines = collector.lines
            begin = lines.offset(attribute.line, attribute.column)
            quote = QUOTE.search(lines.text, begin)
            start = begin
            if quote is not None and lines.text.startswith(attribute.text, quote.end()):
                start = quote.end() + fault  # without references to characters
            shown = clip(attribute.text[fault:]) if fault < len(attribute.text) else ""
            where = f"at '{shown}'" if shown else "at its end"
            message = f"the script in '{attribute.name}' has an error {where}"
            hint = "write values and assignments, such as count := count + 1; door != 'open'"
            if script.mixed:
                hint = "use parentheses: arithmetic, bitwise operators, ! and .. do not mix"
            length = 1 if shown else 0
            collector.add("GP818", start, length, message=message, hint=hint, element=node.path)
        port = PORTS.get(name)
        if port is not None and node.attribute(port) is None:
            hint = f'add the script: {port}="…"'
            self._tell("GP818", node, f"this {name} lacks {port}", hint)

    def _special(self, node: TreeNode) -> None:
        """Report attributes that look like those of every node, and that version 4 ignores."""
        if self.version == 3:
            return
        for attribute in node.attributes:
            written = attribute.name
            meant = special_name(written, self.version)
            if meant:
                message = f"BehaviorTree.CPP silently ignores {clip(written)}"
                hint = f"did you mean {meant}?"
            elif written not in SPECIAL and is_unread_script(written, attribute.text):
                message = f"BehaviorTree.CPP has no attribute {clip(written)} and ignores it"
                hint = "put scripts into _skipIf, _failureIf, _successIf, _while, _onSuccess, …"
            else:
                continue
            tell(self.collector, "GP824", node, message=message, hint=hint, at=attribute)

    def _children(self, node: TreeNode, name: str, builtin: Builtin) -> None:
        count, least, most = len(node.children), builtin.least, builtin.most
        if self.version == 3 and builtin.meaning is Meaning.WHILE:
            least = most  # it throws without a third child
        if count >= least and (most < 0 or count <= most):
            return
        if most < 0:
            self._count(node, f"{_a(name)} has at least {_many(least)}", "add nodes to it")
        elif most == 0:
            self._count(node, f"{_a(name)} has no child", "move its content after it")
        elif least == most == 1:
            hint = "wrap its children in one <Sequence>" if count else "add a node to it"
            self._count(node, f"{_a(name)} has exactly one child", hint)
        else:
            needed = _many(least) if least == most else f"{least} to {_many(most)}"
            self._count(node, f"{_a(name)} has {needed}", "add or remove children")

    def _explicit(self, node: TreeNode) -> None:
        """Report children of a ReactiveSequence whose tags are no nodes to the engine."""
        for child in (self.nodes[each] for each in node.children):
            # The full name of a runner is no tag: such a file is for gpsfsm's own executor.
            if child.explicit and child.identity and "/" not in child.identity:
                message = (
                    f"BehaviorTree.CPP refuses this <{child.tag}> with an ID right inside a "
                    "ReactiveSequence (from 4.7.0 on): it looks for a node of that name"
                )
                hint = f"write <{child.identity}> instead, or put it into a <Sequence>"
                self._tell("GP825", child, message, hint)

    def _paths(self, node: TreeNode) -> None:
        """Report what two SubTree nodes of a tree cannot have alike, and what names no key."""
        name = node.text("name")
        first = self._names.setdefault(name, node) if name and self.version == 4 else node
        if first is not node:
            where = line_words(f"line {first.line}", first.file)
            message = (
                f"the SubTree on {where} has the name '{clip(name)}', too: BehaviorTree.CPP "
                "refuses that (from 4.8.4 on)"
            )
            self._tell("GP826", node, message, "choose another name, or leave it out")
        if self.version != 3 or node.tag != "SubTree":
            return
        for each in node.attributes:
            if is_reference(each.text) and not each.name.startswith("_"):
                message = (
                    f"in format 3 '{clip(each.text)}' is a key with braces in its name, which "
                    "nothing writes"
                )
                key = clip(each.text.strip()[1:-1])
                hint = f'write {each.name}="{key}" for the key {key}, or use <SubTreePlus>'
                tell(self.collector, "GP827", node, message=message, hint=hint, at=each)

    def _subtree(self, node: TreeNode) -> None:
        self._paths(node)
        name = node.text("ID")
        if not name:
            message = f"this <{node.tag}> has no ID, so it names no tree"
            self._tell("GP807", node, message, 'add the ID of the tree: ID="…"')
        elif name not in self.trees:
            alike = nearest(name, self.trees)
            message = f"there is no tree '{clip(name)}' in this file"
            hint = "add a <BehaviorTree> with this ID"
            if alike.lower() == name.lower():
                hint = f'write ID="{clip(alike)}"'
            elif alike:  # StationF is not a misspelt StationE, so that is not all there is to say
                hint += f', or write ID="{clip(alike)}" if you mean that one'
            self._tell("GP801", node, message, hint)

    def _ports(self, node: TreeNode, name: str, builtin: Builtin) -> None:
        allowed = ports_of(builtin, self.version)
        for attribute in node.attributes:
            port = attribute.name
            if _is_common(port) or (port == "ID" and node.explicit):
                continue
            if port not in allowed:
                message = f"{_a(name)} has no port '{clip(port)}'"
                hint = _ports_hint(port, allowed) or 'remove it; a label is written name="…"'
                tell(self.collector, "GP810", node, message=message, hint=hint, at=attribute)
            elif port in builtin.integers and not (
                self._is_number(attribute.text, port) or is_reference(attribute.text)
            ):
                meant = whole_number(attribute.text)
                least = " of at least 0" if port in _UNSIGNED else ""
                meant = "" if least and meant.startswith("-") else meant
                message = f"{port} must be a whole number{least}, not '{clip(attribute.text)}'"
                hint = f'write a number, for instance {port}="3"'
                if meant:
                    message = (
                        f"{port} contains a space, a plus sign or a point that must not be there"
                    )
                    hint = f'write {port}="{meant}"'
                tell(self.collector, "GP811", node, message=message, hint=hint, at=attribute)
        for port in builtin.integers if name in _NEEDED else ():
            if node.attribute(port) is None:
                message = f"this {name} lacks {port}"
                self._tell("GP811", node, message, f'add it, for instance {port}="3"')

    def _is_number(self, text: str, port: str) -> bool:
        """Version 4 takes no blank or plus before a number; what 3 takes is left open."""
        number = (_NUMBER_OF_4 if self.version == 4 else _NUMBER).fullmatch(text) is not None
        return number and not (self.version == 4 and port in _UNSIGNED and text.startswith("-"))

    def _custom(self, node: TreeNode, name: str) -> None:
        """A node that is not built in: its model tells its ports, its children what it is."""
        if refers_to(node, self.trees, self.models) is not None:
            message = f"<{clip(name)}> is a tree, not a node"
            self._tell("GP801", node, message, f'write <SubTree ID="{clip(name)}"/>')
            return
        model = None if self.models is None else self.models.get(name)
        if name == "Root" and node.children and model is None:
            message = "<Root> is what old Groot wrote into the file; BehaviorTree.CPP refuses it"
            self._tell("GP805", node, message, "remove <Root> and </Root>, and keep what is inside")
            return
        category = node.tag if node.explicit else model.category if model else ""
        if model is None and name in NAV2_CONDITIONS:
            category = "Condition"
        if category in ("Action", "Condition", "SubTree") and node.children:
            article = "an" if category == "Action" else "a"
            self._count(node, f"{article} {category} has no child", "move its content after it")
        elif category == "Decorator" and len(node.children) != 1:
            hint = "wrap its children in one <Sequence>" if node.children else "add a node to it"
            self._count(node, "a Decorator has exactly one child", hint)
        elif category == "Control" and not node.children:
            self._count(node, "a Control has at least one child", "add nodes to it")
        if not node.explicit and node.attribute("ID") is not None:
            message = f"<{clip(name)}> has an ID, but its tag is its ID"
            hint = f'remove the ID, or write <Action ID="{clip(name)}" …/>'
            at = node.attribute("ID")
            tell(self.collector, "GP810", node, message=message, hint=hint, at=at)
        alike = nearest(name, BUILTINS)
        if model is not None:
            self._modelled(node, name, model)
        elif self.models is not None:
            alike = nearest(name, self.models) or alike
            there = any(each.line for each in self.models.values())
            message = f"the TreeNodesModel does not describe '{clip(name)}'"
            if self.models and not there:  # they come from elsewhere
                message = f"there is no node '{clip(name)}'"
            hint = _description(node, name)
            self._tell(
                "GP812", node, message, f"did you mean {alike}? Otherwise {hint}" if alike else hint
            )
        elif alike and (node.children or alike.lower() == name.lower()):
            message = f"BehaviorTree.CPP has no node <{clip(name)}> of its own"
            hint = (
                f"did you mean {alike}? If the node is your own, describe it in a <TreeNodesModel>"
            )
            self._tell("GP812", node, message, hint)

    def _modelled(self, node: TreeNode, name: str, model: NodeModel) -> None:
        for attribute in node.attributes:
            port = attribute.name
            if _is_common(port) or port == "ID" or port in model.ports:
                continue
            message = f"{clip(name)} has no port '{clip(port)}'"
            hint = _ports_hint(port, model.ports) or "remove it: its model has no ports"
            hint += f" ({line_words(f'line {model.line}', model.file)})" if model.line else ""
            tell(self.collector, "GP803", node, message=message, hint=hint, at=attribute)


def special_name(written: str, version: int) -> str:
    """The attribute of every node that a name stands for, if it is misspelt or of version 3."""
    if not written.startswith("_") or written in SPECIAL:
        return ""
    if written in _OF_SUBTREES:
        return "_autoremap" if version == 4 else ""
    return nearest(written, SPECIAL)


def is_unread_script(written: str, text: str) -> bool:
    """True if an attribute that nobody reads looks like a condition or an assignment."""
    return written.startswith("_") and _OPERATOR.search(text) is not None


def _a(name: str) -> str:
    """The name of a node behind its article."""
    return f"an {name}" if name[:1] in "AEIOU" else f"a {name}"


def whole_number(text: str) -> str:
    """The whole number that a text stands for, as every version reads it; "" if it is none."""
    match = _MEANT.fullmatch(text)
    return match[1] if match else ""


def port_meant(port: str, allowed: Collection[str]) -> tuple[str, bool]:
    """The port that is meant, "" if none is; whether that is sure.

    It is sure of the name in the other version, in other letters, and without the underscore.
    """
    special = {each.lower(): each for each in SPECIAL}.get(f"_{port}".lower(), "")
    successor = _SUCCESSORS.get(port, "")
    if successor in allowed:
        return successor, True
    alike = likest(port, allowed)
    return (alike, alike.lower() == port.lower()) if alike else (special, bool(special))


def ports_of(builtin: Builtin, version: int) -> frozenset[str]:
    """The ports that a built-in node has in a version."""
    if builtin.meaning is Meaning.PARALLEL and version:
        return builtin.ports - (_OLD_PARALLEL if version == 4 else _NEW_PARALLEL)
    return builtin.ports


def _ports_hint(port: str, allowed: Collection[str]) -> str:
    """The port that is meant, or else all there are; "" where there are none."""
    alike = port_meant(port, allowed)[0] or nearest(port, allowed)
    if alike:
        return f"did you mean {alike}?"
    names = sorted(allowed)[:_MOST_PORTS]
    what = "the port" if len(names) == 1 else "one of the ports"
    return f"use {what} {', '.join(names)}" if names else ""


def _description(node: TreeNode, name: str) -> str:
    """The advice to describe a node in the TreeNodesModel, as it is to be written."""
    kind = ("Decorator" if len(node.children) == 1 else "Control") if node.children else "Action"
    kind = node.tag if node.explicit else kind
    ports = [each.name for each in node.attributes if not _is_common(each.name)]
    inside = "".join(f'<input_port name="{clip(port)}"/>' for port in ports if port != "ID")
    written = (
        f'<{kind} ID="{clip(name)}">{inside}</{kind}>' if inside else f'<{kind} ID="{clip(name)}"/>'
    )
    return f"add {written} to the TreeNodesModel"


def _is_common(port: str) -> bool:
    """True for attributes that every node may have: its label, conditions, scripts."""
    return port == "name" or port.startswith("_")


def _many(count: int) -> str:
    return "one child" if count == 1 else f"{count} children"


def _other_name(name: str) -> str:
    name, exact = OTHER_NAMES.get(name, ("", True))
    if not name:
        return "change BTCPP_format, or use another node"
    return f"write {name}" + ("" if exact else "; it begins at its first child again after a halt")


def tell(
    collector: Collector,
    rule: str,
    node: TreeNode,
    *,
    message: str,
    hint: str = "",
    at: Attribute | None = None,
) -> None:
    """Report a problem at an element, or at one of its attributes."""
    collector = collector.of(node.file)
    start, length = node.start, 1 + len(node.tag)
    if at is not None:
        start, length = collector.lines.offset(at.line, at.column), len(at.name)
    collector.add(rule, start, length, message=message, hint=hint, element=node.path)


def nearest(name: str, names: Iterable[str]) -> str:
    """The known name that is most like ``name``, "" if none is like it."""
    short = [each for each in names if len(each) <= _LONGEST]
    if not name or len(name) > _LONGEST:
        return ""
    exact = [each for each in short if each.lower() == name.lower()]
    return (exact or get_close_matches(name, sorted(short), 1, 0.75) or [""])[0]


def likest(name: str, names: Collection[str]) -> str:
    """The only one of some names that is most like ``name``; "" if there is none, or another.

    StationF is not a misspelt StationE, nor is arm1 a misspelt arm2.

    >>> likest("Paralel", ["Parallel", "Sequence"]), likest("StationF", ["StationE"])
    ('Parallel', '')
    """
    same = [each for each in names if each.lower() == name.lower()]
    if same or not name or len(name) > _LONGEST:
        return same[0] if len(same) == 1 else ""
    short = sorted(each for each in names if len(each) <= _LONGEST)
    alike = get_close_matches(name, short, 2, 0.75)
    if len(alike) != 1:
        return ""
    numbered = _DIGITS.sub("", name) == _DIGITS.sub("", alike[0])
    return "" if numbered or name[:-1] == alike[0][:-1] else alike[0]
