"""The automaton as a part of the view document: nodes, groups, edges, and where they are drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event
from gpsfsm.model.labels import node_label
from gpsfsm.picture.layout import layout
from gpsfsm.picture.polarity import failing_joins

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.model.automaton import Automaton, Node
    from gpsfsm.picture.cells import Cell

__all__ = ["automaton_data"]

_OUTCOMES = {
    NodeKind.RUNNER: (Event.SUCCEEDED, Event.FAILED),
    NodeKind.JOIN: (Event.SUCCEEDED,),
}


def automaton_data(automaton: Automaton) -> dict[str, Any]:
    """Everything that the page draws of an automaton.

    A node is at its index, so that the records of a run name it; the give-up of an engine that has
    none is there, but hidden.
    """
    places = layout(automaton)
    return {
        "nodes": [
            _node(automaton, node, list(box))
            for node, box in zip(automaton.nodes, places.nodes, strict=True)
        ],
        "groups": [
            {
                "element": group.element,
                "parent": group.parent,
                "label": group.label,
                "box": list(group.box),
                "depth": group.depth,
            }
            for group in places.groups
        ],
        "group_of": list(places.group_of),
        "edges": [
            {"source": source, "event": event.value, "target": target}
            for source, event, target in automaton.edges
        ]
        + _open_ends(automaton),
        "size": list(places.size),
        "cells": [
            [cell.flow.name.lower(), cell.parent, cell.element, cell.node, int(join)]
            for cell, join in _with_joins(places.cells)
        ],
        "failing": sorted(failing_joins(automaton)),
        **_quiet(automaton),
    }


def _with_joins(cells: Sequence[Cell]) -> Iterator[tuple[Cell, bool]]:
    """The cells by which the page lays the picture out again when a part of it is folded.

    Each with whether it stands among the joins of the cell around it.
    """
    joins = {join for cell in cells for join in cell.joins}
    return ((cell, number in joins) for number, cell in enumerate(cells))


def _quiet(automaton: Automaton) -> dict[str, Any]:
    """What some engines do not emit; nothing for the paper's semantics."""
    traits = automaton.traits
    found: dict[str, Any] = {"silent": sorted(traits.silent)} if traits.silent else {}
    if traits.refusals_hang:
        found["refusals_hang"] = True
    return found


def _node(automaton: Automaton, node: Node, box: list[float]) -> dict[str, Any]:
    own = node.kind in (NodeKind.RUNNER, NodeKind.JOIN)
    found: dict[str, Any] = {
        "kind": node.kind.value,
        "element": node.origin if own else -1,
        "label": list(node_label(automaton, node)),
        "need": node.need,
        "inputs": len(automaton.inputs[node.index]),
        "box": box,
    }
    if node.index == automaton.give_up and not automaton.traits.gives_up:
        found["hidden"] = True
    return found


def _open_ends(automaton: Automaton) -> list[dict[str, Any]]:
    """Outcomes that lead nowhere, and joins that are wired to themselves."""
    looping = automaton.traits.looping
    found: list[dict[str, Any]] = [
        {"source": join, "event": Event.SUCCEEDED.value, "target": join} for join in sorted(looping)
    ]
    for node in automaton.nodes:
        found += [
            {"source": node.index, "event": event.value, "target": -1}
            for event in _OUTCOMES.get(node.kind, ())
            if Signal(node.index, event) not in automaton.outputs and node.index not in looping
        ]
    return found
