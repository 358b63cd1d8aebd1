"""Behaviour trees: names that are misspelt or of another version, the tree that runs, its frame.

BehaviorTree.CPP refuses most of what is fixed here when it loads a file, so the tree meant nothing
before. What it loads and ignores, such as a misspelt ``_skipIf``, does something else once it is
spelt correctly: these fixes are unsafe.
"""

from __future__ import annotations

import re
from difflib import SequenceMatcher
from functools import cached_property, partial
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import (
    attribute_edit,
    attribute_end,
    escaped,
    line_end,
    rename,
    without_attribute,
    wrapped,
)
from gpsfsm.model.printable import clip
from gpsfsm.model.tree import BUILTINS, CATEGORIES, Meaning
from gpsfsm.syntax.scripts import is_script
from gpsfsm.syntax.text import WHITE
from gpsfsm.syntax.tree_advice import KEY, NAME
from gpsfsm.syntax.tree_nodes import (
    OTHER_NAMES,
    PORT_TAGS,
    likest,
    port_meant,
    ports_of,
    special_name,
    whole_number,
)
from gpsfsm.syntax.trees import MAIN, OF_ROOT
from gpsfsm.syntax.values import decode_value

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from gpsfsm.fixing.draft import Draft, Node
    from gpsfsm.syntax.tokens import RawAttribute

_FORMAT = re.compile(r"[^0-9]*([34])(?:\.[0-9]+)*[^0-9]*")
_ROOT = '<root BTCPP_format="{}">'
_LIMIT = 40
_WRONG_LETTERS = 2


class _File:
    """The trees and the models of a file, as they are written."""

    def __init__(self, draft: Draft) -> None:
        self.draft = draft
        roots = [each for each in draft.outline.roots if each.name in ("root", "BehaviorTree")]
        self.root = roots[-1] if roots else None
        inside = self.root.children if self.root and self.root.name == "root" else roots
        self.tops = [each for each in inside if each.name == "BehaviorTree"]
        self.trees = [self.value(top, "ID") for top in self.tops]
        self.models: dict[str, tuple[str, list[str]]] = {
            self.value(model, "ID"): (model.name, [self.value(p, "name") for p in model.children])
            for described in inside
            if described.name == "TreeNodesModel"
            for model in described.children
        }
        written = self.value(self.root, "BTCPP_format").strip() if self.root else ""
        self.version = {"3": 3, "4": 4}.get(written, 0)

    def text(self, raw: RawAttribute) -> str:
        """The value of an attribute."""
        return decode_value(self.draft.text[raw.value_start : raw.value_end], 0, [])

    def value(self, node: Node, name: str) -> str:
        """The value of the attribute of this name, "" where there is none."""
        raw = node.attribute(name)
        return "" if raw is None else self.text(raw)

    def identity(self, node: Node) -> str:
        """The ID of the kind of node that an element is."""
        return self.value(node, "ID") if node.name in CATEGORIES else node.name

    def renamed(self, node: Node, name: str) -> tuple[Edit, ...]:
        """Another ID for a node, in its tags or in its attribute."""
        raw = node.attribute("ID") if node.name in CATEGORIES else None
        return rename(node, name) if raw is None else (self.written(raw, name),)

    def written(self, raw: RawAttribute, value: str) -> Edit:
        """Another value for an attribute."""
        return attribute_edit(self.draft, raw, raw.name, value)

    @cached_property
    def nodes(self) -> list[Node]:
        """All nodes of all trees."""
        nodes: list[Node] = []
        pending = list(reversed(self.tops))
        while pending:
            node = pending.pop()
            pending += reversed(node.children)
            if node not in self.tops:
                nodes.append(node)
        return nodes

    @cached_property
    def unused(self) -> list[str]:
        """The trees that no other one uses."""
        used = {
            self.value(node, "ID") if node.name in ("SubTree", "SubTreePlus") else node.name
            for node in self.nodes
        }
        return [name for name in self.trees if name not in used]

    @cached_property
    def signs(self) -> set[int]:
        """The versions that alone have a node or an attribute of this file."""
        builtins = [BUILTINS[name] for name in map(self.identity, self.nodes) if name in BUILTINS]
        versions = {builtin.version for builtin in builtins} - {0}
        names = {raw.name for node in self.nodes for raw in node.tag.attributes}
        versions |= {4} if any(is_script("", name) for name in names) else set()
        return versions | ({3} if "__shared_blackboard" in names else set())

    def places(self, *rules: str) -> Iterator[tuple[str, int, Node, RawAttribute | None]]:
        """The wanted findings: rule, offset, element, and the attribute that it is about."""
        for finding in self.draft.findings(*rules):
            at = self.draft.offset(finding)
            node = self.draft.around(at)
            if node is not None:
                raw = next((each for each in node.tag.attributes if each.start == at), None)
                yield finding.rule, at, node, raw


