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

from typing import TYPE_CHECKING, Any, Final
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.formats import CannotSayError, Format
from gpsfsm.compile.formats.elements import Elements, place_of
from gpsfsm.compile.formats.flat import COMPLETED, GAVE_UP, flat
from gpsfsm.compile.formats.outcomes import is_failure
from gpsfsm.compile.formats.scxml_regions import read_regions, runner_of
from gpsfsm.compile.formats.scxml_writing import NAMESPACE, OWN_NAMESPACE, own_of, write_regions
from gpsfsm.compile.machines import machine_of
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.printable import clip
from gpsfsm.syntax.text import root_name

if TYPE_CHECKING:
    from collections.abc import Iterator

    import networkx as nx

    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.source import Limits

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


def recognises(text: str, file: str) -> bool:
    """True for XML whose outermost element is scxml, in whatever namespace."""
    del file
    return root_name(text).rpartition(":")[2] == "scxml"


def read(text: str, file: str, limits: Limits) -> ReadMachine:
    """The machine of a statechart, or what is wrong with it."""
    elements = Elements(text, limits, NAMESPACE, OWN_NAMESPACE)
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
        self.states = [each for each in elements.nodes if each.tag in _STATES]
        self.ids: dict[str, TreeNode] = {}
        self.runner: dict[int, str] = {}  # by element: the node of an atomic state
        self.watchers: dict[int, list[str]] = {}  # by element: what watches while it is active
        self.joins: dict[int, str] = {}
        self.done: dict[int, list[str]] = {}  # by parallel: what its end leads to
        self.effects: dict[str, set[str]] = {}  # of one event: triggered, stopped, by node
        self.left: set[int] = set()  # the states that the last transition has left
        self._check()
        if elements.problems:
            return
        for name in ("begin", "complete", "give_up"):
            self._node(name, self.root, kind="start" if name == "begin" else name)
        for each in self.states:
            self._make(each)
        self._go(("begin", Event.SUCCEEDED), [self.root])
        for each in self.states:
            self._leave(each)

    # -- what is there ----------------------------------------------------------------------

    def _check(self) -> None:
        for node in self.elements.nodes[1:]:
            tag = node.tag
            if tag in _REFUSED:
                self.elements.fault(node, f"<{tag}> is not read: {_REFUSED[tag]}", "leave it out")
            elif tag not in (*_STATES, *_PASSED) and tag != "scxml":
                parent = self.elements.nodes[node.parent]
                if parent.tag in ("scxml", "state", "parallel"):
                    message = f"<{clip(tag, _LONGEST)}> is not an SCXML element"
                    self.elements.fault(node, message, "remove it")
        for node in self.states:
            name = node.text("id")
            if name and self.ids.setdefault(name, node) is not node:
                self.elements.fault(node, f"there are two states {name!r}", "rename one of them")
        for node in self.elements.nodes:
            attribute = "target" if node.tag == "transition" else "initial"
            for name in node.text(attribute).split():
                if name not in self.ids:
                    message = f"there is no state {clip(name, _LONGEST)!r}"
                    self.elements.fault(node, message, "correct the name, or add the state")
        if not any(each.tag in _STATES for each in self.elements.children(self.root)):
            self.elements.fault(self.root, "there is no state here", "add one")

    def _inside(self, node: TreeNode) -> list[TreeNode]:
        """The states in a state."""
        return [each for each in self.elements.children(node) if each.tag in _STATES]

    def _transitions(self, node: TreeNode) -> list[TreeNode]:
        return [each for each in self.elements.children(node) if each.tag == "transition"]

    def _parent(self, node: TreeNode) -> TreeNode:
        return self.elements.nodes[node.parent]

    def _name(self, node: TreeNode) -> str:
        return node.text("id") or f"{node.tag}@{node.line}:{node.column}"

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
        if node.tag == "state" and not inside:
            runner = runner_of(self.elements, node, name)
            self.runner[node.index] = self._node(name, node, **runner)
        elif node.tag == "parallel":
            need = max(1, len(inside))
            join = self.joins[node.index] = self._node(
                f"{name}: done", node, kind="join", need=need
            )
            if self._done(node) is not None:
                self._make_done(node, (join, Event.SUCCEEDED))
        if inside:
            self.watchers[node.index] = [
                self._choice(f"{name}: {each.text('event') or 'always'}", each)
                for each in self._transitions(node)
                if not _is_done(each, name)
            ]

    def _make_done(self, node: TreeNode, signal: Signal) -> None:
        """The moment between the end of all regions and what follows.

        A region that is done may be left by a transition of its own, and be done again. So if there
        are such transitions, nobody knows whether all are done: now, later or never.
        """
        name = self._name(node)
        leaving = any(
            not _is_done(transition, self._name(region))
            for region in self._inside(node)
            for transition in self._transitions(region)
            if self._inside(region)
        )
        if not leaving:
            then = self._node(f"{name}: then", node, kind="runner", interface=TICK)
            self._connect(signal, then)
            self.done[node.index] = [then]
            return
        now = self._choice(f"{name}: all regions are done", node)
        later = self._choice(f"{name}: they may be done later", node)
        self._connect(signal, now)
        self._connect((now, Event.FAILED), later)
        self._connect((later, Event.SUCCEEDED), now)
        self.done[node.index] = [now, later]

    def _choice(self, of: str, place: TreeNode) -> str:
        return self._node(
            of, place, kind="runner", interface=CHOICE, parameters={"of": clip(of, _LONGEST)}
        )

    def _connect(self, signal: Signal, target: str, action: str = "trigger") -> None:
        self.graph.add_edge(signal[0], target, event=signal[1].value, action=action)

    # -- entering ---------------------------------------------------------------------------

    def _go(self, signal: Signal, targets: list[TreeNode]) -> None:
        """An event enters states, and all follows that follows at once.

        A final state that is entered is a transition of its own, once all else has been entered
        (W3C, appendix D). What that leaves again was never active.
        """
        pending, steps = list(reversed(targets)), 0
        ended: list[TreeNode] = []
        while pending or ended:
            steps += 1
            if not pending:
                node = ended.pop(0)
                done = self._ended(node)
                if done is not None:
                    around = self._parent(node)
                    self.left.clear()
                    pending = list(reversed(self._moved(around, done)))
                    ended = [each for each in ended if not self._is_left(each)]
                continue
            node = pending.pop()
            if steps > 10_000:
                self.elements.fault(node, "this is entered without end", "let something happen")
                break
            self._begin(node)
            if node.index in self.runner:
                self._trigger(self.runner[node.index])
            elif node.tag == "final":
                ended.append(node)
            elif node.tag == "parallel":
                pending += reversed(self._inside(node))
            else:
                pending += reversed(self._arrived(node, self._initial(node)))
        for target, actions in self.effects.items():
            for action in sorted(actions):
                if (signal[0], action) != (target, "stop"):  # whoever emits it has ended
                    self._connect(signal, target, action)
        self.effects.clear()

    def _trigger(self, name: str) -> None:
        self.effects.setdefault(name, set()).add("trigger")

    def _is_left(self, node: TreeNode) -> bool:
        """True for what lies in a state that the last transition has left."""
        return any(each.index in self.left for each in self._outwards(node))

    def _begin(self, node: TreeNode) -> None:
        """A state around others becomes active: its watchers start, its join forgets."""
        for watcher in self.watchers.get(node.index, ()):
            self._trigger(watcher)
        if node.index in self.joins:
            self.effects[self.joins[node.index]] = {"stop"}

    def _arrived(self, domain: TreeNode, targets: list[TreeNode]) -> list[TreeNode]:
        """The states to be entered with all they begin with, of those below ``domain``.

        What lies around the targets begins here, and the other regions are entered as well.
        """
        around: dict[int, TreeNode] = {}
        for target in targets:
            for each in self._outwards(self._parent(target)):
                if each.index == domain.index:
                    break
                around[each.index] = each
        whole = [each for each in targets if each.index not in around]
        inner = {*around, *(each.index for each in whole)}
        for _, each in sorted(around.items()):
            self._begin(each)
            if each.tag == "parallel":
                whole += (child for child in self._inside(each) if child.index not in inner)
        return sorted(whole, key=lambda each: each.index)

    def _initial(self, node: TreeNode) -> list[TreeNode]:
        names = node.text("initial").split()
        for each in self.elements.children(node):
            if each.tag == "initial":
                names = [
                    name
                    for transition in self._transitions(each)
                    for name in transition.text("target").split()
                ]
        return [self.ids[name] for name in names] if names else self._inside(node)[:1]

    def _ended(self, final: TreeNode) -> TreeNode | None:
        """A final state was entered: the run ends, or a transition of the state around it follows.

        The others of its transitions stay: it is active, in its final state.
        """
        around = self._parent(final)
        if around is self.root:
            self._trigger("give_up" if is_failure(self._name(final)) else "complete")
            return None
        outer, done = self._parent(around), self._done(around)
        if done is None and outer.tag == "parallel":
            self._trigger(self.joins[outer.index])
        return done

    def _done(self, node: TreeNode) -> TreeNode | None:
        """The transition on ``done.state`` of a state, if it leads anywhere."""
        for each in self._transitions(node):
            if _is_done(each, self._name(node)):
                return each if each.text("target") else None
        return None

    # -- leaving ----------------------------------------------------------------------------

    def _leave(self, node: TreeNode) -> None:
        name = self._name(node)
        if node.index in self.runner:
            self._outcomes(node, self.runner[node.index])
        watchers = self.watchers.get(node.index, [])
        watched = [each for each in self._transitions(node) if not _is_done(each, name)]
        for watcher, transition in zip(watchers, watched, strict=False):  # atomic states have none
            self._take((watcher, Event.SUCCEEDED), node, transition)
        done = self._done(node)
        if node.index in self.done and done is not None:
            self._take((self.done[node.index][0], Event.SUCCEEDED), node, done)

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
        if transition.text("target"):
            self._go(signal, self._moved(source, transition))
        elif source.index in self.runner:  # the state stays as it is
            self._go(signal, [source])

    def _moved(self, source: TreeNode, transition: TreeNode) -> list[TreeNode]:
        """The states that a transition enters; those that it leaves are stopped."""
        targets = [self.ids[name] for name in transition.text("target").split()]
        domain, left = self._domain(source, transition, targets), [source]
        if domain.index == source.index:
            left = self._inside(source)
        while self._parent(left[0]).index != domain.index:
            left = [self._parent(left[0])]
        for each in left:
            self._stop(each)
        return self._arrived(domain, targets)

    def _domain(self, source: TreeNode, transition: TreeNode, targets: list[TreeNode]) -> TreeNode:
        """The innermost state around source and targets, which stays active (W3C, 3.13).

        It is the source itself for an internal transition to states within it.
        """
        inner = transition.text("type") == "internal" and source.tag == "state"
        for each in self._outwards(source if inner else self._parent(source)):
            if each.tag != "parallel" and all(
                each.index in {other.index for other in self._outwards(self._parent(target))}
                for target in targets
            ):
                return each
        return self.root

    def _outwards(self, node: TreeNode) -> Iterator[TreeNode]:
        while node.index != self.root.index:
            yield node
            node = self._parent(node)
        yield self.root

    def _stop(self, node: TreeNode) -> None:
        """All that is active in a state is stopped, and its end counts no more."""
        self.left.add(node.index)
        pending = [node]
        while pending:
            each = pending.pop()
            names = [self.runner[each.index]] if each.index in self.runner else []
            for row in (self.watchers, self.done):
                names += row.get(each.index, ())
            for name in names:
                self.effects[name] = {"stop"}
            if each.index in self.joins:
                self.effects.pop(self.joins[each.index], None)
            pending += self._inside(each)


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
        f'<scxml xmlns="{NAMESPACE}" xmlns:gpsfsm="{OWN_NAMESPACE}"',
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
