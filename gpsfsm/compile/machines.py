"""Machines that are handed in: any graph of networkx → an automaton, or what is wrong with it.

The names of the nodes are the user's. In the automaton they become numbers, as the rest of gpsfsm
has them (a start node, the runners, everything else), and elements of a plan that has no controls:
so a machine has places, paths, parameters and bindings as a plan has them.

    a {kind: start} → b {kind: runner, interface: Go};  b FAILED → b;  b SUCCEEDED → end {complete}
    nodes      0 start   1 runner   2 complete   3 give_up (added: nothing leads to it)
    elements   /machine   /machine/b   /machine/a   /machine/end   /machine/give_up
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.compile.instants import immediate_causes
from gpsfsm.compile.units import MachinePlan
from gpsfsm.model.automaton import Action, Automaton, Edge, Node, NodeKind
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Problem
from gpsfsm.model.graph import edge_number
from gpsfsm.model.plan import (
    NOT_PARAMETERS,
    Attribute,
    Element,
    Kind,
    Location,
    Value,
    sharing_lines,
)
from gpsfsm.model.precision import Approximation, Cause, Reading
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import networkx as nx


MALFORMED = "GP117"
_LONGEST_NAME = 200
_OF_RUNNERS = frozenset({"kind", "interface", "provider", "parameters"})
_OWN = frozenset({"element", "name", "origin", "line", "column"})
"""The attributes that the nodes of our own graphs have besides."""
_OF_EDGES = frozenset({"event", "action"})
_MARKS: Any = object()
"""The attribute with the marks of a node: no file can write it."""
_ENDS = (NodeKind.COMPLETE, NodeKind.GIVE_UP)


class Place(NamedTuple):
    """The place of a node in a file: line and column from 1, offsets in code points.

    Without one, as in a graph that is handed in, line and column are 0.
    """

    line: int = 0
    column: int = 0
    start: int = 0
    end: int = 0


ReadMachine = tuple[MachinePlan | None, tuple[Problem, ...]]
"""A machine that was read, None if it is not well-formed, and what is wrong with it."""


def machine_of(
    graph: nx.Graph[Any],
    *,
    file: str = "<graph>",
    places: Mapping[Hashable, Place] | None = None,
    approximations: Iterable[Approximation] = (),
) -> ReadMachine:
    """The machine of a graph of networkx (docs/machines.md), or what is wrong with the graph.

    ``places``: the places of the nodes in the file that the graph comes from. ``approximations``:
    what its reader says of other constructs than those of the nodes that it has marked (``mark``).
    """
    return _Reader(graph, file, places or {}, tuple(approximations)).read()


def mark(graph: nx.Graph[Any], name: Hashable, *approximations: Approximation) -> None:
    """Mark a node of a graph: runs through it may be none of the file, because of these."""
    data = graph.nodes[name]
    data[_MARKS] = (*data.get(_MARKS, ()), *approximations)


class _Reader:
    def __init__(
        self,
        graph: nx.Graph[Any],
        file: str,
        places: Mapping[Hashable, Place],
        approximations: tuple[Approximation, ...],
    ) -> None:
        self.graph = graph
        self.approximations = approximations
        self.file = file
        self.places = places
        self.whole = Place(1, 1) if places else Place()
        self.problems: list[Problem] = []
        self.kinds: dict[Hashable, NodeKind] = {}
        self.elements: dict[Hashable, tuple[Attribute, ...]] = {}
        self.needs: dict[Hashable, int] = {}

    def read(self) -> ReadMachine:
        """Read nodes, connections and what they make together."""
        if not self.graph.is_directed():
            self.fault(None, "the graph is not directed", "use a networkx.MultiDiGraph")
            return (None, tuple(self.problems))
        names: dict[str, Hashable] = {}
        for name, data in self.graph.nodes(data=True):
            twin = names.setdefault(str(name), name)
            if twin != name or type(twin) is not type(name):
                self.fault(name, "has the same name as another node", "give each its own name")
            self._node(name, data)
        edges, stops = self._connections()
        if NodeKind.START not in self.kinds.values():
            self.fault(None, "there is no start node", 'add a node with kind "start"')
        if self.problems:
            return (None, tuple(self.problems))
        plan = self._plan(edges, stops)
        self._immediate_cycles(plan.automaton)
        if self.problems:
            return (None, tuple(self.problems))
        return plan, ()

    def fault(self, name: Hashable | None, message: str, hint: str) -> None:
        """Something is wrong with a node, or with the machine as a whole."""
        place = self.whole if name is None else self.places.get(name, Place())
        path = "/machine" if name is None else f"/machine/{name}"
        text = message if name is None else f"the node {shown(name)} {message}"
        location = Location(place.line, place.column, clip(path, _LONGEST_NAME))
        self.problems.append(Problem(MALFORMED, text, location, hint, place.end - place.start))

    # -- nodes ------------------------------------------------------------------------------

    def _skip(self, name: Hashable, what: str, attributes: Iterable[object]) -> None:
        """Attributes without a meaning are skipped, and reported."""
        place = self.places.get(name, Place())
        location = Location(place.line, place.column, clip(f"/machine/{name}", _LONGEST_NAME))
        self.approximations += tuple(
            Approximation(Reading.SKIPPED, f"{what} {shown(each)}", location, Cause.NO_MEANING)
            for each in attributes
            if each is not _MARKS
        )

    def _node(self, name: Hashable, data: Mapping[str, Any]) -> None:
        runs, joins = (data.get("kind") == each for each in (NodeKind.RUNNER, NodeKind.JOIN))
        read = {"kind"} | (_OF_RUNNERS if runs else set()) | (_OWN if "element" in data else set())
        read |= {"need"} if joins or data.get("need") == 0 else set()
        self._skip(name, "attribute", (each for each in data if each not in read))
        if not str(name) or len(str(name)) > _LONGEST_NAME:
            self.fault(name, "has no usable name", f"name it in 1 to {_LONGEST_NAME} characters")
        try:
            kind = self.kinds[name] = NodeKind(str(data.get("kind")))
        except ValueError:
            kinds = ", ".join(each.value for each in NodeKind)
            message = f"has no kind, or an unknown one: {shown(data.get('kind'))}"
            self.fault(name, message, f"give it a kind: {kinds}")
            return
        if kind in _ENDS and sum(each is kind for each in self.kinds.values()) > 1:
            self.fault(name, f"is a second {kind.value} node", "connect all events to one of them")
        if kind is NodeKind.JOIN:
            need = data.get("need")
            if isinstance(need, bool) or not isinstance(need, int) or need < 1:
                message = f"is a join with an invalid need: {shown(need)}"
                self.fault(name, message, "write a need that is a whole number of at least 1")
                need = 1
            self.needs[name] = need
        elif kind is NodeKind.RUNNER:
            self.elements[name] = self._runner(name, data)

    def _runner(self, name: Hashable, data: Mapping[str, Any]) -> tuple[Attribute, ...]:
        element = data.get("element")
        if isinstance(element, Element):
            return element.attributes
        interface, provider = data.get("interface"), data.get("provider")
        if not isinstance(interface, str) or not interface:
            self.fault(name, "is a runner without an interface", "give it an interface")
            return ()
        provider = interface if provider is None else provider
        parameters = data.get("parameters")
        parameters = {} if parameters is None else parameters
        if not isinstance(provider, str) or not isinstance(parameters, Mapping):
            self.fault(
                name,
                "has a provider or parameters of a wrong type",
                "write the provider as a text and each parameter as a text, number or Boolean",
            )
            return ()
        place = self.places.get(name, Place())
        own = [("interface", interface), ("provider", provider), ("name", str(name))]
        attributes = [Attribute(key, text, text, place.line, place.column) for key, text in own]
        for key, value in parameters.items():
            if not isinstance(key, str) or key in NOT_PARAMETERS:
                self.fault(name, f"has the parameter {shown(key)}", "choose another name for it")
            elif not isinstance(value, bool | int | float | str):
                message = f"has the parameter {shown(key)} with a value of a wrong type"
                self.fault(name, message, "write a text, a number or a Boolean")
            else:
                text = written(value)
                attributes.append(Attribute(key, text, value, place.line, place.column))
        return tuple(attributes)

    # -- connections ------------------------------------------------------------------------

    def _connections(self) -> tuple[list[tuple[Any, Event, Any]], list[tuple[Any, Event, Any]]]:
        edges: list[tuple[Any, Event, Any]] = []
        stops: list[tuple[Any, Event, Any]] = []
        for source, target, data in self._in_order():
            kinds = self.kinds.get(source), self.kinds.get(target)
            unread = (each for each in data if each not in _OF_EDGES)
            self._skip(source, "attribute of a connection", unread)
            try:
                event, action = (
                    Event(str(data.get("event"))),
                    Action(str(data.get("action", "trigger"))),
                )
            except ValueError:
                event_text, action_text = data.get("event"), data.get("action", "trigger")
                self.fault(
                    source,
                    f"has a connection to {shown(target)} with an invalid event or action: "
                    f"{shown(event_text)}, {shown(action_text)}",
                    "use the events STARTED, STOPPED, SUCCEEDED and FAILED, and the actions "
                    "trigger and stop",
                )
                continue
            if None in kinds:
                continue
            wrong = self._wrong(kinds[0], event, action, kinds[1])
            if wrong:
                self.fault(source, f"has a connection to {shown(target)}, but {wrong}", "remove it")
                continue
            (stops if action is Action.STOP else edges).append((source, event, target))
        return edges, stops

    def _in_order(self) -> list[tuple[Any, Any, Mapping[str, Any]]]:
        """The connections: as networkx lists them, those of an automaton in order of creation.

        The key that networkx gives to a connection that is added to a copy of one is 0 or little
        more.
        """
        graph: Any = self.graph
        if not graph.is_multigraph() or "version" not in graph.graph:
            return list(graph.edges(data=True))
        rows = list(graph.edges(keys=True, data=True))
        rows.sort(key=lambda row: edge_number(row[2]))
        return [(source, target, data) for source, target, _, data in rows]

    def _wrong(
        self, source: NodeKind | None, event: Event, action: Action, target: NodeKind | None
    ) -> str:
        """The reason why a connection makes no sense, or nothing."""
        if source in _ENDS:
            return f"nothing may follow {source}"
        if source is not NodeKind.RUNNER and event is not Event.SUCCEEDED:
            return f"a {source} node emits only SUCCEEDED"
        if target is NodeKind.START:
            return "nothing may lead to a start node"
        if action is Action.STOP and target in _ENDS:
            return "only runners and joins can be stopped"
        return ""

    def _immediate_cycles(self, automaton: Automaton) -> None:
        """Events that cause themselves at one instant (semantics, 9.1)."""
        import networkx

        causes = immediate_causes(automaton)
        plan = automaton.plan
        for members in networkx.strongly_connected_components(causes):
            if len(members) == 1 and not causes.has_edge(*members, *members):
                continue
            nodes = sorted({vertex // 4 for vertex in members})
            names = ", ".join(plan.path(automaton.nodes[each].origin) for each in nodes)
            message = (
                f"these nodes cause each other's events at the same instant: {clip(names, 300)}"
            )
            location = plan.location(automaton.nodes[nodes[0]].origin)
            hint = "let each loop pass through SUCCEEDED or FAILED of a runner"
            self.problems.append(Problem(MALFORMED, message, location, hint))

    # -- the automaton ----------------------------------------------------------------------

    def _plan(
        self, edges: Sequence[tuple[Any, Event, Any]], stops: Sequence[tuple[Any, Event, Any]]
    ) -> MachinePlan:
        starts = [name for name, kind in self.kinds.items() if kind is NodeKind.START]
        runners = [name for name, kind in self.kinds.items() if kind is NodeKind.RUNNER]
        first = [starts[0], *runners]
        rest = [name for name in self.kinds if name not in set(first)]
        order: list[tuple[Any, NodeKind]] = [(name, self.kinds[name]) for name in (*first, *rest)]
        order += [(object(), end) for end in _ENDS if end not in self.kinds.values()]
        number = {name: index for index, (name, _) in enumerate(order)}
        elements = [Element(0, Kind.PLAN, -1, 1, tuple(range(1, len(order) + 1)), (), *self.whole)]
        paths = ["/machine"]
        nodes: list[Node] = []
        for index, (name, kind) in enumerate(order):
            place = self.places.get(name, Place())
            runs = kind is NodeKind.RUNNER
            elements.append(
                Element(
                    index=index + 1,
                    kind=Kind.RUNNER if runs else Kind.CONTROL,
                    parent=0,
                    ordinal=index + 1,
                    children=(),
                    attributes=self.elements.get(name, ()),
                    line=place.line,
                    column=place.column,
                    start=place.start,
                    end=place.end,
                    tag="" if runs else kind.value,
                    node=clip(str(name), _LONGEST_NAME) if name in self.kinds else "",
                )
            )
            paths.append(f"/machine/{name if name in self.kinds else kind.value}")
            nodes.append(Node(index, kind, index + 1, self.needs.get(name, 0)))
        connections = [
            tuple(Edge(number[source], event, number[target]) for source, event, target in each)
            for each in (edges, stops)
        ]
        marks = {number[name]: self.graph.nodes[name].get(_MARKS, ()) for name in self.kinds}
        return MachinePlan(
            self.file,
            sharing_lines(elements),
            paths=tuple(paths),
            nodes=tuple(nodes),
            edges=connections[0],
            stops=connections[1],
            approximations=tuple(dict.fromkeys(chain(self.approximations, *marks.values()))),
            inexact=frozenset(index for index, row in marks.items() if row),
        )


def shown(value: object) -> str:
    """A value of a user's in a message."""
    return repr(clip(str(value), _LONGEST_NAME))


def written(value: Value) -> str:
    """A value as a plan would write it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else repr(value)
