"""The automaton as a part of the view document: nodes, groups, edges, and where they are drawn."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.labels import is_machine
from gpsfsm.picture.cells import failing_joins
from gpsfsm.picture.layered import layered
from gpsfsm.picture.layout import draws_stops, flat_layout, layout
from gpsfsm.picture.routing import Router, dangling
from gpsfsm.picture.shapes import node_lines

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from gpsfsm.model.automaton import Automaton, Node
    from gpsfsm.picture.layout import Layout
    from gpsfsm.picture.routing import Point
    from gpsfsm.picture.shapes import Box

_OUTCOMES = {
    NodeKind.RUNNER: (Event.SUCCEEDED, Event.FAILED),
    NodeKind.JOIN: (Event.SUCCEEDED,),
}
_OPEN_STUB = 41.6
_OPEN_END = (10.0, 10.0)
_LOOP = 16.0
_MOST_LAYERED = 400
"""Nodes that are laid out by their edges, too; larger graphs are no picture anybody reads."""
_MOST_NUMBERS = 20_000
"""Numbers in its routes: some 100 kB. A long row with failures would have several times as many."""
_STRAIGHT_AREA = 0.5
"""A corner that spans no more than that with its neighbours is none."""
_STRAIGHT = 3.0
"""How much straighter than others the line of a success is to be."""

_Edge = tuple[int, Event, int]


def automaton_data(automaton: Automaton, never: Collection[Signal] = ()) -> dict[str, Any]:
    """Everything that the page draws of an automaton.

    A node is at its index, so that the records of a run name it; the give-up of an engine that has
    none is there, but hidden. The page places nothing by itself: it moves these boxes and lines
    together where groups are folded. ``never`` are signals that no scenario emits
    (``never_emitted``): neither their edges nor joins of which no input can come are drawn.
    """
    if is_machine(automaton):
        return _machine_data(automaton)
    places = layout(automaton, parts=True)
    failing = failing_joins(automaton)
    edges: list[_Edge] = [
        edge
        for edge in (*automaton.edges, *_open_ends(automaton))
        if Signal(edge[0], edge[1]) not in never
    ]
    routes = _routes(places, failing, edges)
    data: dict[str, Any] = {
        "nodes": [
            _node(automaton, node, box, never)
            for node, box in zip(automaton.nodes, places.nodes, strict=True)
        ],
        "groups": [
            {
                "element": group.element,
                "parent": group.parent,
                "label": group.label,
                "box": _short(group.box),
                "depth": group.depth,
                "spine": _number(group.spine),
            }
            for group in places.groups
        ],
        "group_of": list(places.group_of),
        "edges": [
            {"source": source, "event": event.value, "target": target, "route": _flat(route)}
            for (source, event, target), route in zip(edges, routes, strict=True)
        ],
        "size": _short(places.size),
        "failing": sorted(failing),
        **_quiet(automaton),
    }
    if len(automaton.nodes) <= _MOST_LAYERED:
        graph = _layered(automaton, places, failing, edges)
        if sum(map(len, graph["routes"])) <= _MOST_NUMBERS:
            data["layered"] = graph
    return data


def _machine_data(automaton: Automaton) -> dict[str, Any]:
    """The same of a machine, which has no groups and one layout, that of its connections.

    Connections that stop their target hide all others where they are more: in a reactive tree each
    condition stops each action. They have no route then, and are drawn for what is selected.
    """
    drawn = draws_stops(automaton)
    flat = flat_layout(automaton, stops=drawn)
    edges: list[dict[str, Any]] = []
    for edge in flat.edges:
        row: dict[str, Any] = {
            "source": edge.source,
            "event": edge.event.value,
            "target": edge.target,
            "route": _flat(edge.route),
        }
        if edge.stops:
            row["stops"] = True
        if edge.named is not None:
            row["named"] = _short(edge.named)
        edges.append(row)
    edges += [
        {"source": source, "event": event.value, "target": target, "route": [], "stops": True}
        for source, event, target in (() if drawn else automaton.stops)
    ]
    places = flat.layout
    nodes = []
    for node, box in zip(automaton.nodes, places.nodes, strict=True):
        data = _node(automaton, node, box)
        nodes.append(data | ({"element": node.origin} if box.width else {"hidden": True}))
    return {
        "nodes": nodes,
        "groups": [],
        "group_of": list(places.group_of),
        "edges": edges,
        "size": _short(places.size),
        "failing": sorted(failing_joins(automaton)),
        "flat": True,
    }


def _routes(
    places: Layout, failing: frozenset[int], edges: Iterable[_Edge]
) -> list[Sequence[Point]]:
    """The corners per edge; none of an edge to what is not drawn."""
    router = Router(places, failing)
    corners: list[Sequence[Point]] = []
    for source, event, target in edges:
        if target < 0:
            corners.append(dangling(places, source, event, _OPEN_STUB))
        elif source == target:
            box = places.nodes[source]
            x, y = box.right, box.middle[1]
            corners.append([(x, y + 6), (x + _LOOP, y + 6), (x + _LOOP, y - 6), (x + 2, y - 6)])
        else:
            corners.append(
                router.route(source, event, target) if places.nodes[target].width else ()
            )
    return corners


def _layered(
    automaton: Automaton, places: Layout, failing: frozenset[int], edges: Iterable[_Edge]
) -> dict[str, Any]:
    """The other layout, which follows the edges and not the plan: corners of boxes, and routes.

    Open ends are nodes there, which are not in the document.
    """
    drawn = [node for node, box in enumerate(places.nodes) if box.width]
    number = {node: place for place, node in enumerate(drawn)}
    sizes = [(places.nodes[node].width, places.nodes[node].height) for node in drawn]
    pairs: list[tuple[int, int]] = []
    weights: list[float] = []
    bundles: list[bool] = []
    for source, event, target in edges:
        if target >= 0 and target not in number:
            continue
        if target < 0:
            sizes.append(_OPEN_END)
        pairs.append((number[source], number[target] if target >= 0 else len(sizes) - 1))
        weights.append(_STRAIGHT if event is Event.SUCCEEDED else 1.0)
        bundles.append(source in failing or event is not Event.SUCCEEDED)
    circles = [number[node.index] for node in automaton.nodes if node.kind is NodeKind.JOIN]
    graph = layered(sizes, pairs, weights=weights, bundles=bundles, circles=circles)
    routes = iter(graph.routes)
    corners: list[list[float]] = [[] for _ in places.nodes]
    for node, place in number.items():
        corners[node] = _short(graph.boxes[place][:2])
    return {
        "corners": corners,
        "routes": [
            _flat(_bent(next(routes))) if end < 0 or end in number else [] for _, _, end in edges
        ],
        "size": _short(graph.size),
    }


def _bent(route: Sequence[Point]) -> list[Point]:
    """A route without the corners at which it goes straight on.

    >>> _bent([(0, 0), (0, 5), (0, 9), (4, 9)])
    [(0, 0), (0, 9), (4, 9)]
    """
    kept = list(route[:1])
    for here, after in pairwise(route[1:]):
        x, y = kept[-1]
        if abs((here[0] - x) * (after[1] - y) - (here[1] - y) * (after[0] - x)) > _STRAIGHT_AREA:
            kept.append(here)
    return [*kept, *route[-1:]] if len(route) > 1 else kept


def _flat(route: Iterable[Point]) -> list[float]:
    return _short(value for point in route for value in point)


def _short(values: Iterable[float]) -> list[float]:
    return [_number(value) for value in values]


def _number(value: float) -> float:
    """To a tenth; whole numbers are written without one."""
    rounded = round(value, 1)
    return int(rounded) if rounded.is_integer() else rounded


def _quiet(automaton: Automaton) -> dict[str, Any]:
    """The events that some engines do not emit; nothing for the paper's semantics."""
    traits = automaton.traits
    data: dict[str, Any] = {"silent": sorted(traits.silent)} if traits.silent else {}
    if traits.refusals_hang:
        data["refusals_hang"] = True
    return data


