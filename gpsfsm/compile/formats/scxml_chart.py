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

from gpsfsm.compile.formats.scxml_content import (
    ERRORS,
    EXPRESSIONS,
    Contents,
    Tokens,
    begins,
    tokens,
)
from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.compile.formats.elements import Elements
    from gpsfsm.model.tree import TreeNode

STATES: Final = ("state", "parallel", "final")
_FIRST: Final = ("initial", "history")
_BLOCKS: Final = ("onentry", "onexit", "transition", "finalize", "if", "foreach")
_OPERANDS: Final = ("send", "invoke", "donedata")
_AROUND: Final = {
    "state": ("scxml", "state", "parallel"),
    "parallel": ("scxml", "state", "parallel"),
    "final": ("scxml", "state"),
    "initial": ("state",),
    "history": ("state", "parallel"),
    "transition": ("state", "parallel", "initial", "history"),
    "onentry": STATES,
    "onexit": STATES,
    "datamodel": ("scxml", "state", "parallel"),
    "data": ("datamodel",),
    "donedata": ("final",),
    "script": ("scxml", *_BLOCKS),
    **dict.fromkeys(("raise", "send", "cancel", "log", "assign", "if", "foreach"), _BLOCKS),
    **dict.fromkeys(("elseif", "else"), ("if",)),
    "invoke": ("state", "parallel"),
    "finalize": ("invoke",),
    **dict.fromkeys(("param", "content"), _OPERANDS),
}
"""The elements that are read, and where they may stand."""
_SKIPPED: Final = {
    **dict.fromkeys(("data", "donedata", "assign", "script", "param", "content"), Cause.DATA),
    **dict.fromkeys(("if", "foreach", "finalize"), Cause.DATA),
    **dict.fromkeys(("log", "cancel"), Cause.NO_MEANING),
}
"""Elements that are skipped, except that their expressions may raise an error."""
_OPAQUE: Final = ("data", "assign", "script", "param", "content", "log", "cancel")
"""Elements whose content is not SCXML, or the SCXML of another machine: it is not looked at."""
_HOLDS: Final = {"true": "ecmascript", "True": "python"}
_NEVER: Final = {"false": "ecmascript", "False": "python"}
"""The literals by their data model. In another one each fails, which is false and an error."""
_ATTRIBUTES: Final = {
    "scxml": ("initial", "name", "version", "datamodel", "binding", "exmode", "gpsfsm:form"),
    "state": ("id", "initial", "gpsfsm:interface", "gpsfsm:provider", "gpsfsm:parameters"),
    "parallel": ("id",),
    "final": ("id",),
    "transition": ("event", "cond", "target", "type"),
    "history": ("id", "type"),
    "raise": ("event",),
    "send": (
        "event", "eventexpr", "target", "targetexpr", "type", "typeexpr", "id", "idlocation",
        "delay", "delayexpr", "namelist",
    ),
    "invoke": (
        "type", "typeexpr", "src", "srcexpr", "id", "idlocation", "namelist", "autoforward",
    ),
}  # fmt: skip
_INTERNAL: Final = (
    ("done", "state"), ("done", "invoke"), ("error", "execution"), ("error", "communication"),
    ("error", "platform"),
)  # fmt: skip
"""The events that only the machine itself raises, by their first tokens."""
_LONGER: Final = "\0"
_MOST_TARGETS: Final = 50
_LONGEST: Final = 200


