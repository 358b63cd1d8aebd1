"""The stepper: what one event triggers at its instant, through joins, and what joins remember.

An event travels along its connections. A join that has as many inputs as it needs succeeds at that
very instant, and its success travels on; an instance that is triggered starts at once (for an
observer of outcomes), or later as an event of its own. Between instants joins remember how many
inputs have come; what none of the active instances can add to is forgotten, so that equal states
are those from which equal runs follow.

>>> from gpsfsm.compile import compile_plan
>>> from gpsfsm.syntax import parse
>>> go = '<Runner interface="a/Go" provider="a/Go"/>'
>>> text = f'<Plan><Control type="parallel_all">{go}{go}</Control>{go}</Plan>'
>>> stepper = Stepper(compile_plan(parse(text).plan))
>>> first = stepper.settle((), Signal(1, Event.SUCCEEDED))  # of two that run side by side
>>> first.triggered, first.arrived
((), {4: 1})
>>> second = stepper.settle(stepper.relevant(first.arrived, (1,)), Signal(2, Event.SUCCEEDED))
>>> second.triggered, stepper.relevant(second.arrived, second.triggered)
((2,), ())
"""

from __future__ import annotations

from bisect import bisect_left
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile.units import UnitKind
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import End, Event

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.compile.paper import Compiled

Arrived = tuple[tuple[int, int], ...]
"""How many inputs have come to joins, ascending by node; joins without any are left out."""

START = Signal(0, Event.SUCCEEDED)
"""The event with which every run begins."""


class Instant(NamedTuple):
    """The effects of an event: instances that are triggered, ascending; inputs of joins; the end.

    ``end`` is None while the run goes on. ABORT: an engine's join has broken, and nothing counts.
    """

    triggered: tuple[int, ...]
    arrived: Mapping[int, int]
    end: End | None


class Stepper:
    """The transitions of a compiled plan; instances are numbers in document order, from 0.

    ``immediate``: an instance starts at the instant at which it is triggered. Otherwise its
    STARTED is an event like any other.
    """

    def __init__(self, compiled: Compiled, *, immediate: bool = False) -> None:
        self._compiled = compiled
        self._automaton = compiled.automaton
        self._immediate = immediate
        kinds = (NodeKind.RUNNER, NodeKind.JOIN)
        nodes = self._automaton.nodes
        self._needs = {node.index: node.need for node in nodes if node.kind in kinds}

    def settle(self, before: Arrived, signal: Signal) -> Instant:
        """The instant of an event, after ``before`` has come to joins."""
        targets, needs, traits = self._automaton.outputs, self._needs, self._automaton.traits
        arrived = dict(before)
        triggered: list[int] = []
        ends: set[int] = set()
        pending = [signal]
        while pending:
            for target in targets.get(pending.pop(), ()):
                need = needs.get(target)
                if need is None:
                    ends.add(target)
                elif need == 0:
                    triggered.append(target - 1)
                    if self._immediate and target not in traits.silent:
                        pending.append(Signal(target, Event.STARTED))
                else:
                    count = arrived[target] = arrived.get(target, 0) + 1
                    if count == need:
                        pending.append(Signal(target, Event.SUCCEEDED))
                        count += target in traits.looping
                    if count > 1 and target in traits.breaking:
                        return Instant(tuple(sorted(triggered)), {}, End.ABORT)
        assert len(set(triggered)) == len(triggered), "an instance is triggered once"
        end = None
        if ends:
            end = End.COMPLETED if self._automaton.complete in ends else End.GAVE_UP
        return Instant(tuple(sorted(triggered)), arrived, end)

    def relevant(self, arrived: Mapping[int, int] | Arrived, active: Sequence[int]) -> Arrived:
        """Without the joins of units that nothing is active in: no input of theirs can come.

        ``active`` is ascending, and holds what is triggered and has not started as well.
        """
        kept: list[tuple[int, int]] = []
        for join, count in dict(arrived).items():
            first, last = self._spans[join]
            place = bisect_left(active, first)
            if place < len(active) and active[place] <= last:
                kept.append((join, min(count, self._needs[join] + 1)))
        return tuple(sorted(kept))

    @cached_property
    def _spans(self) -> Mapping[int, tuple[int, int]]:
        """For each join the first and the last instance of the unit that it belongs to.

        All inputs of a join come from within its unit. The instances of a unit are neighbours in
        document order, but for such that are never triggered.
        """
        units, plan = self._compiled.units, self._automaton.plan
        joins = [node for node in self._automaton.nodes if node.kind is NodeKind.JOIN]
        if not self._automaton.traits.gives_up:  # engines do not keep to units
            everything = 0, len(plan.runners) - 1
            return {node.index: everything for node in joins}
        numbers = {runner.index: number for number, runner in enumerate(plan.runners)}
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
        return {node.index: of_element[node.origin] for node in joins}
