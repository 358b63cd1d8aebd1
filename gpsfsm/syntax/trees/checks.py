"""What is wrong with a file of behaviour trees as a whole: its root, its trees, which one runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.tree import Forest, TreeNode
from gpsfsm.model.tree_nodes import RESERVED
from gpsfsm.syntax.chars import clip
from gpsfsm.syntax.trees.nodes import NodeRules, refers_to
from gpsfsm.syntax.trees.telling import nearest, tell

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.model.tree import NodeModel
    from gpsfsm.syntax.collector import Collector

__all__ = ["TreeRules"]

_VERSIONS = {"3": 3, "4": 4}
_MAIN = "main_tree_to_execute"
_OF_ROOT = ("BehaviorTree", "TreeNodesModel", "include", "Metadata")


class TreeRules:
    """The rules of a file of trees; ``forest`` reports what breaks them."""

    def __init__(
        self,
        nodes: tuple[TreeNode, ...],
        file: str,
        models: Mapping[str, NodeModel] | None,
        collector: Collector,
    ) -> None:
        self.nodes, self.file, self.models, self.collector = nodes, file, models, collector
        self.trees: dict[str, int] = {}
        self.tops: list[TreeNode] = []

    def forest(self) -> Forest | None:
        """The trees; None where the one that runs cannot be known or has no end."""
        root = self.nodes[0]
        if root.tag == "root":
            self.tops = self._tops(root)
        else:
            message = f"the outermost element is <{clip(root.tag)}>, but trees stand in <root>"
            hint = 'put <root BTCPP_format="4"> before it and </root> after it'
            tell(self.collector, "GP815", root, message=message, hint=hint)
            self.tops = [root]
        version = self._version(root)
        self._named()
        rules = NodeRules(self.nodes, version, self.trees, self.models, collector=self.collector)
        for top in self.tops:
            rules.check(top)
        references = self._references()
        main = self._main(root, references)
        ended = self._ended(references)
        if not ended:
            return None
        return Forest(self.file, version, self.nodes, self.trees, main, self.models)

    def _tops(self, root: TreeNode) -> list[TreeNode]:
        """The BehaviorTree elements; what else stands below the root is reported."""
        found: list[TreeNode] = []
        for index in root.children:
            node = self.nodes[index]
            if node.tag == "BehaviorTree":
                found.append(node)
            elif node.tag == "include":
                message = "this includes another file, which gpsfsm does not read"
                hint = "put the trees into one file"
                tell(self.collector, "GP813", node, message=message, hint=hint)
            elif node.tag not in _OF_ROOT:
                message = (
                    f"<{clip(node.tag)}> means nothing here: BehaviorTree.CPP does not read it"
                )
                hint = "nodes stand inside of a <BehaviorTree>; move it there, or remove it"
                tell(self.collector, "GP814", node, message=message, hint=hint)
        return found

    def _version(self, root: TreeNode) -> int:
        """3 or 4, 0 if the file does not say it."""
        written = root.attribute("BTCPP_format")
        if written is None:
            if root.tag == "root":
                message = "the format of the trees is not given"
                hint = 'add BTCPP_format="4" (or "3") to <root>'
                tell(self.collector, "GP808", root, message=message, hint=hint)
            return 0
        version = _VERSIONS.get(written.text.strip(), 0)
        if not version:
            message = f"there is no format '{clip(written.text)}' of trees"
            hint = 'write BTCPP_format="4" or BTCPP_format="3"'
            tell(self.collector, "GP808", root, message=message, hint=hint, at=written)
        return version

    def _named(self) -> None:
        """Take in the IDs of the trees."""
        for top in self.tops:
            name = top.text("ID")
            if not name:
                if len(self.tops) > 1:
                    message = "this tree has no ID, so that nothing can refer to it"
                    tell(self.collector, "GP807", top, message=message, hint='add one: ID="…"')
                self.trees.setdefault("", top.index)
            elif name in self.trees:
                line = self.nodes[self.trees[name]].line
                message = f"there is a tree '{clip(name)}' already, on line {line}"
                hint = "give one of the two another ID"
                tell(self.collector, "GP806", top, message=message, hint=hint)
            else:
                self.trees[name] = top.index
            if name in RESERVED:
                message = f"a tree cannot be called '{clip(name)}': the name is reserved"
                hint = "choose another ID"
                tell(self.collector, "GP804", top, message=message, hint=hint)

    def _main(self, root: TreeNode, references: Mapping[int, Sequence[tuple[int, int]]]) -> int:
        """The tree that runs. Where that is not said right, the one that no other tree uses."""
        written = root.attribute(_MAIN)
        if not self.tops:
            message = "there is no <BehaviorTree> in this file"
            hint = 'a tree is written <BehaviorTree ID="…">…</BehaviorTree>, inside of <root>'
            tell(self.collector, "GP802", root, message=message, hint=hint)
            return -1
        if written is not None:
            if written.text in self.trees:
                return self.trees[written.text]
            message = f"{_MAIN} names '{clip(written.text)}', but there is no such tree"
            alike = nearest(written.text, self.trees)
            known = alike or next((name for name in self.trees if name), "")
            hint = f'write {_MAIN}="{clip(known)}"' if known else "give the tree this ID"
            tell(self.collector, "GP802", root, message=message, hint=hint, at=written)
        elif len(self.tops) > 1:
            message = f"there are {len(self.tops)} trees, and nothing says which of them runs"
            hint = f'add {_MAIN}="…" to <root>'
            tell(self.collector, "GP802", root, message=message, hint=hint)
        used = {target for uses in references.values() for _, target in uses}
        free = [top.index for top in self.tops if top.index not in used]
        return free[0] if len(free) == 1 else -1

    def _references(self) -> dict[int, list[tuple[int, int]]]:
        """Per tree (the index of its element) the uses of other trees: node, tree."""
        found: dict[int, list[tuple[int, int]]] = {}
        for top in self.tops:
            uses = found.setdefault(top.index, [])
            pending = list(reversed(top.children))
            while pending:
                node = self.nodes[pending.pop()]
                pending.extend(reversed(node.children))
                name = refers_to(node, self.trees, self.models)
                if name and name in self.trees:
                    uses.append((node.index, self.trees[name]))
        return found

    def _ended(self, references: Mapping[int, Sequence[tuple[int, int]]]) -> bool:
        """Whether no tree holds itself; reports those that do."""
        state: dict[int, int] = {}  # 1: being looked at, 2: done
        ended = True
        for top in self.tops:
            stack = [(top.index, iter(references[top.index]))]
            if state.get(top.index):
                continue
            state[top.index] = 1
            while stack:
                tree, uses = stack[-1]
                use = next(uses, None)
                if use is None:
                    state[tree] = 2
                    stack.pop()
                elif state.get(use[1]) == 1:
                    ended = False
                    self._recursive(*use)
                elif not state.get(use[1]):
                    state[use[1]] = 1
                    stack.append((use[1], iter(references[use[1]])))
        return ended

    def _recursive(self, use: int, target: int) -> None:
        node, tree = self.nodes[use], self.nodes[target]
        message = f"the tree '{clip(tree.text('ID'))}' holds itself: it would never end"
        hint = f"do not use the tree of line {tree.line} here; to repeat it, use Repeat"
        tell(self.collector, "GP809", node, message=message, hint=hint)
