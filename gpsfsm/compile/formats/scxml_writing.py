"""Automaton → SCXML (W3C, 2015): a statechart that any engine runs, and that gpsfsm reads back.

Everything that can be active is a region of one ``<parallel>``. The environment sends
``X.succeeded`` or ``X.failed`` when the runner X ends; the regions of those that it triggers wait
for that event. So an instant is one macrostep.

    Go SUCCEEDED → Say      <state id="Say_2" initial="Say_2_idle">
                              <state id="Say_2_idle">
                                <transition event="Go_1.succeeded" target="Say_2_active"/> …

A join of all its inputs is a ``<parallel>`` with a final state for each: its event is the
``done.state`` of SCXML. One of k of n inputs is a chain of k states that end in a final one. The
region ``end`` stands first, so that it wins over what happens inside at the same event.

An instant is settled in steps, and semantics.md says it at once. Where that could make a difference
the automaton is refused: a stop and a trigger that come by different events of one instant, joins
in loops whose inputs can come at one instant, both ends at one instant.
"""

from __future__ import annotations

import json
import re
from math import isfinite
from typing import TYPE_CHECKING, Final
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.formats import CannotSayError
from gpsfsm.compile.formats.flat import COMPLETED, GAVE_UP, flat
from gpsfsm.compile.machines import written
from gpsfsm.model.automaton import PAPER, NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Element

NAMESPACE: Final = "http://www.w3.org/2005/07/scxml"
OWN_NAMESPACE: Final = "urn:gpsfsm"
_NO_NAME = re.compile(r"[^A-Za-z0-9_]+")
_WORDS: Final = {each: each.value.lower() for each in Event}
_ENDS: Final = ((NodeKind.GIVE_UP, "gave_up"), (NodeKind.COMPLETE, "completed"))


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


def write_regions(automaton: Automaton, ids: list[str] | None = None) -> str:
    """The automaton as SCXML, with these ids of nodes. Raises CannotSayError."""
    return _Writer(automaton, ids_of(automaton) if ids is None else ids).text()


def ids_of(automaton: Automaton) -> list[str]:
    """The id of each node's region: the last part of its interface, and its number."""
    plan = automaton.plan
    ids: list[str] = []
    for node in automaton.nodes:
        name = node.kind.value
        if node.kind is NodeKind.RUNNER:
            name = plan.elements[node.origin].interface.rpartition("/")[2]
        name = _NO_NAME.sub("_", name).strip("_") or "node"
        ids.append(f"{name if name[0].isalpha() else 'n' + name}_{node.index}")
    return ids


def own_of(element: Element) -> dict[str, str]:
    """The attributes that say which runner a state is; other programs pass over them."""
    rows = {"gpsfsm:interface": element.interface, "gpsfsm:provider": element.provider}
    parameters = {
        key: value if not isinstance(value, float) or isfinite(value) else written(value)
        for key, value in element.parameters.items()
    }
    if parameters:
        rows["gpsfsm:parameters"] = json.dumps(parameters, ensure_ascii=False)
    return rows


