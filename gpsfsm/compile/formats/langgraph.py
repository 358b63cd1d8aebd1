"""LangGraph: the JSON of ``graph.get_graph().to_json()`` → a machine.

A node is a runner; one that raises ends the graph, so its failure gives up. The JSON is a drawing:
it leaves out the targets of ``Command``, ``Send`` and of conditions that do not declare them, and
does not tell a join from single edges. So after each node, the drawing may be followed or not; then
any nodes may run together, or none and the graph ends. Exact is what a plain edge says that cannot
belong to a join; an edge to ``__end__`` may stand for a condition whose targets are not drawn. A
join with a node that nothing is drawn to may be drawn as a single edge, and so may an edge into a
subgraph, within it (``i:a``) or out of it, in place of its own start and end.

    a → b      a SUCCEEDED → "a: as drawn";  it SUCCEEDED → b, FAILED → "another node follows"

Where several nodes run at once, the first that ends stops the others: they may run again next.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.elements import problem
from gpsfsm.compile.machine_files import has_start
from gpsfsm.compile.machines import Place, machine_of, mark
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.plan import Location
from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import strict_loads
from gpsfsm.syntax.text import Lines, is_json

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator

    import networkx as nx

    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.syntax.source import Limits

_START, _END = "__start__", "__end__"
_KEYS = {
    "graph": {"nodes", "edges"},
    "node": {"id", "type", "data", "metadata"},
    "data": {"id", "name"},
    "edge": {"source", "target", "data", "conditional"},
}
"""The keys that are read, or known to say nothing about the runs."""
_OF_KEYS = {
    ("metadata", "defer"): (Reading.OVER, Cause.ORDER),
    ("metadata", "__interrupt"): (Reading.DEFAULTED, Cause.RESUMED),
}


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
    if not all(isinstance(edge.get("conditional", False), bool) for _, _, edge in rows):
        return fault(0, "'conditional' of an edge must be true or false", "correct it")
    places: dict[Hashable, Place] = {name: _place(text, lines, name) for name in nodes}
    if len(nodes) > limits.max_elements:
        return fault(0, f"the graph has more than {limits.max_elements:,} nodes")
    for source, target, _ in rows:
        for name in (source, target):
            if name not in places:
                at = max(0, text.rfind(json.dumps(name)))
                return fault(at, f"an edge names {clip(name, 100)!r}, which is not a node")
    if _START not in places or len(places) < len(nodes):
        return fault(0, f"every node has a name of its own, and one is {_START}")
    unread = tuple(_unread(whole, places))
    graph = _Drawing(nodes, rows, places).graph
    unread += tuple(_limit(rows, places))
    return machine_of(graph, file=file, places=places, approximations=unread)


class _Drawing:
    """The graph of what the drawing says, and of what it may leave out."""

    def __init__(
        self, nodes: list[str], rows: list[tuple[str, str, Any]], places: dict[Hashable, Place]
    ) -> None:
        import networkx

        self.graph: nx.MultiDiGraph[Any] = networkx.MultiDiGraph()
        self.rows, self.places = rows, places
        inner = [name for name in nodes if _is_inner_end(name)]
        runners = [name for name in nodes if name not in (_START, _END, *inner)]
        targets = {target for _, target, _ in rows}
        self.complete = all(name in targets for name in runners)
        self.graph.add_node(_START, kind="start")
        self.graph.add_nodes_from((name, {"kind": "runner", "interface": name}) for name in runners)
        self.graph.add_nodes_from((name, {"kind": "runner", "interface": TICK}) for name in inner)
        self.graph.add_node(_END, kind="complete")
        give_up = self._node("give_up", _START, kind="give_up")
        self.step = self._node("the first of several ends", _START, kind="join", need=1)
        self.another = self._choice("another node follows", _START, exact=False)
        self._lead(self.another, "SUCCEEDED", runners or [_END])
        self._lead(self.another, "FAILED", [_END])
        for name in runners:
            self._lead(name, "FAILED", [give_up])
        for name in (*runners, *inner):
            self._lead(name, "SUCCEEDED", [self.step])
            self.graph.add_edge(self.step, name, event="SUCCEEDED", action="stop")
        for name in (_START, *runners, *inner):
            self._follow(name)

    def _node(self, name: str, of: str, **data: Any) -> str:
        unique, number = clip(name, 180), 2
        while unique in self.graph:
            unique, number = f"{clip(name, 180)}#{number}", number + 1
        self.graph.add_node(unique, **data)
        self.places[unique] = self.places[of]
        return unique

    def _choice(self, name: str, of: str, *, exact: bool) -> str:
        parameters = {"of": clip(name, 200)}
        choice = self._node(name, of, kind="runner", interface=CHOICE, parameters=parameters)
        if not exact:
            where = _location(self.places[of], of)
            mark(self.graph, choice, Approximation(Reading.OVER, of, where, Cause.DRAWING))
        return choice

    def _lead(self, source: str, event: str, targets: list[str]) -> None:
        for target in targets:
            self.graph.add_edge(source, target, event=event)

    def _follow(self, name: str) -> None:
        """Add what is drawn behind a node, or else any others."""
        mine = [(target, _may(edge)) for source, target, edge in self.rows if source == name]
        always = list(dict.fromkeys(target for target, may in mine if not may))
        may = list(dict.fromkeys(target for target, may in mine if may))
        joined = {
            source
            for source, target, edge in self.rows
            if always == [target] and _START not in (name, source) and not _may(edge)
        }
        exact = not may and always != [_END] and len(always) == 1 and len(joined) < 2
        exact = exact and (self.complete or name == _START) and ":" not in name + always[0]
        choice = self._choice(f"{name}: as drawn", name, exact=exact)
        self._lead(name, "SUCCEEDED", [choice])
        self._lead(choice, "FAILED", [self.another])
        for event in ("SUCCEEDED", "FAILED"):  # then a new round begins
            self.graph.add_edge(choice, self.step, event=event, action="stop")
        event, nodes = "SUCCEEDED", [target for target in always if target != _END]
        if nodes or not may:
            self._lead(choice, event, [*nodes, *(each for each in may if each != _END)] or [_END])
            return
        for target in may[:-1]:
            another = self._choice(f"{name}: {target}", name, exact=False)
            self._lead(choice, event, [another])
            self._lead(another, "SUCCEEDED", [target])
            choice, event = another, "FAILED"
        self._lead(choice, event, may[-1:])


def _unread(whole: Any, places: dict[Hashable, Place]) -> Iterator[Approximation]:
    """The keys that are read only in part, or not at all."""
    rows = [("graph", whole, "")]
    for node in whole["nodes"]:
        name = str(node["id"])
        rows += (("node", node, name), ("data", node.get("data"), name))
        rows.append(("metadata", node.get("metadata"), name))
    rows += (("edge", edge, str(edge["source"])) for edge in whole["edges"])
    for kind, row, name in rows:
        for key in row if isinstance(row, dict) else ():
            if key not in _KEYS.get(kind, ()):
                reading, cause = _OF_KEYS.get((kind, key), (Reading.SKIPPED, Cause.NO_MEANING))
                where = _location(places.get(name, Place()), name)
                yield Approximation(reading, clip(f"{kind} {key!r}", 60), where, cause)


def _limit(
    rows: list[tuple[str, str, Any]], places: dict[Hashable, Place]
) -> Iterator[Approximation]:
    """The limit on the steps of a run, which is not in the drawing, if that has a loop."""
    import networkx

    drawn: nx.DiGraph[str] = networkx.DiGraph((source, target) for source, target, _ in rows)
    for part in networkx.strongly_connected_components(drawn):
        name = min(part)
        if len(part) > 1 or drawn.has_edge(name, name):
            where = _location(places[name], name)
            yield Approximation(Reading.DEFAULTED, "recursion_limit", where, Cause.NO_LIMIT)
            return


def _location(place: Place, name: str) -> Location:
    return Location(place.line, place.column, clip(f"/machine/{name}", 200))


def _is_inner_end(name: str) -> bool:
    """True for the start or end of a subgraph: nothing runs there."""
    return ":" in name and name.rpartition(":")[2] in (_START, _END)


def _may(edge: Any) -> bool:
    return bool(edge.get("conditional"))


def _place(text: str, lines: Lines, name: str) -> Place:
    """The place of a node: where its name stands behind ``id``."""
    match = re.search(rf'"id"\s*:\s*{re.escape(json.dumps(name))}', text)
    if match is None:
        return Place()
    line, column = lines.position(match.start())
    return Place(line, column, match.start(), match.end())


FORMAT = Format("langgraph", "graphs of LangGraph in JSON", recognises, read)
