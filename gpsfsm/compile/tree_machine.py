"""Behaviour trees → machine: those with loops, reactive nodes, clocks or values (semantics, 10).

A node is entered by events, and ends by events: those by which it succeeds, fails or is skipped. So
a tree is compiled from the outside in, each node between the events that enter it and those that it
ends by; a Sequence hands the successes of a child on as what enters the next one.

    <ReactiveSequence><Clear/><Drive/></ReactiveSequence>
    Clear, entered by the start       succeeds: Clear SUCCEEDED      fails: Clear FAILED
    Drive, entered by Clear SUCCEEDED
    Clear@2, a second use that watches: entered by Clear SUCCEEDED and, again and again, by its own
        SUCCEEDED. Its FAILED stops Drive; what Drive ends by stops Clear@2.
    The whole succeeds by Drive SUCCEEDED, and fails by FAILED of any of the three.

*Loops*: what a loop goes back by enters its body once more. The events that enter it are not all
known when the body is compiled, so they have a number of their own (a *port*), which is replaced
at the end. A loop passes through an outcome: where nothing in the body has one, a tick stands in.

*What is not known* (a value, a clock, how often a bounded loop has gone round) is a choice
(``model/capability.py``): the machine has all runs that the tree has, and perhaps more. So what it
never does the tree never does. ``MachinePlan.inexact`` are the choices, and all else of which that
is true.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.compile import tree_reactive, tree_rows
from gpsfsm.compile.tree_parts import (
    BlockedError,
    Ends,
    Part,
    Parts,
    Signals,
    Steps,
    TooLargeError,
    Visit,
    all_of,
    ends_at,
    joined,
)
from gpsfsm.compile.tree_reactive import other
from gpsfsm.compile.tree_scripts import AFTERWARDS, reads_blackboard
from gpsfsm.compile.tree_ties import question
from gpsfsm.compile.trees import EMPTY_SCOPE, leaf_attributes, scope_of
from gpsfsm.compile.units import Pruned
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.precision import Cause
from gpsfsm.model.tree import NAV2_CONDITIONS, Builtin, Meaning, builtin_of

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from gpsfsm.compile.tree_ties import Question
    from gpsfsm.compile.units import TreeMachine
    from gpsfsm.model.tree import Forest, TreeNode

WRITTEN_OUT = 300
"""Uses up to which bounded loops are written out; a tree with more is compiled without that."""

COMPILERS = {**tree_rows.COMPILERS, **tree_reactive.COMPILERS}
"""The compilers of nodes, by their meaning."""

_CONDITIONS = ("_failureIf", "_successIf", "_skipIf")
_WHILE = "_while"
_KEEPING = (Meaning.SINGLE_TRIGGER, Meaning.GATE, Meaning.PASS, Meaning.MAYBE)
"""Nodes that, in some release, do not reset their child when it has ended."""
_ROWS = {
    Meaning.SEQUENCE: False,
    Meaning.MEMORY: False,
    Meaning.REACTIVE_SEQUENCE: False,
    Meaning.FALLBACK: True,
    Meaning.FALLBACK_MEMORY: True,
    Meaning.REACTIVE_FALLBACK: True,
}
"""Nodes that go on to the next child; True if its failure leads there."""
_PLAIN = {
    Meaning.SEQUENCE,
    Meaning.REACTIVE_SEQUENCE,
    Meaning.FALLBACK,
    Meaning.REACTIVE_FALLBACK,
    Meaning.BRANCH,
    Meaning.INVERT,
    Meaning.FORCE_SUCCESS,
    Meaning.FORCE_FAILURE,
    Meaning.PARALLEL,
    Meaning.PARALLEL_ALL,
    Meaning.PASS,
}
"""Nodes that never run if none of their children does."""


def machine_of_tree(forest: Forest, sizes: Sequence[int] = (WRITTEN_OUT, 0)) -> TreeMachine | None:
    """The machine of the main tree; None where it cannot be made.

    That is so for a tree of which the front end has reported what is wrong, and for one that is too
    large even without loops that are written out. ``sizes``: up to how many uses they are, tried in
    this order. Time and space: linear in the size of the result.
    """
    for written_out in sizes:
        try:
            return Compiler(forest, written_out).machine()
        except TooLargeError:
            continue
        except BlockedError:
            return None
    return None


@dataclass(slots=True)
class Compiler(Parts):
    """The compilation of one tree, node by node."""

    uses: dict[int, int] = field(default_factory=dict)

    def machine(self) -> TreeMachine:
        """The machine of the main tree. Raises BlockedError and TooLargeError."""
        top = self.forest.nodes[self.forest.main]
        self.parts.append(Part(NodeKind.START, top))
        ends = self.compile(Visit(self.only_child(top), (0,), EMPTY_SCOPE))
        leaves = self.unentered(top)
        for leaf in leaves:
            self.leaf(leaf, Visit(leaf.index, (), EMPTY_SCOPE))
        causes = (self.cause(leaf, {each.index for each in leaves}) for leaf in leaves)
        pruned = tuple(each for each in causes if each is not None)
        return replace(self.numbered(top, ends), pruned=pruned)

    def cause(self, leaf: TreeNode, unentered: Collection[int]) -> Pruned | None:
        """The node before a leaf that never lets it come, if it stands in a row with it."""
        node = leaf
        while node.parent >= 0:
            around = self.forest.nodes[node.parent]
            position = around.children.index(node.index)
            before = around.children[position - 1] if position else -1
            if position and before not in unentered:
                builtin = builtin_of(around.identity, len(around.children))
                if builtin is None or builtin.meaning not in _ROWS:
                    return None
                other = self.forest.nodes[before]
                fails = _ROWS[builtin.meaning]
                return Pruned((leaf.file, leaf.start), other.identity, other.location, fails)
            node = around
        return None

    def unentered(self, top: TreeNode) -> list[TreeNode]:
        """The leaves below a tree that no event enters: nothing was compiled for them."""
        leaves: list[TreeNode] = []
        pending, seen = list(top.children), set[int]()
        while pending:
            node = self.forest.nodes[pending.pop()]
            if node.index in seen:
                continue
            seen.add(node.index)
            builtin = builtin_of(node.identity, len(node.children))
            tree = self.tree_of(node, node.identity)
            if builtin is not None and builtin.meaning is Meaning.SUBTREE:
                tree = self.forest.trees.get(node.text("ID"), -1)
            if tree >= 0:
                pending += self.forest.nodes[tree].children
            pending += node.children
            is_leaf = tree < 0 if builtin is None else builtin.meaning is Meaning.LEAF
            if is_leaf and not node.children and node.index not in self.uses:
                leaves.append(node)
        return sorted(leaves, key=lambda leaf: leaf.index)

    def only_child(self, node: TreeNode) -> int:
        """The child of a node that has one; raises BlockedError for all others."""
        if len(node.children) != 1:
            raise BlockedError
        return node.children[0]

    def compile(self, visit: Visit) -> Ends:
        """A node and all in it. A stack and no recursion: trees may be nested deeply."""
        stack: list[Steps] = [self.visit(visit)]
        ends: Ends | None = None
        while stack:
            try:
                request = next(stack[-1]) if ends is None else stack[-1].send(ends)
            except StopIteration as stop:
                stack.pop()
                ends = stop.value
                continue
            if len(stack) > 3_000:
                raise TooLargeError
            ends = None
            stack.append(self.visit(request))
        assert ends is not None
        return ends

    def visit(self, visit: Visit) -> Steps:
        """The compilation of one use of a node."""
        node = self.forest.nodes[visit.node]
        return self.guarded(node, visit)

    def guarded(self, node: TreeNode, visit: Visit) -> Steps:
        """A node behind its conditions: those at its beginning, and _while, which watches."""
        early: list[Ends] = []
        enter = visit.enter
        self.ties.around(node, visit.scope)
        enter = self.evaluated(node, "_onHalted", enter)  # as if it threw at once, when it throws
        for name in _CONDITIONS:
            if node.attribute(name):
                enter = self.evaluated(node, name, enter)
                about = question(node.text(name), visit.scope)
                chosen = self.choice(node, f"{name}: {node.text(name)}", enter, about)
                enter = chosen.failure
                early.append(ends_at(name, chosen.success))
        if not node.attribute(_WHILE):
            ends = yield from self.node(node, visit._replace(enter=enter))
            whole = self.afterwards(node, all_of((*early, ends)))
            self.ties.after(node, visit.scope, whole.all, len(self.parts))
            return whole
        of, about = f"{_WHILE}: {node.text(_WHILE)}", question(node.text(_WHILE), visit.scope)
        first = self.choice(node, of, self.evaluated(node, _WHILE, enter), about)
        begin = len(self.parts)
        ends = yield from self.node(node, visit._replace(enter=first.success, beside=True))
        ended = self.watched(node, of, first.success, begin, ends, about=about)
        skipped = Ends(skipped=joined(first.failure, ended))
        whole = self.afterwards(node, all_of((*early, ends, skipped)))
        self.ties.after(
            node, visit.scope, whole.all, len(self.parts)
        )  # a condition that decides counts as an end
        return whole

    def afterwards(self, node: TreeNode, ends: Ends) -> Ends:
        """The ends of a node, after its scripts about these."""
        for name in AFTERWARDS:
            if name != "_onFailure":
                ends = ends._replace(success=self.evaluated(node, name, ends.success))
            if name != "_onSuccess":
                ends = ends._replace(failure=self.evaluated(node, name, ends.failure))
        return ends

    def watched(
        self,
        node: TreeNode,
        of: str,
        enter: Signals,
        begin: int,
        ends: Ends,
        *,
        about: Question | None = None,
    ) -> Signals:
        """The events that halt the parts from ``begin`` on: a choice, until they have ended."""
        end = len(self.parts)
        if end == begin:
            return ()
        port = self.port(enter)
        name = of.partition(":")[0]
        watch = self.choice(node, of, self.evaluated(node, name, (port,)), about)
        self.back(node, port, watch.success)
        self.stop(watch.failure, begin, end)
        self.stop(ends.all, end, len(self.parts))
        return watch.failure

    def node(self, node: TreeNode, visit: Visit) -> Steps:
        """A node without its conditions."""
        name = node.identity
        builtin = builtin_of(name, len(node.children))
        if not name:
            raise BlockedError
        if builtin is not None:
            yield from ()
            return (yield from self.of_library(node, builtin, visit))
        tree = self.tree_of(node, name)
        if tree >= 0:
            return (yield from self.subtree(node, tree, visit))
        if node.children:
            if self.category(node, name) in ("Action", "Condition"):
                raise BlockedError  # it can have none
            return (yield from other(self, node, visit))
        return self.leaf(node, visit)

    def tree_of(self, node: TreeNode, name: str) -> int:
        """The tree that a node stands for by its tag, -1 if it stands for none."""
        compact = not node.explicit and name not in (self.forest.models or ())
        return self.forest.trees.get(name, -1) if compact else -1

    def of_library(self, node: TreeNode, builtin: Builtin, visit: Visit) -> Steps:
        """A node of a library."""
        meaning, count = builtin.meaning, len(node.children)
        if count < builtin.least or (builtin.most >= 0 and count > builtin.most):
            raise BlockedError
        if meaning not in _KEEPING:
            visit = visit._replace(rerun=False)  # it resets what is in it
        if meaning is Meaning.LEAF:
            return self.leaf(node, visit)
        if meaning is Meaning.SUCCEED:
            return self.written(node, visit)
        if meaning is Meaning.FAIL:
            return Ends(failure=visit.enter)
        if meaning is Meaning.SUBTREE:
            tree = self.forest.trees.get(node.text("ID"), -1)
            if tree < 0:
                raise BlockedError
            return (yield from self.subtree(node, tree, visit))
        return (yield from COMPILERS[meaning](self, node, visit))

    def written(self, node: TreeNode, visit: Visit) -> Ends:
        """A node that writes to the blackboard at once, or does nothing."""
        enter, failure = self.evaluated(node, "code", visit.enter), Signals()
        if enter and reads_blackboard(node):
            exists = self.choice(node, "there is such an entry", enter, cause=Cause.THROWS)
            self.thrown += exists.failure
            chosen = self.choice(node, f"{node.text('value')} is not empty", exists.success)
            enter, failure = chosen.success, chosen.failure
        self.ties.set(node, visit.scope, enter, len(self.parts))
        return Ends(success=enter, failure=failure)

    def leaf(self, node: TreeNode, visit: Visit) -> Ends:
        """A leaf, which ends by its outcomes."""
        visit = visit._replace(enter=self.evaluated(node, "code", visit.enter))
        self.uses[node.index] = self.uses.get(node.index, 0) + 1
        attributes = leaf_attributes(node, visit.scope, self.uses[node.index])
        self.ties.leaf(len(self.parts), node, visit.scope)
        return self.runner(node, attributes, visit.enter)

    def subtree(self, node: TreeNode, tree: int, visit: Visit) -> Steps:
        """The tree of a SubTree in its place."""
        scope = scope_of(node, visit.scope, self.forest.version)
        top = self.forest.nodes[tree]
        return (yield visit._replace(node=self.only_child(top), scope=scope))

    def child(self, node: TreeNode, visit: Visit) -> Steps:
        """The child of a decorator, in its place."""
        return (yield visit._replace(node=self.only_child(node)))

    def pause(self, visit: Visit, child: int, signals: Signals) -> Signals:
        """A moment later, if something beside may come first."""
        if not visit.beside or not signals:
            return signals
        return self.tick(self.forest.nodes[child], signals)

    def is_constant(self, node: int) -> bool:
        """True for what always gives the same answer, at once."""
        return self.constant(node) is not None

    def constant(self, index: int) -> bool | None:
        """The answer of a node that always gives the same one, at once."""
        node, flips, forced = self.forest.nodes[index], False, None
        while True:
            if any(each.name in (*_CONDITIONS, _WHILE) for each in node.attributes):
                return None
            if self.scripts.node_may_throw(node):
                return None
            builtin = builtin_of(node.identity, len(node.children))
            meaning = None if builtin is None else builtin.meaning
            if meaning in (Meaning.SUCCEED, Meaning.FAIL):
                answer = meaning is Meaning.SUCCEED if forced is None else forced
                return answer is not flips
            if meaning is Meaning.INVERT and forced is None:
                flips = not flips
            elif meaning in (Meaning.FORCE_SUCCESS, Meaning.FORCE_FAILURE):
                forced = meaning is Meaning.FORCE_SUCCESS if forced is None else forced
            elif meaning not in (Meaning.SEQUENCE, Meaning.FALLBACK, Meaning.PASS):
                return None
            if len(node.children) != 1:
                return None
            node = self.forest.nodes[node.children[0]]

    def leaves_running(self, index: int) -> bool:
        """True if a node in this one may end while its child runs, and does not halt it."""
        pending, seen = [index], set[int]()
        while pending:
            node = self.forest.nodes[pending.pop()]
            if node.index in seen:
                continue
            seen.add(node.index)
            builtin = builtin_of(node.identity, len(node.children))
            if builtin is not None and builtin.meaning is Meaning.MAYBE:
                return True
            tree = self.tree_of(node, node.identity)
            if builtin is not None and builtin.meaning is Meaning.SUBTREE:
                tree = self.forest.trees.get(node.text("ID"), -1)
            pending += self.forest.nodes[tree].children if tree >= 0 else node.children
        return False

    def is_pure(self, index: int) -> bool:
        """True for what answers at once: conditions, and nodes that only ask them."""
        pending, seen = [index], 0
        while pending:
            node = self.forest.nodes[pending.pop()]
            seen += 1
            name = node.identity
            builtin = builtin_of(name, len(node.children))
            if seen > 1_000 or any(each.name.startswith("_") for each in node.attributes):
                return False
            if builtin is None:
                tree = self.tree_of(node, name)
                if tree >= 0:
                    pending += self.forest.nodes[tree].children
                elif node.children or self.category(node, name) != "Condition":
                    return False
            elif builtin.meaning is Meaning.SUBTREE:
                tree = self.forest.trees.get(node.text("ID"), -1)
                pending += self.forest.nodes[tree].children if tree >= 0 else ()
            elif builtin.meaning is Meaning.LEAF:
                if name not in ("ScriptCondition", "WasEntryUpdated"):
                    return False
            elif name.startswith("Async") or (
                builtin.meaning not in _PLAIN
                and builtin.meaning not in (Meaning.SUCCEED, Meaning.FAIL)
            ):
                return False
            else:
                pending += node.children
        return True

    def category(self, node: TreeNode, name: str) -> str:
        """Action or Condition, as far as the file or its name says it; else nothing."""
        if node.explicit:
            return node.tag
        model = (self.forest.models or {}).get(name)
        if model is None:
            return "Condition" if name in NAV2_CONDITIONS else ""
        return model.category
