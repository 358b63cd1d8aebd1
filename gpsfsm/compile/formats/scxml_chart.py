"""The states and transitions of an SCXML document: what is wrong with them, which can be taken.

An event enables the first transition in document order that names it, by whole tokens: ``nav``
names ``nav`` and ``nav.failed``, ``*`` names all. So a transition after an unconditional one for
the same events is dead, and so is what waits for events beside an unconditional eventless one.

    <transition event="nav" target="b"/> <transition event="nav.failed" target="c"/>    c is dead
"""

from __future__ import annotations

from bisect import bisect
from functools import cached_property
from itertools import chain, combinations
from typing import TYPE_CHECKING, Final

from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from gpsfsm.compile.formats.elements import Elements
    from gpsfsm.model.tree import TreeNode

STATES: Final = ("state", "parallel", "final")
_REFUSED: Final = {
    "history": "what was active before decides where it goes on",
    "script": "gpsfsm runs no scripts",
    "send": "events that a machine sends are not followed",
    "raise": "events that a machine raises are not followed",
    "invoke": "what is invoked is another machine",
    "if": "gpsfsm runs no scripts",
    "foreach": "gpsfsm runs no scripts",
    "cancel": "events that a machine sends are not followed",
}
_BLOCKS: Final = ("onentry", "onexit", "transition")
_AROUND: Final = {
    "state": ("scxml", "state", "parallel"),
    "parallel": ("scxml", "state", "parallel"),
    "final": ("scxml", "state"),
    "initial": ("state",),
    "transition": ("state", "parallel", "initial"),
    "onentry": STATES,
    "onexit": STATES,
    "datamodel": ("scxml", "state", "parallel"),
    "data": ("datamodel",),
    "donedata": ("final",),
    "log": _BLOCKS,
    "assign": _BLOCKS,
}
"""The elements that are read, and where they may stand."""
_UNREAD: Final = ("data", "donedata", "assign", "log")
"""Elements whose content is not SCXML; of these nothing is read."""
_ATTRIBUTES: Final = {
    "scxml": ("initial", "name", "version", "datamodel", "binding", "exmode", "gpsfsm:form"),
    "state": ("id", "initial", "gpsfsm:interface", "gpsfsm:provider", "gpsfsm:parameters"),
    "parallel": ("id",),
    "final": ("id",),
    "transition": ("event", "cond", "target", "type"),
}
_INTERNAL: Final = (
    ("done", "state"), ("done", "invoke"), ("error", "execution"), ("error", "communication"),
    ("error", "platform"),
)  # fmt: skip
"""The events that only the machine itself raises, by their first tokens."""
_ERROR: Final = ("error", "execution")
_LONGER: Final = "\0"
_MOST_TARGETS: Final = 50
_LONGEST: Final = 200
Tokens = tuple[str, ...]


def tokens(descriptor: str) -> Tokens:
    """The tokens that the name of an event has to begin with.

    >>> tokens("nav.failed.*"), tokens("*")
    (('nav', 'failed'), ())
    """
    if descriptor in ("*", ".*"):
        return ()
    return tuple(descriptor.removesuffix("*").removesuffix(".").split("."))


