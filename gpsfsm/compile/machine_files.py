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

from gpsfsm.compile.formats.elements import Elements
from gpsfsm.compile.machines import MALFORMED, Place, machine_of, shown, written
from gpsfsm.compile.units import MachinePlan, TreeMachine
from gpsfsm.errors import InputError
from gpsfsm.late import pattern
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.finding import Problem
from gpsfsm.model.graph import SCHEMA
from gpsfsm.model.plan import Location
from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import strict_loads
from gpsfsm.syntax import Parsed
from gpsfsm.syntax.source import DEFAULT_LIMITS, Limits, read_source
from gpsfsm.syntax.text import Lines, is_json, root_name

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator

    import networkx as nx

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.tree import TreeNode

_START = pattern(r'"id"\s*+:\s*+"__start__"')
_NAMESPACE = "http://graphml.graphdrawing.org/xmlns"
_MAX_NAME = 60
_BLANK = pattern(r"[ \t\r\n]*")
_ROWS = pattern(r'"nodes"[ \t\r\n]*:[ \t\r\n]*\[')
_TAGS = pattern(r"<(?:\w+:)?node\b[^>]*?\bid=(?:\"([^\"]*)\"|'([^']*)')[^>]*>")


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
        read = _from_json(text) if is_json(text) else _from_graphml(text, limits)
    except _TextError as fault:
        line, column = Lines(text).position(fault.offset)
        problem = Problem(MALFORMED, str(fault), Location(line, column, "/machine"), fault.hint)
        return Parsed(file, text, None, (problem,), machine=True)
    graph, places, skipped = read
    if graph.number_of_nodes() > limits.max_elements:
        message = f"the machine has more than {limits.max_elements:,} nodes"
        hint = "raise --max-elements if the machine is meant to be that large"
        problem = Problem("GP103", message, Location(1, 1, "/machine"), hint)
        return Parsed(file, text, None, (problem,), over_limit=True, machine=True)
    machine, problems = machine_of(graph, file=file, places=places, approximations=skipped)
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
    if is_json(text):
        return '"nodes"' in text and '"edges"' in text and not has_start(text)
    return root_name(text).rpartition(":")[2] == "graphml"


def has_start(text: str) -> bool:
    """True if there is a node ``__start__`` in JSON: LangGraph begins at this one."""
    return _START.search(text) is not None


class _TextError(InputError):
    """A text that is no machine, and where."""

    def __init__(self, message: str, offset: int = 0, hint: str = "") -> None:
        super().__init__(message)
        self.offset = offset
        self.hint = hint or "docs/machines.md describes the format"


def _skipped(construct: str, line: int, cause: Cause = Cause.NO_MEANING) -> Approximation:
    location = Location(line, 1, "/machine")
    return Approximation(Reading.SKIPPED, clip(construct, _MAX_NAME), location, cause)


# --- JSON ---------------------------------------------------------------------------------------


def _from_json(
    text: str,
) -> tuple[nx.MultiDiGraph[Any], dict[Hashable, Place], list[Approximation]]:
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
        data = {key: row[key] for key in row if key not in ("source", "target", "key")}
        data.setdefault("action", "trigger")
        graph.add_edge(*ends, number)
        graph.edges[(*ends, number)].update(data)
    return graph, places, _unread_keys(text, whole)


def _unread_keys(text: str, whole: dict[str, Any]) -> list[Approximation]:
    """The keys of the outermost object that are skipped."""
    if whole.get("directed", True) is not True:
        raise _TextError("the graph is not directed", text.find('"directed"'))
    lines = Lines(text)
    unread = (key for key in whole if not _is_read(key, whole))
    at = {key: lines.position(max(0, text.find(json.dumps(key))))[0] for key in unread}
    return [_skipped(f"key {key!r}", line) for key, line in at.items()]


def _is_read(key: str, whole: dict[str, Any]) -> bool:
    """True for a key of the outermost object that is read, or repeats what the nodes say."""
    if key in ("complete", "give_up"):
        nodes = whole["nodes"]
        return any(row.get("kind") == key and row.get("index") == whole[key] for row in nodes)
    return key in ("nodes", "edges", "version", "directed", "multigraph") or whole[key] == {}


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


_OF_GRAPHML: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "graphml": (("key", "graph", "desc"), ()),
    "key": (("desc",), ("id", "for", "attr.name", "attr.type")),
    "graph": (("node", "edge", "data", "desc"), ("id", "edgedefault")),
    "node": (("data", "desc"), ("id",)),
    "edge": (("data", "desc"), ("id", "source", "target", "directed")),
    "data": ((), ("key", "id")),
}
"""The elements and attributes in each element that are read."""


def _unread_graphml(text: str, limits: Limits) -> Iterator[Approximation]:
    """The parts of a GraphML text that networkx passes over.

    Raises _TextError for those that may change the runs.
    """
    elements = Elements(text, limits, _NAMESPACE)
    if not elements.nodes:
        raise _TextError(elements.problems[0].message)
    prefix = elements.nodes[0].tag.rpartition(":")[0]
    yield from elements.skipped
    names: set[tuple[object, ...]] = set()
    pending = [elements.nodes[0]]
    for node in pending:  # it grows
        tag = node.tag.rpartition(":")[2]
        inside, attributes = _OF_GRAPHML.get(tag, ((), ()))
        for each in node.attributes:
            if each.name not in attributes and not each.name.startswith(("xmlns", "xsi:")):
                yield _skipped(f"attribute {each.name} of <{tag}>", node.line)
        for child in elements.children(node):
            space, _, local = child.tag.rpartition(":")
            name = _identity(child, local)
            if space != prefix:
                yield _skipped(f"<{child.tag}>", child.line, Cause.NAMESPACE)
                continue
            if local not in inside:
                message = f"<{local}> in <{tag}> is not read, and may change the runs"
                raise _TextError(message, child.start, "remove it, or write it otherwise")
            if name and name in names:
                what = "graph" if local == "graph" else f"<{local}> of this name"
                raise _TextError(f"there is a second {what}", child.start, "remove one of them")
            names.add(name)
            pending.append(child)


def _identity(node: TreeNode, tag: str) -> tuple[object, ...]:
    """The name that no other element of a GraphML text may share; nothing where there is none."""
    if tag == "graph":
        return (tag,)
    if tag == "data":
        return tag, node.parent, node.text("key")
    name = node.text("id")  # networkx numbers the edges between two nodes
    return (tag, name, node.text("source"), node.text("target")) if name else ()


def _from_graphml(
    text: str, limits: Limits
) -> tuple[nx.Graph[Any], dict[Hashable, Place], list[Approximation]]:
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
    skipped = list(_unread_graphml(text, limits))
    try:
        graph = networkx.parse_graphml(text, node_type=str, force_multigraph=True)
    except Exception as error:  # it raises whatever a text makes it stumble over
        raise _TextError(f"networkx cannot read the text as GraphML: {error}") from None
    if graph.graph.pop("version", SCHEMA) != SCHEMA:
        raise _TextError(f"this gpsfsm reads version {SCHEMA} of machines")
    others = [each for each in graph.graph if each not in ("node_default", "edge_default")]
    skipped += (_skipped(f"attribute {each!r} of the graph", 1) for each in others)
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
    return graph, places, skipped


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
