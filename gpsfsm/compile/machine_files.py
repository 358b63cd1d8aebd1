"""Files of machines: JSON and GraphML → a graph of networkx, with the places of its nodes.

JSON has ``nodes`` and ``edges``, each a list of objects with the attributes of docs/machines.md;
the name of a node is its ``id`` (a text, or the ``index`` that ``gpsfsm show --format json``
writes).
GraphML is what ``networkx.write_graphml`` writes; parameters, which it cannot nest, are a text with
a JSON object. Nothing in a file can make a reader open another one.
"""

from __future__ import annotations

import json
from math import isfinite
from typing import TYPE_CHECKING, Any

from gpsfsm.compile.machines import MALFORMED, Place, machine_of, shown, written
from gpsfsm.compile.units import MachinePlan, TreeMachine
from gpsfsm.errors import InputError
from gpsfsm.late import pattern
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.finding import Problem
from gpsfsm.model.graph import SCHEMA
from gpsfsm.model.plan import Location
from gpsfsm.strict_json import strict_loads
from gpsfsm.syntax import Parsed
from gpsfsm.syntax.source import DEFAULT_LIMITS, Limits, read_source
from gpsfsm.syntax.text import Lines

if TYPE_CHECKING:
    from collections.abc import Hashable

    import networkx as nx

    from gpsfsm.model.automaton import Automaton

_GRAPHML = pattern(
    r"\s*(?:<\?xml[^>]*\?>\s*|<!--.*?-->\s*"
    r"|<!DOCTYPE[^>\[]{0,1000}(?:\[[^\]]{0,1000}\]\s*)?>\s*)*<graphml\b"
)
"""The beginning of GraphML; a DOCTYPE is part of it, and is refused."""
_BLANK = pattern(r"[ \t\r\n]*")
_ROWS = pattern(r'"nodes"[ \t\r\n]*:[ \t\r\n]*\[')
_TAGS = pattern(r"<node\b[^>]*?\bid=(?:\"([^\"]*)\"|'([^']*)')[^>]*>")


def read_machine(
    data: str | bytes, *, file: str = "<text>", limits: Limits = DEFAULT_LIMITS
) -> Parsed | None:
    """Read a machine; what is wrong with it is a list of problems, never an exception.

    None for a text that is none: neither JSON with nodes and edges nor GraphML.
    """
    text = read_source(data, limits).text
    if text is None or not _is_machine(text):
        return None
    try:
        graph, places = _from_json(text) if text.lstrip()[:1] == "{" else _from_graphml(text)
    except _TextError as fault:
        line, column = Lines(text).position(fault.offset)
        problem = Problem(MALFORMED, str(fault), Location(line, column, "/machine"), fault.hint)
        return Parsed(file, text, None, (problem,), machine=True)
    if graph.number_of_nodes() > limits.max_elements:
        message = f"the machine has more than {limits.max_elements:,} nodes"
        hint = "raise --max-elements if the machine is meant to be that large"
        problem = Problem("GP103", message, Location(1, 1, "/machine"), hint)
        return Parsed(file, text, None, (problem,), over_limit=True, machine=True)
    machine, problems = machine_of(graph, file=file, places=places)
    return Parsed(file, text, machine, problems, machine=True)


def graph_from_json(text: str) -> nx.MultiDiGraph[Any]:
    """The graph of a machine's JSON, such as ``Automaton.to_json`` writes; it may be edited.

    Raises InputError for what is no such JSON. Whether the graph is a machine, ``gpsfsm.check``
    says.
    """
    return _from_json(text)[0]


def graph_to_json(graph: nx.Graph[Any]) -> str:
    """The JSON of a machine that is a graph, a line for each node and connection.

    Raises InputError for a graph that cannot be written so.
    """
    if not graph.is_directed():
        raise InputError("the graph is not directed; use a networkx.MultiDiGraph")
    nodes = [{**data, "id": name} for name, data in graph.nodes(data=True)]
    edges = [{**data, "source": s, "target": t} for s, t, data in graph.edges(data=True)]
    try:
        lists = [
            ",\n".join(json.dumps(row, allow_nan=False) for row in rows) for rows in (nodes, edges)
        ]
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"the graph cannot be written as JSON: {error}") from None
    text = f'{{"nodes": [\n{lists[0]}\n], "edges": [\n{lists[1]}\n]}}\n'
    return text.replace('"__start__"', '"\\u005f_start__"')  # which another tool's format has


def _is_machine(text: str) -> bool:
    if text.lstrip()[:1] == "{":
        return '"nodes"' in text and '"edges"' in text and '"__start__"' not in text
    return _GRAPHML.match(text) is not None


class _TextError(InputError):
    """A text that is no machine, and where."""

    def __init__(self, message: str, offset: int = 0, hint: str = "") -> None:
        super().__init__(message)
        self.offset = offset
        self.hint = hint or "docs/machines.md describes the format"


# --- JSON ---------------------------------------------------------------------------------------


