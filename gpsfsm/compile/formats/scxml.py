"""SCXML (W3C, 2015): statecharts without scripts ↔ machines.

An atomic state with transitions is a runner: it acts until one of its events comes. The names of
the events tell how it ends, as those of outcomes do (``outcomes.py``). A transition of a state with
others in it may be taken at any time while one of these is active: a choice watches for it. What is
left by a transition is stopped.

    <parallel id="P"><state id="A">…</state><state id="B">…</state></parallel>
    entering P enters A and B; done.state.P comes when each has come to a final state: a join

What gpsfsm writes itself (``scxml_writing``) is read by ``scxml_regions``.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.formats import CannotSayError, Format
from gpsfsm.compile.formats.elements import Elements, place_of
from gpsfsm.compile.formats.flat import COMPLETED, GAVE_UP, flat
from gpsfsm.compile.formats.outcomes import is_failure
from gpsfsm.compile.formats.scxml_regions import read_regions, runner_of
from gpsfsm.compile.formats.scxml_writing import OWN_NAMESPACE, own_of, write_regions
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.choice import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    import networkx as nx

    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.source import Limits

_FIRST = re.compile(
    r"\s*(?:<\?xml[^>]*\?>\s*|<!--.{0,2000}?-->\s*)*<(?:\w+:)?scxml(?=[\s/>])", re.S
)
_STATES = ("state", "parallel", "final")
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
_PASSED = ("datamodel", "data", "onentry", "onexit", "log", "assign", "initial", "transition")
_LONGEST: Final = 200
Signal = tuple[str, Event]


def recognises(begin: str, file: str) -> bool:
    """True for XML whose outermost element is scxml."""
    del file
    return _FIRST.match(begin) is not None


def read(text: str, file: str, limits: Limits) -> ReadMachine:
    """The machine of a statechart, or what is wrong with it."""
    elements = Elements(text, limits)
    if not elements.nodes:
        return None, tuple(elements.problems)
    if elements.nodes[0].text("gpsfsm:form") == "regions":
        return read_regions(elements, file)
    reader = _Reader(elements)
    if elements.problems:
        return None, tuple(elements.problems)
    return machine_of(reader.graph, file=file, places=reader.places)


class _Reader:
    def __init__(self, elements: Elements) -> None:
        import networkx

        self.elements = elements
        self.graph: nx.MultiDiGraph[Any] = networkx.MultiDiGraph()
        self.places: dict[Any, Any] = {}
        self.root = elements.nodes[0]
        self.states = [each for each in elements.nodes if _tag(each) in _STATES]
        self.ids: dict[str, TreeNode] = {}
        self.runner: dict[int, str] = {}  # by element: the node of an atomic state
        self.watchers: dict[int, list[str]] = {}  # by element: what watches while it is active
        self.joins: dict[int, str] = {}
        self._check()
        if elements.problems:
            return
        for name in ("begin", "complete", "give_up"):
            self._node(name, self.root, kind="start" if name == "begin" else name)
        for each in self.states:
            self._make(each)
        self._enter(("begin", Event.SUCCEEDED), [self.root])
        for each in self.states:
            self._leave(each)

    # -- what is there ----------------------------------------------------------------------

    def _check(self) -> None:
        for node in self.elements.nodes[1:]:
            tag = _tag(node)
            if tag in _REFUSED:
                self.elements.fault(node, f"<{tag}> is not read: {_REFUSED[tag]}", "leave it out")
            elif tag not in (*_STATES, *_PASSED) and tag != "scxml":
                parent = self.elements.nodes[node.parent]
                if _tag(parent) in ("scxml", "state", "parallel"):
                    message = f"<{clip(tag, _LONGEST)}> is no element of SCXML"
                    self.elements.fault(node, message, "remove it")
        for node in self.states:
            name = node.text("id")
            if name and self.ids.setdefault(name, node) is not node:
                self.elements.fault(node, f"there are two states {name!r}", "rename one of them")
        for node in self.elements.nodes:
            attribute = "target" if _tag(node) == "transition" else "initial"
            for name in node.text(attribute).split():
                if name not in self.ids:
                    message = f"there is no state {clip(name, _LONGEST)!r}"
                    self.elements.fault(node, message, "correct the name, or add the state")
        if not any(_tag(each) in _STATES for each in self.elements.children(self.root)):
            self.elements.fault(self.root, "there is no state here", "add one")

    def _inside(self, node: TreeNode) -> list[TreeNode]:
        """The states in a state."""
        return [each for each in self.elements.children(node) if _tag(each) in _STATES]

    def _transitions(self, node: TreeNode) -> list[TreeNode]:
        return [each for each in self.elements.children(node) if _tag(each) == "transition"]

    def _parent(self, node: TreeNode) -> TreeNode:
        return self.elements.nodes[node.parent]

    def _name(self, node: TreeNode) -> str:
        return node.text("id") or f"{_tag(node)}@{node.line}:{node.column}"

    # -- nodes ------------------------------------------------------------------------------

    def _node(self, name: str, place: TreeNode, **data: Any) -> str:
        unique, number = clip(name, _LONGEST - 20), 2
        while unique in self.graph:
            unique, number = f"{clip(name, _LONGEST - 20)}#{number}", number + 1
        self.graph.add_node(unique, **data)
        self.places[unique] = place_of(place)
        return unique

    def _make(self, node: TreeNode) -> None:
        name, inside = self._name(node), self._inside(node)
        if _tag(node) == "state" and not inside:
            runner = runner_of(self.elements, node, name)
            self.runner[node.index] = self._node(name, node, **runner)
        elif _tag(node) == "parallel":
            need = max(1, len(inside))
            self.joins[node.index] = self._node(f"{name}: done", node, kind="join", need=need)
        if inside:
            self.watchers[node.index] = [
                self._choice(f"{name}: {each.text('event') or 'always'}", each)
                for each in self._transitions(node)
                if not _is_done(each, name)
            ]

    def _choice(self, of: str, place: TreeNode) -> str:
        return self._node(
            of, place, kind="runner", interface=CHOICE, parameters={"of": clip(of, _LONGEST)}
        )

    def _connect(self, signal: Signal, target: str, action: str = "trigger") -> None:
        self.graph.add_edge(signal[0], target, event=signal[1].value, action=action)

    # -- entering ---------------------------------------------------------------------------

    def _enter(self, signal: Signal, targets: list[TreeNode]) -> None:
        """An event enters states, and what they begin with; final states may end more."""
        pending, steps = list(reversed(targets)), 0
        while pending:
            node, steps = pending.pop(), steps + 1
            if steps > 10_000:
                self.elements.fault(node, "this is entered without end", "let something happen")
                return
            for watcher in self.watchers.get(node.index, ()):
                self._connect(signal, watcher)
            if node.index in self.runner:
                self._connect(signal, self.runner[node.index])
            elif _tag(node) == "final":
                pending += reversed(self._ended(signal, node))
            elif _tag(node) == "parallel":
                self._connect(signal, self.joins[node.index], "stop")
                pending += reversed(self._inside(node))
            else:
                pending += reversed(self._initial(node))

    def _initial(self, node: TreeNode) -> list[TreeNode]:
        names = node.text("initial").split()
        for each in self.elements.children(node):
            if _tag(each) == "initial":
                names = [
                    name
                    for transition in self._transitions(each)
                    for name in transition.text("target").split()
                ]
        return [self.ids[name] for name in names] if names else self._inside(node)[:1]

    def _ended(self, signal: Signal, final: TreeNode) -> list[TreeNode]:
        """A final state is entered: the run ends, or the state around it is done."""
        around = self._parent(final)
        if around is self.root:
            self._connect(signal, "give_up" if is_failure(self._name(final)) else "complete")
            return []
        outer = self._parent(around)
        for watcher in self.watchers.get(around.index, ()):
            if watcher != signal[0]:
                self._connect(signal, watcher, "stop")
        if _tag(outer) == "parallel":
            self._connect(signal, self.joins[outer.index])
            return []
        return self._done(around)

    def _done(self, node: TreeNode) -> list[TreeNode]:
        """The targets of the transition on ``done.state`` of a state."""
        for each in self._transitions(node):
            if _is_done(each, self._name(node)):
                return [self.ids[name] for name in each.text("target").split()]
        return []

    # -- leaving ----------------------------------------------------------------------------

    def _leave(self, node: TreeNode) -> None:
        name = self._name(node)
        if node.index in self.runner:
            self._outcomes(node, self.runner[node.index])
        watchers = self.watchers.get(node.index, [])
        watched = [each for each in self._transitions(node) if not _is_done(each, name)]
        for watcher, transition in zip(watchers, watched, strict=False):  # atomic states have none
            self._take((watcher, Event.SUCCEEDED), node, transition)
        if node.index in self.joins:
            signal: Signal = (self.joins[node.index], Event.SUCCEEDED)
            targets = self._done(node)
            if targets:
                tick = self._node(f"{name}: then", node, kind="runner", interface=TICK)
                self._connect(signal, tick)
                self._stop((tick, Event.SUCCEEDED), node)
                self._enter((tick, Event.SUCCEEDED), targets)

    def _outcomes(self, node: TreeNode, runner: str) -> None:
        """The transitions of an atomic state: by two events, and choices where there are more."""
        rows = self._transitions(node)
        failures = [each for each in rows if is_failure(each.text("event"))]
        others = [each for each in rows if each not in failures]
        if not rows:
            return
        if not failures or not others:
            others, failures = (rows[:1], rows[1:]) if len(rows) > 1 else (rows, rows)
        for event, transitions in ((Event.SUCCEEDED, others), (Event.FAILED, failures)):
            signal: Signal = (runner, event)
            for number, each in enumerate(transitions):
                taken = signal
                if each.text("cond"):
                    choice = self._choice(f"{self._name(node)}: {each.text('cond')}", each)
                    self._connect(signal, choice)
                    taken, signal = (choice, Event.SUCCEEDED), (choice, Event.FAILED)
                    if number == len(transitions) - 1:
                        self._connect(signal, runner)  # it stays, and waits for the next event
                elif number < len(transitions) - 1:
                    choice = self._choice(f"{self._name(node)}: {each.text('event')}", each)
                    self._connect(signal, choice)
                    taken, signal = (choice, Event.SUCCEEDED), (choice, Event.FAILED)
                self._take(taken, node, each)

    def _take(self, signal: Signal, source: TreeNode, transition: TreeNode) -> None:
        """A transition: what it leaves is stopped, and its targets are entered."""
        targets = [self.ids[name] for name in transition.text("target").split()]
        if not targets:  # the state stays as it is
            self._enter(signal, [source] if source.index in self.runner else [])
            return
        left = self._left(source, targets)
        self._stop(signal, left)
        self._enter(signal, targets)

    def _left(self, source: TreeNode, targets: list[TreeNode]) -> TreeNode:
        """The outermost state that a transition leaves: below the innermost one around both."""
        around = {each.index for each in self._outwards(source)}
        common = next(
            each
            for each in self._outwards(self._parent(targets[0]))
            if each.index in around and each.index != source.index and _tag(each) != "parallel"
        )
        left = source
        while self._parent(left).index != common.index:
            left = self._parent(left)
        return left

    def _outwards(self, node: TreeNode) -> Iterator[TreeNode]:
        while node.index != self.root.index:
            yield node
            node = self._parent(node)
        yield self.root

    def _stop(self, signal: Signal, node: TreeNode) -> None:
        """All that is active in a state, but what emits the event."""
        pending = [node]
        while pending:
            each = pending.pop()
            own = [self.runner[each.index]] if each.index in self.runner else []
            for name in (*own, *self.watchers.get(each.index, ())):
                if name != signal[0]:
                    self._connect(signal, name, "stop")
            pending += self._inside(each)


def _tag(node: TreeNode) -> str:
    return node.tag.rpartition(":")[2]


def _is_done(transition: TreeNode, name: str) -> bool:
    events = transition.text("event").split()
    return any(each in (f"done.state.{name}", "done.state", "done.state.*") for each in events)


# -- writing -----------------------------------------------------------------------------------


def write(automaton: Automaton) -> str:
    """A statechart with a state for each runner; where several act at once, one of regions.

    A runner is left by the event ``name.succeeded`` or ``name.failed``. Raises CannotSayError.
    """
    try:
        first, states = flat(automaton)
    except CannotSayError:
        return write_regions(automaton)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<scxml xmlns="http://www.w3.org/2005/07/scxml" xmlns:gpsfsm="{OWN_NAMESPACE}"',
        f'    version="1.0" initial="{first}">',
    ]
    for each in states:
        own = " ".join(f"{key}={quoteattr(text)}" for key, text in own_of(each.element).items())
        lines.append(f"  <state id={quoteattr(each.name)} {own}>")
        lines += (
            f'    <transition event="{each.name}.{event}" target="{target}"/>'
            for event, target in (("succeeded", each.succeeded), ("failed", each.failed))
        )
        lines.append("  </state>")
    lines += (f'  <final id="{name}"/>' for name in (COMPLETED, GAVE_UP))
    return "\n".join((*lines, "</scxml>")) + "\n"


FORMAT = Format("scxml", "SCXML statecharts without scripts", recognises, read, write)
