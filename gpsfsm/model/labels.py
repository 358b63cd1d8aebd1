"""How nodes and controls are labelled in pictures: printable, clipped, never more than text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton, Node
    from gpsfsm.model.plan import Element

__all__ = ["MAX_LABEL", "control_label", "node_label", "parameters_label"]

MAX_LABEL = 60
"""The longest label line, in code points."""
_LABEL_PARAMETERS = 2
_NOT_SHOWN = frozenset({"interface", "provider"})


def node_label(automaton: Automaton, node: Node) -> tuple[str, ...]:
    """The lines of a node's label: a runner's name, its first parameters and its line."""
    if node.kind is NodeKind.JOIN:
        inputs = len(automaton.inputs[node.index])
        if automaton.traits.gives_up:
            return (_join_label(node.need, inputs),)
        never = "never" if node.need > inputs else ""
        breaks = "2nd: ABORT" if node.index in automaton.traits.breaking and inputs > 1 else ""
        return tuple(filter(None, (f"{node.need} of {inputs}", never, breaks)))
    if node.kind is NodeKind.RUNNER:
        element = automaton.plan.elements[node.origin]
        name = element.interface.rpartition("/")[2] or element.interface or "(no interface)"
        parameters = parameters_label(element, MAX_LABEL // _LABEL_PARAMETERS, _LABEL_PARAMETERS)
        lines = [clip(name, MAX_LABEL), ", ".join(parameters), f"line {element.line}"]
        return tuple(line for line in lines if line)
    return (node.kind.value.replace("_", " "),)


def _join_label(need: int, inputs: int) -> str:
    if need == 1:
        return "any"
    return f"all {need}" if need >= inputs else f"{need} of {inputs}"


def parameters_label(element: Element, max_length: int, max_count: int | None = None) -> list[str]:
    """``name=value`` of the parameters and labels of a runner, clipped; "…" for what is left."""
    shown = [found for found in element.attributes if found.name not in _NOT_SHOWN]
    texts = [clip(f"{found.name}={found.text}", max_length) for found in shown[:max_count]]
    return [*texts, "…"] if len(texts) < len(shown) else texts


def control_label(element: Element) -> str:
    """What stands above a control: its type, its name and its line."""
    words = [element.words or "control"]
    name = element.text("name")
    if name:
        words.append(f"“{clip(name, MAX_LABEL)}”")
    words.append(f"(line {element.line})")
    return " ".join(words)
