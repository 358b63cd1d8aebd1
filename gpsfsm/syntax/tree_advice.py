"""Advice on trees that BehaviorTree.CPP takes, but that hardly do what their author means.

A reactive node asks its earlier children again at every tick: if two of them act, the first one
runs again and halts the other. A key of the blackboard that is read and that nothing in the file
can write is misspelt, or comes from the program. An output needs a key in braces. Nav2's
RecoveryNode and RoundRobin have traps of their own: a recovery that does not run, a round that is
run once.

Keys of different trees are one key where a SubTree maps them:

    <SubTree ID="Pick" object="{cup}"/>     in Pick, {object} is {cup} of the tree around
    a key is written if one that is the same is written
"""

from __future__ import annotations

import re
from math import inf
from typing import TYPE_CHECKING

from gpsfsm.model.plan import line_words
from gpsfsm.model.tree import BUILTINS, NAV2, Meaning, PortKind, is_reference
from gpsfsm.syntax.scripts import is_script, read_script
from gpsfsm.syntax.text import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.model.plan import Attribute
    from gpsfsm.model.tree import NodeModel, TreeNode
    from gpsfsm.syntax.token_reader import Collector

KEY = re.compile(r"\s*\{\s*(@?[A-Za-z_][\w.]*)\s*\}\s*")
_REACTIVE = (Meaning.REACTIVE_SEQUENCE, Meaning.REACTIVE_FALLBACK)
_ROWS_OF_ALL = (
    *(Meaning.SEQUENCE, Meaning.MEMORY, Meaning.REACTIVE_SEQUENCE),
    *(Meaning.PIPELINE, Meaning.NONBLOCKING),
)
"""Nodes that succeed only if all of their children do."""
_ROWS_OF_ONE = (
    *(Meaning.FALLBACK, Meaning.FALLBACK_MEMORY, Meaning.REACTIVE_FALLBACK),
    Meaning.ROUND_ROBIN,
)
"""Nodes that succeed only if one of their children does."""
_ONCE = (
    *(Meaning.SEQUENCE, Meaning.FALLBACK, Meaning.MEMORY, Meaning.FALLBACK_MEMORY),
    *(Meaning.PARALLEL, Meaning.PARALLEL_ALL, Meaning.BRANCH, Meaning.INVERT, Meaning.DELAY),
    *(Meaning.FORCE_SUCCESS, Meaning.FORCE_FAILURE, Meaning.RUN_ONCE, Meaning.TIMEOUT),
    *(Meaning.ROUND_ROBIN, Meaning.GATE, Meaning.PASS),
)
"""Nodes that enter a child at most once each time that they are entered themselves."""
_LAST_ONCE = (*_REACTIVE, Meaning.PIPELINE)
"""Nodes for which that holds of their last child, unless they halt it, and it begins anew."""
NAME = re.compile(r"[A-Za-z_][\w.]*")
_WHOLE = re.compile(r"\s*[+-]?[0-9]{1,9}\s*")
_MOST = 8
_OF_NAV2 = frozenset(
    {"goal", "goals", "number_recoveries", "initial_pose_received", "waypoint_statuses"}
)
"""Keys that Nav2's navigators write before or while a tree runs."""
Key = tuple[int, str]
"""A key of the blackboard of a tree: the index of its element, and the name."""