def _safety(sure: bool) -> Safety:
    return Safety.SAFE if sure else Safety.UNSAFE


def _misspelt(written: str, meant: str) -> bool:
    """True if two letters at most are wrong, missing or too many: a prefix is no mistake."""
    codes = SequenceMatcher(None, written, meant, autojunk=False).get_opcodes()
    wrong = (max(code[2] - code[1], code[4] - code[3]) for code in codes if code[0] != "equal")
    return sum(wrong) <= _WRONG_LETTERS


def _shown(before: str, after: str) -> str:
    return f"'{clip(before, _LIMIT)}' changed to '{clip(after, _LIMIT)}'"


# ---- Names ---------------------------------------------------------------------------------------


def _node_names(draft: Draft) -> Iterator[Fix]:
    """Nodes of another version, and misspelt ones: one fix each."""
    file = _File(draft)
    for rule, at, node, _ in file.places("GP812", "GP817"):
        name = file.identity(node)
        if rule == "GP817":
            meant, sure = OTHER_NAMES.get(name, ("", False))
        else:
            meant, sure = likest(name, {*file.models, *BUILTINS}), False
            if not _misspelt(name.removesuffix("Node"), meant.removesuffix("Node")):
                continue
        if meant in ("", name):
            continue
        edits = list(file.renamed(node, meant))
        remap = node.attribute("__autoremap")
        if name == "SubTreePlus" and remap is not None:
            edits.append(attribute_edit(draft, remap, "_autoremap"))
        yield Fix(rule, _shown(name, meant), at, tuple(edits), _safety(sure))


def _ports(draft: Draft) -> Iterator[Fix]:
    """Ports that a node does not have: one fix each."""
    file = _File(draft)
    for rule, at, node, raw in file.places("GP803", "GP810"):
        if raw is None:
            continue
        name = file.identity(node)
        if raw.name == "ID":  # the tag is the ID
            if file.text(raw) == name:
                title = "ID that repeats the tag removed"
                yield Fix(rule, title, at, (without_attribute(draft, raw),))
            continue
        allowed: Collection[str] = file.models[name][1] if name in file.models else ()
        if name in BUILTINS:
            allowed = ports_of(BUILTINS[name], file.version)
        meant, sure = port_meant(raw.name, allowed)
        sure = sure and name in BUILTINS  # of others the program may know more than their model
        if meant and node.attribute(meant) is None:
            edit = attribute_edit(draft, raw, meant)
            yield Fix(rule, _shown(raw.name, meant), at, (edit,), _safety(sure))


def _special_attributes(draft: Draft) -> Iterator[Fix]:
    """Attributes such as ``_skipIf`` that are misspelt: one fix each."""
    file = _File(draft)
    for rule, at, node, raw in file.places("GP824"):
        meant = special_name(raw.name, file.version) if raw is not None else ""
        if raw is not None and meant and node.attribute(meant) is None:
            edit = attribute_edit(draft, raw, meant)
            yield Fix(rule, _shown(raw.name, meant), at, (edit,), Safety.UNSAFE)


