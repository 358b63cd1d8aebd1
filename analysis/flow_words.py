"""How rules on data flow say why a value does not arrive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind

if TYPE_CHECKING:
    from gpsfsm.analysis.context import Context

__all__ = ["why_nothing_arrives"]


def why_nothing_arrives(context: Context, number: int) -> str:
    """Why nothing arrives at an instance that no other instance triggers directly."""
    automaton = context.automaton
    for signal in automaton.inputs[automaton.runner_node(number)]:
        found = automaton.nodes[signal.node]
        if found.kind is NodeKind.START:
            return "nothing comes before it that could hand over a value"
        if found.kind is NodeKind.JOIN:
            before = context.place(context.plan.elements[found.origin])
            return f"no value gets past the end of {before}"
    return "nothing hands over a value to it"
