"""The structural pass: exact answers for independent outcomes, in linear time.

A plan whose outcomes are independent is read-once: every outcome is used in one place only. Then
what a unit can do follows from what its parts can do, and one pass from the leaves and one from
the root decide every question. All of this assumes ``Constraints.separate``: every instance
decides for itself, and none hangs. So every unit that is triggered either succeeds or fails.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.analysis.deviations import Deviations
from gpsfsm.analysis.siblings import Result, Siblings, successes_needed
from gpsfsm.compile import Compiled, UnitKind
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.timing.instants import Instants

__all__ = ["Structure"]


class Structure:
    """What the units of a plan can do; unit indices are those of ``Compiled.units``."""

    def __init__(
        self, compiled: Compiled, constraints: Constraints, clock: Instants | None = None
    ) -> None:
        self.compiled = compiled
        self.constraints = constraints
        self.clock = clock  # what is asked besides where durations are declared
        self.units = compiled.units
        plan = compiled.automaton.plan
        numbers = {runner.index: number for number, runner in enumerate(plan.runners)}
        self.number = [
            numbers[element] if kind is UnitKind.RUNNER else -1
            for kind, element in zip(self.units.kinds, self.units.elements, strict=True)
        ]
        self.unit_of = [0] * len(plan.runners)
        for unit, number in enumerate(self.number):
            if number >= 0:
                self.unit_of[number] = unit
        self.unit_of_element = {
            element: unit
            for unit, (kind, element) in enumerate(
                zip(self.units.kinds, self.units.elements, strict=True)
            )
            if kind is not UnitKind.GUARD
        }

    @cached_property
    def _ends(self) -> tuple[list[bool], list[bool]]:
        """Whether a unit, once triggered, can succeed, and whether it can fail."""
        size = len(self.units)
        succeed, fail = [False] * size, [False] * size
        for unit in reversed(range(size)):
            kind, children = self.units.kinds[unit], self.units.children[unit]
            if kind is UnitKind.RUNNER:
                allowed = self.constraints.allowed[self.number[unit]]
                succeed[unit] = Outcome.SUCCEEDED in allowed
                fail[unit] = allowed != {Outcome.SUCCEEDED}
            elif kind is UnitKind.NOT:
                succeed[unit], fail[unit] = fail[children[0]], succeed[children[0]]
            elif kind is UnitKind.BRANCH:
                condition, then, *others = children
                otherwise = (succeed[others[0]], fail[others[0]]) if others else (False, True)
                succeed[unit], fail[unit] = (
                    (succeed[condition] and able) or (fail[condition] and other)
                    for able, other in zip((succeed[then], fail[then]), otherwise, strict=True)
                )
            else:
                needed = successes_needed(self.units, unit)
                succeed[unit] = sum(succeed[child] for child in children) >= needed
                fail[unit] = sum(fail[child] for child in children) > len(children) - needed
        return succeed, fail

    @property
    def can_succeed(self) -> list[bool]:
        """Whether a unit, once triggered, can succeed; in plans every unit can."""
        return self._ends[0]

    @property
    def can_fail(self) -> list[bool]:
        """Whether a unit, once triggered, can fail."""
        return self._ends[1]

    @cached_property
    def siblings(self) -> Siblings:
        """What the units beside a unit make of its end."""
        return Siblings(self.units, self.can_succeed, self.can_fail)

    @cached_property
    def reached(self) -> list[bool]:
        """Whether a unit can be triggered: all that is before it must end so that it is."""
        found = [False] * len(self.units)
        found[0] = True
        for unit, parent in enumerate(self.units.parents):
            if parent >= 0:
                found[unit] = found[parent] and self.siblings.opened(unit)
        return found

    @cached_property
    def _decides(self) -> tuple[list[bool], list[bool]]:
        """Whether in some run the plan ends like the unit, and the other way round.

        What must happen for that lies outside the unit: it must be reached, and nothing around it
        must settle how the plan ends.
        """
        size = len(self.units)
        like, unlike = [False] * size, [False] * size
        like[0] = True
        for unit, parent in enumerate(self.units.parents):
            if parent < 0 or not self.siblings.opened(unit):
                continue
            for same, needs in self.siblings.turns(unit):
                if self.siblings.possible(unit, needs):
                    like[unit] |= like[parent] if same else unlike[parent]
                    unlike[unit] |= unlike[parent] if same else like[parent]
        return like, unlike

    @property
    def fails_plan(self) -> list[bool]:
        """Whether some run gives up if the unit fails, and would not had it succeeded."""
        return self._decides[0]

    @property
    def success_fails_plan(self) -> list[bool]:
        """Whether some run gives up if the unit succeeds, and would not had it failed."""
        return self._decides[1]

    @cached_property
    def outlived(self) -> list[bool]:
        """Whether some run completes while the unit has been triggered and has not ended yet.

        So it is beside another unit of a parallel_any, which succeeds first, and beside another
        unit of a parallel_all, which fails first, if the plan survives that. Whether the unit is
        triggered early enough is another matter: see ``late``.
        """
        nothing: dict[Result, bool] = dict.fromkeys((True, False, None), False)
        found = [nothing] * len(self.units)  # whether some run completes if the unit ends so
        found[0] = nothing | {True: True}
        for unit, parent in enumerate(self.units.parents):
            if parent >= 0:
                found[unit] = {
                    end: self.siblings.opened(unit)
                    and any(
                        found[parent][result] and self.siblings.possible(unit, needs)
                        for result, needs in self.siblings.ways(unit, end)
                    )
                    for end in (True, False, None)
                }
        return [ends[None] for ends in found]

    # -- canonical scenarios ----------------------------------------------------------------

    @cached_property
    def deviations(self) -> Deviations:
        """Which runners have to fail for what."""
        return Deviations(self.units, self.siblings, self.number)

    def outcome(self, number: int, failing: Collection[int]) -> Outcome:
        """The outcome of a runner in the scenario in which ``failing`` are those that have to fail.

        FAILED comes before NO_START.
        """
        allowed = self.constraints.allowed[number]
        if number not in failing and Outcome.SUCCEEDED in allowed:
            return Outcome.SUCCEEDED
        return Outcome.FAILED if Outcome.FAILED in allowed else Outcome.NO_START

    def failing(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail in the canonical scenario in which ``unit`` fails."""
        return self.deviations.ending(unit, succeeds=False)

    def succeeding(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail in the canonical scenario in which it succeeds."""
        return self.deviations.ending(unit, succeeds=True)

    def failing_before(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail in the canonical scenario that triggers ``unit``."""
        return self.deviations.triggering(unit)

    def failing_around(self, unit: int, *, same: bool = True) -> Iterator[int]:
        """Numbers of the runners that fail so that the unit decides how the plan ends.

        It is triggered, and the plan ends like it, or the other way round if not ``same``.
        """
        return self.deviations.deciding(unit, same=same)

    def failing_to_outlive(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail in the canonical scenario in which ``unit`` is outlived.

        In a plan none but those that trigger it, if a parallel_any is around it; else also one unit
        beside it in a parallel_all.
        """
        return self.deviations.outliving(unit)

    @cached_property
    def instant(self) -> list[bool]:
        """Whether a unit succeeds at the very instant at which it is triggered."""
        found = [False] * len(self.units)
        for unit in reversed(range(len(found))):
            kind, children = self.units.kinds[unit], self.units.children[unit]
            if kind is UnitKind.ANY:
                found[unit] = any(found[child] for child in children)
            elif kind is UnitKind.GUARD:
                found[unit] = found[children[0]]
            elif kind in (UnitKind.EMPTY, UnitKind.SEQUENCE, UnitKind.ALL):
                found[unit] = all(found[child] for child in children)
        return found

    @cached_property
    def late(self) -> list[bool]:
        """Whether a unit can only be triggered strictly after the plan has completed.

        So it is where a parallel_any succeeds instantly (it holds an empty control), the plan
        completes with it at that instant, and the unit has to wait for an outcome. No behaviour
        tree holds such a parallel (see ``compile.instants``).
        """
        size = len(self.units)
        if not self.units.plain:
            return [False] * size
        completing = [False] * size  # the plan completes at the instant at which the unit succeeds
        armed = [False] * size  # triggered at the instant at which the plan completes
        found = [False] * size
        completing[0] = True
        slow = [
            [index for index, child in enumerate(children) if not self.instant[child]]
            for children in self.units.children
        ]
        for unit, parent in enumerate(self.units.parents):
            if parent < 0:
                continue
            kind, position = self.units.kinds[parent], self.units.positions[unit]
            quick = len(slow[parent]) < len(self.units.children[parent]) - self.instant[unit]
            first_slow = slow[parent][0] if slow[parent] else size
            last_slow = slow[parent][-1] if slow[parent] else -1
            alone_slow = slow[parent] in ([], [position])
            completing[unit] = completing[parent] and (
                kind in (UnitKind.ANY, UnitKind.GUARD)
                or (kind is UnitKind.SEQUENCE and last_slow <= position)
                or (kind is UnitKind.ALL and alone_slow)
            )
            waits = (kind is UnitKind.GUARD and position > 0) or (
                kind is UnitKind.SEQUENCE and first_slow < position
            )
            found[unit] = found[parent] or (armed[parent] and waits)
            armed[unit] = (armed[parent] and not waits) or (
                kind is UnitKind.ANY and completing[parent] and quick
            )
        return found
