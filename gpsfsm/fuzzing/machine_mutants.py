"""Mutants of machines: one connection or one need is changed, and the machine written as JSON.

    drop      leaves out a connection
    event     SUCCEEDED in the place of FAILED, and the other way round
    action    stops what was triggered, triggers what was stopped
    need      a join that needs one input more, or one less

What is no machine any more, such as one with a cycle of events at one instant, is no mutant.
"""

from __future__ import annotations

import json
from functools import partial
from math import isfinite
from typing import TYPE_CHECKING, Any

from gpsfsm.compile.machines import written
from gpsfsm.compile.plan_text import machine_in
from gpsfsm.fuzzing.operators import Mutation
from gpsfsm.model.automaton import NodeKind

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.compile import MachinePlan

_OTHER_EVENT = {"SUCCEEDED": "FAILED", "FAILED": "SUCCEEDED"}
_OTHER_ACTION = {"trigger": "stop", "stop": "trigger"}
_ENDS = (NodeKind.COMPLETE, NodeKind.GIVE_UP)


class MachineRows:
    """A machine as rows of JSON, node by node and connection by connection."""

    def __init__(self, plan: MachinePlan) -> None:
        names = [plan.path(node.origin).removeprefix("/machine/") for node in plan.nodes]
        self.nodes: list[dict[str, Any]] = []
        self.edges: list[dict[str, str]] = []
        for node in plan.nodes:
            row: dict[str, Any] = {"id": names[node.index], "kind": node.kind.value}
            if node.kind is NodeKind.JOIN:
                row["need"] = node.need
            elif node.kind is NodeKind.RUNNER:
                element = plan.elements[node.origin]
                row |= {"interface": element.interface, "provider": element.provider}
                row["parameters"] = {
                    name: written(value)
                    if isinstance(value, float) and not isfinite(value)
                    else value
                    for name, value in element.parameters.items()
                }
            self.nodes.append(row)
        for action, edges in (("trigger", plan.edges), ("stop", plan.stops)):
            for source, event, target in edges:
                ends = {"source": names[source], "target": names[target]}
                self.edges.append({**ends, "event": event.value, "action": action})

    def __str__(self) -> str:
        nodes, edges = (",\n  ".join(map(json.dumps, rows)) for rows in (self.nodes, self.edges))
        return f'{{"nodes": [\n  {nodes}],\n "edges": [\n  {edges}]}}\n'


def machine_mutations(plan: MachinePlan) -> Iterator[Mutation]:
    """All changes of a machine, by operator, then by its connections and joins."""
    rows = MachineRows(plan)
    edges = list(zip(rows.edges, (*plan.edges, *plan.stops), strict=True))

    def mutation(
        operator: str, node: int, summary: str, change: Callable[[MachineRows], None]
    ) -> Mutation:
        return Mutation(operator, plan.nodes[node].origin, summary, change)

    for place, (row, edge) in enumerate(edges):
        yield mutation("drop", edge.source, f"leaves out {_shown(row)}", partial(_drop, place))
    for place, (row, edge) in enumerate(edges):
        other = _OTHER_EVENT.get(row["event"])
        if other is not None and plan.nodes[edge.source].kind is NodeKind.RUNNER:
            change = partial(_set, place, "event", other)
            yield mutation("event", edge.source, f"makes {_shown(row)} one of {other}", change)
    for place, (row, edge) in enumerate(edges):
        if plan.nodes[edge.target].kind not in _ENDS:
            action = _OTHER_ACTION[row["action"]]
            change = partial(_set, place, "action", action)
            yield mutation("action", edge.source, f"makes {_shown(row)} one that {action}s", change)
    for node in plan.nodes:
        for need in (node.need - 1, node.need + 1) if node.kind is NodeKind.JOIN else ():
            if need >= 1:
                join = rows.nodes[node.index]["id"]
                summary = f"lets the join {join} need {need} in the place of {node.need}"
                yield mutation("need", node.index, summary, partial(_need, node.index, need))


def _drop(place: int, rows: MachineRows) -> None:
    del rows.edges[place]


def _set(place: int, key: str, value: str, rows: MachineRows) -> None:
    rows.edges[place][key] = value


def _need(node: int, need: int, rows: MachineRows) -> None:
    rows.nodes[node]["need"] = need


def _shown(row: dict[str, str]) -> str:
    stops = " stops" if row["action"] == "stop" else ""
    return f"{row['source']} {row['event']}{stops} → {row['target']}"


def is_impossible(text: str, file: str) -> bool:
    """True for the text of a mutant that is no machine any more."""
    parsed = machine_in(text, file=file)
    return parsed is not None and parsed.plan is None and not parsed.over_limit