class _Writer:
    def __init__(self, automaton: Automaton, ids: list[str]) -> None:
        self.automaton = automaton
        self.lines: list[str] = []
        self.ids = ids
        self.stops: dict[int, dict[Signal, None]] = {}  # by node: what stops it
        for source, event, target in automaton.stops:
            if source not in automaton.starts:  # nothing is active yet
                self.stops.setdefault(target, {})[Signal(source, event)] = None
        self._refuse()

    def text(self) -> str:
        """The whole text."""
        automaton = self.automaton
        self._put(0, "<?xml version='1.0' encoding='UTF-8'?>")
        self._open(
            0, "scxml", **{"xmlns": NAMESPACE, "xmlns:gpsfsm": OWN_NAMESPACE},
            version="1.0", datamodel="null", initial=self._initial(), **{"gpsfsm:form": "regions"},
        )  # fmt: skip
        self._open(1, "parallel", id="run")
        self._end_region()
        for node in automaton.nodes:
            if node.kind is NodeKind.RUNNER:
                self._runner(node.index)
            elif node.kind is NodeKind.JOIN:
                self._join(node.index, node.need)
        self._put(1, "</parallel>")
        for _, name in _ENDS:
            self._put(1, f'<final id="{name}"/>')
        self._put(0, "</scxml>")
        return "\n".join(self.lines) + "\n"

    # -- names ------------------------------------------------------------------------------

    def _event(self, signal: Signal) -> str:
        source, event = signal
        if self._counts_all(source):
            return f"done.state.{self.ids[source]}_all"
        return f"{self.ids[source]}.{_WORDS[event]}"

    def _counts_all(self, node: int) -> bool:
        automaton = self.automaton
        join = automaton.nodes[node].kind is NodeKind.JOIN
        return join and automaton.nodes[node].need == len(automaton.inputs[node])

    def _from_start(self, node: int) -> bool:
        starts = self.automaton.starts
        return any(source in starts for source, _ in self.automaton.inputs[node])

    def _initial(self) -> str:
        for kind, name in _ENDS:
            if any(
                self._from_start(node.index) for node in self.automaton.nodes if node.kind is kind
            ):
                return name
        return "run"

    # -- what cannot be said ----------------------------------------------------------------

    def _refuse(self) -> None:
        import networkx

        automaton = self.automaton
        if automaton.traits != PAPER:
            self._cannot(0, "the traits of an engine have no words in SCXML")
        single = all(len(automaton.inputs[each.index]) <= 1 for each in automaton.runners)
        repeats = not single or not networkx.is_directed_acyclic_graph(automaton.graph)
        roots = self._roots() if repeats or automaton.stops or self._both_ends() else {}
        for node in automaton.nodes:
            inputs, stops = automaton.inputs[node.index], self.stops.get(node.index, {})
            if any(
                one != other and roots[one] & roots[other] for one in inputs for other in stops
            ) or (node.kind is NodeKind.JOIN and set(inputs) & set(stops)):
                self._cannot(node.index, "it can be stopped and triggered at one instant")
            if node.kind is not NodeKind.JOIN:
                continue
            if len(set(inputs)) < len(inputs):
                self._cannot(node.index, "this join has one input twice")
            if (repeats or stops) and node.need != len(inputs):
                self._cannot(node.index, "a join of some of its inputs that can come again")
            if (repeats or stops) and self._from_start(node.index):
                self._cannot(node.index, "the start is an input of a join that can wait again")
            if repeats and self._together(inputs, roots):
                self._cannot(node.index, "two inputs of a join that can come at one instant again")
        if self._both_ends():
            ends = [automaton.inputs[automaton.give_up], automaton.inputs[automaton.complete]]
            all_roots = [set().union(*(roots[each] for each in rows)) for rows in ends]
            if all_roots[0] & all_roots[1]:
                self._cannot(automaton.complete, "it may give up at the same instant")
        if (
            self._initial() != "run"
            and automaton.runners
            and any(self._from_start(node.index) for node in automaton.runners)
        ):
            self._cannot(automaton.complete, "it ends at the instant at which runners start")

    def _cannot(self, node: int, why: str) -> None:
        plan = self.automaton.plan
        raise CannotSayError(plan.path(self.automaton.nodes[node].origin), why)

    def _both_ends(self) -> bool:
        automaton = self.automaton
        return bool(automaton.inputs[automaton.give_up] and automaton.inputs[automaton.complete])

    def _roots(self) -> dict[Signal, frozenset[Signal]]:
        """For each signal the outcomes (or the start) at whose instant it can come."""
        automaton = self.automaton
        signals = automaton.specified
        roots = {
            each: frozenset() if self._immediate(each) else frozenset([each]) for each in signals
        }
        changed = True
        while changed:
            changed = False
            for each in filter(self._immediate, signals):
                causes: Iterable[Signal] = automaton.inputs[each.node]
                if each.event is Event.STOPPED:
                    causes = self.stops.get(each.node, ())
                none: frozenset[Signal] = frozenset()
                new = none.union(*(roots[cause] for cause in causes))
                changed = changed or new != roots[each]
                roots[each] = new
        return roots

    def _immediate(self, signal: Signal) -> bool:
        kind = self.automaton.nodes[signal.node].kind
        return kind is NodeKind.JOIN or signal.event in (Event.STARTED, Event.STOPPED)

    def _together(self, inputs: tuple[Signal, ...], roots: dict[Signal, frozenset[Signal]]) -> bool:
        seen: set[Signal] = set()
        for each in inputs:
            if seen & roots[each]:
                return True
            seen |= roots[each]
        return False

    # -- elements ---------------------------------------------------------------------------

    def _put(self, depth: int, text: str) -> None:
        self.lines.append("  " * depth + text)

    def _open(self, depth: int, tag: str, **attributes: str) -> None:
        rows = "".join(f" {key}={quoteattr(value)}" for key, value in attributes.items())
        self._put(depth, f"<{tag}{rows}>")

    def _transition(self, depth: int, event: str, target: str) -> None:
        self._put(depth, f'<transition event="{event}" target="{target}"/>')

    def _stop(self, depth: int, event: str, target: str, stopped: str) -> None:
        self._open(depth, "transition", event=event, target=target)
        self._put(depth + 1, f'<raise event="{stopped}"/>')
        self._put(depth, "</transition>")

    def _end_region(self) -> None:
        automaton = self.automaton
        self._open(2, "state", id="end", initial="end_wait", **{"gpsfsm:kind": "end"})
        self._open(3, "state", id="end_wait")
        for kind, name in _ENDS:
            node = automaton.give_up if kind is NodeKind.GIVE_UP else automaton.complete
            for signal in dict.fromkeys(automaton.inputs[node]):
                if signal[0] not in automaton.starts:
                    self._transition(4, self._event(signal), name)
        self._put(3, "</state>")
        self._put(2, "</state>")

    def _runner(self, node: int) -> None:
        automaton, name = self.automaton, self.ids[node]
        element = automaton.plan.elements[automaton.nodes[node].origin]
        idle, active = f"{name}_idle", f"{name}_active"
        own = {"gpsfsm:kind": "runner", **own_of(element)}
        first = active if self._from_start(node) else idle
        self._open(2, "state", id=name, initial=first, **own)
        inputs = dict.fromkeys(automaton.inputs[node])
        self._open(3, "state", id=idle)
        for signal in inputs:
            if signal[0] not in automaton.starts and signal[0] != node:
                self._transition(4, self._event(signal), active)
        self._put(3, "</state>")
        self._open(3, "state", id=active)
        if Signal(node, Event.STARTED) in automaton.specified:
            self._put(4, f'<onentry><raise event="{name}.started"/></onentry>')
        for event in (Event.SUCCEEDED, Event.FAILED):
            again = any(signal == (node, event) for signal in inputs)
            self._transition(4, f"{name}.{_WORDS[event]}", active if again else idle)
        for signal in self.stops.get(node, ()):
            if signal[0] != node:  # else it has ended already
                target = active if signal in inputs else idle
                self._stop(4, self._event(signal), target, f"{name}.stopped")
        self._put(3, "</state>")
        self._put(2, "</state>")

    def _join(self, node: int, need: int) -> None:
        automaton, name = self.automaton, self.ids[node]
        inputs = automaton.inputs[node]
        if not self._counts_all(node):
            self._some(node, need)
            return
        # The state around it is what its transition to itself stays in: the domain of a transition
        # is a state or the whole statechart, never a <parallel>.
        every = f"{name}_all"
        self._open(2, "state", id=name, initial=every, **{"gpsfsm:kind": "join"})
        self._open(3, "parallel", id=every)
        for number, signal in enumerate(inputs):
            wait, come = f"{name}_in{number}_wait", f"{name}_in{number}_come"
            first = come if signal[0] in automaton.starts else wait
            self._open(4, "state", id=f"{name}_in{number}", initial=first)
            self._open(5, "state", id=wait)
            if first == wait:
                self._transition(6, self._event(signal), come)
            self._put(5, "</state>")
            self._put(5, f'<final id="{come}"/>')
            self._put(4, "</state>")
        if not self._from_start(node):  # else it fires once, and would at once again
            self._transition(4, f"done.state.{every}", every)  # it is armed again
        for signal in self.stops.get(node, ()):
            self._transition(4, self._event(signal), every)
        self._put(3, "</parallel>")
        self._put(2, "</state>")

    def _some(self, node: int, need: int) -> None:
        automaton, name = self.automaton, self.ids[node]
        inputs = automaton.inputs[node]
        first = sum(source in automaton.starts for source, _ in inputs)
        self._open(
            2, "state", id=name, initial=f"{name}_c{min(first, need)}", **{"gpsfsm:kind": "join"}
        )
        for count in range(need):
            self._open(3, "state", id=f"{name}_c{count}")
            for signal in inputs:
                if signal[0] not in automaton.starts:
                    self._transition(4, self._event(signal), f"{name}_c{count + 1}")
            self._put(3, "</state>")
        self._open(3, "final", id=f"{name}_c{need}")
        self._put(4, f'<onentry><raise event="{name}.succeeded"/></onentry>')
        self._put(3, "</final>")
        self._put(2, "</state>")
