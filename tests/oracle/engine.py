"""A brute force for engines: it plays the connections themselves, in every order.

Written from what is known of the original engines alone: an event of a source goes to the one
target that its connection names; a join counts its triggers; the first version's runners and a few
of the second's emit STARTED. Nothing of the package but the connections is used.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.model.engine import Connection, EnginePlan

JOINS = ("InputMultiplexRunner", "InputMultiplexAnyRunner", "InputMultiplexAllRunner")


State = tuple[frozenset[tuple[int, bool]], frozenset[tuple[int, int]], bool]
"""Leaves that have not ended, with whether they still have to emit STARTED; arrivals at joins; and
whether the plan has completed."""


class Machine:
    """One plan on one engine; instances are the engine's numbers.

    ``orphans`` are the leaves that were active when a run completed, ``most_active`` how many
    interfaces were active at once before that, both in all runs that were played so far.
    """

    def __init__(self, plan: EnginePlan) -> None:
        self.first_version = plan.profile == "fabric-v1"
        self.of = {each.source.instance: each for each in plan.connections if each.source.named}
        self.begin = next((each for each in plan.connections if each.id == 0), None)
        self.done = {number for number, each in self.of.items() if each.completion}
        self.joins = {number for number, each in self.of.items() if _is_join(each)}
        self.leaves = sorted(set(self.of) - self.joins - self.done)
        self.orphans: set[int] = set()
        self.most_active = 0

    def ends(self, succeeds: Mapping[int, bool]) -> tuple[set[str], set[int]]:
        """How runs with these outcomes can end, and which leaves can be triggered."""
        results: set[str] = set()
        reached: set[int] = set()
        seen: set[State] = set()
        start: State = (frozenset(), frozenset(), False)
        first = None if self.begin is None else self.begin.source.instance
        pending: list[State] = []
        self._then(start, first, pending, results, reached)
        while pending:
            state = pending.pop()
            if state in seen:
                continue
            seen.add(state)
            active, arrived, completed = state
            if not completed:
                names = {self.of[number].source.interface for number, _ in active}
                self.most_active = max(self.most_active, len(names))
            if not active:
                results.add("COMPLETED" if completed else "HANG")
            for each in sorted(active):
                number, starting = each
                rest = active - {each}
                connection = self.of[number]
                if starting:
                    rest |= {(number, False)}
                    target = connection.on_start
                elif succeeds[number]:
                    target = connection.on_success
                else:
                    target = connection.on_failure
                after = (rest, arrived, completed)
                instance = None if target is None or not target.named else target.instance
                self._then(after, instance, pending, results, reached)
        return results, reached

    def _then(
        self,
        state: State,
        number: int | None,
        pending: list[State],
        actual: set[str],
        reached: set[int],
    ) -> None:
        """The target of an event is triggered, and at once what follows from joins."""
        active, arrived, completed = state
        while number is not None:
            if number in self.done:
                if not completed:
                    self.orphans |= {leaf for leaf, _ in active}
                completed = True
                break
            if number in self.leaves:
                reached.add(number)
                active |= {(number, self._starts(number))}
                break
            counts = dict(arrived)
            counts[number] = counts.get(number, 0) + 1
            arrived = frozenset(counts.items())
            connection = self.of[number]
            count, kind = counts[number], connection.source.interface.rpartition("/")[2]
            if kind != "InputMultiplexAllRunner" and count > 1:
                actual.add("COMPLETED" if completed else "ABORT")
                return
            if count != self._expected(connection):
                break
            target = connection.on_success
            number = None if target is None else target.instance
        pending.append((active, arrived, completed))

    def _starts(self, number: int) -> bool:
        name = self.of[number].source.interface.rpartition("/")[2]
        return self.first_version or name == "OccupancyGridRunner"

    def _expected(self, connection: Connection) -> int:
        if connection.source.interface.endswith("InputMultiplexAnyRunner"):
            return 1
        return next(
            int(each.value) for each in connection.source.parameters if each.name == "input_count"
        )

    def leads_on(self, number: int, *, succeeds: bool) -> bool:
        """Whether an outcome is connected, through joins, to a leaf or to completion."""
        each = self.of[number]
        target = each.on_success if succeeds else each.on_failure
        seen: set[int] = set()
        while target is not None and target.named and target.instance not in seen:
            if target.instance not in self.joins:
                return True
            seen.add(target.instance)
            target = self.of[target.instance].on_success
        return False


def _is_join(each: Connection) -> bool:
    return each.source.element is None and each.source.interface.rpartition("/")[2] in JOINS


def scenarios(machine: Machine) -> Iterator[dict[int, bool]]:
    """All outcomes of all leaves."""
    for outcomes in product((True, False), repeat=len(machine.leaves)):
        yield dict(zip(machine.leaves, outcomes, strict=True))
