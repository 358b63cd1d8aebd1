"""The tree of a run as Groot2 draws it, and the status of each node while the run goes on.

A node is there once for each use: a SubTree that is used twice occurs twice, but a round of a
loop is no use. Uses are numbered as BehaviorTree.CPP numbers them (uids), and written as it does:

    <BehaviorTree ID="A"> <Sequence> <SubTree ID="B"/> <Dock/>      uids 1, 2, 4
    <BehaviorTree ID="B"> <Go/>                                     uid 3

The compilers say by which signals of the automaton each node is entered, and by which it ends. So
every signal of a run means a row of steps, in the order in which the tree takes them:

    Go SUCCEEDED      3 SUCCESS   2 SUCCESS   4 RUNNING
    Dock FAILED       4 FAILURE   1 FAILURE, and what is in it is IDLE again

As in BehaviorTree.CPP, a node that is IDLE again remembers what it was, and nothing is SKIPPED: a
node that is skipped is IDLE.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.tree_machine import WRITTEN_OUT, Compiler
from gpsfsm.compile.tree_parts import Ends, Signals, Steps, TooLargeError
from gpsfsm.compile.units import TreeMachine
from gpsfsm.errors import UsageError
from gpsfsm.execution.records import Kind
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import Event
from gpsfsm.model.tree import BUILTINS, NAV2, NAV2_CONDITIONS, Meaning, builtin_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.compile.tree_parts import Visit
    from gpsfsm.execution.records import Record
    from gpsfsm.model.tree import Forest, NodeModel, TreeNode

IDLE, RUNNING, SUCCESS, FAILURE, SKIPPED = range(5)
WAS = 10
"""A node that is IDLE again has the number of what it was, and ten."""

MOST_USES = 65_535
"""A uid has two bytes."""

_REACTIVE = (Meaning.REACTIVE_SEQUENCE, Meaning.REACTIVE_FALLBACK)
_WATCHED = (*_REACTIVE, Meaning.WHILE)

_EVENTS = {
    Kind.BEGIN: Event.SUCCEEDED,
    Kind.SUCCEEDED: Event.SUCCEEDED,
    Kind.JOINED: Event.SUCCEEDED,
    Kind.FAILED: Event.FAILED,
}
_NAME = re.compile(r"[A-Za-z_][\w.-]*")
_OWN = ("ID", "name", "_uid", "_fullpath")


# --- the uses of nodes ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Use:
    """A use of a node; its uid is one more than its index.

    ``block`` is the tree that it stands in, ``tree`` the one that a SubTree stands for, else -1.
    """

    node: TreeNode
    meaning: Meaning
    parent: int
    block: int
    tree: int


class Block(NamedTuple):
    """One tree of the text: the main one, whose path is "", or that of a SubTree."""

    tree: str
    path: str


class Step(NamedTuple):
    """A use is entered (RUNNING), has ended, or is halted (IDLE).

    ``watches``: it is ticked again, beside a later child, and is not shown as RUNNING.
    """

    use: int
    status: int
    watches: bool = False


@dataclass(frozen=True, slots=False)
class GrootTree:
    """All uses in the order of the nodes, the trees that they stand in, and their steps."""

    uses: Sequence[Use]
    blocks: Sequence[Block]
    models: Mapping[str, NodeModel]
    steps: Mapping[Signal, Sequence[Step]]

    @cached_property
    def ends(self) -> list[int]:
        """For each use the index behind all that is in it."""
        ends = [use + 1 for use in range(len(self.uses))]
        for use in reversed(range(1, len(ends))):
            parent = self.uses[use].parent
            ends[parent] = max(ends[parent], ends[use])
        return ends


def groot_tree(forest: Forest, compiled: Compiled) -> GrootTree:
    """The tree of a run. Raises UsageError if it has too many nodes for the protocol."""
    plan = compiled.automaton.plan
    tracer = _Tracer(forest, WRITTEN_OUT)
    uses, blocks, places = _uses(tracer)
    if not isinstance(plan, TreeMachine):
        return GrootTree(uses, blocks, forest.models or {}, _of_units(compiled, uses, places))
    tracer.places = places
    try:
        tracer.machine()
    except TooLargeError:  # as in machine_of_tree
        tracer = _Tracer(forest, 0, places=places)
        tracer.machine()
    return GrootTree(uses, blocks, forest.models or {}, tracer.steps())


def _uses(c: Compiler) -> tuple[list[Use], list[Block], dict[tuple[int, ...], int]]:
    """All uses and trees, and the use at each place: the starts of its SubTrees and its own."""
    nodes = c.forest.nodes
    main = nodes[c.forest.main]
    uses: list[Use] = []
    blocks = [Block(main.text("ID"), "")]
    places: dict[tuple[int, ...], int] = {}
    pending: list[tuple[int, int, int, tuple[int, ...]]] = [(main.children[0], -1, 0, ())]
    while pending:
        index, parent, block, around = pending.pop()
        use, node = len(uses), nodes[index]
        if use >= MOST_USES:
            raise UsageError(f"--groot shows at most {MOST_USES:,} nodes of a tree; leave it out")
        places[(*around, node.start)] = use
        meaning, tree = _meaning(c, node)
        uses.append(Use(node, meaning, parent, block, len(blocks) if tree >= 0 else -1))
        children = node.children
        if tree >= 0:
            name, path = nodes[tree].text("ID"), blocks[block].path
            own = node.text("name") or f"{name}::{use + 1}"
            block, around = len(blocks), (*around, node.start)
            blocks.append(Block(name, f"{path}/{own}" if path else own))
            children = nodes[tree].children
        pending += [(child, use, block, around) for child in reversed(children)]
    return uses, blocks, places


def _meaning(c: Compiler, node: TreeNode) -> tuple[Meaning, int]:
    """The meaning of a node, and the tree that it stands for: -1 if it stands for none."""
    builtin = builtin_of(node.identity, len(node.children))
    if builtin is not None:
        is_subtree = builtin.meaning is Meaning.SUBTREE
        return builtin.meaning, c.forest.trees.get(node.text("ID"), -1) if is_subtree else -1
    return Meaning.OTHER if node.children else Meaning.LEAF, c.tree_of(node, node.identity)


# --- the steps that signals mean -----------------------------------------------------------------


def _of_units(
    compiled: Compiled, uses: Sequence[Use], places: Mapping[tuple[int, ...], int]
) -> dict[Signal, list[Step]]:
    """The steps of a tree that is a plan, whose units come in the order of the nodes."""
    units, elements = compiled.units, compiled.automaton.plan.elements
    around: list[tuple[int, ...]] = [()]
    shown = [-1]
    for element in elements[1:]:  # parents come before their children
        parent = element.parent
        inside = parent > 0 and uses[shown[parent]].tree >= 0
        around.append((*around[parent], elements[parent].start) if inside else around[parent])
        shown.append(places[(*around[-1], element.start)])
    last = list(range(len(units)))
    for unit in reversed(range(1, len(units))):
        last[units.parents[unit]] = max(last[units.parents[unit]], last[unit])
    rows: dict[Signal, list[tuple[tuple[int, ...], Step]]] = {}
    outermost = {index: unit for unit, index in reversed([*enumerate(units.elements)])}
    for index, unit in outermost.items():
        if index == 0:
            continue
        ahead, behind = (unit,), (last[unit], 1, -unit)
        ends = zip((SUCCESS, FAILURE), compiled.outlets[unit], (behind, behind), strict=True)
        for status, signal, at in ((RUNNING, compiled.triggers[unit], ahead), *ends):
            if signal is not None:
                rows.setdefault(signal, []).append((at, Step(shown[index], status)))
    return {signal: [step for _, step in sorted(row)] for signal, row in rows.items()}


@dataclass(slots=True)
class _Span:
    """One compilation of a use, from the part ``first`` to ``last``; ``below`` are those in it.

    ``watched``: a node that is compiled below it once more is ticked again beside a later child.
    ``again``: the signals that enter it once more, after what they end.
    """

    use: int
    outer: _Span | None = None
    watches: bool = False
    watched: bool = False
    begin: int = 0
    enter: Signals = ()
    end: int = 0
    ends: Ends = field(default_factory=Ends)
    first: int = 0
    last: int = 0
    below: dict[int, list[_Span]] = field(default_factory=dict)
    again: set[int] = field(default_factory=set)


@dataclass(slots=True)
class _Tracer(Compiler):
    """A compiler that remembers what enters each node, what ends it, and in which order.

    ``made`` says for each part when it was made: what its signals lead to comes after that, or, in
    a loop, before it.
    """

    places: Mapping[tuple[int, ...], int] = field(default_factory=dict)
    around: tuple[int, ...] = ()
    open: list[_Span] = field(default_factory=list)
    spans: list[_Span] = field(default_factory=list)
    halted: list[tuple[int, Signals, _Span]] = field(default_factory=list)
    made: list[int] = field(default_factory=list)
    now: int = 0

    def _moment(self) -> int:
        while len(self.made) < len(self.parts):
            self.made.append(self.now)
        self.now += 1
        return self.now

    def visit(self, visit: Visit) -> Steps:
        """The compilation of one use of a node."""
        self._moment()
        place = (*self.around, self.forest.nodes[visit.node].start)
        outer = self.open[-1] if self.open else None
        span = _Span(self.places[place], outer, first=len(self.parts))
        if outer is not None:
            earlier = outer.below.setdefault(visit.node, [])
            span.watches = outer.watches or (outer.watched and bool(earlier))
            earlier.append(span)
        self.spans.append(span)
        self.open.append(span)
        span.ends = yield from Compiler.visit(self, visit)
        self.open.pop()
        span.end, span.last = self._moment(), len(self.parts)
        return span.ends

    def stop(self, signals: Signals, begin: int, end: int) -> None:
        """These events halt all that was compiled from one part to another."""
        Compiler.stop(self, signals, begin, end)
        now = self._moment()
        for spans in self.open[-1].below.values():
            inside = (each for each in spans if begin <= each.first < each.last <= end)
            self.halted += ((now, signals, each) for each in inside)

    def node(self, node: TreeNode, visit: Visit) -> Steps:
        """A node without its conditions: it is RUNNING once these have let it."""
        span = self.open[-1]
        span.begin, span.enter = self._moment(), visit.enter
        span.watched = _meaning(self, node)[0] in _WATCHED
        return Compiler.node(self, node, visit)

    def subtree(self, node: TreeNode, tree: int, visit: Visit) -> Steps:
        """The tree of a SubTree in its place."""
        around = self.around
        self.around = (*around, node.start)
        ends = yield from Compiler.subtree(self, node, tree, visit)
        self.around = around
        return ends

    def steps(self) -> dict[Signal, list[Step]]:
        """The steps of each signal, once all is compiled."""
        self._moment()
        place = {part: number for number, part in enumerate(self.order())}
        rows: dict[Signal, list[tuple[bool, int, Step]]] = {}
        changes = [(at, IDLE, signals, span) for at, signals, span in self.halted]
        for span in self.spans:
            changes.append((span.begin, RUNNING, span.enter, span))
            ends = zip((SUCCESS, FAILURE, SKIPPED), span.ends, strict=True)
            changes += ((span.end, status, signals, span) for status, signals in ends)
        for at, status, signals, span in changes:
            for each in self.meant(signals):
                part, event = each // 4, Event.FAILED if each % 4 else Event.SUCCEEDED
                later = at <= self.made[part]
                if status == RUNNING:
                    later = later or (span.outer is not None and each in span.outer.again)
                    if later:
                        span.again.add(each)
                elif each in span.again and not span.first <= part < span.last:
                    later = True  # it ends at once
                row = rows.setdefault(Signal(place[part], event), [])
                row.append((later, at, Step(span.use, status, span.watches)))
        return {signal: [step for _, _, step in sorted(row)] for signal, row in rows.items()}


# --- a run ---------------------------------------------------------------------------------------


class Statuses:
    """Follows a run. ``shown`` has the number of the status of each use."""

    def __init__(self, tree: GrootTree) -> None:
        self.tree, self._ends = tree, tree.ends
        self.shown = [IDLE] * len(tree.uses)
        self._order = sorted(range(len(self.shown)), key=lambda use: tree.uses[use].block)
        self._bytes = bytearray(b"".join(struct.pack("<HB", use + 1, IDLE) for use in self._order))

    def add(self, records: Iterable[Record]) -> None:
        """Take in what has happened."""
        for record in records:
            if record.kind is Kind.ENDED:
                self._rest(0, len(self.shown))
            elif record.kind in _EVENTS:
                signal = Signal(max(record.node, 0), _EVENTS[record.kind])
                for step in self.tree.steps.get(signal, ()):
                    self._take(*step)

    def buffer(self) -> bytes:
        """The statuses as the protocol has them: of each node two bytes, its uid, and one."""
        self._bytes[2::3] = bytes(self.shown[use] for use in self._order)
        return bytes(self._bytes)

    def _take(self, use: int, status: int, watches: bool) -> None:
        each = self.tree.uses[use]
        outer = self.tree.uses[each.parent] if each.parent >= 0 else None
        if watches:
            if status in (SUCCESS, FAILURE):
                kept = outer is not None and outer.meaning is Meaning.WHILE  # others reset it
                self.shown[use] = status if kept else status + WAS
        elif outer is not None and self.shown[each.parent] != RUNNING:
            pass  # it runs on, though BehaviorTree.CPP halts it
        elif status == RUNNING:
            if outer is not None and outer.meaning in _REACTIVE:  # it resets all others
                self._rest(each.parent + 1, self._ends[each.parent])
            self.shown[use] = RUNNING
        elif status in (IDLE, SKIPPED):
            self._rest(use, self._ends[use])
        else:
            self.shown[use] = status
            self._rest(use + 1, self._ends[use])

    def _rest(self, begin: int, end: int) -> None:
        """Uses that are reset."""
        for use in range(begin, end):
            if RUNNING <= self.shown[use] < WAS:
                self.shown[use] += WAS


# --- the text ------------------------------------------------------------------------------------


def text_of(tree: GrootTree) -> str:
    """The text of the trees, each node with its uid, and of the nodes that there are."""
    lines = ['<root BTCPP_format="4">']
    tops = [0, *(use + 1 for use, each in enumerate(tree.uses) if each.tree >= 0)]
    for (name, path), top in zip(tree.blocks, tops, strict=True):
        lines.append(f"  <BehaviorTree ID={quoteattr(name)} _fullpath={quoteattr(path)}>")
        lines += _nested(tree, top)
        lines.append("  </BehaviorTree>")
    return "\n".join((*lines, *_models(tree), "</root>", ""))


def _nested(tree: GrootTree, top: int) -> Iterator[str]:
    """One tree as nested elements; what a SubTree stands for has a text of its own."""
    open_: list[tuple[int, str]] = []
    use, end = top, tree.ends[top]
    while use < end or open_:
        if open_ and use >= open_[-1][0]:
            yield "  " * (len(open_) + 1) + f"</{open_.pop()[1]}>"
            continue
        each = tree.uses[use]
        name, attributes = _tag(tree, use)
        leaf = each.tree >= 0 or tree.ends[use] == use + 1
        yield "  " * (len(open_) + 2) + f"<{name} {attributes}{'/' if leaf else ''}>"
        if not leaf:
            open_.append((tree.ends[use], name))
        use = tree.ends[use] if leaf else use + 1


def _tag(tree: GrootTree, use: int) -> tuple[str, str]:
    """The tag of a use, and its attributes."""
    each = tree.uses[use]
    node = each.node
    if each.tree >= 0:
        block = tree.blocks[each.tree]
        name, own = "SubTree", {"ID": block.tree, "_fullpath": block.path}
    else:
        name, own = node.identity, {"name": node.text("name") or node.identity}
        if not _NAME.fullmatch(name):
            name, own = _kind(tree, each), {"ID": name, **own}
    own["_uid"] = str(use + 1)
    ports = (each for each in node.attributes if _NAME.fullmatch(each.name))
    own |= {each.name: each.text for each in ports if each.name not in _OWN}
    return name, " ".join(f"{key}={quoteattr(text)}" for key, text in own.items())


def _models(tree: GrootTree) -> Iterator[str]:
    """The nodes that are used, by their kinds, with the ports that the file declares."""
    kinds = {each.node.identity: _kind(tree, each) for each in tree.uses if each.tree < 0}
    yield "  <TreeNodesModel>"
    for name, kind in sorted(kinds.items()):
        ports = tree.models[name].ports if name in tree.models else {}
        yield f"    <{kind} ID={quoteattr(name)}{'' if ports else '/'}>"
        for port, direction in ports.items():
            yield f"      <{direction.value} name={quoteattr(port)}/>"
        if ports:
            yield f"    </{kind}>"
    yield "  </TreeNodesModel>"


def _kind(tree: GrootTree, use: Use) -> str:
    """Action, Condition, Decorator or Control."""
    node = use.node
    if node.identity in tree.models:
        return tree.models[node.identity].category
    if node.explicit:
        return node.tag
    builtin = BUILTINS.get(node.identity) or NAV2.get(node.identity)
    if not node.children:
        asks = node.identity == "ScriptCondition" or node.identity in NAV2_CONDITIONS
        return "Condition" if asks else "Action"
    one = len(node.children) == 1 if builtin is None else builtin.most == 1
    return "Decorator" if one else "Control"
