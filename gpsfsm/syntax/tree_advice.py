"""Advice on trees that BehaviorTree.CPP takes, but that hardly do what their author means.

A reactive node asks its earlier children again at every tick: if two of them act, the first one
runs again and halts the other. A key of the blackboard that is read and that nothing in the file
can write is misspelt, or comes from the program.

Keys of different trees are one key where a SubTree maps them:

    <SubTree ID="Pick" object="{cup}"/>     in Pick, {object} is {cup} of the tree around
    a key is written if one that is the same is written
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.model.plan import line_words
from gpsfsm.model.tree import BUILTINS, NAV2, Meaning, PortKind
from gpsfsm.syntax.scripts import is_script, read_script
from gpsfsm.syntax.text import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.model.plan import Attribute
    from gpsfsm.model.tree import NodeModel, TreeNode
    from gpsfsm.syntax.token_reader import Collector

_REFERENCE = re.compile(r"\s*\{\s*(@?[A-Za-z_][\w.]*)\s*\}\s*")
_REACTIVE = (Meaning.REACTIVE_SEQUENCE, Meaning.REACTIVE_FALLBACK)
_MOST = 8
_OF_NAV2 = frozenset(
    {"goal", "goals", "number_recoveries", "initial_pose_received", "waypoint_statuses"}
)
"""Keys that Nav2's navigators write before or while a tree runs."""
Key = tuple[int, str]
"""A key of the blackboard of a tree: the index of its element, and the name."""


