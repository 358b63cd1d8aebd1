"""SCXML that gpsfsm wrote (``scxml_writing``) → its machine: regions that wait for each other.

A region of the kind ``runner`` is a runner; the events that its idle state waits for are what
triggers it. A region of the kind ``join`` is a join, the one of the kind ``end`` says what ends the
run.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from gpsfsm.compile.formats import CannotSayError
from gpsfsm.compile.formats.elements import Elements, place_of
from gpsfsm.compile.formats.scxml_writing import NAMESPACE, OWN_NAMESPACE, write_regions
from gpsfsm.compile.machines import Place, ReadMachine, machine_of
from gpsfsm.model.event import Event
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import strict_loads

if TYPE_CHECKING:
    from gpsfsm.compile.units import MachinePlan
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.source import Limits

_EVENTS = {each.value.lower(): each for each in Event}
_ENDS = {"completed": "complete", "gave_up": "give_up"}
_INPUT = re.compile(r"_in\d+$")
_BEGIN = "begin"
_OWN = ("gpsfsm:interface", "gpsfsm:provider", "gpsfsm:parameters")


def read_regions(elements: Elements, file: str, limits: Limits) -> ReadMachine:
    """The machine of a statechart of regions, or what is wrong with it."""
    reader = _Reader(elements)
    if elements.problems:
        return None, tuple(elements.problems)
    machine, problems = machine_of(
        reader.graph, file=file, places=reader.places, approximations=elements.skipped
    )
    if machine is not None:
        _compare(reader, machine, limits)
    return (None, tuple(elements.problems)) if elements.problems else (machine, problems)


def _compare(reader: _Reader, machine: MachinePlan, limits: Limits) -> None:
    """Report what a text says besides what gpsfsm writes of the machine that was read of it."""
    names = [machine.path(node.origin) for node in machine.automaton.nodes]
    table: dict[object, int] = {}
    try:
        text = write_regions(machine.automaton, [each.removeprefix("/machine/") for each in names])
    except CannotSayError:
        text = f'<scxml xmlns="{NAMESPACE}"/>'
    written = set(_forms(Elements(text, limits, NAMESPACE, OWN_NAMESPACE), table))
    forms = _forms(reader.elements, table)
    for node, form in zip(reader.elements.nodes, forms, strict=True):
        if form not in written and all(forms[child] in written for child in node.children):
            reader.fault(
                node, f"gpsfsm does not write this <{clip(node.tag, 60)}> as it stands here"
            )
            break


def _forms(elements: Elements, table: dict[object, int]) -> list[int]:
    """A number for each element; the same for equal ones, whatever the order of what is in them.

    The inputs of a join are numbered in any order, so their own names count as one.
    """
    inputs: list[str] = []
    for node in elements.nodes:
        own = node.text("id") if elements.nodes[node.parent].tag == "parallel" else ""
        inputs.append(own or (inputs[node.parent] if node.parent >= 0 else ""))
    forms = [0] * len(elements.nodes)
    for node in reversed(elements.nodes):
        name = inputs[node.index]
        same = (name, f"{name}_wait", f"{name}_come") if _INPUT.search(name) else ()
        rows = sorted(
            (each.name, each.text.removeprefix(name) if each.text in same else each.text)
            for each in node.attributes
            if each.name not in _OWN
        )
        children = sorted(forms[child] for child in node.children)
        key = (node.tag, tuple(rows), tuple(children))
        forms[node.index] = table.setdefault(key, len(table) + 1)
    return forms


def runner_of(elements: Elements, node: TreeNode, name: str) -> dict[str, Any]:
    """The runner that a state is, for a node of a graph: as gpsfsm has written it, else by name."""
    parameters: Any = {}
    written = node.attribute("gpsfsm:parameters")
    if written is not None:
        try:
            parameters = strict_loads(str(written.value))
        except (ValueError, RecursionError):
            parameters = None
    if not isinstance(parameters, dict):
        elements.fault(node, "gpsfsm:parameters is not a JSON object", "correct it")
        parameters = {}
    interface = node.text("gpsfsm:interface") or name
    provider = node.text("gpsfsm:provider") or None
    return {
        "kind": "runner", "interface": interface, "provider": provider, "parameters": parameters
    }  # fmt: skip


class _Reader:
    def __init__(self, elements: Elements) -> None:
        import networkx

        self.elements = elements
        self.graph: Any = networkx.MultiDiGraph()
        self.places: dict[Any, Place] = {}
        root = elements.nodes[0]
        self._node(_BEGIN, root, kind="start")
        for kind in _ENDS.values():
            self._node(kind, root, kind=kind)
        runs = [each for each in elements.children(root) if each.tag == "parallel"]
        if len(runs) != 1:
            self.fault(root, "there is not exactly one <parallel> right inside <scxml>")
            return
        regions = elements.children(runs[0])
        if not regions or regions[0].text("gpsfsm:kind") != "end":
            self.fault(runs[0], "the region that ends the run is not the first one")
        for region in regions:
            self._declare(region)
        if elements.problems:
            return
        for region in regions:
            kind = region.text("gpsfsm:kind")
            if kind == "runner":
                self._runner(region)
            elif kind == "join":
                self._join(region)
            else:
                for each in self._within(region, "transition"):
                    self._connect(each, _ENDS.get(each.text("target"), ""))
        end = _ENDS.get(root.text("initial"))
        if end:
            self._edge(_BEGIN, Event.SUCCEEDED, end)

    def fault(self, node: TreeNode, message: str) -> None:
        """Something is not as gpsfsm writes it."""
        hint = "write the file again, or leave out gpsfsm:form to read it as ordinary SCXML"
        self.elements.fault(node, message, hint)

    def _node(self, name: str, node: TreeNode, **data: Any) -> None:
        if name in self.graph:
            self.fault(node, f"there are two regions {name!r}")
        self.graph.add_node(name, **data)
        self.places[name] = place_of(node)

    def _within(self, node: TreeNode, tag: str) -> list[TreeNode]:
        """The elements of this tag right inside an element or a child of it."""
        rows: list[TreeNode] = []
        for child in self.elements.children(node):
            rows += [child] if child.tag == tag else []
            rows += [each for each in self.elements.children(child) if each.tag == tag]
        return rows

    # -- regions ----------------------------------------------------------------------------

    def _declare(self, region: TreeNode) -> None:
        name, kind = region.text("id"), region.text("gpsfsm:kind")
        children = self.elements.children(region)
        if kind == "runner":
            self._node(name, region, **runner_of(self.elements, region, name))
        elif kind == "join":
            inside = self.elements.children(children[0]) if self._all(region) else children
            need = sum(child.tag == "state" for child in inside)
            if not need:
                self.fault(region, "there is no state in this join")
            self._node(name, region, kind="join", need=max(need, 1))
        elif kind != "end":
            self.fault(region, "this region has no gpsfsm:kind of runner, join or end")

    def _runner(self, region: TreeNode) -> None:
        name = region.text("id")
        active = f"{name}_active"
        if region.text("initial") == active:
            self._edge(_BEGIN, Event.SUCCEEDED, name)
        own = (f"{name}.succeeded", f"{name}.failed")
        for each in self._within(region, "transition"):
            inside = self.elements.nodes[each.parent].text("id") == active
            if inside and each.text("event") not in own:
                self._connect(each, name, "stop")
            elif each.text("target") == active:
                self._connect(each, name)

    def _join(self, region: TreeNode) -> None:
        name = region.text("id")
        if self._all(region):
            every = self.elements.children(region)[0]
            for flag in self.elements.children(every):
                if flag.tag == "transition" and flag.text("event") != f"done.state.{name}_all":
                    self._connect(flag, name, "stop")
                if flag.tag != "state":
                    continue
                if flag.text("initial") == f"{flag.text('id')}_come":
                    self._edge(_BEGIN, Event.SUCCEEDED, name)
                for each in self._within(flag, "transition"):
                    self._connect(each, name)
            return
        for _ in range(self._count(region)):
            self._edge(_BEGIN, Event.SUCCEEDED, name)
        counts = [each for each in self.elements.children(region) if each.tag == "state"]
        for each in self._within(region, "transition"):
            if each.parent == counts[-1].index:
                self._connect(each, name)

    def _all(self, region: TreeNode) -> bool:
        """True for a join of all its inputs, which is a parallel."""
        return any(child.tag == "parallel" for child in self.elements.children(region)[:1])

    def _count(self, region: TreeNode) -> int:
        """The inputs of a chain that have arrived at the start."""
        names = [each.text("id") for each in self.elements.children(region)]
        initial = region.text("initial")
        return names.index(initial) if initial in names else 0

    # -- connections ------------------------------------------------------------------------

    def _connect(self, transition: TreeNode, target: str, action: str = "trigger") -> None:
        for text in transition.text("event").split():
            source, _, word = text.rpartition(".")
            event = _EVENTS.get(word)
            if text.startswith("done.state."):
                source, event = word.removesuffix("_all"), Event.SUCCEEDED
            if source not in self.graph or event is None or not target:
                message = f"no region has the event {text!r}" if target else "no end has this name"
                self.fault(transition, message)
            else:
                self._edge(source, event, target, action)

    def _edge(self, source: str, event: Event, target: str, action: str = "trigger") -> None:
        self.graph.add_edge(source, target, event=event.value, action=action)