def _subtree_names(draft: Draft) -> Iterator[Fix]:
    """SubTrees whose tree is called otherwise, and trees that stand as nodes: one fix each."""
    file = _File(draft)
    for rule, at, node, _ in file.places("GP801"):
        raw = node.attribute("ID")
        if node.name in ("SubTree", "SubTreePlus"):
            name = file.value(node, "ID")
            meant = likest(name, set(file.trees))
            if raw is not None and meant:
                sure = meant.lower() == name.lower()
                edit = file.written(raw, meant)
                yield Fix(rule, _shown(name, meant), at, (edit,), _safety(sure))
        elif node.name in file.trees and raw is None and not node.children:
            opening, *closing = rename(node, "SubTree")
            written = f'SubTree ID="{escaped(node.name)}"'
            edits = (Edit(opening.start, opening.end, written), *closing)
            yield Fix(rule, f"<{clip(node.name, _LIMIT)}> changed to a SubTree", at, edits)


def _model_elements(draft: Draft) -> Iterator[Fix]:
    """Elements that are read if they are spelt in other letters: one fix each."""
    file = _File(draft)
    for rule, at, node, _ in file.places("GP814"):
        around = node.parent.name if node.parent else ""
        names: Collection[str] = OF_ROOT if around == "root" else PORT_TAGS
        names = (*CATEGORIES, "SubTree") if around == "TreeNodesModel" else names
        meant = likest(node.name, set(names))
        if meant.lower() == node.name.lower():
            safety = _safety(names is PORT_TAGS)
            yield Fix(rule, _shown(node.name, meant), at, rename(node, meant), safety)


# ---- Values --------------------------------------------------------------------------------------


def _numbers(draft: Draft) -> Iterator[Fix]:
    """Whole numbers with blanks, a plus or a point: one fix each."""
    file = _File(draft)
    for rule, at, _, raw in file.places("GP811"):
        meant = whole_number(file.text(raw)) if raw is not None else ""
        if raw is not None and meant and meant != file.text(raw):
            yield Fix(rule, f"number changed to {meant}", at, (file.written(raw, meant),))


def _keys(draft: Draft) -> Iterator[Fix]:
    """Keys of the blackboard without braces, and misspelt ones: one fix each."""
    file = _File(draft)
    for rule, at, _, raw in file.places("GP820", "GP823"):
        text = "" if raw is None else file.text(raw)
        reference = KEY.fullmatch(text)
        if raw is None:
            continue
        if rule == "GP823":
            if NAME.fullmatch(text.strip()):
                yield _braced(file, rule, at, raw)
        elif reference is not None:
            yield from _written_key(file, at, raw, reference[1])


def _braced(file: _File, rule: str, at: int, raw: RawAttribute) -> Fix:
    name = file.text(raw).strip()
    edit = file.written(raw, f"{{{name}}}")
    return Fix(rule, f"'{clip(name, _LIMIT)}' enclosed in braces", at, (edit,), Safety.UNSAFE)


def _written_key(file: _File, at: int, raw: RawAttribute, name: str) -> Iterator[Fix]:
    """The key that is read is that of a port without braces, or one that is spelt like it."""
    bare, keys = [], set[str]()
    for node in file.nodes:
        for each in node.tag.attributes:
            text = file.text(each)
            reference = KEY.fullmatch(text)
            if reference is not None:
                keys.add(reference[1])
            elif text.strip() == name and each.name not in ("ID", "name", "output_key"):
                bare.append(each)
            elif each.name == "output_key":
                keys.add(text.strip())
    if len(bare) == 1:
        yield _braced(file, "GP820", at, bare[0])
        return
    meant = likest(name, keys - {name})
    if meant and _misspelt(name, meant):
        edit = file.written(raw, f"{{{meant}}}")
        yield Fix("GP820", _shown(f"{{{name}}}", f"{{{meant}}}"), at, (edit,), Safety.UNSAFE)


# ---- The frame -----------------------------------------------------------------------------------


