"""Automata as JSON."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from gpsfsm.model.automaton import Automaton, Node, NodeKind

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Traits

__all__ = ["automaton_to_json"]


def automaton_to_json(automaton: Automaton) -> str:
    """Write the automaton as JSON: ``nodes`` and ``edges``, in order of creation, one per line.

    For an engine there is also ``engine``, which tells its traits.
    """
    nodes = ",\n".join("  " + json.dumps(_node(automaton, node)) for node in automaton.nodes)
    edges = ",\n".join(
        "  " + json.dumps({"source": source, "event": event.value, "target": target})
        for source, event, target in automaton.edges
    )
    traits = "" if automaton.traits.gives_up else f',\n "engine": {_engine(automaton.traits)}'
    return (
        f'{{\n "nodes": [\n{nodes}\n ],\n "edges": [\n{edges}\n ],\n'
        f' "complete": {automaton.complete},\n "give_up": {automaton.give_up}{traits}\n}}\n'
    )


def _engine(traits: Traits) -> str:
    """What an engine does otherwise at run time; the lists hold indices of nodes."""
    return json.dumps(
        {
            "name": traits.engine,
            "silent": sorted(traits.silent),
            "breaking": sorted(traits.breaking),
            "looping": sorted(traits.looping),
        }
    )


def _node(automaton: Automaton, node: Node) -> dict[str, Any]:
    found: dict[str, Any] = {
        "index": node.index,
        "kind": node.kind.value,
        "name": automaton.name(node.index),
        "origin": automaton.plan.path(node.origin),
        "need": node.need,
    }
    if node.kind is NodeKind.RUNNER:
        element = automaton.plan.elements[node.origin]
        found |= {
            "line": element.line,
            "column": element.column,
            "interface": element.interface,
            "provider": element.provider,
            "parameters": {name: _json_value(value) for name, value in element.parameters.items()},
        }
    return found


def _json_value(value: object) -> object:
    """JSON has no infinity and no NaN: they are written as text."""
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
