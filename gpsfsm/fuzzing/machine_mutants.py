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
from gpsfsm.fuzzing.operators import Mutation
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.compile import MachinePlan

_OTHER = {"SUCCEEDED": "FAILED", "FAILED": "SUCCEEDED"}
_OTHER_ACTION = {"trigger": "stop", "stop": "trigger"}
_ENDS = (NodeKind.COMPLETE, NodeKind.GIVE_UP)


class MachineRows:
    """A machine as rows of JSON, node by node and connection by connection."""

    def __init__(self, plan: MachinePlan) -> None:
        self.nodes: list[dict[str, Any]] = []
        self.edges: list[dict[str, str]] = []
        for node in plan.nodes:
            row: dict[str, Any] = {"id": self._name(plan, node.index), "kind": node.kind.value}
            if node.kind is NodeKind.JOIN:
                row["need"] = node.need
            elif node.kind is NodeKind.RUNNER:
                element = plan.elements[node.origin]
                row |= {"interface": element.interface, "provider": element.provider}
                row["parameters"] = {
                    name: value
                    if not isinstance(value, float) or isfinite(value)
                    else written(value)
                    for name, value in element.parameters.items()
                }
            self.nodes.append(row)
        for action, edges in (("trigger", plan.edges), ("stop", plan.stops)):
            for source, event, target in edges:
                ends = {"source": self._name(plan, source), "target": self._name(plan, target)}
                self.edges.append({**ends, "event": event.value, "action": action})

    @staticmethod
    def _name(plan: MachinePlan, node: int) -> str:
        return plan.path(plan.nodes[node].origin).removeprefix("/machine/")

    def __str__(self) -> str:
        nodes, edges = (",\n  ".join(map(json.dumps, rows)) for rows in (self.nodes, self.edges))
        return f'{{"nodes": [\n  {nodes}],\n "edges": [\n  {edges}]}}\n'


def machine_mutations(plan: MachinePlan) -> Iterator[Mutation]:
    """All changes of a machine, in the order of the operators, then of its parts."""
    rows = MachineRows(plan)
    edges = [*plan.edges, *plan.stops]
    for place, row in enumerate(rows.edges):
        yield _mutation(plan, edges[place][0], "drop", f"leaves out {_shown(row)}",
                        partial(_drop, place))  # fmt: skip
    for place, row in enumerate(rows.edges):
        if row["event"] in _OTHER and plan.nodes[edges[place][0]].kind is NodeKind.RUNNER:
            event = _OTHER[row["event"]]
            summary = f"makes {_shown(row)} one of {event}"
            yield _mutation(plan, edges[place][0], "event", summary,
                            partial(_set, place, "event", event))  # fmt: skip
    for place, row in enumerate(rows.edges):
        if plan.nodes[edges[place][2]].kind not in _ENDS:
            action = _OTHER_ACTION[row["action"]]
            summary = f"makes {_shown(row)} one that {action}s"
            yield _mutation(plan, edges[place][0], "action", summary,
                            partial(_set, place, "action", action))  # fmt: skip
    for node in plan.nodes:
        for need in (node.need - 1, node.need + 1) if node.kind is NodeKind.JOIN else ():
            if need >= 1:
                name = rows.nodes[node.index]["id"]
                summary = f"lets the join {name} need {need} in the place of {node.need}"
                yield _mutation(plan, node.index, "need", summary, partial(_need, node.index, need))


def _mutation(
    plan: MachinePlan, node: int, operator: str, summary: str, change: Callable[[Any], None]
) -> Mutation:
    return Mutation(operator, plan.nodes[node].origin, summary, change)


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
    from gpsfsm.compile.plan_text import machine_in

    parsed = machine_in(text, file=file)
    return parsed is not None and parsed.plan is None and not parsed.over_limit


assert set(_OTHER) == {Event.SUCCEEDED, Event.FAILED}
