"""From an engine's connections to the automaton (docs/engines.md), and whether it runs as on paper.

The nodes are those of the plan: the runner instances in document order, the joins that the engine
makes, and completion, which is the runner that it appends. What the engine does otherwise than
semantics.md says at run time is told by ``Automaton.traits``.

``same_runs`` compares the automaton with the paper's: sufficient, and linear. Both run alike where
they do one step at a time and every outcome of every runner leads to the same next step, however
many joins stand between them. Whoever gives up in the paper hangs on the engine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.paper import Compiled, Outlets, with_arriving
from gpsfsm.compile.units import UnitKind, Units
from gpsfsm.model.automaton import Automaton, Block, Edge, Node, NodeKind, Signal, Traits
from gpsfsm.model.event import Event
from gpsfsm.model.plan import ControlType
from gpsfsm.model.story import FABRIC_V1

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.model.capability import Binding
    from gpsfsm.model.engine import Connection, EngineNode, EnginePlan
    from gpsfsm.model.plan import Plan

_COUNT = "input_count"
_ALL = "InputMultiplexAllRunner"
_EMITS_STARTED = ("OccupancyGridRunner",)
"""The runners of fabric-v2 that wait for a message of a topic; they alone emit STARTED."""

_NOTHING, _COMPLETE = -1, -2
_OUTCOMES = (Event.SUCCEEDED, Event.FAILED)


def compile_connections(
    plan: Plan,
    engine_plan: EnginePlan,
    element_of: Mapping[int, int],
    bindings: tuple[Binding | None, ...] | None = None,
) -> Compiled:
    """The automaton of connections, with the engine's traits.

    ``element_of`` leads from the engine's elements to those of ``plan``. The units of the result
    are the instances beside each other: these engines do not keep to the controls of the plan.
    Connections without source or without target lead nowhere.
    """
    wiring = _Wiring(plan, engine_plan, element_of)
    automaton = wiring.automaton()
    size = len(plan.runners)
    units = Units(
        kinds=(UnitKind.ALL if size > 1 else UnitKind.SEQUENCE, *[UnitKind.RUNNER] * size),
        elements=(0, *(runner.index for runner in plan.runners)),
        children=(tuple(range(1, size + 1)), *[()] * size),
        parents=(-1, *[0] * size),
        positions=(0, *range(size)),
    )
    start = Signal(0, Event.SUCCEEDED)
    triggers = [next(iter(automaton.inputs[node.index]), None) for node in automaton.runners]
    outlets: list[Outlets] = [
        (Signal(node.index, Event.SUCCEEDED), Signal(node.index, Event.FAILED))
        for node in automaton.runners
    ]
    return Compiled(
        automaton,
        units,
        (start, *triggers),
        ((None, None), *outlets),
        with_arriving(automaton, bindings or (None,) * size),
    )


class _Wiring:
    def __init__(self, plan: Plan, engine_plan: EnginePlan, element_of: Mapping[int, int]) -> None:
        self.plan = plan
        self.first_version = engine_plan.profile == FABRIC_V1
        self.connections = [each for each in engine_plan.connections if each.source.named]
        self.element_of = element_of
        self.nodes = [Node(0, NodeKind.START, 0)]
        self.nodes += [
            Node(number, NodeKind.RUNNER, runner.index)
            for number, runner in enumerate(plan.runners, start=1)
        ]
        self.profile = engine_plan.profile
        node_of = {node.origin: node.index for node in self.nodes[1:]}
        self.node_of: dict[int, int] = {}  # by the engine's number of the instance
        self.joins: dict[int, Connection] = {}
        self.complete = -1
        for each in self.connections:
            source = each.source
            if source.element is not None:
                self.node_of[source.instance] = node_of[element_of[source.element]]
            elif each.completion:
                self.complete = self._add(source, NodeKind.COMPLETE, 0)
            else:
                assert each.control is not None
                join = self._add(source, NodeKind.JOIN, element_of[each.control])
                self.joins[join] = each
        if self.complete < 0:  # the engine broke off before it appended that
            self.complete = self._add(None, NodeKind.COMPLETE, 0)
        self._add(None, NodeKind.GIVE_UP, 0)

    def _add(self, source: EngineNode | None, kind: NodeKind, origin: int) -> int:
        node = len(self.nodes)
        self.nodes.append(Node(node, kind, origin))
        if source is not None:
            self.node_of[source.instance] = node
        return node

    def automaton(self) -> Automaton:
        """The whole automaton."""
        edges, looping = self._edges()
        inputs: dict[int, list[Signal]] = {}
        for source, event, target in edges:
            inputs.setdefault(target, []).append(Signal(source, event))
        for join, each in self.joins.items():
            need = self._need(each, len(inputs.get(join, ())))
            self.nodes[join] = Node(join, NodeKind.JOIN, self.nodes[join].origin, need)
        return Automaton.of(
            self.plan,
            self.nodes,
            edges,
            blocks=tuple(self._blocks(inputs)),
            traits=Traits(
                engine=self.profile,
                gives_up=False,
                refusals_hang=True,
                silent=frozenset() if self.first_version else self._silent(),
                breaking=frozenset(
                    join for join, each in self.joins.items() if self._breaks(each.source)
                ),
                looping=looping,
            ),
        )

    def _edges(self) -> tuple[list[Edge], frozenset[int]]:
        edges: list[Edge] = []
        looping: set[int] = set()
        first = self.connections[0] if self.connections else None
        if first is not None and first.id == 0:
            edges.append(Edge(0, Event.SUCCEEDED, self.node_of[first.source.instance]))
        for each in self.connections:
            source = self.node_of[each.source.instance]
            for event, target in (
                (Event.STARTED, each.on_start),
                (Event.SUCCEEDED, each.on_success),
                (Event.FAILED, each.on_failure),
            ):
                if target is None or not target.named:
                    continue
                node = self.node_of[target.instance]
                if node == source:
                    looping.add(node)
                else:
                    edges.append(Edge(source, event, node))
        return edges, frozenset(looping)

    def _need(self, each: Connection, inputs: int) -> int:
        """The inputs that make a join fire; one that never fires needs more than it has."""
        if self.first_version and not each.source.interface.endswith(_ALL):
            return 1
        counts = [
            parameter.value for parameter in each.source.parameters if parameter.name == _COUNT
        ]
        count = int(counts[0]) if counts else 1
        return count if count > 0 else inputs + 1

    def _breaks(self, source: EngineNode) -> bool:
        """True if a second input aborts the engine."""
        return not (self.first_version and source.interface.endswith(_ALL))

    def _silent(self) -> frozenset[int]:
        return frozenset(
            number
            for number, runner in enumerate(self.plan.runners, start=1)
            if (runner.text("interface") or "").rpartition("/")[2] not in _EMITS_STARTED
        )

    def _blocks(self, inputs: Mapping[int, Sequence[Signal]]) -> list[Block]:
        """The joins of parallel_all of two inputs or more, with what triggers the first runner."""
        blocks: list[Block] = []
        for join in self.joins:
            element = self.plan.elements[self.nodes[join].origin]
            waits = element.control_type is ControlType.PARALLEL_ALL
            if not waits or len(inputs.get(join, ())) < 2:
                continue
            units: list[Outlets] = [
                (signal, self._failure(signal)) for signal in inputs.get(join, ())
            ]
            trigger = next(iter(inputs.get(self._first_runner(element.index), ())), None)
            blocks.append(Block(element.index, trigger, join, None, tuple(units)))
        return sorted(blocks, key=lambda block: block.element)

    def _failure(self, success: Signal) -> Signal | None:
        if self.nodes[success.node].kind is not NodeKind.RUNNER:
            return None
        return Signal(success.node, Event.FAILED)

    def _first_runner(self, control: int) -> int:
        """The node of the first runner after the start of a control; 0 if there is none."""
        for node in self.nodes:
            if node.kind is NodeKind.RUNNER and node.origin > control:
                return node.index
        return 0


def same_runs(paper: Automaton, engine: Automaton) -> bool:
    """True if both automata of one plan have the same runs, where runners succeed or fail.

    False also where this simple comparison cannot tell. The engine never aborts if it is True: what
    happens one after the other cannot arrive twice at a join that has fired, since no connection
    leads back.
    """
    if engine.traits.looping:
        return False
    there = _next_things(engine)
    return there is not None and there == _next_things(paper)


def _next_things(automaton: Automaton) -> list[int] | None:
    """The step after the start and after each outcome; None if two may happen at a time."""
    if any(event is Event.STARTED for _, event, _ in automaton.edges):
        return None
    behind_joins: dict[int, int | None] = {}  # what follows a join
    steps: list[int] = []
    for node in automaton.nodes:
        if node.kind in (NodeKind.START, NodeKind.RUNNER):
            for event in _OUTCOMES:
                step = _follow(automaton, Signal(node.index, event), behind_joins)
                if step is None:
                    return None
                steps.append(step)
    return steps


def _follow(
    automaton: Automaton, signal: Signal, behind_joins: dict[int, int | None]
) -> int | None:
    """The one runner that an event triggers, in the end; None if there are more, or it waits."""
    joins: list[int] = []
    while True:
        targets = [
            target for target in automaton.outputs.get(signal, ()) if target != automaton.give_up
        ]
        step: int | None = None
        if not targets:
            step = _NOTHING
        elif len(targets) == 1:
            (target,) = targets
            node = automaton.nodes[target]
            if target == automaton.complete:
                step = _COMPLETE
            elif node.kind is NodeKind.RUNNER:
                step = target
            elif target in behind_joins:
                step = behind_joins[target]
            elif node.need == 1:
                joins.append(target)
                signal = Signal(target, Event.SUCCEEDED)
                continue
        behind_joins.update(dict.fromkeys(joins, step))
        return step