class Advice:
    """Advice on one file; ``mapped``: the trees that nodes stand for."""

    def __init__(
        self,
        nodes: Sequence[TreeNode],
        tops: Sequence[TreeNode],
        models: Mapping[str, NodeModel] | None,
        mapped: Mapping[int, int],
        collector: Collector,
    ) -> None:
        self.nodes, self.tops, self.models = nodes, tops, models or {}
        self.mapped, self.collector = mapped, collector
        self.reads: dict[Key, list[tuple[TreeNode, Attribute]]] = {}
        self.writes: set[Key] = set()
        self.same: dict[Key, Key] = {}
        self.bare: dict[str, tuple[str, str]] = {}  # where a text without braces is, by the text
        self.navigates = False
        self.shared: set[int] = set()  # trees whose keys are those around them

    def give(self) -> None:
        """Report it all."""
        for top in self.tops:
            for node in self._below(top):
                self._reactive(node)
                self._ports(top.index, node)
        self._unwritten()

    def _below(self, top: TreeNode) -> Iterator[TreeNode]:
        pending = list(reversed(top.children))
        while pending:
            node = self.nodes[pending.pop()]
            pending += reversed(node.children)
            yield node

    def _tell(self, rule: str, node: TreeNode, message: str, hint: str) -> None:
        length = 1 + len(node.tag)
        collector = self.collector.of(node.file)
        collector.add(rule, node.start, length, message=message, hint=hint, element=node.path)

    # -- reactive nodes ---------------------------------------------------------------------

    def _reactive(self, node: TreeNode) -> None:
        builtin = BUILTINS.get(node.identity)
        if builtin is None or builtin.meaning not in _REACTIVE:
            return
        acting = [child for child in node.children if self._acts(self.nodes[child])]
        if len(acting) < 2:
            return
        lines = [str(self.nodes[child].line) for child in acting]
        message = (
            f"{len(acting)} children of this {node.identity} act (lines {', '.join(lines[:-1])} "
            f"and {lines[-1]}): at each tick the first of them is ticked again, and if it runs, "
            "it halts the later one"
        )
        hint = (
            f"put conditions before one child that acts, or use "
            f"{node.identity.removeprefix('Reactive')}"
        )
        self._tell("GP819", node, message, hint)

    def _acts(self, node: TreeNode) -> bool:
        """True if a leaf in a node is an Action by its tag or its model."""
        pending = [node]
        while pending:
            each = pending.pop()
            name = each.identity
            model = self.models.get(name)
            category = each.tag if each.explicit else model.category if model else ""
            if name == "Sleep" or (category == "Action" and not each.children):
                return True
            pending += (self.nodes[child] for child in each.children)
        return False

    # -- keys -------------------------------------------------------------------------------

    def _ports(self, tree: int, node: TreeNode) -> None:
        name = node.identity
        target = self.mapped.get(node.index, -1)
        self.navigates |= name in NAV2
        for attribute in node.attributes:
            if attribute.name not in ("ID", "name"):
                line = line_words(f"line {attribute.line}", node.file)
                self.bare.setdefault(attribute.text.strip(), (line, attribute.name))
            if is_script(name, attribute.name):
                script = read_script(attribute.text)
                self.writes |= {(tree, key) for key in script.writes}
                for read in script.reads:
                    self.reads.setdefault((tree, read), []).append((node, attribute))
                continue
            match = _REFERENCE.fullmatch(attribute.text)
            if target >= 0:
                self._mapping(tree, target, attribute, match)
            elif match is not None:
                key = (tree, match[1])
                if self._is_read(node, name, attribute.name):
                    self.reads.setdefault(key, []).append((node, attribute))
                else:
                    self.writes.add(key)
            elif name == "SetBlackboard" and attribute.name == "output_key":
                self.writes.add((tree, attribute.text.strip()))

    def _mapping(
        self, tree: int, target: int, attribute: Attribute, match: re.Match[str] | None
    ) -> None:
        """A port of a SubTree: a key inside that is one outside, or that has a value."""
        if attribute.name in ("_autoremap", "__autoremap", "__shared_blackboard"):
            self.shared |= {tree, target}
        elif attribute.text.strip() == "{=}":
            self._equal((tree, attribute.name), (target, attribute.name))
        elif match is not None:
            self._equal((tree, match[1]), (target, attribute.name))
        else:  # a value; in version 3 it is the name of a key
            self.writes.add((target, attribute.name))
            self._equal((tree, attribute.text.strip()), (target, attribute.name))

    def _is_read(self, node: TreeNode, name: str, port: str) -> bool:
        """True if nothing can be written by a port: a model says so, or the node is built in."""
        builtin = BUILTINS.get(name) or NAV2.get(name)
        if builtin is not None:
            return not port.startswith("output") and builtin.meaning is not Meaning.LOOP
        model = self.models.get(name)
        del node
        return model is not None and model.ports.get(port) is PortKind.INPUT

    def _root(self, key: Key) -> Key:
        while key in self.same:
            key = self.same[key]
        return key

    def _equal(self, one: Key, other: Key) -> None:
        first, second = self._root(one), self._root(other)
        if first != second:
            self.same[second] = first

    def _unwritten(self) -> None:
        """Keys that are read, if no key that is the same can be written anywhere."""
        writes = {self._root(key) for key in self.writes}
        names = {key[1] for key in self.writes}
        rows: dict[Key, list[tuple[TreeNode, Attribute]]] = {}
        for key, places in self.reads.items():
            shared = key[0] in self.shared and key[1] in names
            outside = key[1].startswith("@") or (self.navigates and key[1] in _OF_NAV2)
            if self._root(key) not in writes and not shared and not outside:
                rows.setdefault(self._root(key), []).extend(places)
        for (_, name), places in rows.items():
            node, attribute = min(places, key=lambda place: place[0].index)
            others = {(each.file, each.line) for each, _ in places} - {(node.file, node.line)}
            lines = [line_words(str(line), file) for file, line in sorted(others)[:_MOST]]
            also = f" (also on line {', '.join(lines)})" if lines else ""
            message = f"{{{clip(name)}}} is read here{also}, and nothing in this file writes it"
            hint = "check its spelling; if your program sets it, nothing is wrong"
            if name in self.bare:
                line, port = self.bare[name]
                braced = f'{port}="{{{clip(name)}}}"'
                hint = (
                    f"{port} has the name without braces on {line}: write {braced} there, "
                    "unless that node takes the name of a key"
                )
            collector = self.collector.of(node.file)
            offset = collector.lines.offset(attribute.line, attribute.column)
            collector.add(
                "GP820",
                offset,
                len(attribute.name),
                message=message,
                hint=hint,
                element=node.path,
            )