def _main_tree(draft: Draft) -> Iterator[Fix]:
    """The name of the tree that runs, where it is missing or that of no tree."""
    file = _File(draft)
    only = file.unused[0] if len(file.unused) == 1 else ""
    for rule, at, node, _ in file.places("GP802"):
        raw = node.attribute(MAIN)
        if node.name != "root":
            continue
        if raw is None:
            if only:
                edit = _added(draft, node, f'{MAIN}="{escaped(only)}"')
                yield Fix(rule, f"{MAIN} names '{clip(only, _LIMIT)}'", at, (edit,))
            continue
        written = file.text(raw)
        meant = likest(written, set(file.trees)) or only
        if meant:
            sure = meant.lower() == written.lower()
            edit = file.written(raw, meant)
            yield Fix(rule, _shown(written, meant), at, (edit,), _safety(sure))


def _tree_format(draft: Draft) -> Iterator[Fix]:
    """The version that a file is for."""
    file = _File(draft)
    for rule, at, node, raw in file.places("GP808"):
        if raw is not None:
            match = _FORMAT.fullmatch(file.text(raw))
            if match is not None:
                edit = file.written(raw, match[1])
                yield Fix(rule, f'BTCPP_format changed to "{match[1]}"', at, (edit,))
        elif len(file.signs) < 2:
            version = next(iter(file.signs), 4)
            edit = _added(draft, node, f'BTCPP_format="{version}"')
            title = f'BTCPP_format="{version}" added'
            yield Fix(rule, title, at, (edit,), _safety(bool(file.signs)))


def _added(draft: Draft, node: Node, words: str) -> Edit:
    """An attribute behind those that an element has."""
    last = node.tag.attributes[-1:]
    place = attribute_end(draft.text, last[0]) if last else node.start + 1 + len(node.name)
    return Edit(place, place, f" {words}")


def _tree_root(draft: Draft) -> Iterator[Fix]:
    """``<root>`` around trees that stand alone."""
    file = _File(draft)
    roots = draft.outline.roots
    if not roots or any(each.name not in OF_ROOT for each in roots) or len(file.signs) > 1:
        return
    for rule in ("GP815", "GP101"):
        for finding in draft.findings(rule):
            place = draft.offset(finding)
            if rule == "GP101" and (len(roots) < 2 or place != roots[1].start):
                continue
            text, end = draft.text, line_end(draft.text)
            stop = len(text[: roots[-1].stop].rstrip(WHITE))
            begin = roots[0].start
            opened = f"{_ROOT.format(next(iter(file.signs), 4))}{end}"
            edits = (Edit(begin, begin, opened), Edit(stop, stop, f"{end}</root>"))
            yield Fix(rule, "trees wrapped in <root>", place, edits)
            return


def _several_children(draft: Draft) -> Iterator[Fix]:
    """Trees and decorators around several nodes: one fix each."""
    file = _File(draft)
    for rule, at, node, _ in file.places("GP805"):
        name = file.identity(node)
        builtin = BUILTINS.get(name)
        one = builtin.most == 1 and builtin.meaning is not Meaning.SUBTREE if builtin else False
        one = one or node.name in ("BehaviorTree", "Decorator")
        if len(node.children) > 1 and (one or file.models.get(name, ("",))[0] == "Decorator"):
            edits = wrapped(draft, node.children, "<Sequence>", "</Sequence>")
            yield Fix(rule, "children wrapped in a Sequence", at, edits, Safety.UNSAFE)


def _taken_out(draft: Draft) -> Iterator[Fix]:
    """The trees of a language model's answer without the text around them."""
    root = _File(draft).root
    for finding in draft.findings("GP115"):
        if root is None or root.closing is None:
            continue
        text = draft.text
        end = line_end(text) if root.stop < len(text) else ""
        edits = (Edit(0, root.start), Edit(root.stop, len(text), end))
        yield Fix(
            "GP115", "trees extracted from the text around them", draft.offset(finding), edits
        )


_SHOWN = frozenset({"GP302", "GP304", "GP305", "GP314", "GP816", "GP820"})
"""What may come to light once a condition or a node is read."""

_fixer = partial(Fixer, plans=False, trees=True)

