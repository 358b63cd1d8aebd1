"""Pruning of what cannot happen any more, so that runners are unloaded when nothing needs them.

All that a unit of the plan leads to goes through its success and its failure signal. So a unit
that is never triggered is passed over as a whole, however many instances it has: their runners
lose as many users, and its two signals never come. Only the joins between units are followed one
by one, and of these only those that lead to an instance.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Container, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Signal


STARTED, SUCCEEDED, FAILED, STOPPED = range(4)
"""Signals are numbers, four for each node: ``node * 4 + STARTED``, and so on."""


def number_of(node: int, event: Event) -> int:
    """The number of a signal."""
    # identity, since hashing a member of an enum is slow
    if event is Event.SUCCEEDED:
        return node * 4 + SUCCEEDED
    if event is Event.FAILED:
        return node * 4 + FAILED
    return node * 4 + (STARTED if event is Event.STARTED else STOPPED)


class Pruning:
    """Counts for each runner the instances that may still need it.

    ``targets`` are the nodes to which each signal leads, ``fired`` tells which of them have been
    triggered (the kernel writes it). ``visits`` counts what is looked at: joins, instances, and for
    a unit that is passed over as a whole the runners whose users are counted.
    """

    def __init__(
        self,
        compiled: Compiled,
        targets: Mapping[int, list[int]],
        *,
        runner_of: Sequence[int],
        runners: int,
        fired: bytearray,
    ) -> None:
        nodes = compiled.automaton.nodes
        self.visits = 0
        self._compiled = compiled
        self._targets = targets
        self._runner_of = runner_of
        self._fired = fired
        self._is_join = bytearray(node.kind is NodeKind.JOIN for node in nodes)
        self._dead = bytearray(len(nodes))
        self._silent = bytearray(4 * len(nodes))  # signals that never come
        # inputs that may still fail to come
        self._spare = [-(node.need or 1) for node in nodes]
        for edges in targets.values():
            for target in edges:
                self._spare[target] += 1
        self._users = [0] * runners
        for runner in runner_of:
            self._users[runner] += 1
        # a start chain leads out of units in the middle, and other engines do not keep to units at
        # all, so there all goes node by node
        self._by_unit = compiled.automaton.traits.gives_up and all(signal & 3 for signal in targets)
        self._grouped = False
        for node, spare in enumerate(self._spare):
            if node and spare < 0 and not self._dead[node]:
                self._follow(self._bury(node, []), [])  # nothing ever triggers it

    def ended(self, number: int) -> bool:
        """An instance has ended; whether nothing needs its runner any more."""
        runner = self._runner_of[number]
        self._users[runner] -= 1
        return not self._users[runner]

    def never(self, signal: int, loaded: Container[int]) -> list[int]:
        """A signal never comes: the runners that nothing needs any more.

        Those that are ``loaded`` are in the order in which they lose their last users if one node
        is looked at after the other.
        """
        unneeded: list[int] = []
        if not self._by_unit:
            self._follow([signal], unneeded)
            return unneeded
        if not self._grouped:
            self._group()
        touched: list[int] = []
        died: set[int] = set()
        self._pass_over(signal, unneeded, touched=touched, died=died)
        if len(unneeded) > 1 and sum(runner in loaded for runner in unneeded) > 1:
            return self._in_order(signal, unneeded, touched=touched, died=died)
        return unneeded

    # -- node by node -----------------------------------------------------------------------

    def _bury(self, node: int, unneeded: list[int]) -> list[int]:
        """A node is never triggered; the signals that never come because of that."""
        self._dead[node] = 1
        if not self._is_join[node] and self._is_instance(node) and self.ended(node - 1):
            unneeded.append(self._runner_of[node - 1])
        return self._emits(node)

    def _emits(self, node: int) -> list[int]:
        if self._is_join[node]:
            return [node * 4 + SUCCEEDED]
        return (
            [node * 4, node * 4 + SUCCEEDED, node * 4 + FAILED] if self._is_instance(node) else []
        )

    def _is_instance(self, node: int) -> bool:
        return 0 < node <= len(self._runner_of)

    def _follow(self, pending: list[int], unneeded: list[int]) -> None:
        """Follow signals that never come, the last one first."""
        while pending:
            signal = pending.pop()
            self._silent[signal] = 1
            for target in self._targets.get(signal, ()):
                self.visits += 1
                self._spare[target] -= 1
                if self._spare[target] < 0 and not (self._dead[target] or self._fired[target]):
                    pending += self._bury(target, unneeded)

    # -- unit by unit -----------------------------------------------------------------------

    def _group(self) -> None:
        """Find out for each signal which units and which joins it triggers."""
        self._grouped = True
        units, triggers = self._compiled.units, self._compiled.triggers
        first = [len(self._runner_of)] * len(units)
        last = [-1] * len(units)
        number = {runner.origin: runner.index - 1 for runner in self._compiled.automaton.runners}
        self._units: dict[int, list[int]] = {}
        for unit in range(len(units) - 1, 0, -1):
            own = number.get(units.elements[unit])
            if not units.children[unit] and own is not None:
                first[unit] = last[unit] = own
            parent, trigger = units.parents[unit], triggers[unit]
            if parent < 0:
                continue  # nothing triggers it
            first[parent] = min(first[parent], first[unit])
            last[parent] = max(last[parent], last[unit])
            if trigger is not None and trigger != triggers[parent] and last[unit] >= 0:
                self._units.setdefault(number_of(*trigger), []).append(unit)
        self._first, self._last = first, last
        self._passed = bytearray(len(self._runner_of))  # instances of units that are passed over
        self._useful = self._useful_joins()
        self._instances: list[list[int]] = [[] for _ in self._users]  # without dead ones
        for instance, runner in enumerate(self._runner_of):
            if not self._dead[instance + 1]:
                self._instances[runner].append(instance)

    def _useful_joins(self) -> bytearray:
        """The nodes that are joins which lead to an instance."""
        useful = bytearray(len(self._is_join))
        for node in range(len(useful) - 1, len(self._runner_of), -1):
            if self._is_join[node]:  # it leads to instances or to later joins
                targets = self._targets.get(node * 4 + SUCCEEDED, ())
                useful[node] = any(useful[target] or target <= node for target in targets)
        return useful

    def _pass_over(
        self, signal: int, unneeded: list[int], *, touched: list[int], died: set[int]
    ) -> None:
        """``touched`` gets the joins that lose an input, ``died`` those that die of it."""
        pending = [signal]
        while pending:
            signal = pending.pop()
            if signal < 0 or self._silent[signal]:
                continue
            self._silent[signal] = 1
            for join in self._targets.get(signal, ()):
                if not self._useful[join]:
                    continue
                self.visits += 1
                self._spare[join] -= 1
                touched.append(join)
                if self._spare[join] < 0 and not (self._dead[join] or self._fired[join]):
                    self._dead[join] = 1
                    died.add(join)
                    pending.append(join * 4 + SUCCEEDED)
            for unit in self._units.get(signal, ()):
                if not self._passed[self._first[unit]]:
                    self._bury_unit(self._first[unit], self._last[unit] + 1, unneeded)
                    pending += map(_number, self._compiled.outlets[unit])

    def _bury_unit(self, begin: int, end: int, unneeded: list[int]) -> None:
        """The instances of a unit, which follow each other in the plan, are never triggered."""
        self._passed[begin:end] = b"\1" * (end - begin)
        if end - begin <= len(self._users):
            self.visits += end - begin
            for number in range(begin, end):
                if not self._dead[number + 1] and self.ended(number):
                    unneeded.append(self._runner_of[number])
            return
        self.visits += len(self._users)
        for runner, instances in enumerate(self._instances):
            lost = bisect_left(instances, end) - bisect_left(instances, begin)
            self._users[runner] -= lost
            if lost and not self._users[runner]:
                unneeded.append(runner)

    def _in_order(
        self, signal: int, unneeded: list[int], *, touched: list[int], died: set[int]
    ) -> list[int]:
        """The same runners, in the order in which they lose their last users node by node."""
        spare: dict[int, int] = {}
        gone: set[int] = set()
        for join in touched:
            spare[join] = spare.get(join, self._spare[join]) + 1
        order: dict[int, None] = {}
        pending = [signal]
        while pending:
            for target in self._targets.get(pending.pop(), ()):
                self.visits += 1
                spare[target] = spare.get(target, self._spare[target]) - 1
                dead = target in gone or (self._dead[target] and target not in died)
                if spare[target] >= 0 or dead or self._fired[target]:
                    continue
                gone.add(target)
                if self._is_instance(target):
                    runner = self._runner_of[target - 1]
                    order.pop(runner, None)
                    order[runner] = None
                pending += self._emits(target)
        return [runner for runner in order if runner in unneeded]


def _number(signal: Signal | None) -> int:
    return -1 if signal is None else number_of(*signal)
