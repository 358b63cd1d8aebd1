"""LangGraph: the JSON of ``graph.get_graph().to_json()`` → a machine.

A node is a runner; one that raises ends the graph, so its failure gives up. Conditional edges are a
choice among their targets, and several others start all of them.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.elements import problem
from gpsfsm.compile.machine_files import has_start, is_json
from gpsfsm.compile.machines import Place, machine_of
from gpsfsm.model.capability import CHOICE
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import strict_loads
from gpsfsm.syntax.text import Lines

if TYPE_CHECKING:
    from collections.abc import Hashable

    import networkx as nx

    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.syntax.source import Limits

_START, _END = "__start__", "__end__"


def recognises(text: str, file: str) -> bool:
    """True for JSON with a node ``__start__``."""
    del file
    return is_json(text) and has_start(text)


def read(text: str, file: str, limits: Limits) -> ReadMachine:
    """The machine of a graph, or what is wrong with it."""
    lines = Lines(text)

    def fault(offset: int, message: str, hint: str = "") -> ReadMachine:
        line, column = lines.position(offset)
        return None, (problem(message, Location(line, column, "/machine"), hint),)

    try:
        whole = strict_loads(text)
        nodes = [str(each["id"]) for each in whole["nodes"]]
        rows = [(str(each["source"]), str(each["target"]), each) for each in whole["edges"]]
    except json.JSONDecodeError as error:
        return fault(error.pos, f"the text is not valid JSON: {error.msg}", "correct it there")
    except (KeyError, TypeError, ValueError, RecursionError):
        return fault(0, "this is not a LangGraph graph", "write it with get_graph().to_json()")
    places: dict[Hashable, Place] = {name: _place(text, lines, name) for name in nodes}
    if len(nodes) > limits.max_elements:
        return fault(0, f"the graph has more than {limits.max_elements:,} nodes")
    for source, target, _ in rows:
        for name in (source, target):
            if name not in places:
                return fault(0, f"an edge names {clip(name, 100)!r}, which is not a node")
    if _START not in places or len(places) < len(nodes):
        return fault(0, f"every node has a name of its own, and one is {_START}")
    return machine_of(_graph(nodes, rows, places), file=file, places=places)


def _graph(
    nodes: list[str], rows: list[tuple[str, str, Any]], places: dict[Hashable, Place]
) -> nx.MultiDiGraph[Any]:
    import networkx

    graph: nx.MultiDiGraph[Any] = networkx.MultiDiGraph()
    for name in nodes:
        kind = {_START: "start", _END: "complete"}.get(name, "runner")
        graph.add_node(name, kind=kind, **({"interface": name} if kind == "runner" else {}))
    graph.add_node("give_up", kind="give_up")
    for name in nodes:
        if name == _END:
            continue
        always = [target for source, target, edge in rows if source == name and not _may(edge)]
        may = [target for source, target, edge in rows if source == name and _may(edge)]
        for target in always:
            graph.add_edge(name, target, event="SUCCEEDED")
        source, event = name, "SUCCEEDED"
        targets = list(dict.fromkeys(may))
        for target in targets[:-1]:
            choice = clip(f"{name}: {target}", 180)
            graph.add_node(choice, kind="runner", interface=CHOICE, parameters={"of": choice})
            places[choice] = places[name]
            graph.add_edge(source, choice, event=event)
            graph.add_edge(choice, target, event="SUCCEEDED")
            source, event = choice, "FAILED"
        if targets:
            graph.add_edge(source, targets[-1], event=event)
    for name in nodes:
        if name not in (_START, _END):
            graph.add_edge(name, "give_up", event="FAILED")
    return graph


def _may(edge: Any) -> bool:
    return isinstance(edge, dict) and bool(edge.get("conditional"))


def _place(text: str, lines: Lines, name: str) -> Place:
    """The place of a node: where its name stands behind ``id``."""
    match = re.search(rf'"id"\s*:\s*{re.escape(json.dumps(name))}', text)
    if match is None:
        return Place()
    line, column = lines.position(match.start())
    return Place(line, column, match.start(), match.end())


FORMAT = Format("langgraph", "graphs of LangGraph in JSON", recognises, read)