def _from_json(text: str) -> tuple[nx.MultiDiGraph[Any], dict[Hashable, Place]]:
    import networkx

    try:
        whole = strict_loads(text)
    except json.JSONDecodeError as error:
        raise _TextError(
            f"the text is not valid JSON: {error.msg}", error.pos, "correct it there"
        ) from None
    except RecursionError:
        raise _TextError("the JSON is nested too deeply") from None
    except ValueError as error:
        raise _TextError(f"the text is not usable as JSON: {error}") from None
    if not isinstance(whole, dict):
        raise _TextError("a machine must be a JSON object")
    version = whole.get("version", SCHEMA)
    if version != SCHEMA:
        raise _TextError(f"the machine has version {shown(version)}; this gpsfsm reads {SCHEMA}")
    rows: dict[str, Any] = {}
    for key in ("nodes", "edges"):
        rows[key] = whole.get(key)
        if not isinstance(rows[key], list) or not all(isinstance(row, dict) for row in rows[key]):
            raise _TextError(f"{key!r} must be a list of objects")
    graph: nx.MultiDiGraph[Any] = networkx.MultiDiGraph(version=SCHEMA)
    places: dict[Hashable, Place] = {}
    spans = _spans(text)
    for number, row in enumerate(rows["nodes"]):
        name = _name(row.get("id", row.get("index")))
        place = spans[number] if number < len(spans) else Place()
        if name in places:
            raise _TextError(f"two nodes have the name {shown(name)}", place.start)
        places[name] = place
        graph.add_node(name, **{key: row[key] for key in row if key not in ("id", "index")})
    for number, row in enumerate(rows["edges"]):
        ends = _name(row.get("source")), _name(row.get("target"))
        for name in ends:
            if name not in places:
                raise _TextError(f"a connection names the node {shown(name)}, which does not exist")
        data = {"event": row.get("event"), "action": row.get("action", "trigger")}
        graph.add_edge(*ends, number, **data)
    return graph, places


def _name(value: object) -> str | int:
    if isinstance(value, str) or (isinstance(value, int) and not isinstance(value, bool)):
        return value
    raise _TextError(f"the name of a node must be a text or a whole number, not {shown(value)}")


def _spans(text: str) -> list[Place]:
    """The places of the objects in the outermost list ``nodes``."""
    decoder = json.JSONDecoder()
    lines = Lines(text)
    for begin in _ROWS.finditer(text):
        places: list[Place] = []
        at = begin.end()
        while True:
            blank = _BLANK.match(text, at)
            assert blank is not None
            at = blank.end()
            if text[at : at + 1] == ",":
                at += 1
            elif text[at : at + 1] == "{":
                _, end = decoder.raw_decode(text, at)
                line, column = lines.position(at)
                places.append(Place(line, column, at, min(end, at + lines.rest(at))))
                at = end
            else:
                return places
    return []


# --- GraphML ------------------------------------------------------------------------------------


def _from_graphml(text: str) -> tuple[nx.Graph[Any], dict[Hashable, Place]]:
    """The graph of a GraphML text: lxml looks for what is hostile, networkx reads it."""
    import networkx

    from gpsfsm.syntax.frontend import well_formedness_fault

    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        at = max(text.find("<!DOCTYPE"), text.find("<!ENTITY"))
        raise _TextError("the text has a DOCTYPE or defines entities", at, "remove it")
    fault = well_formedness_fault(text)
    if fault is not None:
        offset = Lines(text).offset(fault[0], fault[1])
        raise _TextError(fault[2].message, offset, fault[2].hint)
    try:
        graph = networkx.parse_graphml(text, node_type=str, force_multigraph=True)
    except Exception as error:  # it raises whatever a text makes it stumble over
        raise _TextError(f"networkx cannot read the text as GraphML: {error}") from None
    lines = Lines(text)
    places: dict[Hashable, Place] = {}
    for tag in _TAGS.finditer(text):
        line, column = lines.position(tag.start())
        length = min(tag.end() - tag.start(), lines.rest(tag.start()))
        places[tag[1] or tag[2]] = Place(line, column, tag.start(), tag.start() + length)
    for name, data in graph.nodes(data=True):
        parameters = data.get("parameters")
        if isinstance(parameters, str):
            try:
                data["parameters"] = strict_loads(parameters)
            except (ValueError, RecursionError):
                start = places.get(name, Place()).start
                message = f"the parameters of the node {shown(name)} are not a JSON object"
                raise _TextError(message, start) from None
    return graph, places


def automaton_to_graphml(automaton: Automaton) -> str:
    """The automaton as GraphML, which ``gpsfsm check`` and networkx read."""
    import networkx

    plan = automaton.plan
    graph: nx.MultiDiGraph[Any] = networkx.MultiDiGraph()
    for node in automaton.nodes:
        row: dict[str, Any] = {"kind": node.kind.value}
        if node.kind is NodeKind.JOIN:
            row["need"] = node.need
        elif node.kind is NodeKind.RUNNER:
            element = plan.elements[node.origin]
            row |= {"interface": element.interface, "provider": element.provider}
            parameters = {
                name: value if not isinstance(value, float) or isfinite(value) else written(value)
                for name, value in element.parameters.items()
            }
            row["parameters"] = json.dumps(parameters, ensure_ascii=False)
        graph.add_node(_graph_name(automaton, node.index), **row)
    for action, edges in (("trigger", automaton.edges), ("stop", automaton.stops)):
        for source, event, target in edges:
            ends = _graph_name(automaton, source), _graph_name(automaton, target)
            graph.add_edge(*ends, event=event.value, action=action)
    return "\n".join(networkx.generate_graphml(graph, named_key_ids=True)) + "\n"


def _graph_name(automaton: Automaton, node: int) -> str:
    """The name of a node in a file: that of the machine's author, else its number."""
    if isinstance(automaton.plan, MachinePlan) and not isinstance(automaton.plan, TreeMachine):
        return automaton.plan.paths[automaton.nodes[node].origin].removeprefix("/machine/")
    return f"n{node}"
