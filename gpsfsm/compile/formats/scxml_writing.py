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

What SCXML would do in another order than semantics.md says is refused: stops, joins of a loop whose
inputs can come at one instant, and both ends at one instant.
"""

from __future__ import annotations

import json
import re
from math import isfinite
from typing import TYPE_CHECKING, Any, Final
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.formats import CannotSayError
from gpsfsm.compile.machines import written
from gpsfsm.model.automaton import PAPER, NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Element

NAMESPACE: Final = "http://www.w3.org/2005/07/scxml"
OWN_NAMESPACE: Final = "urn:gpsfsm"
_NO_NAME = re.compile(r"[^A-Za-z0-9_]+")
_WORDS: Final = {Event.STARTED: "started", Event.SUCCEEDED: "succeeded", Event.FAILED: "failed"}
_ENDS: Final = ((NodeKind.GIVE_UP, "gave_up"), (NodeKind.COMPLETE, "completed"))


def write_regions(automaton: Automaton) -> str:
    """The automaton as SCXML. Raises CannotSayError."""
    return _Writer(automaton).text()


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
    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self.lines: list[str] = []
        self.ids = ids_of(automaton)
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
        for _, _, target in automaton.stops:
            self._cannot(target, "a stop at the instant of a trigger has another order in SCXML")
        loops = not networkx.is_directed_acyclic_graph(automaton.graph)
        roots = self._roots() if loops or self._both_ends() else {}
        for node in automaton.nodes:
            inputs = automaton.inputs[node.index]
            if node.kind is not NodeKind.JOIN:
                continue
            if not inputs or node.need > len(inputs) or len(set(inputs)) < len(inputs):
                self._cannot(node.index, "this join can never fire, or has one input twice")
            if loops and node.need < len(inputs):
                self._cannot(node.index, "a join of some of its inputs in a machine with loops")
            if loops and self._together(inputs, roots):
                self._cannot(node.index, "in a loop two of its inputs can come at one instant")
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
        signals = {(edge[0], edge[1]) for edge in automaton.edges}
        roots: dict[Any, frozenset[Any]] = {
            each: frozenset() if self._immediate(each) else frozenset([each]) for each in signals
        }
        changed = True
        while changed:
            changed = False
            for each in signals:
                if self._immediate(each):
                    new = frozenset().union(
                        *(roots[(source, event)] for source, event in automaton.inputs[each[0]])
                    )
                    if new != roots[each]:
                        roots[each], changed = new, True
        return {Signal(*each): value for each, value in roots.items()}

    def _immediate(self, signal: tuple[int, Event]) -> bool:
        kind = self.automaton.nodes[signal[0]].kind
        return kind is NodeKind.JOIN or signal[1] is Event.STARTED

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
        if any(edge[:2] == (node, Event.STARTED) for edge in automaton.edges):
            self._put(4, f'<onentry><raise event="{name}.started"/></onentry>')
        for event in (Event.SUCCEEDED, Event.FAILED):
            again = any(signal == (node, event) for signal in inputs)
            self._transition(4, f"{name}.{_WORDS[event]}", active if again else idle)
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
        self._transition(4, f"done.state.{every}", every)  # it is armed again
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
