"""Text → behaviour trees: BehaviorTree.CPP XML, versions 3 and 4.

The front end, the signs of such a text, the rules of a whole file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.model.tree import RESERVED, Forest, TreeNode
from gpsfsm.syntax.frontend import DEEPEST, well_formedness_fault
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.source import DEFAULT_LIMITS, Limits
from gpsfsm.syntax.text import ILLEGAL, WHITE, Lines, clip, root_name
from gpsfsm.syntax.token_reader import (
    MAX_SUPPRESSIONS,
    Collector,
    Frame,
    Inside,
    TokenReader,
)
from gpsfsm.syntax.tree_advice import Advice
from gpsfsm.syntax.tree_nodes import NodeRules, models_of, nearest, refers_to, tell

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.model.plan import Attribute
    from gpsfsm.model.tree import NodeModel
    from gpsfsm.syntax.token_reader import Suppression
    from gpsfsm.syntax.tokens import EndTag, StartTag, TextRun, Token

_FIRST = re.compile(
    rf"(?:[{WHITE}\ufeff]++|<\?(?:[^?]++|\?(?!>))*+\?>|<!--(?:[^-]++|-(?!->))*+-->)*+"
    r"<(root|BehaviorTree)(?=[\s/>])"
)
_SIGNS = ("<BehaviorTree", "BTCPP_format", "main_tree_to_execute")
_ROOT = re.compile(r"<root(?=[\s/>])|</root\s*+>")


@dataclass(frozen=True, slots=True)
class ReadTrees:
    """A text of behaviour trees that was read.

    ``forest`` is None where the trees cannot be known. ``over`` tells that a limit ended the
    reading. ``collector`` takes what the compiler finds wrong, too. ``texts`` are the indices of
    the elements that hold text.
    """

    forest: Forest | None
    collector: Collector
    suppressions: tuple[Suppression, ...]
    over: bool
    texts: tuple[int, ...] = ()


def is_trees(text: str, *, alone: bool = False) -> bool:
    """True if a text is a file of behaviour trees and not a plan.

    BehaviorTree.CPP skips text before them; with ``alone``, a text with such text is none.

    >>> is_trees('<root BTCPP_format="4"/>'), is_trees("<Plan/>"), is_trees("<root/>")
    (True, False, False)
    """
    begins = _FIRST.match(text) is not None if alone else begins_as_trees(text)
    return begins and any(sign in text for sign in _SIGNS)


def last_root(text: str) -> tuple[int, int] | None:
    """The span of the last whole ``<root>…</root>`` of a text.

    >>> answer = "Here: <root><Go/></root> Done."
    >>> start, end = last_root(answer)
    >>> answer[start:end]
    '<root><Go/></root>'
    """
    span: tuple[int, int] | None = None
    start = -1
    for match in _ROOT.finditer(text):
        if not match[0].startswith("</"):
            start = match.start()
        elif start >= 0:
            span, start = (start, match.end()), -1
    return span


def cut_trees(text: str) -> tuple[int, int] | None:
    """The span of the last ``<root>…</root>`` of a model's answer, if it holds trees.

    >>> cut_trees("Here: <root><BehaviorTree/></root> Done."), cut_trees("<root><Go/></root>")
    ((6, 34), None)
    """
    span = last_root(text)
    return span if span and is_trees(text[span[0] : span[1]]) else None


@dataclass(frozen=True, slots=True)
class Target:
    """The name of the file that an include element stands for, or ``why`` it is not read.

    ``hint`` says what to do then, ``rule`` is the code of the rule that reports it.
    """

    file: str = ""
    why: str = ""
    hint: str = ""
    rule: str = "GP813"


@dataclass(frozen=True, slots=True)
class Includes:
    """The files that a file of trees includes, as ``checking/inputs.py`` has read them.

    ``texts`` are these files by name; ``targets`` are those of the include elements, by their file
    ("" for the first one) and offset. ``notes`` say what was guessed.
    """

    texts: Mapping[str, str] = field(default_factory=dict)
    targets: Mapping[tuple[str, int], Target] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def include_elements(text: str, limits: Limits = DEFAULT_LIMITS) -> list[TreeNode]:
    """The elements of a text by which it includes other files.

    >>> [node.text("path") for node in include_elements('<root><include path="arm.xml"/></root>')]
    ['arm.xml']
    """
    if "<include" not in text or not begins_as_trees(text):
        return []
    reader = TreeReader(ILLEGAL.sub(" ", text), limits, Collector(Lines(text), 1))
    return _includes_of(reader.read(scan(reader.text, limits)), 0)


def begins_as_trees(text: str) -> bool:
    """True if the outermost element of a text is one that holds trees."""
    return root_name(text) in ("root", "BehaviorTree")


def _includes_of(nodes: Sequence[TreeNode], root: int) -> list[TreeNode]:
    if not nodes or nodes[root].tag != "root":
        return []
    children = (nodes[child] for child in nodes[root].children)
    return [child for child in children if child.tag == "include"]


def read_trees(
    text: str,
    file: str,
    limits: Limits = DEFAULT_LIMITS,
    extra: Mapping[str, NodeModel] | None = None,
    includes: Includes | None = None,
) -> ReadTrees:
    """Read decoded text; never raises on bad input, but tells the collector what is wrong.

    ``extra`` are the nodes that there are besides the built-in ones, whatever the text says in a
    TreeNodesModel. Without ``includes`` no other file counts as read.
    """
    collector = Collector(Lines(text), limits.max_problems)
    reading = Reading(limits, collector, includes or Includes())
    reading.read(text)
    nodes, suppressions = tuple(reading.nodes), tuple(reading.suppressions)
    if reading.over or reading.fatal or not nodes:
        return ReadTrees(None, collector, suppressions, reading.over)
    described = models_of(nodes, collector)
    models = described if extra is None else extra
    rules = TreeRules(nodes, file, models, collector, roots=reading.in_order(), includes=includes)
    texts = tuple(reading.texts)
    return ReadTrees(rules.forest(), collector, suppressions, over=False, texts=texts)


@dataclass(slots=True)
class Reading:
    """The reading of a file of trees and of those that it includes, each once."""

    limits: Limits
    collector: Collector
    includes: Includes
    nodes: list[TreeNode] = field(default_factory=list)
    roots: dict[str, int] = field(default_factory=dict)
    suppressions: list[Suppression] = field(default_factory=list)
    texts: list[int] = field(default_factory=list)
    over: bool = False
    broken: bool = False
    fatal: bool = False

    def read(self, text: str) -> None:
        """Read all files, an included one where it is first included."""
        pending = [("", text, "")]
        while pending and not (self.over or self.fatal):
            name, text, prefix = pending.pop()
            if name in self.roots:
                continue
            self.roots[name] = len(self.nodes)
            self._one(name, text, prefix)
            pending += [
                (target, self.includes.texts[target], node.path)
                for node, target in reversed(self._included(name))
            ]

    def _one(self, name: str, text: str, prefix: str) -> None:
        collector = self.collector.including(name, Lines(text)) if name else self.collector
        illegal = ILLEGAL.search(text)
        if illegal:
            shown = f"U+{ord(illegal[0]):04X}"
            collector.add(
                "GP116",
                illegal.start(),
                1,
                message=f"the text contains the character {shown}, which XML does not allow",
                hint="remove it",
            )
        body = ILLEGAL.sub(" ", text) if illegal else text
        reader = TreeReader(body, self.limits, collector, prefix=prefix, base=len(self.nodes))
        nodes = reader.read(scan(body, self.limits))
        broken = reader.broken or reader.over or illegal is not None
        if not broken and reader.deepest <= DEEPEST:
            fault = well_formedness_fault(body)
            if fault is not None:
                line, column, (_, length, message, hint, rule) = fault
                offset = collector.lines.offset(line, column)
                collector.add(rule, offset, length, message=message, hint=hint)
                broken = True
        if broken and nodes and not (reader.over or reader.fatal):
            from gpsfsm.syntax.tinyxml import read_elements

            base = nodes[0].index
            rows = [
                (each.tag, max(each.parent - base, -1), [(a.name, a.text) for a in each.attributes])
                for each in nodes
            ]
            if rows == read_elements(body, self.limits):
                collector.tolerate("BehaviorTree.CPP reads it, but tools that expect XML do not")
        self.nodes += nodes
        self.broken |= broken
        room = MAX_SUPPRESSIONS - len(self.suppressions)
        self.suppressions += reader.suppressions[:room]
        self.texts += reader.texts
        self.over |= reader.over
        self.fatal |= reader.fatal or not nodes

    def _included(self, name: str) -> list[tuple[TreeNode, str]]:
        """The include elements of a file that was read, with the names of their files."""
        root = self.roots[name]
        if root == len(self.nodes):
            return []
        rows = (
            (node, self.includes.targets.get((name, node.start), Target()).file)
            for node in _includes_of(self.nodes, root)
        )
        return [(node, target) for node, target in rows if target in self.includes.texts]

    def in_order(self) -> list[int]:
        """The roots in the order in which BehaviorTree.CPP takes in their trees.

        It takes an included file before the one that includes it, and takes it again wherever it is
        included again; as a later tree replaces an earlier one, the last time counts. So it is the
        first time that counts when going backwards.
        """
        backwards: dict[str, None] = {}
        pending = [""]
        while pending:
            name = pending.pop()
            if name not in backwards:
                backwards[name] = None
                pending += [target for _, target in self._included(name)]
        return [self.roots[name] for name in reversed(backwards)]


class TreeReader(TokenReader):
    """Takes tokens in order; afterwards the elements are there.

    ``prefix`` is put before their paths, and ``base`` is the index of the first one.
    """

    noun = "tree"
    declares_namespaces = False

    def __init__(
        self, text: str, limits: Limits, collector: Collector, *, prefix: str = "", base: int = 0
    ) -> None:
        super().__init__(text, limits, collector)
        self._prefix, self._base = prefix, base
        self._tags: list[tuple[StartTag, int, str, tuple[Attribute, ...]]] = []
        self._children: list[list[int]] = []
        self.texts: list[int] = []

    def read(self, tokens: Iterable[Token]) -> tuple[TreeNode, ...]:
        """Read all tokens; the elements in document order, the root first."""
        self._take(tokens)
        self._attach("")
        return tuple(map(self._node, range(len(self._tags))))

    def _start(self, tag: StartTag) -> None:
        frames = self._nesting.frames
        if self._too_many(tag, self._base + len(self._tags) + 1):
            return
        path, parent = f"/{clip(tag.name)}", -1
        if frames:
            around = frames[-1]
            around.counts[tag.name] = around.counts.get(tag.name, 0) + 1
            path = f"{around.path}{path}[{around.counts[tag.name]}]"
            parent = around.index
        else:
            path = f"{self._prefix}{path}"
        if self._tags and not frames:
            self.broken = self.fatal = True
            message = f"a second outermost element <{clip(tag.name)}>; there must be only one"
            hint = "keep one <root>; --from-response takes the last one of a model's answer"
            self.collector.add(
                "GP101", tag.start, 1 + len(tag.name), message=message, hint=hint, element=path
            )
            return
        attributes = self._attributes(tag, path)
        self._attach(path)
        index = len(self._tags)
        self._tags.append((tag, parent, path, attributes))
        self._children.append([])
        if parent >= 0:
            self._children[parent].append(index)
        if not tag.empty:
            frame = Frame(
                path=path, tag=tag.name, start=tag.start, index=index, inside=Inside.OTHER
            )
            self._nesting.open(frame)

    def _end(self, tag: EndTag) -> None:
        self._faults(tag.faults)
        self._attach("")
        if not self._nesting.end(tag):
            self.broken = self.fatal = True

    def _text(self, run: TextRun) -> None:
        """BehaviorTree.CPP skips text inside elements, and so do we; outside it is an error."""
        self._faults(run.faults)
        if self._nesting.frames:
            self.texts.append(self._base + self._nesting.frames[-1].index)
        else:
            self.broken = True
            shown, hint = clip(self.text[run.start : run.end]), "remove it"
            if self._outermost in ("root", "BehaviorTree"):
                hint = "remove it; --from-response takes the tree out of a model's answer"
            self.collector.add(
                "GP108",
                run.start,
                run.end - run.start,
                message=f"text outside of <{clip(self._outermost)}>: {shown}",
                hint=hint,
            )

    @cached_property
    def _outermost(self) -> str:
        return root_name(self.text)

    def _node(self, index: int) -> TreeNode:
        tag, parent, path, attributes = self._tags[index]
        line, column = self.collector.lines.position(tag.start)
        base = self._base
        return TreeNode(
            base + index,
            tag.name,
            base + parent if parent >= 0 else -1,
            tuple(base + child for child in self._children[index]),
            attributes,
            line,
            column,
            tag.start,
            tag.end,
            path,
            self.collector.file,
        )


_VERSIONS = {"3": 3, "4": 4}
MAIN = "main_tree_to_execute"
OF_ROOT = ("BehaviorTree", "TreeNodesModel", "include", "Metadata")
_ONE_TEXT = Target(
    why="this includes another file, which is read only for a tree that is itself a file",
    hint="put the trees into one file, or pass the path of this file to gpsfsm check",
)


class TreeRules:
    """The rules of a file of trees; ``forest`` reports what breaks them.

    ``roots`` are those of all files, in the order in which their trees are taken in.
    """

    def __init__(
        self,
        nodes: tuple[TreeNode, ...],
        file: str,
        models: Mapping[str, NodeModel] | None,
        collector: Collector,
        *,
        roots: Sequence[int],
        includes: Includes | None,
    ) -> None:
        self.nodes, self.file, self.models, self.collector = nodes, file, models, collector
        self.roots, self.includes = [nodes[root] for root in roots], includes
        self.trees: dict[str, int] = {}
        self.tops: list[TreeNode] = []
        self.endless = False

    def forest(self) -> Forest | None:
        """The trees; None where the one that runs cannot be known or has no end."""
        root = self.nodes[0]
        for each in self.roots:
            if each.tag == "root":
                self.tops += self._tops(each)
                continue
            message = (
                f"the outermost element is <{clip(each.tag)}>, but trees must be inside <root>"
            )
            hint = 'put <root BTCPP_format="4"> before it and </root> after it'
            tell(self.collector, "GP815", each, message=message, hint=hint)
            self.tops.append(each)
        version = self._versions(root)
        self._named()
        rules = NodeRules(self.nodes, version, self.trees, self.models, collector=self.collector)
        for top in self.tops:
            rules.check(top)
        references = self._references()
        main = self._main(root, references)
        ended = self._ended(references)
        if self.endless or not ended:
            return None
        mapped = {node: tree for uses in references.values() for node, tree in uses}
        advice = Advice(
            self.nodes, self.tops, self.models, mapped, self.collector, version=version, main=main
        )
        advice.give()
        return Forest(self.file, version, self.nodes, self.trees, main, self.models)

    def _tops(self, root: TreeNode) -> list[TreeNode]:
        """The BehaviorTree elements; what else stands below the root is reported."""
        tops: list[TreeNode] = []
        for index in root.children:
            node = self.nodes[index]
            if node.tag == "BehaviorTree":
                tops.append(node)
            elif node.tag == "include":
                self._include(node)
            elif node.tag not in OF_ROOT:
                message = (
                    f"<{clip(node.tag)}> has no effect here: BehaviorTree.CPP does not read it"
                )
                meant = nearest(node.tag, OF_ROOT)
                hint = "move it into a <BehaviorTree>, or remove it"
                hint = f"did you mean <{meant}>? Otherwise {hint}" if meant else hint
                tell(self.collector, "GP814", node, message=message, hint=hint)
        return tops

    def _include(self, node: TreeNode) -> None:
        """Report an include element whose file was not read."""
        target = _ONE_TEXT
        if self.includes is not None:
            target = self.includes.targets.get((node.file, node.start), _ONE_TEXT)
        if target.why:
            self.endless |= target.rule == "GP809"
            at = node.attribute("path") if target is not _ONE_TEXT else None
            tell(self.collector, target.rule, node, message=target.why, hint=target.hint, at=at)

    def _versions(self, root: TreeNode) -> int:
        """The format of the trees; files that it includes and that have another are reported."""
        version = self._version(root)
        for each in self.roots:
            other = version if each is root else self._version(each)
            if version and other and other != version:
                message = f"this is format {other}, but the file that includes it has {version}"
                hint = "declare one format in all files; gpsfsm uses that of the including file"
                at = each.attribute("BTCPP_format")
                tell(self.collector, "GP808", each, message=message, hint=hint, at=at)
        return version

    def _version(self, root: TreeNode) -> int:
        """3 or 4, 0 if the file does not say it."""
        written = root.attribute("BTCPP_format")
        if written is None:
            if root.tag == "root":
                message = "<root> does not declare the format of the trees"
                hint = 'add BTCPP_format="4" (or "3") to <root>'
                tell(self.collector, "GP808", root, message=message, hint=hint)
            return 0
        version = _VERSIONS.get(written.text.strip(), 0)
        if not version:
            message = f"there is no tree format '{clip(written.text)}'"
            hint = 'write BTCPP_format="4" or BTCPP_format="3"'
            tell(self.collector, "GP808", root, message=message, hint=hint, at=written)
        return version

    def _named(self) -> None:
        """Take in the IDs of the trees."""
        for top in self.tops:
            name = top.text("ID")
            if not name:
                if len(self.tops) > 1:
                    message = "this tree has no ID, so nothing can refer to it"
                    tell(self.collector, "GP807", top, message=message, hint='add one: ID="…"')
                self.trees.setdefault("", top.index)
            elif name in self.trees:
                line = self.nodes[self.trees[name]].location.words
                message = (
                    f"there already is a tree '{clip(name)}' on {line}; BehaviorTree.CPP "
                    "uses the last one"
                )
                hint = "give one of the two another ID"
                tell(self.collector, "GP806", top, message=message, hint=hint)
                self.trees[name] = top.index
            else:
                self.trees[name] = top.index
            if name in RESERVED:
                message = f"a tree cannot be called '{clip(name)}': the name is reserved"
                hint = "choose another ID"
                tell(self.collector, "GP804", top, message=message, hint=hint)

    def _main(self, root: TreeNode, references: Mapping[int, Sequence[tuple[int, int]]]) -> int:
        """The tree that runs. Where that is not said right, the one that no other tree uses."""
        written = root.attribute(MAIN)
        if not self.tops:
            message = "there is no <BehaviorTree> in this file"
            hint = 'write a tree as <BehaviorTree ID="…">…</BehaviorTree> inside <root>'
            tell(self.collector, "GP802", root, message=message, hint=hint)
            return -1
        if written is not None:
            if written.text in self.trees:
                return self.trees[written.text]
            message = f"{MAIN} names '{clip(written.text)}', but there is no such tree"
            alike = nearest(written.text, self.trees)
            intended = alike or next((name for name in self.trees if name), "")
            hint = f'write {MAIN}="{clip(intended)}"' if intended else "give the tree this ID"
            tell(self.collector, "GP802", root, message=message, hint=hint, at=written)
        elif len(self.tops) > 1:
            message = f"there are {len(self.tops)} trees, and nothing defines which of them runs"
            hint = f'add {MAIN}="…" to <root>'
            tell(self.collector, "GP802", root, message=message, hint=hint)
        used = {target for uses in references.values() for _, target in uses}
        free = [top.index for top in self.tops if top.index not in used]
        return free[0] if len(free) == 1 else -1

    def _references(self) -> dict[int, list[tuple[int, int]]]:
        """Per tree (the index of its element) the uses of other trees: node, tree."""
        references: dict[int, list[tuple[int, int]]] = {}
        for top in self.tops:
            uses = references.setdefault(top.index, [])
            pending = list(reversed(top.children))
            while pending:
                node = self.nodes[pending.pop()]
                pending.extend(reversed(node.children))
                name = refers_to(node, self.trees, self.models)
                if name and name in self.trees:
                    uses.append((node.index, self.trees[name]))
        return references

    def _ended(self, references: Mapping[int, Sequence[tuple[int, int]]]) -> bool:
        """True if no tree holds itself; reports those that do."""
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
        message = (
            f"the tree '{clip(tree.text('ID'))}' contains itself: it would never end, and "
            "BehaviorTree.CPP crashes when it loads it"
        )
        hint = f"do not use the tree of {tree.location.words} here; use Repeat to repeat it"
        tell(self.collector, "GP809", node, message=message, hint=hint)
