"""YASMIN: state machines in XML, with concurrences and orthogonal regions → a machine.

https://github.com/uleroboticsgroup/yasmin. A machine of another file is one state, whose outcomes
are those of its transitions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.elements import Elements, place_of
from gpsfsm.compile.formats.flat import COMPLETED, GAVE_UP, flat
from gpsfsm.compile.formats.outcomes import State, machine_from
from gpsfsm.compile.machines import written
from gpsfsm.syntax.text import root_name

if TYPE_CHECKING:
    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax.source import Limits

_CONTAINERS = ("StateMachine", "Concurrence", "OrthogonalState", "Region")
_PARALLEL = ("Concurrence", "OrthogonalState")
_SKIPPED = (
    *("Param", "ParamRemap", "Key", "Remap", "Transition", "FinalOutcome", "OutcomeMap"),
    *("Description", "Default", "Text", "Item"),
)


def recognises(text: str, file: str) -> bool:
    """True for XML whose outermost element is a StateMachine."""
    del file
    return root_name(text).rpartition(":")[2] == "StateMachine"


def read(text: str, file: str, limits: Limits) -> ReadMachine:
    """The machine of a YASMIN file, or what is wrong with it."""
    elements = Elements(text, limits)
    if not elements.nodes:
        return None, tuple(elements.problems)
    root = elements.nodes[0]
    top = _state(elements, root)
    pending = [(root, top)]
    while pending:
        node, state = pending.pop()
        for child in elements.children(node):
            if child.tag in _CONTAINERS or child.tag == "State":
                inner = _state(elements, child)
                state.states.append(inner)
                if inner.container:
                    pending.append((child, inner))
            elif child.tag == "OutcomeMap":
                items = {
                    item.text("state"): item.text("outcome") for item in elements.children(child)
                }
                state.rules.append((child.text("outcome"), items))
            elif child.tag not in _SKIPPED:
                message = f"<{child.tag}> is not a YASMIN element that gpsfsm knows"
                elements.fault(child, message, "remove it, or report it")
    if elements.problems:
        return None, tuple(elements.problems)
    return machine_from(top, file)


def _state(elements: Elements, node: TreeNode) -> State:
    name = node.text("name") or node.tag
    children = elements.children(node)
    elsewhere = bool(node.text("file_name"))
    container = node.tag in _CONTAINERS and not elsewhere
    state = State(name, place_of(node), kind=_kind(node), container=container)
    for child in children:
        if child.tag == "Transition":
            state.transitions[child.text("from")] = child.text("to")
    if container:
        finals = [child.text("name") for child in children if child.tag == "FinalOutcome"]
        state.outcomes = tuple(dict.fromkeys((*node.text("outcomes").split(), *finals)))
        state.initial = node.text("start_state")
        state.parallel = node.tag in _PARALLEL
        state.default = node.text("default_outcome")
        if not any(child.tag in _CONTAINERS or child.tag == "State" for child in children):
            state.container = False  # nothing in it: a state like others
    else:
        for child in children:
            if child.tag == "Param" and child.text("name") and child.text("default_value"):
                state.parameters[child.text("name")] = _value(child)
    return state


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
    kind = node.text("class") or node.text("file_name") or node.tag
    return f"{place}/{kind}" if place else kind


def write(automaton: Automaton) -> str:
    """A state machine with a state for each runner, of the outcomes ``succeeded`` and ``failed``.

    A state's class is the runner's interface, and its parameters are those of the runner. Raises
    CannotSayError for automata in which several act at once.
    """
    first, states = flat(automaton)
    name = quoteattr(automaton.plan.file.rpartition("/")[2].partition(".")[0] or "plan")
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<StateMachine name={name} outcomes="{COMPLETED} {GAVE_UP}" start_state="{first}">',
    ]
    for each in states:
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
