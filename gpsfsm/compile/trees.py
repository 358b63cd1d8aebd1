"""Behaviour trees → plan: every use of a node becomes an element of its own.

SubTrees are put in where they are used, Retry and Repeat are written out. What the automaton
cannot express is reported, and then there is no plan: nothing is left out.

BehaviorTree.CPP ticks the children of a Parallel one after the other. Children that end in their
first tick can end the Parallel before the others have been started; an automaton starts them all.
A reactive control is an ordinary one only if what stands before its last child never changes. So
units that end at the instant at which they begin make some controls inexpressible.

``<Parallel success_count="1"><AlwaysSuccess/><Go/></Parallel>`` succeeds in its first tick, and Go
    never starts; the automaton would start it. ``first_inexpressible`` reports the Parallel.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.compile.tree_scripts import Scripts
from gpsfsm.compile.units import TreePlan, UnitKind, Units
from gpsfsm.model.finding import Problem
from gpsfsm.model.plan import (
    NOT_PARAMETERS,
    Attribute,
    ControlType,
    Element,
    Kind,
    sharing_lines,
)
from gpsfsm.model.tree import BUILTINS, Builtin, Meaning, is_reference
from gpsfsm.syntax.tree_nodes import nearest

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.model.tree import Forest, TreeNode

MAX_NODES = 100_000
"""Nodes after unfolding: Retry and Repeat inside each other multiply."""

MAX_DEPTH = 1_000
_CONDITIONS = ("_skipIf", "_failureIf", "_successIf", "_while")
_LOST = "GP813"
_ONLY_MACHINES = frozenset(
    {
        Meaning.WHILE,
        Meaning.FALLBACK_MEMORY,
        Meaning.KEEP_RUNNING,
        Meaning.TIMEOUT,
        Meaning.RUN_ONCE,
        Meaning.SWITCH,
        Meaning.PRECONDITION,
        Meaning.CHECK,
        Meaning.ENTRY,
        Meaning.LOOP,
        Meaning.MANUAL,
        Meaning.TRY_CATCH,
    }
)
_PARALLEL = (UnitKind.ALL, UnitKind.ANY, UnitKind.COUNT)
_TYPES = {
    UnitKind.ALL: ControlType.PARALLEL_ALL,
    UnitKind.ANY: ControlType.PARALLEL_ANY,
    UnitKind.COUNT: ControlType.PARALLEL_ANY,
    UnitKind.WAIT: ControlType.PARALLEL_ALL,
}


@dataclass(frozen=True, slots=True)
class Unfolded:
    """The plan of a forest; None where ``problems`` (or those of the front end) say why not.

    ``over``: a limit was hit.
    """

    plan: TreePlan | None
    problems: tuple[Problem, ...] = ()
    over: bool = False


def unfold(forest: Forest) -> Unfolded:
    """The plan that the main tree of a forest stands for; linear in the size of the result."""
    if forest.main < 0:
        return Unfolded(None)
    return _Unfolder(forest).unfold()


@dataclass(frozen=True, slots=True)
class _Use:
    """A node that is to be unfolded, and where.

    ``retried``: whether a Retry around it may run the same node again after a failure.
    """

    node: int
    parent: int
    unit: int
    scope: Scope
    depth: int
    retried: bool = False


@dataclass(slots=True)
class Growth:
    """Parents come before their children; ``nodes`` tells the node of each element."""

    elements: list[Element] = field(default_factory=list)
    nodes: list[TreeNode] = field(default_factory=list)
    needs: dict[int, int] = field(default_factory=dict)
    _paths: list[str] = field(default_factory=list)
    _inside: list[list[int]] = field(default_factory=list)
    _uses: dict[int, int] = field(default_factory=dict)
    _kinds: list[UnitKind] = field(default_factory=list)
    _origins: list[int] = field(default_factory=list)
    _children: list[list[int]] = field(default_factory=list)
    _parents: list[int] = field(default_factory=list)

    def element(
        self,
        node: TreeNode,
        parent: int,
        kind: Kind,
        *,
        attributes: tuple[Attribute, ...] | None = None,
        unit: UnitKind = UnitKind.SEQUENCE,
    ) -> int:
        """A new element for a use of a node; its index."""
        index = len(self.elements)
        copy = self._uses[node.index] = self._uses.get(node.index, 0) + 1
        self._paths.append(node.path if copy == 1 else f"{node.path}@{copy}")
        self._inside.append([])
        if parent >= 0:
            self._inside[parent].append(index)
        self.nodes.append(node)
        control_type = _TYPES.get(unit, ControlType.SEQUENTIAL)
        self.elements.append(
            Element(
                index,
                kind,
                parent,
                copy,
                (),
                node.attributes if attributes is None else attributes,
                node.line,
                node.column,
                node.start,
                node.end,
                None if kind is Kind.RUNNER else control_type,
                "" if kind is Kind.RUNNER else node.identity,
                file=node.file,
            )
        )
        return index

    def unit(self, kind: UnitKind, element: int, parent: int) -> int:
        """A new unit for an element, the last child of its parent; its index."""
        unit = len(self._kinds)
        self._kinds.append(kind)
        self._origins.append(element)
        self._children.append([])
        self._parents.append(parent)
        if parent >= 0:
            self._children[parent].append(unit)
        return unit

    def units(self) -> Units:
        """All units so far."""
        assert all(parent < unit for unit, parent in enumerate(self._parents))
        positions = [0] * len(self._kinds)
        for children in self._children:
            for position, child in enumerate(children):
                positions[child] = position
        return Units(
            tuple(self._kinds),
            tuple(self._origins),
            tuple(map(tuple, self._children)),
            tuple(self._parents),
            tuple(positions),
            self.needs,
        )

    def plan(self, file: str) -> TreePlan:
        """The plan of all elements."""
        elements = sharing_lines(
            [
                replace(each, children=tuple(inside))
                for each, inside in zip(self.elements, self._inside, strict=True)
            ]
        )
        return TreePlan(file, elements, None, tuple(self._paths), self.units())


@dataclass(slots=True)
class _Unfolder:
    forest: Forest
    problems: dict[tuple[int, str], Problem] = field(default_factory=dict)
    over: bool = False
    blocked: bool = False  # by what the front end has reported
    grown: Growth = field(default_factory=Growth)
    reactive: dict[int, bool] = field(default_factory=dict)
    pending: list[_Use] = field(default_factory=list)
    uses: dict[int, int] = field(default_factory=dict)
    scripts: Scripts = field(init=False)

    def unfold(self) -> Unfolded:
        self.scripts = Scripts.of(self.forest)
        top = self.forest.nodes[self.forest.main]
        self.grown.element(top, -1, Kind.PLAN)
        self._unit(UnitKind.SEQUENCE, 0, -1)
        self._later(top, _Use(top.index, 0, 0, EMPTY_SCOPE, 0))
        while self.pending and not self.over:
            use = self.pending.pop()
            if len(self.grown.elements) >= MAX_NODES:
                self._too_much(use, f"more than {MAX_NODES:,} nodes")
            elif use.depth > MAX_DEPTH:
                self._too_much(use, f"nodes that are nested more than {MAX_DEPTH:,} deep")
            else:
                self._use(self.forest.nodes[use.node], use)
        if not (self.over or self.problems or self.blocked):
            self._instants()
        problems = tuple(self.problems.values())
        plan = None if self.over or self.blocked or problems else self.grown.plan(self.forest.file)
        return Unfolded(plan, problems, self.over)

    # -- nodes -------------------------------------------------------------------------------

    def _use(self, node: TreeNode, use: _Use) -> None:
        name = node.identity
        condition = next((each for each in _CONDITIONS if node.attribute(each)), "")
        if condition:
            what = f"the condition {condition} of this {name} depends on the blackboard"
            self._lose(node, what, "put a condition node before it instead")
        elif self.scripts.node_may_throw(node):
            self._lose(node, f"a script of this {name or node.tag} may throw an exception")
        elif not name:
            self.blocked = True  # an ID is missing, which the front end has reported
        elif name in BUILTINS:
            self._builtin(node, BUILTINS[name], use)
        elif not node.explicit and name in self.forest.trees and not self._described(name):
            self._subtree(node, self.forest.trees[name], use)
        elif node.children:
            what = f"it is unknown what the node {name} does with its children"
            hint = (
                "write it with nodes of BehaviorTree.CPP, or treat it as one action: remove "
                f'its children and declare <Action ID="{name}"/> in <TreeNodesModel>'
            )
            if alike := nearest(name, BUILTINS):
                hint = f"write {alike} if that is what you mean"
            self._lose(node, what, hint)
        else:
            self._leaf(node, use)

    def _described(self, name: str) -> bool:
        return name in (self.forest.models or ())

    def _builtin(self, node: TreeNode, builtin: Builtin, use: _Use) -> None:
        meaning, count = builtin.meaning, len(node.children)
        if count < builtin.least and count == 0 and builtin.most < 0:
            self.blocked = True
        elif builtin.most >= 0 and not builtin.least <= count <= builtin.most:
            self.blocked = True  # a wrong number of children, which has been reported
        elif meaning in _ONLY_MACHINES:
            self._lose(node, f"{node.identity} cannot be expressed as a plan")
        elif meaning is Meaning.LEAF:
            self._leaf(node, use)
        elif meaning is Meaning.SUBTREE:
            tree = self.forest.trees.get(node.text("ID"), -1)
            if tree < 0:
                self.blocked = True
            else:
                self._subtree(node, tree, use)
        elif meaning in (Meaning.SUCCEED, Meaning.FAIL):
            self._constant(node, use, succeeds=meaning is Meaning.SUCCEED)
        elif meaning in (Meaning.RETRY, Meaning.REPEAT):
            self._rounds(node, use, retries=meaning is Meaning.RETRY)
        elif meaning is Meaning.PARALLEL:
            self._parallel(node, use)
        elif meaning is Meaning.PARALLEL_ALL:
            self._parallel_all(node, use)
        else:
            self._plain(node, meaning, use)

    def _plain(self, node: TreeNode, meaning: Meaning, use: _Use) -> None:
        """A node without numbers: how its units are built tells what it does."""
        if meaning is Meaning.MEMORY and use.retried:
            what = f"{node.identity} resumes where it failed when the Retry around it tries again"
            self._lose(node, what, "use Sequence, or put the Retry around the child that fails")
            return
        element = self._control(node, use)
        forced = meaning in (Meaning.FORCE_SUCCESS, Meaning.FORCE_FAILURE)
        kind = UnitKind.SEQUENCE
        if meaning in (Meaning.FALLBACK, Meaning.REACTIVE_FALLBACK) or forced:
            kind = UnitKind.GUARD
        elif meaning is Meaning.BRANCH:
            kind = UnitKind.BRANCH
        unit = use.unit
        if meaning in (Meaning.INVERT, Meaning.FORCE_FAILURE):
            unit = self._unit(UnitKind.NOT, element, unit)
        if meaning is not Meaning.INVERT:
            unit = self._unit(kind, element, unit)
        if forced:
            self._forced(node, element, unit, use)
            return
        if meaning in (Meaning.REACTIVE_SEQUENCE, Meaning.REACTIVE_FALLBACK):
            self.reactive[unit] = meaning is Meaning.REACTIVE_SEQUENCE
        if meaning is Meaning.DELAY:
            self._unit(UnitKind.EMPTY, element, unit)  # it takes time, and cannot go wrong
        self._later(node, _Use(0, element, unit, use.scope, use.depth, use.retried))

    def _forced(self, node: TreeNode, element: int, unit: int, use: _Use) -> None:
        """The child, and an empty unit that takes over where it fails."""
        slot = self._unit(UnitKind.SEQUENCE, element, unit)
        self._unit(UnitKind.EMPTY, element, unit)
        self._later(node, _Use(0, element, slot, use.scope, use.depth, use.retried))

    def _rounds(self, node: TreeNode, use: _Use, *, retries: bool) -> None:
        port = "num_attempts" if retries else "num_cycles"
        rounds = number(node, port, use.scope)
        if rounds is None:
            self._unknown(node, port)
            return
        if rounds < 1:
            why = "has no end in the automaton" if rounds == -1 else "never runs its child"
            bound = "without a limit" if rounds == -1 else "with no round"
            what = f"a {node.identity} {bound} ({port}={rounds}) {why}"
            self._lose(node, what, f'write a limit, such as {port}="3"')
            return
        element = self._control(node, use)
        kind = UnitKind.GUARD if retries else UnitKind.SEQUENCE
        unit = self._unit(kind, element, use.unit)
        again = use.retried or (retries and rounds > 1)
        if rounds + len(self.pending) + len(self.grown.elements) > MAX_NODES:
            self._too_much(use, f"more than {MAX_NODES:,} nodes")
            return
        for _ in range(rounds):
            self._later(node, _Use(0, element, unit, use.scope, use.depth, again))

    def _parallel(self, node: TreeNode, use: _Use) -> None:
        size = len(node.children)
        counts: list[int] = []
        for ports, default in (
            (("success_count", "success_threshold", "threshold"), -1),
            (("failure_count", "failure_threshold"), 1),
        ):
            port = next((each for each in ports if node.attribute(each)), "")
            count = number(node, port, use.scope) if port else default
            if count is None:
                self._unknown(node, port)
                return
            counts.append(size + count + 1 if count < 0 else count)
        need, fails = counts
        if not (1 <= need <= size and 1 <= fails <= size):
            what = (
                f"a Parallel of {size} children cannot wait for {need} success{'es' * (need != 1)} "
                f"or {fails} failure{'s' * (fails != 1)}"
            )
            self._report("GP811", node, what, f"write numbers from 1 to {size}, or -1 for all")
            return
        if min(fails, size - need + 1) + need <= size:
            what = (
                f"{need} of {size} successes end this Parallel, and so do {fails} of {size} "
                "failures: its result depends on which come first"
            )
            hint = (
                f'write failure_count="{size - need + 1}", so that only one of the two can happen'
            )
            self._lose(node, what, hint)
            return
        kind = UnitKind.ALL if need == size else UnitKind.ANY if need == 1 else UnitKind.COUNT
        self._side_by_side(node, use, kind, need)

    def _parallel_all(self, node: TreeNode, use: _Use) -> None:
        """It fails with so many failures, once all its children have ended."""
        size = len(node.children)
        port = "max_failures"
        count = number(node, port, use.scope) if node.attribute(port) else 1
        if count is None:
            self._unknown(node, port)
            return
        fails = size + count + 1 if count < 0 else count
        if not 1 <= fails <= size:
            failures = f"{fails} failure{'s' * (fails != 1)}"
            what = f"a ParallelAll of {size} children cannot fail with {failures}"
            self._report("GP811", node, what, f"write a number from 1 to {size}, or -1 for all")
            return
        self._side_by_side(node, use, UnitKind.WAIT, size - fails + 1)

    def _side_by_side(self, node: TreeNode, use: _Use, kind: UnitKind, need: int) -> None:
        element = self._control(node, use, kind)
        unit = self._unit(kind, element, use.unit)
        self.grown.needs[unit] = need
        self._later(node, _Use(0, element, unit, use.scope, use.depth, use.retried))

    def _subtree(self, node: TreeNode, tree: int, use: _Use) -> None:
        element = self._control(node, use)
        unit = self._unit(UnitKind.SEQUENCE, element, use.unit)
        top = self.forest.nodes[tree]
        if len(top.children) != 1:
            self.blocked = True
            return
        scope = scope_of(node, use.scope, self.forest.version)
        self._later(top, _Use(0, element, unit, scope, use.depth, use.retried))

    def _constant(self, node: TreeNode, use: _Use, *, succeeds: bool) -> None:
        element = self._control(node, use)
        unit = use.unit if succeeds else self._unit(UnitKind.NOT, element, use.unit)
        self._unit(UnitKind.EMPTY, element, unit)

    def _leaf(self, node: TreeNode, use: _Use) -> None:
        self.uses[node.index] = self.uses.get(node.index, 0) + 1
        attributes = leaf_attributes(node, use.scope, self.uses[node.index])
        element = self.grown.element(node, use.parent, Kind.RUNNER, attributes=attributes)
        self._unit(UnitKind.RUNNER, element, use.unit)

    # -- elements, units, problems -----------------------------------------------------------

    def _later(self, node: TreeNode, use: _Use) -> None:
        """The children of a node come next, in document order."""
        if len(node.children) == 0 or (use.depth == 0 and len(node.children) != 1):
            self.blocked = True
        uses = [
            _Use(child, use.parent, use.unit, use.scope, use.depth + 1, use.retried)
            for child in reversed(node.children)
        ]
        self.pending.extend(uses)

    def _control(self, node: TreeNode, use: _Use, kind: UnitKind = UnitKind.SEQUENCE) -> int:
        return self.grown.element(node, use.parent, Kind.CONTROL, unit=kind)

    def _unit(self, kind: UnitKind, element: int, parent: int) -> int:
        return self.grown.unit(kind, element, parent)

    def _report(self, rule: str, node: TreeNode, message: str, hint: str) -> None:
        problem = Problem(rule, message, node.location, hint, 1 + len(node.tag))
        self.problems.setdefault((node.index, rule), problem)

    def _lose(self, node: TreeNode, message: str, hint: str = "") -> None:
        hint = hint or "use nodes whose results alone determine what runs next"
        self._report(_LOST, node, message, hint)

    def _unknown(self, node: TreeNode, port: str) -> None:
        """A number that is not there, or is none, is reported; one from the blackboard is lost."""
        if not is_reference(node.text(port)):
            self.blocked = True
            return
        what = f"{port} of this {node.identity} comes from the blackboard, so it is unknown"
        self._lose(node, what, "write the number here")

    def _too_much(self, use: _Use, what: str) -> None:
        self.over = True
        message = f"with its SubTrees, Retry and Repeat written out, this tree has {what}"
        hint = "lower num_attempts or num_cycles"
        self._report("GP103", self.forest.nodes[use.node], message, hint)

    def _instants(self) -> None:
        """Report what cannot be expressed because nodes end at the instant at which they begin."""
        units = self.grown.units()
        for unit, what in first_inexpressible(units, self.reactive):
            self._lose(self.grown.nodes[units.elements[unit]], what)


def first_inexpressible(units: Units, reactive: Mapping[int, bool]) -> Iterator[tuple[int, str]]:
    """The units that cannot be expressed, with the reason.

    ``reactive`` are the units of reactive controls; True for a ReactiveSequence.
    """
    instant = _instants(units)
    for unit, kind in enumerate(units.kinds):
        ends = [instant[child] for child in units.children[unit]]
        if kind in _PARALLEL and len(ends) > 1 and _parallel(units, unit, ends) is not None:
            yield (
                unit,
                "children that end at once end this Parallel before it has started all of them",
            )
    for unit, sequence in reactive.items():
        ends = [instant[child] for child in units.children[unit][:-1]]
        if any(end is not sequence for end in ends):
            what = "ReactiveSequence" if sequence else "ReactiveFallback"
            yield (
                unit,
                f"this {what} ticks its first children again while the last one runs, so that "
                "their results may change; the automaton asks them once",
            )


def _instants(units: Units) -> list[bool | None]:
    """Per unit: it succeeds at once, it fails at once (False), or neither (None)."""
    instants: list[bool | None] = [None] * len(units)
    for unit in reversed(range(len(units))):
        kind = units.kinds[unit]
        ends = [instants[child] for child in units.children[unit]]
        if kind is UnitKind.EMPTY:
            instants[unit] = True
        elif kind is UnitKind.SEQUENCE:
            instants[unit] = next((end for end in ends if end is not True), True)
        elif kind is UnitKind.GUARD:
            instants[unit] = next((end for end in ends if end is not False), False)
        elif kind is UnitKind.NOT and ends[0] is not None:
            instants[unit] = not ends[0]
        elif kind is UnitKind.BRANCH and ends[0] is not None:
            instants[unit] = ends[1] if ends[0] else (ends[2] if len(ends) > 2 else False)
        elif kind in _PARALLEL:
            instants[unit] = _parallel(units, unit, ends)
        elif kind is UnitKind.WAIT and None not in ends:
            instants[unit] = sum(end is True for end in ends) >= units.needs[unit]
    return instants


def _parallel(units: Units, unit: int, ends: Sequence[bool | None]) -> bool | None:
    need = units.needs.get(unit, 1 if units.kinds[unit] is UnitKind.ANY else len(ends))
    if sum(end is True for end in ends) >= need:
        return True
    return False if sum(end is False for end in ends) > len(ends) - need else None


_NUMBER = re.compile(r"[ \t]*+[+-]?+[0-9]{1,9}[ \t]*+")
_SHARED = ("__shared_blackboard", "__autoremap", "_autoremap")


@dataclass(frozen=True, slots=True)
class Scope:
    """The texts that the blackboard of a SubTree takes from outside, by key.

    ``outer`` is the scope outside where all other keys are shared with it, else None.
    """

    texts: Mapping[str, str] = field(default_factory=dict)
    outer: Scope | None = None

    def text(self, text: str) -> str:
        """A value as it is written in the main tree; a reference that nothing fills stays."""
        scope: Scope | None = self
        if not is_reference(text):
            return text
        key = text.strip()[1:-1].strip()
        while scope is not None:
            if key in scope.texts:
                return scope.texts[key]
            scope = scope.outer
        return text


EMPTY_SCOPE = Scope()


def scope_of(node: TreeNode, outer: Scope, version: int) -> Scope:
    """The scope inside a SubTree, from what its node hands over.

    In version 3 a SubTree names the key outside without braces; SubTreePlus, and version 4, write
    a key in braces and anything else as a text. ``{=}`` is the key of the same name.
    """
    texts: dict[str, str] = {}
    shared = any(node.text(name).strip().lower() in ("true", "1") for name in _SHARED)
    for attribute in node.attributes:
        name, text = attribute.name, attribute.text
        if name in ("ID", "name") or name.startswith("_"):
            continue
        if text.strip() == "{=}":
            text = f"{{{name}}}"
        elif version == 3 and node.tag == "SubTree":
            text = f"{{{text.strip()}}}"  # of {goal}: a key with braces in its name
        texts[name] = outer.text(text)
    return Scope(texts, outer if shared else None)


def leaf_attributes(node: TreeNode, scope: Scope, use: int) -> tuple[Attribute, ...]:
    """The attributes of the runner that a leaf is: its ID as interface and provider, its ports.

    A value from the blackboard that the file does not give is like no other value, so that two
    uses are never taken for the same action. Ports that are called like what is no parameter of a
    runner keep their place under another name.
    """
    identity = node.identity
    result = [
        Attribute(name, identity, identity, node.line, node.column)
        for name in ("interface", "provider")
    ]
    for each in node.attributes:
        if each.name == "name":
            result.append(each)
        elif not (each.name == "ID" or each.name.startswith("_")):
            name = f"port.{each.name}" if each.name in NOT_PARAMETERS else each.name
            text = scope.text(each.text)
            value = each.value if text == each.text else text
            if is_reference(text):
                value = f"{text} of {node.path}, use {use}"
            result.append(replace(each, name=name, text=text, value=value))
    return tuple(result)


def number(node: TreeNode, port: str, scope: Scope) -> int | None:
    """The whole number that a port holds; None if there is none that the file tells."""
    text = scope.text(node.text(port))
    return int(text) if _NUMBER.fullmatch(text) else None
