"""YASMIN: state machines in XML, with concurrences and orthogonal regions → a machine.

https://github.com/uleroboticsgroup/yasmin; read as its factory of version 6.1 reads it. The classes
of states are not in a file: a state ends with an outcome of its transitions, or with another one. A
machine of another file is one state. ``gpsfsm:complete="true"`` at the outermost element says that
the transitions of each state are all its outcomes; gpsfsm writes it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.formats import CannotSayError, Format
from gpsfsm.compile.formats.elements import Elements, at, place_of
from gpsfsm.compile.formats.flat import COMPLETED, GAVE_UP, flat
from gpsfsm.compile.formats.outcomes import machine_from
from gpsfsm.compile.formats.scxml_writing import OWN_NAMESPACE
from gpsfsm.compile.formats.states import State
from gpsfsm.compile.machines import Place, written
from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip
from gpsfsm.syntax.text import root_name

if TYPE_CHECKING:
    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.source import Limits

_PARALLEL = ("Concurrence", "OrthogonalState")
_STATES = ("State", "StateMachine", *_PARALLEL)
_DATA = ("Param", "ParamRemap", "Key", "Default", "Remap", "Transition", "Description", "Text")
_MAPS = ("OutcomeMap", "Outcome")
_INSIDE: dict[str, tuple[str, ...]] = {
    "State": _DATA,
    "StateMachine": (*_STATES, *_DATA, "FinalOutcome"),
    "Region": (*_STATES, *_DATA, "FinalOutcome"),
    "Concurrence": (*_STATES, *_DATA, *_MAPS, "FinalOutcome"),
    "OrthogonalState": ("Region", *_DATA, *_MAPS, "FinalOutcome"),
    "OutcomeMap": ("Item",),
    "Outcome": ("Transition",),
}
"""The elements that are read in an element. YASMIN passes over most others in silence."""
_NAMED = "name description x y"
_MACHINE = f"{_NAMED} outcomes start_state file_path file_name package type instance_id"
_OF_MAPS = {"OutcomeMap": "outcome", "Outcome": "to", "Item": "state outcome"}
_ATTRIBUTES = {
    **dict.fromkeys(("StateMachine", "Region"), _MACHINE),
    **dict.fromkeys(_PARALLEL, f"{_NAMED} default_outcome outcomes"),
    **dict.fromkeys(
        ("Param", "Key", "Default"), f"{_NAMED} type key value default_type default_value"
    ),
    **dict.fromkeys(("Remap", "ParamRemap"), "old new"),
    **_OF_MAPS,
    "State": f"{_NAMED} class module package type",
    "Transition": "from to to_instance",
    "FinalOutcome": f"{_NAMED} instance_id",
    "Text": f"{_NAMED} content",
}
_REQUIRED = {**dict.fromkeys((*_STATES, "Region"), "name"), **_OF_MAPS, "Transition": "from to"}
_COMPLETE = "gpsfsm:complete"


def recognises(text: str, file: str) -> bool:
    """True for XML whose outermost element is a StateMachine."""
    del file
    return root_name(text).rpartition(":")[2] == "StateMachine"


def read(text: str, file: str, limits: Limits) -> ReadMachine:
    """The machine of a YASMIN file, or what is wrong with it."""
    elements = Elements(text, limits, own=OWN_NAMESPACE)
    if not elements.nodes:
        return None, tuple(elements.problems)
    reader = _Reader(elements)
    top = reader.machine()
    if elements.problems:
        return None, tuple(elements.problems)
    return machine_from(top, file, reader.skipped)


class _Reader:
    def __init__(self, elements: Elements) -> None:
        self.elements = elements
        self.root = elements.nodes[0]
        self.complete = self.root.text(_COMPLETE) == "true"
        self.skipped = [*elements.skipped]

    def machine(self) -> State:
        """The outermost machine, with all that is in it."""
        top = self._state(self.root, None)
        if not top.container:
            message = "this machine is in another file, which is not read"
            self.elements.fault(self.root, message, "check that file")
        pending = [(self.root, top)]
        while pending:
            node, state = pending.pop()
            inner: list[tuple[TreeNode, State]] = []
            for child in self._check_element(node, node.tag):
                if child.tag in (*_STATES, "Region"):
                    inner.append((child, self._state(child, state)))
            state.states = [each for _, each in inner]
            if state.container:
                self._check_container(node, state, inner)
            pending += reversed(inner)
        return top

    def _skip(self, node: TreeNode, construct: str, cause: Cause = Cause.NO_MEANING) -> None:
        construct = clip(construct, 60)
        self.skipped.append(Approximation(Reading.SKIPPED, construct, at(node), cause))

    def _check_element(self, node: TreeNode, tag: str) -> list[TreeNode]:
        """Report what is not read of an element; the elements in it that are read."""
        read = _ATTRIBUTES.get(tag, "").split()
        for each in node.attributes:
            own = each.name.startswith("xmlns") or (each.name == _COMPLETE and node is self.root)
            if each.name not in read and not own:
                self._skip(node, f"attribute {each.name} of <{node.tag}>")
        missing = [each for each in _REQUIRED.get(tag, "").split() if not node.text(each)]
        if missing and node is not self.root:
            message = f"<{node.tag}> has no attribute '{missing[0]}'"
            self.elements.fault(node, message, "YASMIN requires it: add it")
        kept: list[TreeNode] = []
        for child in self.elements.children(node):
            if child.tag in _INSIDE.get(tag, ()) and not (
                _is_elsewhere(node) and child.tag not in _DATA
            ):
                kept.append(child)
                if child.tag not in (*_STATES, "Region"):
                    self._check_element(child, "Item" if tag == "Outcome" else child.tag)
            elif _is_elsewhere(node):
                self._skip(child, f"<{child.tag}> of a machine in another file")
            else:
                message = f"<{child.tag}> in <{node.tag}> is not read, and may change the runs"
                self.elements.fault(child, message, "remove it, or report it")
        return kept

    def _state(self, node: TreeNode, around: State | None) -> State:
        name, container = node.text("name") or node.tag, node.tag != "State"
        container = container and not _is_elsewhere(node)
        state = State(name, place_of(node), kind=_kind(node), container=container)
        for child in self.elements.children(node):
            ignored = around is None or (around.parallel and (container or not self.complete))
            if child.tag == "Transition" and ignored:
                self._skip(child, "<Transition> of what is not in a StateMachine")
            elif child.tag == "Transition":
                if child.text("from") in state.transitions:
                    self._skip(child, f"<Transition> from '{child.text('from')}' before this one")
                state.transitions[child.text("from")] = child.text("to")
            elif child.tag == "Param" and child.text("name") and child.text("default_value"):
                state.parameters[child.text("name")] = _value(child)
        if container:
            state.outcomes = tuple(dict.fromkeys(node.text("outcomes").split()))
            state.initial, state.by_name = node.text("start_state"), True
            state.parameters = {}
            if node.tag in _PARALLEL:
                state.parallel = state.exclusive = True
                self._read_maps(node, state)
        elif not self.complete or _is_elsewhere(node):
            state.open = Cause.ELSEWHERE if _is_elsewhere(node) else Cause.UNDECLARED
        return state

    def _read_maps(self, node: TreeNode, state: State) -> None:
        """The outcomes of a concurrence: YASMIN takes them from the maps, not from the list."""
        maps: dict[str, dict[str, str]] = {}
        for child in self.elements.children(node):
            if child.tag in _MAPS:
                outcome = child.text(_OF_MAPS[child.tag])
                if maps.pop(outcome, None) is not None:
                    self._skip(child, f"outcome map of '{outcome}' before this one")
                items = self.elements.children(child)
                maps[outcome] = {each.text("state"): each.text("outcome") for each in items}
                if not items:
                    message = f"the outcome map of '{outcome}' has no <Item>"
                    self.elements.fault(child, message, "add the outcomes that lead to it")
        state.rules, state.default = list(maps.items()), node.text("default_outcome")
        named = {*state.outcomes}
        state.outcomes = tuple(each for each in dict.fromkeys((*maps, state.default)) if each)
        if named and named != {*state.outcomes}:
            self._skip(node, f"attribute outcomes of <{node.tag}>")

    def _check_container(
        self, node: TreeNode, state: State, inner: list[tuple[TreeNode, State]]
    ) -> None:
        """Report what YASMIN refuses in a container when it loads or validates it."""
        for child in self.elements.children(node):
            name = child.text("name")
            if child.tag == "FinalOutcome" and not state.parallel and name not in state.outcomes:
                self._skip(child, f"<FinalOutcome> '{name}', which is not in outcomes")
        reached = state.parallel or bool(self.elements.problems) or _reached(state)
        for child, each in inner:
            name = each.name
            spoken = [items[name] for _, items in state.rules if name in items]
            if not each.container:
                each.outcomes = tuple(dict.fromkeys((*each.transitions, *spoken)))
            for outcome in (*spoken, *each.transitions) if each.container else ():
                if outcome not in each.outcomes:
                    message = f"'{name}' never ends with '{outcome}'"
                    self.elements.fault(child, message, "correct the name of the outcome")
            if not state.parallel and name in state.outcomes:
                message = f"the state '{name}' has the name of an outcome of its machine"
                self.elements.fault(child, message, "YASMIN refuses that: rename one of them")
            elif reached is not True and name not in reached:
                message = f"no transition leads to the state '{name}', from the first state on"
                hint = "YASMIN refuses that from 6.1.0 on: add the transition, or remove the state"
                self.elements.fault(child, message, hint)


def _reached(state: State) -> set[str]:
    """The states of a machine that transitions lead to; all, if it does not begin with any."""
    states = {each.name: each for each in state.states}
    pending = [state.initial or next(iter(states), "")]
    if pending[0] not in states:
        return {*states}
    reached = {*pending}
    for name in pending:  # grows while it is read
        for target in states[name].transitions.values():
            if target in states and target not in reached:
                reached.add(target)
                pending.append(target)
    return reached


def _is_elsewhere(node: TreeNode) -> bool:
    """True for a machine that YASMIN loads from another file, whatever is in the element."""
    by_name = node.text("file_name") and node.text("package")
    return node.tag in ("StateMachine", "Region") and bool(node.text("file_path") or by_name)


def _value(node: TreeNode) -> str | float | bool:
    """The value of a Param, in its type if it can be read so."""
    text, kind = node.text("default_value"), node.text("default_type")
    try:
        if kind in ("int", "float"):
            return int(text) if kind == "int" else float(text)
    except (ValueError, OverflowError):
        return text
    return text.strip().lower() == "true" if kind == "bool" else text


def _kind(node: TreeNode) -> str:
    """The interface of a state: its class, with the module or package that it is from."""
    place = node.text("module") or node.text("package")
    kind = node.text("class") or node.text("file_name") or node.text("file_path") or node.tag
    return f"{place}/{kind}" if place else kind


def write(automaton: Automaton) -> str:
    """A state machine with a state for each runner, of the outcomes ``succeeded`` and ``failed``.

    A state's class is the runner's interface, and its parameters are those of the runner. Raises
    CannotSayError for automata in which several act at once.
    """
    first, states = flat(automaton)
    if first in (COMPLETED, GAVE_UP):
        start = automaton.plan.path(automaton.nodes[automaton.starts[0]].origin)
        raise CannotSayError(start, "the machine ends before a state runs")
    name = quoteattr(automaton.plan.file.rpartition("/")[2].partition(".")[0] or "plan")
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<StateMachine name={name} outcomes="{COMPLETED} {GAVE_UP}" start_state="{first}"',
        f'    xmlns:gpsfsm="{OWN_NAMESPACE}" {_COMPLETE}="true">',
    ]
    targets = {each.name: {"s": each.succeeded, "f": each.failed} for each in states}
    inner = [State(name, Place(), transitions=row) for name, row in targets.items()]
    reached = _reached(State("", Place(), states=inner, initial=first))
    for each in (each for each in states if each.name in reached):  # YASMIN refuses others
        module, _, kind = each.element.interface.rpartition("/")
        where = f" module={quoteattr(module)}" if module else ""
        lines.append(f'  <State name="{each.name}" type="py"{where} class={quoteattr(kind)}>')
        lines += (
            f'    <Param name={quoteattr(key)} default_type="{type(value).__name__}" '
            f"default_value={quoteattr(written(value))}/>"
            for key, value in each.element.parameters.items()
        )
        lines += (
            f'    <Transition from="{outcome}" to="{target}"/>'
            for outcome, target in (("succeeded", each.succeeded), ("failed", each.failed))
        )
        lines.append("  </State>")
    lines += (f'  <FinalOutcome name="{name}"/>' for name in (COMPLETED, GAVE_UP))
    return "\n".join((*lines, "</StateMachine>")) + "\n"


FORMAT = Format("yasmin", "YASMIN state machines in XML", recognises, read, write)