class Chart:
    """The states and transitions of an SCXML document; what is wrong goes to ``elements``."""

    def __init__(self, elements: Elements) -> None:
        self.elements = elements
        self._fault = elements.fault
        self.root = elements.nodes[0]
        self.states = [each for each in elements.nodes if each.tag in STATES]
        self.ids: dict[str, TreeNode] = {}
        self.approximations = [*elements.skipped]
        self._unread: set[int] = set()
        for node in elements.nodes[1:]:
            self._element(node)
        for node in elements.nodes:
            if node.index not in self._unread:
                self._attributes(node)
        for node in self.states:
            name = node.text("id")
            if name and self.ids.setdefault(name, node) is not node:
                self._fault(node, f"there are two states {name!r}", "rename one of them")
        if not self.inside(self.root):
            self._fault(self.root, "there is no state here", "add one")
        if not elements.problems:  # else there are names that mean nothing
            for node in elements.nodes:
                self._references(node)
        if not elements.problems:
            self._circles()
        for node in self.states:
            live = self.live(node)
            for each in self.transitions(node):
                if each not in live:
                    self._skip("transition", each, Cause.EARLIER)

    # -- what is there ----------------------------------------------------------------------

    def _element(self, node: TreeNode) -> None:
        tag, parent = node.tag, self.parent(node)
        if parent.index in self._unread or (parent.tag in _UNREAD and tag not in _REFUSED):
            self._unread.add(node.index)
        elif tag in _REFUSED:
            self._fault(node, f"<{tag}> is not read: {_REFUSED[tag]}", "leave it out")
        elif tag not in _AROUND:
            message = f"<{clip(tag, _LONGEST)}> is not an SCXML element"
            self._fault(node, message, "remove it")
        elif parent.tag not in _AROUND[tag]:
            if parent.tag not in _REFUSED:
                message = f"a <{clip(parent.tag, _LONGEST)}> cannot contain a <{tag}>"
                self._fault(node, message, "move or remove it")
        elif tag in _UNREAD:
            self._skip(tag, node, Cause.DATA if tag != "log" else Cause.NO_MEANING)

    def _skip(self, construct: str, node: TreeNode, cause: Cause = Cause.NO_MEANING) -> None:
        self.approximations.append(
            Approximation(Reading.SKIPPED, clip(construct, _LONGEST), node.location, cause)
        )

    def _attributes(self, node: TreeNode) -> None:
        for attribute in node.attributes:
            if node.tag not in _UNREAD and attribute.name not in _ATTRIBUTES.get(node.tag, ()):
                self._skip(f"attribute {attribute.name}", node)
        if node.tag == "transition":
            self._transition(node)
        if node.tag == "initial":
            if len(self.elements.children(node)) != 1:
                self._fault(node, "<initial> does not have exactly one transition", "write one")
            if self.parent(node).attribute("initial") is not None:
                self._fault(node, "this state has an initial attribute as well", "remove one")

    def _transition(self, node: TreeNode) -> None:
        first = self.parent(node).tag == "initial"
        for name in ("event", "cond", "target"):
            if node.attribute(name) is not None and not node.text(name).strip():
                self._fault(node, f"the {name} of this transition is empty", "write or remove it")
        if node.text("type") not in ("", "internal", "external"):
            message = f"a transition has no type {clip(node.text('type'), _LONGEST)!r}"
            self._fault(node, message, 'write type="internal" or type="external"')
        if not any(node.text(name) for name in ("event", "cond", "target")):
            message = "this transition has neither event, cond nor target"
            self._fault(node, message, "add one of them: it would be taken without end")
        elif first and (node.text("event") or node.text("cond") or not node.text("target")):
            message = "the transition of <initial> needs a target, and neither event nor cond"
            self._fault(node, message, "write its target alone")

    def _references(self, node: TreeNode) -> None:
        name = "target" if node.tag == "transition" else "initial"
        around = self.root
        if node.tag == "state" or self.parent(node).tag == "initial":
            around = node if node.tag == "state" else self.parent(self.parent(node))
        targets: list[TreeNode] = []
        for each in node.text(name).split() if node.tag in _ATTRIBUTES else ():
            message = ""
            if each not in self.ids:
                message = f"there is no state {clip(each, _LONGEST)!r}"
            elif around is not self.root and not self.contains(around, self.ids[each]):
                message = f"the initial state {clip(each, _LONGEST)!r} is not in this state"
            else:
                targets.append(self.ids[each])
            if message:
                self._fault(node, message, "correct the name, or add the state")
        if len(targets) > _MOST_TARGETS or any(
            not self.is_beside(*pair) for pair in combinations(targets, 2)
        ):
            message = f"the targets {clip(node.text(name), _LONGEST)!r} are never active together"
            self._fault(node, message, "name one state in each region of a <parallel>")

    # -- structure --------------------------------------------------------------------------

    def inside(self, node: TreeNode) -> list[TreeNode]:
        """The states in a state."""
        return [each for each in self.elements.children(node) if each.tag in STATES]

    def transitions(self, node: TreeNode) -> list[TreeNode]:
        """The transitions of a state or of an initial element, in document order."""
        return [each for each in self.elements.children(node) if each.tag == "transition"]

    def parent(self, node: TreeNode) -> TreeNode:
        """The element around an element."""
        return self.elements.nodes[node.parent]

    def name(self, node: TreeNode) -> str:
        """The id of a state, or where it stands."""
        return node.text("id") or f"{node.tag}@{node.line}:{node.column}"

    def outwards(self, node: TreeNode) -> Iterator[TreeNode]:
        """A state and those around it, the root last."""
        while node.index != self.root.index:
            yield node
            node = self.parent(node)
        yield self.root

    @cached_property
    def _last(self) -> list[int]:
        """For each element the last one in it."""
        last = list(range(len(self.elements.nodes)))
        for node in reversed(self.elements.nodes[1:]):
            last[node.parent] = max(last[node.parent], last[node.index])
        return last

    @cached_property
    def _in_regions(self) -> frozenset[int]:
        inside: set[int] = set()
        for node in self.states:
            if self.parent(node).tag == "parallel" or node.parent in inside:
                inside.add(node.index)
        return frozenset(inside)

    def contains(self, outer: TreeNode, inner: TreeNode) -> bool:
        """True for a state in a state."""
        return outer.index < inner.index <= self._last[outer.index]

    def is_beside(self, one: TreeNode, other: TreeNode) -> bool:
        """True for states in different regions of a parallel."""
        if one.index not in self._in_regions or other.index not in self._in_regions:
            return False
        common = next(
            each for each in self.outwards(other) if each is one or self.contains(each, one)
        )
        return common.tag == "parallel" and common not in (one, other)

    def in_parallel(self, node: TreeNode) -> bool:
        """True for what lies in a region."""
        return node.index in self._in_regions

    # -- transitions ------------------------------------------------------------------------

    def live(self, node: TreeNode) -> list[TreeNode]:
        """The transitions of a state that are not dead."""
        rows: list[TreeNode] = []
        taken: set[Tokens] = set()
        for each in self.transitions(node):
            events = self._events(each)
            if events and all(_begins(event, taken) for event in events):
                continue
            rows.append(each)
            if not each.text("cond"):
                if not events:
                    return [row for row in rows if not row.text("event")]
                taken.update(events)
        return rows

    def done(self, node: TreeNode) -> list[TreeNode]:
        """Those that may be taken when the state is done."""
        rows: list[TreeNode] = []
        for each in self.live(node):
            if _begins(self._done_event(node), self._events(each)):
                rows.append(each)
                if not each.text("cond"):
                    break
        return rows

    def is_of_itself(self, node: TreeNode, row: TreeNode) -> bool:
        """True for a transition by the end of its state alone."""
        return set(self._events(row)) == {self._done_event(node)}

    def external(self, row: TreeNode) -> list[Tokens]:
        """The names by which the environment can take a transition."""
        return [each for each in self._events(row) if each[:2] not in _INTERNAL]

    def _events(self, row: TreeNode) -> list[Tokens]:
        return [tokens(text) for text in row.text("event").split()]

    def is_private(self, node: TreeNode, row: TreeNode) -> bool:
        """True if an event takes this transition and no other one that can be active besides."""
        return any(
            not any(
                self._rivals(node, row, each)
                for length in range(len(name) + 1)
                for each in self._near(node, self._by_name.get(name[:length], []))
            )
            for event in self.external(row)
            for name in (event, (*event, _LONGER))
            if name
        )

    def _near(self, node: TreeNode, rows: list[TreeNode]) -> list[TreeNode]:
        """The transitions in a state; if it is in a region, all."""
        if self.in_parallel(node):
            return rows
        ends = (node.index, self._last[node.index])
        first, last = (bisect(rows, end, key=lambda row: row.index) for end in ends)
        return rows[first:last]

    def _rivals(self, node: TreeNode, row: TreeNode, other: TreeNode) -> bool:
        """True if the other transition, which has the same event, could be taken with or before."""
        source = self.parent(other)
        if source is node:
            return other.index < row.index
        if self.contains(source, node):
            return any(
                each.tag == "parallel" and (each is source or self.contains(source, each))
                for each in self.outwards(self.parent(node))
            )
        return self.contains(node, source) or self.is_beside(node, source)

    @cached_property
    def _by_name(self) -> dict[Tokens, list[TreeNode]]:
        rows: dict[Tokens, list[TreeNode]] = {}
        for node in self.states:
            for each in self.transitions(node):
                for event in self._events(each):
                    rows.setdefault(event, []).append(each)
        for named in rows.values():
            named.sort(key=lambda row: row.index)
        return rows

    def is_left_at_once(self, node: TreeNode) -> bool:
        """True if nothing in a state comes before its own eventless transition."""
        return not any(self.contains(node, each) for each in self._eventless)

    def _circles(self) -> None:
        """Refuse transitions without event that lead in a circle beside other regions.

        These would wait for ever, though their own events have come.
        """
        import networkx

        eventless = [each for each in self._eventless if self.in_parallel(each)]
        graph: networkx.DiGraph[int] = networkx.DiGraph()
        for node in (*eventless, *self._with_done):
            for row in self.live(node):
                if row.text("event") and row not in self.done(node):
                    continue
                for target in self.targets(row):
                    graph.add_edges_from(
                        (node.index, each.index)
                        for each in (*eventless, *self._with_done)
                        if self.contains(each, target) or self.contains(target, each)
                        or each is target
                    )  # fmt: skip
        circles = networkx.strongly_connected_components(graph)
        inside = {each for part in circles if len(part) > 1 for each in part}
        for node in eventless:
            if node.index in inside or graph.has_edge(node.index, node.index):
                message = "transitions without event may lead in a circle, beside other regions"
                self._fault(node, message, "let one of them wait for an event")

    @cached_property
    def _eventless(self) -> list[TreeNode]:
        return [
            node for node in self.states if any(not row.text("event") for row in self.live(node))
        ]

    @cached_property
    def _hasty(self) -> list[TreeNode]:
        """The states with transitions that may be taken before one by a ``done.state`` event."""
        errors = any(
            each.tag in _UNREAD or each.attribute("cond") is not None
            for each in self.elements.nodes
        )
        return [*self._eventless, *(self._naming(_ERROR) if errors else ())]

    @cached_property
    def _with_done(self) -> list[TreeNode]:
        return [node for node in self.states if self.in_parallel(node) and self.done(node)]

    def _naming(self, event: Tokens) -> list[TreeNode]:
        """The states with a transition for an event."""
        rows = (self._by_name.get(event[:length], ()) for length in range(len(event) + 1))
        return [self.parent(each) for each in chain.from_iterable(rows)]

    def _is_active(self, node: TreeNode, others: list[TreeNode]) -> bool:
        """True if one of the others may be active when a state is done."""
        indexes = {each.index for each in others}
        around = self.outwards(self.parent(node))
        return any(each.index in indexes for each in around) or self._has_beside(node, others)

    def _has_beside(self, node: TreeNode, others: list[TreeNode]) -> bool:
        return self.in_parallel(node) and any(self.is_beside(each, node) for each in others)

    def is_uncertain(self, node: TreeNode) -> bool:
        """True if the ``done.state`` of a state may come late, or be lost, or come again.

        What is eventless comes before it; of two at one time the first may leave the other's
        state, which may be active again when its turn comes.
        """
        return (
            self._is_rushed(node)
            or self._has_beside(node, self._naming(self._done_event(node)))
            or any(
                self._leaves(each, row, node)
                for each in self._with_done
                if self.is_beside(each, node)
                or (node.tag == "parallel" and self.contains(node, each))
                for row in self.done(each)
            )
        )

    def is_listened_for(self, node: TreeNode) -> bool:
        """True if other states may have transitions for the ``done.state`` of a state."""
        others = [each for each in self._naming(self._done_event(node)) if each is not node]
        return self._is_active(node, others) or (bool(others) and self._is_rushed(node))

    def _is_rushed(self, node: TreeNode) -> bool:
        return any(each is node for each in self._hasty) or self._is_active(node, self._hasty)

    def _done_event(self, node: TreeNode) -> Tokens:
        return ("done", "state", *tokens(self.name(node)))

    def _leaves(self, source: TreeNode, row: TreeNode, other: TreeNode) -> bool:
        """True if a transition leaves the other state too."""
        return bool(row.text("target")) and self.contains(self.domain_of(source, row), other)

    def targets(self, row: TreeNode) -> list[TreeNode]:
        """The targets of a transition."""
        return [self.ids[name] for name in row.text("target").split()]

    def domain_of(self, source: TreeNode, row: TreeNode) -> TreeNode:
        """The innermost state around source and targets, which stays active (W3C, 3.13).

        It is the source itself for an internal transition to states within it.
        """
        targets = self.targets(row)
        inner = row.text("type") == "internal" and source.tag == "state"
        for each in self.outwards(source if inner else self.parent(source)):
            if each.tag != "parallel" and all(self.contains(each, target) for target in targets):
                return each
        return self.root


def _begins(name: Tokens, taken: Collection[Tokens]) -> bool:
    """True if one of the taken names is what the name begins with."""
    return any(name[:length] in taken for length in range(len(name) + 1))