class Chart:
    """The states and transitions of an SCXML document; what is wrong goes to ``elements``."""

    def __init__(self, elements: Elements) -> None:
        self.elements = elements
        self._fault = elements.fault
        self.root = elements.nodes[0]
        self.ids: dict[str, TreeNode] = {}
        self.approximations = [*elements.skipped]
        self._unread: set[int] = set()
        for node in elements.nodes[1:]:
            self._element(node)
        self.read = [each for each in elements.nodes if each.index not in self._unread]
        self.states = [each for each in self.read if each.tag in STATES]
        self.histories = [each for each in self.read if each.tag == "history"]
        for node in self.read:
            self._attributes(node)
        for node in (*self.states, *self.histories):
            name = node.text("id")
            if name and self.ids.setdefault(name, node) is not node:
                self._fault(node, f"there are two states {name!r}", "rename one of them")
        if not self.inside(self.root):
            self._fault(self.root, "there is no state here", "add one")
        if not elements.problems:  # else there are names that mean nothing
            for node in self.read:
                self._references(node)
        if not elements.problems:
            self._circles()
        for node in self.states:
            live = self.live(node)
            for each in self.transitions(node):
                if self.never_holds(each):
                    self._skip("transition", each, Cause.FALSE)
                elif each not in live:
                    self._skip("transition", each, Cause.EARLIER)

    # -- what is there ----------------------------------------------------------------------

    def _element(self, node: TreeNode) -> None:
        tag, parent = node.tag, self.parent(node)
        if parent.index in self._unread or parent.tag in _OPAQUE:
            self._unread.add(node.index)
        elif tag not in _AROUND:
            message = f"<{clip(tag, _LONGEST)}> is not an SCXML element"
            self._fault(node, message, "remove it")
        elif parent.tag not in _AROUND[tag]:
            message = f"a <{clip(parent.tag, _LONGEST)}> cannot contain a <{tag}>"
            self._fault(node, message, "move or remove it")
        elif tag in _SKIPPED:
            self._skip(tag, node, _SKIPPED[tag])

    def _skip(self, construct: str, node: TreeNode, cause: Cause = Cause.NO_MEANING) -> None:
        self.approximations.append(
            Approximation(Reading.SKIPPED, clip(construct, _LONGEST), node.location, cause)
        )

    def _attributes(self, node: TreeNode) -> None:
        for attribute in node.attributes:
            names = (*_ATTRIBUTES.get(node.tag, ()), *EXPRESSIONS.get(node.tag, ()))
            if node.tag not in _OPAQUE and attribute.name not in names:
                self._skip(f"attribute {attribute.name}", node)
        if node.tag == "transition":
            self._transition(node)
        if node.tag == "raise" and not node.text("event").strip():
            self._fault(node, "this <raise> has no event", "name one")
        if node.tag == "history" and node.text("type") not in ("", "shallow", "deep"):
            message = f"a history has no type {clip(node.text('type'), _LONGEST)!r}"
            self._fault(node, message, 'write type="shallow" or type="deep"')
        if node.tag in _FIRST:
            if len(self.elements.children(node)) != 1:
                message = f"<{node.tag}> does not have exactly one transition"
                self._fault(node, message, "write one")
            if node.tag == "initial" and self.parent(node).attribute("initial") is not None:
                self._fault(node, "this state has an initial attribute as well", "remove one")

    def _transition(self, node: TreeNode) -> None:
        around = self.parent(node).tag
        first = around in _FIRST
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
            message = f"the transition of <{around}> needs a target, and neither event nor cond"
            self._fault(node, message, "write its target alone")

    def _references(self, node: TreeNode) -> None:
        name = "target" if node.tag == "transition" else "initial"
        around = self.root
        first = self.parent(node).tag in _FIRST
        if node.tag == "state" or first:
            around = node if node.tag == "state" else self.parent(self.parent(node))
        targets: list[TreeNode] = []
        named = node.tag in ("scxml", "state", "transition")
        for each in node.text(name).split() if named else ():
            message = ""
            if each not in self.ids:
                message = f"there is no state {clip(each, _LONGEST)!r}"
            elif around is not self.root and not self.contains(around, self.ids[each]):
                message = f"the initial state {clip(each, _LONGEST)!r} is not in this state"
            elif self.ids[each].tag == "history" and self._is_odd(node, self.ids[each]):
                message = f"the history {clip(each, _LONGEST)!r} cannot be followed from here"
            else:
                targets.append(self.ids[each])
            if message:
                self._fault(node, message, "correct the name, or add the state")
        if len(targets) > _MOST_TARGETS or any(
            not self.is_beside(*pair) for pair in combinations(targets, 2)
        ):
            message = f"the targets {clip(node.text(name), _LONGEST)!r} are never active together"
            self._fault(node, message, "name one state in each region of a <parallel>")

    def _is_odd(self, node: TreeNode, history: TreeNode) -> bool:
        """True for a history that decides, by what it remembers, how much a transition leaves.

        One that leads to another history, or that belongs to a whole parallel, is as rare.
        """
        source, parent = self.parent(node), self.parent(history)
        several = len(node.text("target").split()) > 1
        whole = several and parent.tag == "parallel"
        return whole or source.tag == "history" or self._is_within(node, source, history)

    def _is_within(self, row: TreeNode, source: TreeNode, history: TreeNode) -> bool:
        """True if all that a history leads to may lie in a smaller state that stays active."""
        parent = self.parent(history)
        if source.tag not in STATES or not self.contains(parent, source):
            return False
        inner = row.text("type") == "internal" and self.inside(source)
        first = source if inner else self.parent(source)
        around = [each for each in self.outwards(first) if self.contains(parent, each)]
        names = [name for each in self.transitions(history) for name in each.text("target").split()]
        flat = all(name in self.ids and self.parent(self.ids[name]) is parent for name in names)
        deep = history.text("type") == "deep" or not flat
        return deep and any(each.tag == "state" for each in around)

    # -- structure --------------------------------------------------------------------------

    def inside(self, node: TreeNode) -> list[TreeNode]:
        """The states in a state."""
        return [each for each in self.elements.children(node) if each.tag in STATES]

    def within(self, node: TreeNode) -> list[TreeNode]:
        """The states in a state, and those in them."""
        ends = (node.index, self._last[node.index])
        first, last = (bisect(self.states, end, key=lambda each: each.index) for end in ends)
        return self.states[first:last]

    def transitions(self, node: TreeNode) -> list[TreeNode]:
        """The transitions of a state or of an initial element, in document order."""
        return [each for each in self.elements.children(node) if each.tag == "transition"]

    def inwards(self, node: TreeNode) -> list[TreeNode]:
        """The transitions of the initial element and the histories of a state."""
        around = [each for each in self.elements.children(node) if each.tag in _FIRST]
        return [row for each in around for row in self.transitions(each)]

    def parent(self, node: TreeNode) -> TreeNode:
        """The element around an element."""
        return self.elements.nodes[node.parent]

    def name(self, node: TreeNode) -> str:
        """The id of a state, or where it stands."""
        return node.text("id") or f"{node.tag}@{node.line}:{node.column}"

    def around(self, node: TreeNode) -> TreeNode:
        """The state that an element stands in, or is."""
        return next(each for each in self.outwards(node) if each.tag in STATES or each is self.root)

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
        for node in sorted((*self.states, *self.histories), key=lambda each: each.index):
            region = self.parent(node).tag == "parallel" and node.tag != "history"
            if region or node.parent in inside:
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

    # -- conditions -------------------------------------------------------------------------

    @cached_property
    def contents(self) -> Contents:
        """The executable content of the chart."""
        return Contents(self)

    def cond(self, row: TreeNode) -> str:
        """The condition of an element, "" if it always holds."""
        text = row.text("cond").strip()
        return "" if self._is(text, _HOLDS) or self._is_around(row) else text

    def _is(self, text: str, literals: Mapping[str, str]) -> bool:
        """True for one of these literals in its data model."""
        return text in literals and literals[text] == self.root.text("datamodel")

    def never_holds(self, row: TreeNode) -> bool:
        """True for a transition whose condition is false, wherever the machine is."""
        state, source = self.state_in(row), self.parent(row)
        if state is None or source.tag not in STATES:
            return row.text("cond").strip() in _NEVER
        possible = self.contains(source, state) or self.is_beside(source, state)
        return not possible and not self._is_around(row)

    def _is_around(self, row: TreeNode) -> bool:
        """True for a transition on condition that its own state is active, or one around it."""
        state, source = self.state_in(row), self.parent(row)
        return state is not None and (state is source or self.contains(state, source))

    def state_in(self, row: TreeNode) -> TreeNode | None:
        """The state that a condition ``In('state')`` asks for."""
        text = row.text("cond").strip()
        inner = text[3:-1].strip() if text.startswith("In(") and text.endswith(")") else ""
        quoted = len(inner) > 2 and inner[0] == inner[-1] and inner[0] in "'\""
        state = self.ids.get(inner[1:-1]) if quoted else None
        return state if state is not None and state.tag in STATES else None

    def is_undecided(self, node: TreeNode) -> bool:
        """True for an element with a condition that has to be evaluated."""
        return bool(self.cond(node)) and not self.never_holds(node) and not self.state_in(node)

    def may_fail(self, node: TreeNode) -> bool:
        """True for an element with a condition that may raise an error."""
        text = node.text("cond").strip()
        return self.is_undecided(node) or (text in _NEVER and not self._is(text, _NEVER))

    # -- transitions ------------------------------------------------------------------------

    def live(self, node: TreeNode) -> list[TreeNode]:
        """The transitions of a state that are not dead."""
        rows: list[TreeNode] = []
        taken: set[Tokens] = set()
        for each in self.transitions(node):
            events = self.events(each)
            dead = events and all(begins(event, taken) for event in events)
            if dead or self.never_holds(each):
                continue
            rows.append(each)
            if not self.cond(each):
                if not events:
                    return [row for row in rows if not row.text("event")]
                taken.update(events)
        return rows

    def done(self, node: TreeNode) -> list[TreeNode]:
        """Those that may be taken when the state is done."""
        rows: list[TreeNode] = []
        for each in self.live(node):
            if begins(self.done_event(node), self.events(each)):
                rows.append(each)
                if not self.cond(each):
                    break
        return rows

    def is_of_itself(self, node: TreeNode, row: TreeNode) -> bool:
        """True for a transition by the end of its state alone."""
        return set(self.events(row)) == {self.done_event(node)}

    def is_by_end(self, node: TreeNode, row: TreeNode) -> bool:
        """True for a transition by the ends of states that are none of a parallel in its state."""
        ends = all(each[:2] == ("done", "state") for each in self.events(row))
        return (
            bool(row.text("event")) and ends and not any(map(self.in_parallel, self.within(node)))
        )

    def external(self, row: TreeNode) -> list[Tokens]:
        """The names by which the environment alone can take a transition."""
        return [each for each in self.outer(row) if not self.contents.is_own(each)]

    def outer(self, row: TreeNode) -> list[Tokens]:
        """The names by which the environment, too, can take a transition."""
        return [each for each in self.events(row) if each[:2] not in _INTERNAL]

    def events(self, row: TreeNode) -> list[Tokens]:
        """The tokens that the names of its events have to begin with."""
        return [tokens(text) for text in row.text("event").split()]

    def is_private(self, node: TreeNode, row: TreeNode) -> bool:
        """True if an event takes this transition and no other one that can be active besides."""
        return any(
            not any(
                self._rivals(node, row, each)
                for length in range(len(name) + 1)
                for each in self._near(node, self.by_name.get(name[:length], []))
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
    def by_name(self) -> dict[Tokens, list[TreeNode]]:
        """The transitions by what the names of their events have to begin with."""
        rows: dict[Tokens, list[TreeNode]] = {}
        for node in self.states:
            for each in self.transitions(node):
                for event in self.events(each):
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
                for target in map(self._whole, self.targets(row)):
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

    def _whole(self, target: TreeNode) -> TreeNode:
        """The state of which a history may enter anything."""
        return self.parent(target) if target.tag == "history" else target

    @cached_property
    def follows(self) -> bool:
        """True if more has to be known of a macrostep than which states it leaves and enters.

        Else a state with a transition without event is a runner, too, which acts for a while.
        """
        contents = self.contents
        decided = any(
            row.text("cond") and not self.is_undecided(row)
            for node in self.states
            for row in self.transitions(node)
        )
        own = contents.raised or contents.sent or contents.sends_any or contents.raises_any
        return bool(own or self.histories or decided)

    @cached_property
    def _eventless(self) -> list[TreeNode]:
        return [
            node for node in self.states if any(not row.text("event") for row in self.live(node))
        ]

    @cached_property
    def _hasty(self) -> list[TreeNode]:
        """The states with transitions that may be taken before one by a ``done.state`` event."""
        events = [*self.contents.raised, *(ERRORS if self.contents.fails else ())]
        if self.contents.raises_any:
            events = [(*name, _LONGER) for name in self.by_name]
        return [*self._eventless, *chain.from_iterable(map(self._naming, events))]

    @cached_property
    def _with_done(self) -> list[TreeNode]:
        return [node for node in self.states if self.in_parallel(node) and self.done(node)]

    def _naming(self, event: Tokens) -> list[TreeNode]:
        """The states with a transition for an event."""
        rows = (self.by_name.get(event[:length], ()) for length in range(len(event) + 1))
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
            or self._has_beside(node, self._naming(self.done_event(node)))
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
        others = [each for each in self._naming(self.done_event(node)) if each is not node]
        return self._is_active(node, others) or (bool(others) and self._is_rushed(node))

    def _is_rushed(self, node: TreeNode) -> bool:
        return any(each is node for each in self._hasty) or self._is_active(node, self._hasty)

    def done_event(self, node: TreeNode) -> Tokens:
        """The name of the event that a state is done."""
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
