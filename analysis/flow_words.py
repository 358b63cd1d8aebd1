"""What rules on data flow share: which needs are told, and why a value does not arrive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.data_flow import DataFlow, Missing
from gpsfsm.model.automaton import NodeKind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.analysis.context import Context

__all__ = ["missing_inputs", "why_nothing_arrives"]


def missing_inputs(context: Context) -> Mapping[int, Sequence[Missing]]:
    """The needs that GP401 names, by runner: those that are always missing, else the others.

    A parameter that nothing can ever give is left to GP204.
    """
    flow: DataFlow = context.answers.get("data_flow") or DataFlow()
    groups: dict[int, list[Missing]] = {}
    for found in flow.missing:
        if found.kind == "input" or found.how == "sometimes":
            groups.setdefault(found.runner, []).append(found)
    return {
        number: [found for found in missing if found.how == "always"] or missing
        for number, missing in groups.items()
    }


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