def _node(
    automaton: Automaton, node: Node, box: Box, never: Collection[Signal] = ()
) -> dict[str, Any]:
    own = node.kind in (NodeKind.RUNNER, NodeKind.JOIN)
    data: dict[str, Any] = {
        "kind": node.kind.value,
        "element": node.origin if own else -1,
        "label": list(node_lines(automaton, node)),
        "need": node.need,
        "inputs": len(automaton.inputs[node.index]),
        "box": _short(box),
    }
    inputs = automaton.inputs[node.index]
    dead = node.kind is NodeKind.JOIN and bool(inputs) and all(each in never for each in inputs)
    if dead or (node.index == automaton.give_up and not automaton.traits.gives_up):
        data["hidden"] = True
    return data


_FAILURES = frozenset({Outcome.FAILED, Outcome.NO_START})


def never_emitted(
    automaton: Automaton, allowed: Sequence[Collection[Outcome]]
) -> frozenset[Signal]:
    """The failures of instances that cannot fail, and what joins would make of them.

    ``allowed`` are the outcomes per instance that assumptions and capabilities leave. Of a join so
    many inputs must be able to come as it needs:

        three speeches in a parallel_all, which never fail → no FAILED of theirs, and so
        the join that collects one failure of them never fires
    """
    nodes, outputs = automaton.nodes, automaton.outputs
    spare = [len(automaton.inputs[node.index]) - (node.need or 1) for node in nodes]
    pending = [
        Signal(automaton.runner_node(number), Event.FAILED)
        for number, outcomes in enumerate(allowed)
        if _FAILURES.isdisjoint(outcomes)
    ]
    never = set(pending)
    while pending:
        for target in outputs.get(pending.pop(), ()):
            spare[target] -= 1
            signal = Signal(target, Event.SUCCEEDED)
            if nodes[target].kind is NodeKind.JOIN and spare[target] < 0 and signal not in never:
                never.add(signal)
                pending.append(signal)
    return frozenset(never)


def _open_ends(automaton: Automaton) -> list[_Edge]:
    """Outcomes that lead nowhere, and joins that are wired to themselves."""
    looping = automaton.traits.looping
    edges: list[_Edge] = [(join, Event.SUCCEEDED, join) for join in sorted(looping)]
    for node in automaton.nodes:
        edges += [
            (node.index, event, -1)
            for event in _OUTCOMES.get(node.kind, ())
            if Signal(node.index, event) not in automaton.outputs and node.index not in looping
        ]
    return edges