FIXERS = (
    _fixer(
        name="tree-node-names",
        rules=("GP812", "GP817"),
        propose=_node_names,
        reveals=_SHOWN,
        safe=(
            "writes `SequenceStar` as `SequenceWithMemory`, and other names as the version of the "
            "file has them: the engine refuses the other name"
        ),
        unsafe=(
            "takes the only node with a similar name, and `Fallback` for `FallbackStar`, although "
            "a Fallback forgets where it was: another node may be meant, or one that the program "
            "registers"
        ),
    ),
    _fixer(
        name="tree-ports",
        rules=("GP803", "GP810"),
        propose=_ports,
        reveals=_SHOWN,
        safe=(
            "corrects the case of the ports of built-in nodes, writes `success_threshold` as "
            "`success_count` in version 4 and `skipIf` as `_skipIf`, and removes an ID that "
            "repeats the tag: the engine refuses the other names"
        ),
        unsafe=(
            "takes the only port with a similar name, also from the TreeNodesModel: another one "
            "may be meant, or the model may be outdated"
        ),
    ),
    _fixer(
        name="special-attributes",
        rules=("GP824",),
        propose=_special_attributes,
        reveals=_SHOWN | {"GP301", "GP818"},
        unsafe=(
            "writes `_skipif` as `_skipIf`, and `__shared_blackboard` as `_autoremap` in version "
            "4: the engine ignored them, and now heeds them"
        ),
    ),
    _fixer(
        name="subtree-names",
        rules=("GP801",),
        propose=_subtree_names,
        safe=(
            "corrects the case of a tree's ID, and writes `<Dock/>` as a SubTree if the file has a "
            "tree Dock: the engine refuses anything else"
        ),
        unsafe="takes the only tree with a similar ID: another one may be meant",
    ),
    _fixer(
        name="model-elements",
        rules=("GP814",),
        propose=_model_elements,
        reveals=_SHOWN,
        safe="writes `<Input_Port>` as `<input_port>`: nothing reads it in another case",
        unsafe=(
            "corrects the case of `<action>` and other elements: what was ignored is then read, "
            "and a node that was taken for an action may be a condition"
        ),
    ),
    _fixer(
        name="tree-numbers",
        rules=("GP811",),
        propose=_numbers,
        safe=(
            "writes a number of rounds, successes or failures without spaces, plus sign and "
            "decimal point: the number is the same"
        ),
    ),
    _fixer(
        name="tree-keys",
        rules=("GP820", "GP823"),
        propose=_keys,
        unsafe=(
            "puts braces around the key of an output, or around the only text that equals the key "
            "that is read, and corrects a key to the only similar one: a text may be meant, or a "
            "key that the program sets"
        ),
    ),
    _fixer(
        name="main-tree",
        rules=("GP802",),
        propose=_main_tree,
        reveals=_SHOWN,
        safe=(
            "names the only tree that no other tree uses if the file names none, and corrects the "
            "case of the name: the check examined that tree, too"
        ),
        unsafe=(
            "takes the only tree with a similar name, or the only one that no other tree uses: "
            "another one may be meant"
        ),
    ),
    _fixer(
        name="tree-format",
        rules=("GP808",),
        propose=_tree_format,
        safe=(
            "writes `4.0` as `4`, and adds the version if the file has a node or an attribute that "
            "only one version has"
        ),
        unsafe="adds version 4 if the file gives no indication: it may be for version 3",
    ),
    _fixer(
        name="tree-root",
        rules=("GP101", "GP815"),
        propose=_tree_root,
        safe="puts `<root>` around trees that have none: nothing else can enclose them",
    ),
    _fixer(
        name="several-children",
        rules=("GP805",),
        propose=_several_children,
        reveals=_SHOWN,
        unsafe=(
            "puts the children of a tree or a decorator, which may have only one, into a Sequence: "
            "a Fallback may be meant"
        ),
    ),
    _fixer(
        name="extracted-trees",
        rules=("GP115",),
        propose=_taken_out,
        first=True,
        safe=(
            "removes the text around the trees in a model's answer, with `--from-response`: it is "
            "no part of the trees"
        ),
    ),
)