class Advice:
    """Advice on one file.

    ``mapped`` are the trees that nodes stand for, ``main`` is the one that runs.
    """

    def __init__(
        self,
        nodes: Sequence[TreeNode],
        tops: Sequence[TreeNode],
        models: Mapping[str, NodeModel] | None,
        mapped: Mapping[int, int],
        collector: Collector,
        *,
        version: int = 0,
        main: int = -1,
    ) -> None:
        self.nodes, self.tops, self.models = nodes, tops, models or {}
        self.version, self.main = version, main
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
                self._recovery(node)
                if top.index == self.main:
                    self._round_robin(node)
                self._outputs(node)
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
        lines = list(dict.fromkeys(str(self.nodes[child].line) for child in acting))
        before = f"s {', '.join(lines[:-1])} and" if len(lines) > 1 else ""
        message = (
            f"{len(acting)} children of this {node.identity} are actions (line{before} "
            f"{lines[-1]}): every tick starts again at the first of them, and if that runs, it "
            "halts the later one"
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

    # -- recoveries -------------------------------------------------------------------------

    def _meaning(self, node: TreeNode) -> Meaning | None:
        """The meaning of a node that a library has; None for one's own, and for a name like it."""
        name, count = node.identity, len(node.children)
        builtin = BUILTINS.get(name) or NAV2.get(name)
        if builtin is None or count < builtin.least or (0 <= builtin.most < count):
            return None
        return builtin.meaning

    def _recovery(self, node: TreeNode) -> None:
        """A RecoveryNode whose second child does not run, or after which nothing is tried again."""
        if self._meaning(node) is not Meaning.RECOVERY:
            return
        second = self.nodes[node.children[1]]
        retries = _whole(node, "number_of_retries", 1)
        if retries == 0:
            message = (
                "number_of_retries is 0: this RecoveryNode never runs its recovery (line "
                f"{second.line}), and fails as soon as its first child does"
            )
            hint = "write how often the recovery may be tried, or remove the RecoveryNode"
        elif retries < 0:
            message = (
                f"number_of_retries is {retries}: a RecoveryNode has no endless retries, and the "
                "effect of a negative number depends on the Nav2 release"
            )
            hint = 'for endless retries, write a large number: number_of_retries="999999999"'
        elif self._never_succeeds(second):
            message = (
                f"the recovery of this RecoveryNode (line {second.line}) never succeeds, so the "
                "first child is never tried again"
            )
            hint = (
                "let the recovery succeed: only then does a RecoveryNode try its first child again"
            )
        else:
            return
        self._tell("GP821", node, message, hint)

    def _never_succeeds(self, node: TreeNode) -> bool:
        """True if no outcome of any leaf lets a node succeed, as far as its structure tells."""
        never: dict[int, bool] = {}
        pending = [(node, False)]
        while pending:
            each, opened = pending.pop()
            if not opened:
                pending.append((each, True))
                pending += ((self.nodes[child], False) for child in each.children)
                continue
            meaning = self._meaning(each)
            inside = [never[child] for child in each.children]
            never[each.index] = (
                meaning in (Meaning.FAIL, Meaning.FORCE_FAILURE)
                or (meaning in _ROWS_OF_ALL and any(inside))
                or (meaning in _ROWS_OF_ONE and all(inside))
            ) and not _may_be_skipped(each)
        return never[node.index]

    def _round_robin(self, node: TreeNode) -> None:
        """A RoundRobin that is not entered often enough for each of its children to be first."""
        count = len(node.children)
        if self._meaning(node) is not Meaning.ROUND_ROBIN or count < 2:
            return
        turns = self._entered(node)
        if turns < 1 or turns >= count:
            return
        if turns == 1:
            message = (
                "this RoundRobin is entered only once, so it behaves like a Fallback: "
                "it begins at its first child"
            )
            hint = "use Fallback, or move it to where it is entered again"
        else:
            message = (
                f"this RoundRobin is entered at most {turns:.0f} times but has {count} children: "
                "the last ones run only if others fail"
            )
            hint = f"let it be entered {count} times, so that each child has its turn"
        self._tell("GP822", node, message, hint)

    def _entered(self, node: TreeNode) -> float:
        """The most times that a node of the main tree is entered, as the nodes around it tell."""
        times: float = 1
        while node.parent != self.main:
            around = self.nodes[node.parent]
            meaning = self._meaning(around)
            if any(each.name == "_while" for each in around.attributes):
                return inf
            rounds: float = 1
            if meaning is Meaning.RECOVERY:
                rounds = _whole(around, "number_of_retries", 1)
                rounds += rounds >= 0 and around.children[0] == node.index
            elif meaning in (Meaning.RETRY, Meaning.REPEAT):
                port = "num_attempts" if meaning is Meaning.RETRY else "num_cycles"
                rounds = _whole(around, port, -1)
            elif meaning not in _ONCE and (
                meaning not in _LAST_ONCE or around.children[-1] != node.index
            ):
                return inf
            if not rounds:
                return 0  # whatever the loops in it, and infinity times nothing is no number
            times *= inf if rounds < 0 else rounds
            node = around
        return times

    # -- outputs ----------------------------------------------------------------------------

    def _outputs(self, node: TreeNode) -> None:
        """Outputs whose values are no keys: BehaviorTree.CPP 4 writes them nowhere."""
        model = self.models.get(node.identity)
        if self.version != 4 or model is None or node.identity in BUILTINS:
            return
        for attribute in node.attributes:
            text = attribute.text.strip()
            output = model.ports.get(attribute.name) is PortKind.OUTPUT
            if not output or not text or text == "=" or is_reference(text):
                continue
            message = (
                f"{clip(attribute.name)} is an output, but '{clip(text)}' is not a key: what "
                f"{clip(node.identity)} writes is lost"
            )
            hint = "put the key in braces"
            if NAME.fullmatch(text):
                hint += f': {attribute.name}="{{{clip(text)}}}"'
            collector = self.collector.of(node.file)
            offset = collector.lines.offset(attribute.line, attribute.column)
            length = len(attribute.name)
            collector.add("GP823", offset, length, message=message, hint=hint, element=node.path)

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
            match = KEY.fullmatch(attribute.text)
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
            message = f"{{{clip(name)}}} is read here{also}, but nothing in this file writes it"
            hint = "check its spelling, unless your program sets it"
            if name in self.bare:
                line, port = self.bare[name]
                braced = f'{port}="{{{clip(name)}}}"'
                hint = (
                    f"{port} has the name without braces on {line}: write {braced} there, "
                    "unless that node expects the name of a key"
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


def _whole(node: TreeNode, port: str, absent: int) -> float:
    """The number in a port, infinity for one on the blackboard."""
    attribute = node.attribute(port)
    if attribute is None:
        return absent
    return int(attribute.text) if _WHOLE.fullmatch(attribute.text) else inf


def _may_be_skipped(node: TreeNode) -> bool:
    """True if a script may decide how a node ends, or that it is left out."""
    return any(each.name in ("_skipIf", "_successIf", "_while") for each in node.attributes)
