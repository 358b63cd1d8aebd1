"""What an observer sees of a plan who gives every action its outcome.

A plan is played one outcome at a time. All that is seen is which actions are triggered at an
instant and how the run ends; names, layout and providers are not.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile import UnitKind
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import End, Event

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.model.plan import Plan

__all__ = ["OUTCOMES", "Action", "Behaviour", "Reaction", "State"]

Action = Hashable
"""Equal for equal actions (semantics, section 4)."""

OUTCOMES = (Event.SUCCEEDED, Event.FAILED)
"""What an observer can answer, in the order of canonical scenarios."""

_Arrived = tuple[tuple[int, int], ...]
"""How many inputs have arrived at joins, ascending by node; joins without any are left out."""


class State(NamedTuple):
    """All that the rest of a run depends on.

    ``active`` are the numbers of the active instances, ascending. States are equal if the rest of
    the run cannot differ by what the joins still wait for. An ended run has no active instances.
    """

    active: tuple[int, ...]
    arrived: _Arrived


class Reaction(NamedTuple):
    """What happens at one instant: the instances that are triggered, ascending, and the end.

    ``end`` is None while the run goes on. What is triggered at the instant of the end counts;
    later than that nothing is observed, since all that is active is stopped.
    """

    triggered: tuple[int, ...]
    end: End | None


@dataclass(frozen=True, slots=False, eq=False)
class Behaviour:
    """A compiled plan, to be played; instances are numbers in document order, from 0.

    The plan must be compiled without start chain: outcomes are SUCCEEDED and FAILED. It may be
    compiled for an engine; then a run that can go on no more hangs.
    """

    compiled: Compiled

    @property
    def plan(self) -> Plan:
        """The plan."""
        return self.compiled.automaton.plan

    @cached_property
    def actions(self) -> tuple[Action, ...]:
        """The action of each instance."""
        return tuple(runner.action for runner in self.plan.runners)

    def begin(self) -> tuple[State, Reaction]:
        """The start of a run."""
        return self._after((), (), Signal(0, Event.SUCCEEDED))

    def after(self, state: State, number: int, event: Event) -> tuple[State, Reaction]:
        """An active instance has this outcome (SUCCEEDED or FAILED)."""
        active = tuple(other for other in state.active if other != number)
        return self._after(active, state.arrived, Signal(number + 1, event))

    def _after(
        self, active: tuple[int, ...], before: _Arrived, signal: Signal
    ) -> tuple[State, Reaction]:
        automaton, needs = self.compiled.automaton, self._needs
        arrived = dict(before)
        triggered: list[int] = []
        ends: set[int] = set()
        traits = automaton.traits
        todo = [signal]
        while todo:
            for target in self._targets.get(todo.pop(), ()):
                need = needs.get(target)
                if need is None:
                    ends.add(target)
                elif need == 0:
                    triggered.append(target - 1)
                    if target not in traits.silent:  # as it does on engines, where that leads on
                        todo.append(Signal(target, Event.STARTED))
                else:
                    count = arrived[target] = arrived.get(target, 0) + 1
                    if count == need:
                        todo.append(Signal(target, Event.SUCCEEDED))
                        count += target in traits.looping
                    if count > 1 and target in traits.breaking:
                        return State((), ()), Reaction(tuple(sorted(triggered)), End.ABORT)
        triggered.sort()
        if ends:
            end = End.COMPLETED if automaton.complete in ends else End.GAVE_UP
            return State((), ()), Reaction(tuple(triggered), end)
        now = tuple(sorted((*active, *triggered)))
        if not now and not traits.gives_up:
            return State((), ()), Reaction((), End.HANG)
        return State(now, self._relevant(now, arrived)), Reaction(tuple(triggered), None)

    def _relevant(self, active: Sequence[int], arrived: Mapping[int, int]) -> _Arrived:
        """Without the joins of units that nothing is active in: no input of theirs can come."""
        kept: list[tuple[int, int]] = []
        for join, count in arrived.items():
            first, last = self._spans[join]
            place = bisect_left(active, first)
            if place < len(active) and active[place] <= last:
                kept.append((join, min(count, self._needs[join] + 1)))
        return tuple(sorted(kept))

    @cached_property
    def _needs(self) -> Mapping[int, int]:
        """Need of each join; 0 for instances; the ends are left out."""
        nodes = self.compiled.automaton.nodes
        kinds = (NodeKind.RUNNER, NodeKind.JOIN)
        return {node.index: node.need for node in nodes if node.kind in kinds}

    @cached_property
    def _targets(self) -> Mapping[Signal, tuple[int, ...]]:
        return self.compiled.automaton.outputs

    @cached_property
    def _spans(self) -> Mapping[int, tuple[int, int]]:
        """For each join the first and the last instance of the unit that it belongs to.

        All inputs of a join come from within its unit. The instances of a unit are neighbours in
        document order, but for such that are never triggered.
        """
        units = self.compiled.units
        if not self.compiled.automaton.traits.gives_up:  # engines do not keep to units
            everything = 0, len(self.plan.runners) - 1
            nodes = self.compiled.automaton.nodes
            return {node.index: everything for node in nodes if node.kind is NodeKind.JOIN}
        numbers = {runner.index: number for number, runner in enumerate(self.plan.runners)}
        nowhere = len(numbers), -1
        inside = [nowhere] * len(units)
        for unit in reversed(range(len(units))):  # every parent comes before its children
            if units.kinds[unit] is UnitKind.RUNNER:
                number = numbers[units.elements[unit]]
                inside[unit] = number, number
            parent = units.parents[unit]
            if parent >= 0:
                (first, last), (low, high) = inside[unit], inside[parent]
                inside[parent] = min(first, low), max(last, high)
        of_element = {element: inside[unit] for unit, element in enumerate(units.elements)}
        nodes = self.compiled.automaton.nodes
        return {node.index: of_element[node.origin] for node in nodes if node.kind is NodeKind.JOIN}
