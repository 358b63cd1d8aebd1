"""The tree of a run as Groot2 draws it: a node for each use of a node, with its number (uid).

A SubTree that is used twice is there twice, but a round of a loop is no use: Retry and Repeat run
the same nodes again. So a runner of the automaton belongs to the use with the same node and the
same SubTrees around it, and several may belong to one.

    <BehaviorTree ID="A"> <Sequence> <SubTree ID="B"/> <Dock/>      uids 1, 2, 4
    <BehaviorTree ID="B"> <Go/>                                     uid 3

The numbers and the form of the text are those of BehaviorTree.CPP's publisher: SubTrees are
numbered in their places, and written as a tree each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.units import TreeMachine
from gpsfsm.errors import UsageError
from gpsfsm.model.choice import CHOICE, TICK
from gpsfsm.model.tree import BUILTINS, NAV2, Meaning

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.tree import Forest, NodeModel, TreeNode

MOST_USES = 65_535
"""A uid has two bytes."""

_CONDITIONS = ("ScriptCondition", "WasEntryUpdated")


@dataclass(frozen=True, slots=True)
class Use:
    """A use of a node. Its uid is one more than its index.

    ``block`` is the tree that it stands in, ``tree`` the one that it stands for, -1 for all but
    SubTrees (both are indices into ``GrootTree.blocks``).
    """

    node: TreeNode
    parent: int
    block: int
    meaning: Meaning
    tree: int
    children: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Block:
    """One tree of the text: the main one, whose path is "", or that of a SubTree."""

    tree: str
    path: str


@dataclass(frozen=True, slots=True)
class GrootTree:
    """All uses, parents before their children, and the use of each runner of the automaton.

    ``owners`` says for a node of the automaton to which use it belongs; ``helpers`` are the choices
    and ticks among them, which are no nodes of the tree.
    """

    uses: tuple[Use, ...]
    blocks: tuple[Block, ...]
    models: Mapping[str, NodeModel]
    owners: Mapping[int, int]
    helpers: frozenset[int]

    @property
    def order(self) -> list[int]:
        """The uses as a status buffer has them: one tree after the other."""
        return sorted(range(len(self.uses)), key=lambda use: (self.uses[use].block, use))

    def text(self) -> str:
        """The text of the trees, each node with its uid, and of the nodes that there are."""
        lines = ['<root BTCPP_format="4">']
        inside: list[list[int]] = [[] for _ in self.blocks]
        for use in self.order:
            inside[self.uses[use].block].append(use)
        for block, members in zip(self.blocks, inside, strict=True):
            identity, path = quoteattr(block.tree), quoteattr(block.path)
            lines.append(f"  <BehaviorTree ID={identity} _fullpath={path}>")
            lines += self._lines(members)
            lines.append("  </BehaviorTree>")
        return "\n".join((*lines, *_models(self), "</root>", ""))

    def _lines(self, members: Sequence[int]) -> Iterator[str]:
        """The uses of one tree as nested elements; parents come before their children."""
        open_: list[int] = []
        for use in members:
            while open_ and self.uses[use].parent != open_[-1]:  # the parent of a top is elsewhere
                yield self._end(open_)
            each = self.uses[use]
            leaf = each.tree >= 0 or not each.children
            yield f"{'  ' * (len(open_) + 2)}<{self._tag(use)}{'/' if leaf else ''}>"
            if not leaf:
                open_.append(use)
        while open_:
            yield self._end(open_)

    def _end(self, open_: list[int]) -> str:
        use = open_.pop()
        return f"{'  ' * (len(open_) + 2)}</{self.uses[use].node.identity}>"

    def _tag(self, use: int) -> str:
        each = self.uses[use]
        node = each.node
        if each.tree >= 0:
            block = self.blocks[each.tree]
            parts = ["SubTree", f"ID={quoteattr(block.tree)}", f"_fullpath={quoteattr(block.path)}"]
        else:
            parts = [node.identity, f"name={quoteattr(node.text('name') or node.identity)}"]
        parts.append(f'_uid="{use + 1}"')
        parts += [
            f"{attribute.name}={quoteattr(attribute.text)}"
            for attribute in node.attributes
            if attribute.name not in ("ID", "name", "_uid", "_fullpath")
        ]
        return " ".join(parts)


def groot_tree(forest: Forest, automaton: Automaton) -> GrootTree:
    """The tree of a run. Raises UsageError if it has too many nodes for the protocol."""
    trees = {node.start: _tree_of(forest, node) for node in forest.nodes}
    uses, blocks, places = _uses(forest, trees)
    plan = automaton.plan
    around = plan.subtrees if isinstance(plan, TreeMachine) else _around(plan, trees)
    owners, helpers = {}, set()
    for node in automaton.runners:
        element = plan.elements[node.origin]
        owners[node.index] = places[(*around[element.index], element.start)]
        if element.interface in (CHOICE, TICK):
            helpers.add(node.index)
    return GrootTree(uses, blocks, forest.models or {}, owners, frozenset(helpers))


def _tree_of(forest: Forest, node: TreeNode) -> int:
    """The tree that a node stands for (an index into the nodes), -1 if it stands for none."""
    name = node.identity
    if name in BUILTINS:
        return forest.trees.get(node.text("ID"), -1) if meaning_of(node) is Meaning.SUBTREE else -1
    compact = not node.explicit and name not in (forest.models or ())
    return forest.trees.get(name, -1) if compact else -1


def _around(plan: Plan, trees: Mapping[int, int]) -> list[tuple[int, ...]]:
    """The start offsets of the SubTrees around each element of a plan."""
    around: list[tuple[int, ...]] = []
    for element in plan.elements:  # parents come before their children
        outer: tuple[int, ...] = ()
        if element.parent >= 0:
            outer, start = around[element.parent], plan.elements[element.parent].start
            if trees[start] >= 0:
                outer = (*outer, start)
        around.append(outer)
    return around


def _uses(
    forest: Forest, trees: Mapping[int, int]
) -> tuple[tuple[Use, ...], tuple[Block, ...], dict[tuple[int, ...], int]]:
    """All uses and trees, and the use at each place: the starts of its SubTrees and its own."""
    uses: list[Use] = []
    inside: list[list[int]] = []
    blocks = [Block(forest.nodes[forest.main].text("ID"), "")]
    places: dict[tuple[int, ...], int] = {}
    top = forest.nodes[forest.main]
    pending: list[tuple[int, int, int, tuple[int, ...]]]
    pending = [(child, -1, 0, ()) for child in reversed(top.children)]
    while pending:
        index, parent, block, subtrees = pending.pop()
        node, use = forest.nodes[index], len(uses)
        if use >= MOST_USES:
            raise UsageError(f"--groot: the protocol allows for {MOST_USES:,} nodes of a tree")
        tree = trees[node.start]
        children: Sequence[int] = node.children
        if parent >= 0:
            inside[parent].append(use)
        places[(*subtrees, node.start)] = use
        uses.append(Use(node, parent, block, meaning_of(node), len(blocks) if tree >= 0 else -1))
        inside.append([])
        if tree >= 0:
            name, around = forest.nodes[tree].text("ID"), blocks[block].path
            own = node.text("name") or f"{name}::{use + 1}"
            blocks.append(Block(name, f"{around}/{own}" if around else own))
            children, subtrees = forest.nodes[tree].children, (*subtrees, node.start)
            block = len(blocks) - 1
        pending += [(child, use, block, subtrees) for child in reversed(children)]
    rows = zip(uses, inside, strict=True)
    return tuple(replace(use, children=tuple(row)) for use, row in rows), tuple(blocks), places


def meaning_of(node: TreeNode) -> Meaning:
    """The meaning of a node; OTHER for one of one's own with children, else LEAF."""
    builtin = BUILTINS.get(node.identity) or NAV2.get(node.identity)
    if builtin is not None and (node.identity in BUILTINS or node.children):
        return builtin.meaning
    return Meaning.OTHER if node.children else Meaning.LEAF


def _models(tree: GrootTree) -> Iterator[str]:
    """The nodes that are used, by their kinds, with the ports that the file declares."""
    kinds: dict[str, str] = {}
    for use in tree.uses:
        if use.tree < 0:
            kinds.setdefault(use.node.identity, _kind(use, tree.models))
    yield "  <TreeNodesModel>"
    for name, kind in sorted(kinds.items()):
        ports = tree.models[name].ports if name in tree.models else {}
        yield f"    <{kind} ID={quoteattr(name)}{'' if ports else '/'}>"
        for port, direction in ports.items():
            yield f"      <{direction.value} name={quoteattr(port)}/>"
        if ports:
            yield f"    </{kind}>"
    yield "  </TreeNodesModel>"


def _kind(use: Use, models: Mapping[str, NodeModel]) -> str:
    node = use.node
    if node.identity in models:
        return models[node.identity].category
    if node.explicit:
        return node.tag
    if node.children:
        builtin = BUILTINS.get(node.identity) or NAV2.get(node.identity)
        one = len(node.children) == 1 if builtin is None else builtin.most == 1
        return "Decorator" if one else "Control"
    return "Condition" if node.identity in _CONDITIONS else "Action"
