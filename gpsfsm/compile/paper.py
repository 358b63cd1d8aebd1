"""The compiler of the paper's semantics (semantics, section 3).

A unit gets the signal that triggers it and returns its outlets: the signals of its success and of
its failure. A sequence hands the success of each child to the next one, a guard the failure; where
several signals mean the same, a join makes one of them. Only the plan completes and gives up.

``<Plan> A <Control type="recovery"> B </Control> C </Plan>`` is the sequence of guard(A, B) and C
    start → A    A FAILED → B    A SUCCEEDED, B SUCCEEDED → join(1) → C    C SUCCEEDED → complete
    B FAILED, C FAILED → join(1) → give up
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.compile.units import MachinePlan, TreePlan, UnitKind, Units, group_units
from gpsfsm.errors import misused, require_flag
from gpsfsm.late import collecting_rarely, dataclass
from gpsfsm.model.automaton import Automaton, Block, NodeKind, Signal
from gpsfsm.model.capability import Binding
from gpsfsm.model.event import Event
from gpsfsm.model.graph import GraphBuilder
from gpsfsm.model.plan import Plan

if TYPE_CHECKING:
    import networkx as nx

Outlets = tuple[Signal | None, Signal | None]
"""The success and the failure signal of a unit; None is the signal that never comes."""

_Step = Generator[tuple[int, Signal | None], Outlets, Outlets]


@dataclass(frozen=True, slots=True)
class Compiled:
    """A compiled plan: its automaton, its units, and for each unit the signal that triggers it.

    ``outlets`` holds, for each unit, the signals of its success and its failure; whatever follows
    the unit is connected to these (with a start chain, also to STARTED). ``bindings`` holds, for
    each runner instance, its description in the library (None: undescribed), under the names that
    this automaton uses.
    """

    automaton: Automaton
    units: Units
    triggers: tuple[Signal | None, ...]
    outlets: tuple[Outlets, ...]
    bindings: tuple[Binding | None, ...]

    @property
    def graph(self) -> nx.MultiDiGraph[int]:
        """The automaton as a frozen networkx graph (docs/machines.md)."""
        return self.automaton.graph


def compile_plan(
    plan: Plan,
    *,
    start_chain: bool = False,
    bindings: tuple[Binding | None, ...] | None = None,
) -> Compiled:
    """Compile a plan into its automaton, in linear time for any nesting depth.

    ``start_chain``: each further unit of a parallel control is triggered by the STARTED event of a
    runner in the unit before it, as the fault model ``no-start`` requires. ``bindings``, one for
    each runner instance in document order, are kept for the analyses; without them, all instances
    are undescribed.

    Raises UsageError if ``plan`` is not a ``Plan``.
    """
    if not isinstance(plan, Plan):
        raise misused("compile_plan", "a plan", plan, "gpsfsm.parse(text).plan is one")
    require_flag("compile_plan", "start_chain", start_chain)
    if bindings and not _are_bindings(bindings, len(plan.runners)):
        raise misused("compile_plan", "a binding or None for each runner as bindings", bindings)
    if isinstance(plan, MachinePlan):
        return _machine(plan, bindings or (None,) * len(plan.runners))
    with collecting_rarely():
        return _Compiler(plan, start_chain).compile(bindings or (None,) * len(plan.runners))


def _are_bindings(value: object, number: int) -> bool:
    """True for as many bindings, or None in their place."""
    if not isinstance(value, Sequence) or len(value) != number:
        return False
    return all(each is None or isinstance(each, Binding) for each in value)


def _machine(plan: MachinePlan, bindings: tuple[Binding | None, ...]) -> Compiled:
    """A machine that was handed in is an automaton already; it has no units."""
    automaton = plan.automaton
    empty = Units((), (), (), (), ())
    return Compiled(automaton, empty, (), (), with_arriving(automaton, bindings))


def with_arriving(
    automaton: Automaton, bindings: Sequence[Binding | None]
) -> tuple[Binding | None, ...]:
    """The bindings of a plan, each with the names of what its one connection hands over.

    Nothing is handed over by the start, by STARTED and by joins; what an undescribed instance
    hands over nobody knows (semantics, 8.2).
    """
    completed: list[Binding | None] = []
    for binding, node in zip(bindings, automaton.runners, strict=True):
        if binding is not None:
            arriving: frozenset[str] | None = frozenset()
            for source, event in automaton.inputs[node.index]:
                if automaton.nodes[source].kind is NodeKind.RUNNER and event is not Event.STARTED:
                    giver = bindings[automaton.runner_number(source)]
                    names = None if giver is None else giver.provider.names_handed_over(event)
                    arriving = None if names is None or arriving is None else arriving | names
            same = arriving == binding.arriving
            completed.append(binding if same else replace(binding, arriving=arriving))
        else:
            completed.append(None)
    return tuple(completed)


class _Compiler:
    def __init__(self, plan: Plan, start_chain: bool) -> None:
        self.plan = plan
        self.units = group_units(plan)
        # BehaviorTree.CPP ticks all children of a Parallel, whatever the one before does.
        self.start_chain = start_chain and not isinstance(plan, TreePlan)
        self.graph = GraphBuilder(plan)
        self.graph.add(NodeKind.START, 0)
        self.node_of = {
            runner.index: self.graph.add(NodeKind.RUNNER, runner.index) for runner in plan.runners
        }
        self.blocks: list[Block] = []
        self.triggers: list[Signal | None] = [None] * len(self.units)
        self.outlets: list[Outlets] = [(None, None)] * len(self.units)
        self.triggered: list[tuple[Signal | None, int]] = []  # runners in order of compilation

    def compile(self, bindings: tuple[Binding | None, ...]) -> Compiled:
        success, failure = self._walk(0, Signal(0, Event.SUCCEEDED))
        for unit, kind in enumerate(self.units.kinds):
            if kind is UnitKind.DEAD:
                self._walk(unit, None)
        self._add(NodeKind.COMPLETE, 0, 0, [success])
        self._add(NodeKind.GIVE_UP, 0, 0, [failure])
        # Every runner instance is compiled exactly once, those as well that nothing triggers.
        assert len(self.triggered) == len(self.plan.runners)
        self.blocks.sort(key=lambda block: block.element)
        automaton = Automaton(self.plan, self.graph.finished(), tuple(self.blocks))
        return Compiled(
            automaton,
            self.units,
            tuple(self.triggers),
            tuple(self.outlets),
            with_arriving(automaton, bindings),
        )

    def _walk(self, root: int, trigger: Signal | None) -> Outlets:
        """Drive the generators below with a stack of our own: plans may nest deeply."""
        stack = [self._unit(root, trigger)]
        units = [root]
        result: Outlets | None = None
        while stack:
            try:
                child, child_trigger = next(stack[-1]) if result is None else stack[-1].send(result)
                stack.append(self._unit(child, child_trigger))
                units.append(child)
                result = None
            except StopIteration as finished:
                stack.pop()
                result = self.outlets[units.pop()] = finished.value
        assert result is not None
        return result

    def _unit(self, unit: int, trigger: Signal | None) -> _Step:
        self.triggers[unit] = trigger
        kind = self.units.kinds[unit]
        if kind is UnitKind.RUNNER:
            return self._runner(unit, trigger)
        if kind in (UnitKind.ALL, UnitKind.ANY, UnitKind.COUNT, UnitKind.WAIT):
            return self._parallel(unit, trigger)
        if kind is UnitKind.GUARD:
            return self._guard(unit, trigger)
        if kind is UnitKind.DEAD:
            return self._dead(unit)
        if kind is UnitKind.NOT:
            return self._not(unit, trigger)
        if kind is UnitKind.BRANCH:
            return self._branch(unit, trigger)
        return self._sequence(unit, trigger)

    def _runner(self, unit: int, trigger: Signal | None) -> _Step:
        node = self.node_of[self.units.elements[unit]]
        self._connect(trigger, node)
        self.triggered.append((trigger, node))
        yield from ()  # a generator, like the others
        return Signal(node, Event.SUCCEEDED), Signal(node, Event.FAILED)

    def _sequence(self, unit: int, trigger: Signal | None) -> _Step:
        """Also an empty control: it has no children, succeeds when triggered and cannot fail."""
        failures: list[Signal | None] = []
        for child in self.units.children[unit]:
            trigger, failure = yield child, trigger
            failures.append(failure)
        return trigger, self._any(unit, failures)

    def _guard(self, unit: int, trigger: Signal | None) -> _Step:
        successes: list[Signal | None] = []
        for child in self.units.children[unit]:
            success, trigger = yield child, trigger
            successes.append(success)
        return self._any(unit, successes), trigger

    def _dead(self, unit: int) -> _Step:
        trigger: Signal | None = None
        for child in self.units.children[unit]:
            _, trigger = yield child, trigger
        return None, None

    def _not(self, unit: int, trigger: Signal | None) -> _Step:
        success, failure = yield self.units.children[unit][0], trigger
        return failure, success

    def _branch(self, unit: int, trigger: Signal | None) -> _Step:
        """Without a third child the unit fails where its condition does."""
        condition, *branches = self.units.children[unit]
        outlets = yield condition, trigger
        ends: list[Outlets] = []
        for branch, chosen in zip(branches, outlets, strict=False):
            ends.append((yield branch, chosen))
        if len(branches) == 1:
            ends.append((None, outlets[1]))
        return (
            self._any(unit, [success for success, _ in ends]),
            self._any(unit, [failure for _, failure in ends]),
        )

    def _parallel(self, unit: int, trigger: Signal | None) -> _Step:
        outlets: list[Outlets] = []
        child_trigger = trigger
        for child in self.units.children[unit]:
            before = len(self.triggered)
            outlets.append((yield child, child_trigger))
            if self.start_chain:
                child_trigger = self._started(child_trigger, before)
        successes = [success for success, _ in outlets]
        failures = [failure for _, failure in outlets]
        if self.units.kinds[unit] is UnitKind.COUNT:
            need = self.units.needs[unit]
            spare = len(outlets) - need + 1
            return self._some(unit, successes, need), self._some(unit, failures, spare)
        if self.units.kinds[unit] is UnitKind.WAIT:
            return self._waiting(unit, outlets)
        if self.units.kinds[unit] is UnitKind.ANY:
            return self._any(unit, successes), self._all(unit, failures)
        success, failure = self._all(unit, successes), self._any(unit, failures)
        # The Parallel of a behaviour tree halts what runs when it fails: there, no join waits.
        waits = not isinstance(self.plan, TreePlan)
        if waits and len(outlets) > 1 and success is not None:
            element = self.units.elements[unit]
            self.blocks.append(Block(element, trigger, success.node, failure, tuple(outlets)))
        return success, failure

    def _waiting(self, unit: int, outlets: Sequence[Outlets]) -> Outlets:
        """A parallel that ends when all have ended; if all end alike, that is known without."""
        size, need = len(outlets), self.units.needs[unit]
        ended = self._all(unit, [self._any(unit, both) for both in outlets])
        outcomes: list[Signal | None] = []
        for number, count in enumerate((need, size - need + 1)):
            enough = self._some(unit, [both[number] for both in outlets], count)
            outcomes.append(enough if count == size else self._all(unit, [enough, ended]))
        return outcomes[0], outcomes[1]

    def _started(self, trigger: Signal | None, before: int) -> Signal | None:
        """STARTED of the first runner that ``trigger`` triggers in the unit just compiled."""
        nodes = [node for signal, node in self.triggered[before:] if signal == trigger]
        if trigger is None or not nodes:
            return trigger
        return Signal(min(nodes), Event.STARTED)

    def _any(self, unit: int, signals: Sequence[Signal | None]) -> Signal | None:
        """One signal for several of which the first counts: join(1), if there are several."""
        present = [signal for signal in signals if signal is not None]
        if len(present) <= 1:
            return present[0] if present else None
        return Signal(self._join(unit, 1, present), Event.SUCCEEDED)

    def _all(self, unit: int, signals: Sequence[Signal | None]) -> Signal | None:
        """One signal for all of several: join(n). One that never comes keeps the join waiting."""
        if len(signals) == 1:
            return signals[0]
        present = [signal for signal in signals if signal is not None]
        if not present:
            return None
        return Signal(self._join(unit, len(signals), present), Event.SUCCEEDED)

    def _some(self, unit: int, signals: Sequence[Signal | None], need: int) -> Signal | None:
        """One signal for several of which ``need`` must come; it never does if too few can."""
        present = [signal for signal in signals if signal is not None]
        if not present:
            return None
        return Signal(self._join(unit, need, present), Event.SUCCEEDED)

    def _join(self, unit: int, need: int, inputs: Sequence[Signal | None]) -> int:
        return self._add(NodeKind.JOIN, self.units.elements[unit], need, inputs)

    def _add(self, kind: NodeKind, origin: int, need: int, inputs: Sequence[Signal | None]) -> int:
        node = self.graph.add(kind, origin, need)
        for signal in inputs:
            self._connect(signal, node)
        return node

    def _connect(self, signal: Signal | None, node: int) -> None:
        if signal is not None:
            self.graph.connect(signal.node, signal.event, node)
