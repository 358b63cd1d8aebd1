"""Plans and automata made by hand, without the front end and the compiler."""

from __future__ import annotations

from gpsfsm.model.automaton import Automaton, Edge, Node, NodeKind
from gpsfsm.model.event import Event
from gpsfsm.model.plan import Attribute, ControlType, Element, Kind, Plan, Value

S, F = Event.SUCCEEDED, Event.FAILED


class PlanBuilder:
    """Adds elements one after the other, each on a line of its own."""

    def __init__(self, **attributes: Value) -> None:
        self._rows: list[tuple[Kind, int, dict[str, Value], ControlType | None]] = []
        self._add(Kind.PLAN, -1, attributes, ControlType.SEQUENTIAL)

    def control(self, parent: int, kind: ControlType, **attributes: Value) -> int:
        return self._add(Kind.CONTROL, parent, attributes, kind)

    def runner(self, parent: int, interface: str, provider: str = "", **parameters: Value) -> int:
        values: dict[str, Value] = {"interface": interface, "provider": provider, **parameters}
        return self._add(Kind.RUNNER, parent, values, None)

    def _add(
        self, kind: Kind, parent: int, attributes: dict[str, Value], control: ControlType | None
    ) -> int:
        self._rows.append((kind, parent, attributes, control))
        return len(self._rows) - 1

    def build(self, *, completion: str = "") -> Plan:
        elements = tuple(self._element(index) for index in range(len(self._rows)))
        dropped = None
        if completion:
            line = len(elements) + 1
            attributes = (_attribute("interface", completion, line),)
            dropped = Element(-1, Kind.RUNNER, 0, 1, (), attributes, line, 3, 0, 0)
        return Plan("plan.xml", elements, dropped)

    def _element(self, index: int) -> Element:
        kind, parent, attributes, control = self._rows[index]
        before = self._rows[:index]
        ordinal = 1 + sum(row[0] is kind and row[1] == parent for row in before)
        children = tuple(i for i, row in enumerate(self._rows) if row[1] == index)
        line = index + 1
        return Element(
            index=index,
            kind=kind,
            parent=parent,
            ordinal=ordinal,
            children=children,
            attributes=tuple(_attribute(k, v, line) for k, v in attributes.items()),
            line=line,
            column=3,
            start=0,
            end=0,
            control_type=control,
        )


def _attribute(name: str, value: Value, line: int) -> Attribute:
    return Attribute(name, str(value), value, line, 5)


def tour() -> Automaton:
    """A sequence of a runner, a guarded parallel_all of two, and a race of two."""
    plan = PlanBuilder(name="tour")
    go = plan.runner(0, "nav2_capabilities/WaypointRunner", "nav2", x=1.5, y=2, frame="map")
    both = plan.control(0, ControlType.PARALLEL_ALL, name="welcome")
    say = plan.runner(both, "speech/SayRunner", "tts", text="hello")
    photo = plan.runner(both, "camera/PhotoRunner", "cam")
    rescue = plan.control(0, ControlType.RECOVERY)
    help_ = plan.runner(rescue, "speech/HelpRunner", "tts")
    race = plan.control(0, ControlType.PARALLEL_ANY)
    left = plan.runner(race, "nav2_capabilities/WaypointRunner", "nav2", x=0)
    right = plan.runner(race, "nav2_capabilities/WaypointRunner", "nav2", x=9)
    origins = (go, say, photo, help_, left, right)
    nodes = [Node(0, NodeKind.START, 0)]
    nodes += [Node(i, NodeKind.RUNNER, origin) for i, origin in enumerate(origins, start=1)]
    nodes += [
        Node(7, NodeKind.JOIN, both, 2),  # say and photo succeeded
        Node(8, NodeKind.JOIN, both, 1),  # one of them failed
        Node(9, NodeKind.JOIN, rescue, 1),  # the block or its recovery succeeded
        Node(10, NodeKind.JOIN, race, 1),
        Node(11, NodeKind.JOIN, race, 2),
        Node(12, NodeKind.COMPLETE, 0),
        Node(13, NodeKind.GIVE_UP, 0),
    ]
    edges = (
        Edge(0, S, 1),
        Edge(1, S, 2),
        Edge(1, Event.STARTED, 3),
        Edge(2, S, 7),
        Edge(3, S, 7),
        Edge(2, F, 8),
        Edge(3, F, 8),
        Edge(8, S, 4),
        Edge(7, S, 9),
        Edge(4, S, 9),
        Edge(9, S, 5),
        Edge(9, S, 6),
        Edge(5, S, 10),
        Edge(6, S, 10),
        Edge(5, F, 11),
        Edge(6, F, 11),
        Edge(10, S, 12),
        Edge(11, S, 13),
    )
    return Automaton.of(plan.build(completion="x/FabricCompletionRunner"), nodes, edges)


def single(interface: str, **parameters: Value) -> Automaton:
    """One runner, inside one control whose name is the interface too."""
    plan = PlanBuilder()
    control = plan.control(0, ControlType.SEQUENTIAL, name=interface)
    runner = plan.runner(control, interface, interface, **parameters)
    nodes = (
        Node(0, NodeKind.START, 0),
        Node(1, NodeKind.RUNNER, runner),
        Node(2, NodeKind.COMPLETE, 0),
        Node(3, NodeKind.GIVE_UP, 0),
    )
    return Automaton.of(plan.build(), nodes, (Edge(0, S, 1), Edge(1, S, 2)))
