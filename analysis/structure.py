"""The structural pass: exact answers for independent outcomes, in linear time.

A plan whose outcomes are independent is read-once: every outcome is used in one place only. Then
what a unit can do follows from what its parts can do, and one pass from the leaves and one from
the root decide every question. All of this assumes ``Constraints.separate``: every instance
decides for itself, and none hangs. So every unit that is triggered either succeeds or fails.

``Structure`` answers about units and instances, ``Paths`` about pairs of instances: it walks from a
runner up to the plan. That needs more (``Constraints.independent``): every unit can succeed, and
what one unit does never depends on another beside it.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.deviations import Deviations, Result, Siblings, successes_needed
from gpsfsm.compile import Compiled, UnitKind
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.timing.pairs import Instants


class Structure:
    """The ends that the units of a plan can have; unit indices are those of ``Compiled.units``."""

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
        """True if a unit, once triggered, can succeed, and whether it can fail."""
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
        """True if a unit, once triggered, can succeed; in plans every unit can."""
        return self._ends[0]

    @property
    def can_fail(self) -> list[bool]:
        """True if a unit, once triggered, can fail."""
        return self._ends[1]

    @cached_property
    def siblings(self) -> Siblings:
        """The consequences that the units beside a unit draw from its end."""
        return Siblings(self.units, self.can_succeed, self.can_fail)

    @cached_property
    def reached(self) -> list[bool]:
        """True if a unit can be triggered: all that is before it must end so that it is."""
        reached = [False] * len(self.units)
        reached[0] = True
        for unit, parent in enumerate(self.units.parents):
            if parent >= 0:
                reached[unit] = reached[parent] and self.siblings.opened(unit)
        return reached

    @cached_property
    def _decides(self) -> tuple[list[bool], list[bool]]:
        """True if in some run the plan ends like the unit, and the other way round.

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
        """True if some run gives up if the unit fails, and would not had it succeeded."""
        return self._decides[0]

    @property
    def success_fails_plan(self) -> list[bool]:
        """True if some run gives up if the unit succeeds, and would not had it failed."""
        return self._decides[1]

    @cached_property
    def outlived(self) -> list[bool]:
        """True if some run completes while the unit has been triggered and has not ended yet.

        So it is beside another unit of a parallel_any, which succeeds first, and beside another
        unit of a parallel_all, which fails first, if the plan survives that. Whether the unit is
        triggered early enough is another matter: see ``late``.
        """
        nothing: dict[Result, bool] = dict.fromkeys((True, False, None), False)
        outlived = [nothing] * len(self.units)  # whether some run completes if the unit ends so
        outlived[0] = nothing | {True: True}
        for unit, parent in enumerate(self.units.parents):
            if parent >= 0:
                outlived[unit] = {
                    end: self.siblings.opened(unit)
                    and any(
                        outlived[parent][result] and self.siblings.possible(unit, needs)
                        for result, needs in self.siblings.ways(unit, end)
                    )
                    for end in (True, False, None)
                }
        return [ends[None] for ends in outlived]

    # -- canonical scenarios ----------------------------------------------------------------

    @cached_property
    def deviations(self) -> Deviations:
        """The runners that have to fail, for each end."""
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
        """True if a unit succeeds at the very instant at which it is triggered."""
        instant = [False] * len(self.units)
        for unit in reversed(range(len(instant))):
            kind, children = self.units.kinds[unit], self.units.children[unit]
            if kind is UnitKind.ANY:
                instant[unit] = any(instant[child] for child in children)
            elif kind is UnitKind.GUARD:
                instant[unit] = instant[children[0]]
            elif kind in (UnitKind.EMPTY, UnitKind.SEQUENCE, UnitKind.ALL):
                instant[unit] = all(instant[child] for child in children)
        return instant

    @cached_property
    def late(self) -> list[bool]:
        """True if a unit can only be triggered strictly after the plan has completed.

        So it is where a parallel_any succeeds instantly (it holds an empty control), the plan
        completes with it at that instant, and the unit has to wait for an outcome. No behaviour
        tree holds such a parallel (see ``compile.trees``).
        """
        size = len(self.units)
        if not self.units.plain:
            return [False] * size
        completing = [False] * size  # the plan completes at the instant at which the unit succeeds
        armed = [False] * size  # triggered at the instant at which the plan completes
        late = [False] * size
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
            late[unit] = late[parent] or (armed[parent] and waits)
            armed[unit] = (armed[parent] and not waits) or (
                kind is UnitKind.ANY and completing[parent] and quick
            )
        return late


class Can(NamedTuple):
    """True if a unit can succeed, and whether it can fail, under some condition."""

    succeed: bool
    fail: bool


class Paths:
    """Walks from a runner up to the plan; unit indices are those of ``Compiled.units``."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.units = structure.units
        can_fail = structure.can_fail
        self._failing: list[int] = []  # per unit the number of children that can fail,
        self._last_failing: list[int] = []  # the place of the last one,
        self._last_safe: list[int] = []  # and of the last one that cannot
        for children in self.units.children:
            places = [place for place, child in enumerate(children) if can_fail[child]]
            last = places[-1] if places else -1
            safe = len(children) - 1
            while safe >= 0 and can_fail[children[safe]]:
                safe -= 1
            self._failing.append(len(places))
            self._last_failing.append(last)
            self._last_safe.append(safe)

    def up(self, unit: int) -> Iterator[tuple[int, int]]:
        """(child, parent) from a unit up to the plan."""
        parents = self.units.parents
        while parents[unit] >= 0:
            yield unit, parents[unit]
            unit = parents[unit]

    def _others_can_all_fail(self, parent: int, child: int) -> bool:
        others = len(self.units.children[parent]) - 1
        return self._failing[parent] - self.structure.can_fail[child] == others

    def _another_can_fail(self, parent: int, child: int) -> bool:
        return self._failing[parent] > self.structure.can_fail[child]

    def above(self, child: int, parent: int, can: Can) -> Can:
        """The ends that the parent can have if the child can have no more than ``can`` says."""
        kind, position = self.units.kinds[parent], self.units.positions[child]
        last = len(self.units.children[parent]) - 1
        if kind is UnitKind.SEQUENCE:
            later_fails = self._last_failing[parent] > position
            return Can(can.succeed, can.fail or (can.succeed and later_fails))
        if kind is UnitKind.GUARD:
            rescued = can.fail and position < last
            return Can(can.succeed or rescued, can.fail and self._last_safe[parent] <= position)
        if kind is UnitKind.ALL:
            return Can(can.succeed, can.fail or self._another_can_fail(parent, child))
        return Can(can.succeed or last > 0, can.fail and self._others_can_all_fail(parent, child))

    def happen_together(self, unit: int, success: bool, other: int) -> bool:
        """True if in some run ``unit`` succeeds (or fails) and ``other`` is triggered.

        Both are runners, ``other`` the later one in document order.
        """
        structure, units = self.structure, self.units
        if not (structure.reached[unit] and structure.reached[other]):
            return False
        if not success and not structure.can_fail[unit]:
            return False
        towards = {parent: child for child, parent in self.up(other)}
        can = Can(success, not success)
        for child, parent in self.up(unit):
            if parent in towards:
                kind = units.kinds[parent]
                if kind is UnitKind.SEQUENCE:
                    return can.succeed
                # what is between the two can fail, for the other one is reached
                return can.fail if kind is UnitKind.GUARD else True
            can = self.above(child, parent, can)
        return False

    def while_active(self, unit: int) -> Iterator[tuple[int, int, Can]]:
        """(child, parent, what the child can do while runner ``unit`` is active), upwards."""
        can = Can(False, False)
        for child, parent in self.up(unit):
            yield child, parent, can
            can = self.above(child, parent, can)

    def triggered_without(self, unit: int, without: Avoiding) -> bool:
        """True if runner ``unit`` can be triggered before all successes that are held back."""
        if not self.structure.reached[unit]:
            return False
        for child, parent in self.up(unit):
            before = self.units.children[parent][: self.units.positions[child]]
            kind = self.units.kinds[parent]
            if kind is UnitKind.SEQUENCE and not all(without.succeed[other] for other in before):
                return False
            if kind is UnitKind.GUARD and not all(without.fail[other] for other in before):
                return False
        return True

    def completes_without_after(self, unit: int, without: Avoiding) -> bool:
        """True if some run completes in which ``unit`` succeeds and none of the others is tried.

        Those do not count that would be triggered without its outcome, too. States are (success,
        released): what the unit around it does, and whether it would do so without that outcome.
        Once released, nothing that follows has to wait for it.
        """
        if not self.structure.reached[unit]:
            return False
        states = {(True, False)}
        for child, parent in self.up(unit):
            states = {
                after
                for success, free in states
                for after in self._states_above(child, parent, without, success, free)
            }
        return any(success for success, _ in states)

    def _states_above(
        self, child: int, parent: int, without: Avoiding, success: bool, free: bool
    ) -> Iterator[tuple[bool, bool]]:
        kind, children = self.units.kinds[parent], self.units.children[parent]
        if kind is UnitKind.ALL:
            yield success, free
            if self._another_can_fail(parent, child):
                yield False, True
            return
        if kind is UnitKind.ANY:
            if self._others_can_all_fail(parent, child):
                yield success, free
            if len(children) > 1:
                yield True, True
            return
        later = children[self.units.positions[child] + 1 :]
        if success is not (kind is UnitKind.SEQUENCE) or not later:
            yield success, free
            return
        succeed = [free or without.succeed[other] for other in later]
        fail = [(self.structure.can_fail if free else without.fail)[other] for other in later]
        passing, ending = (succeed, fail) if kind is UnitKind.SEQUENCE else (fail, succeed)
        if all(passing):
            yield success, free
        if _first(passing, ending):
            yield not success, free


class Avoiding:
    """The ends that units can have without those of some runners (``banned``, by number).

    ``tried``: these may be triggered and may fail, but their success is held back; else they may
    not even be triggered.
    """

    def __init__(self, structure: Structure, banned: Collection[int], *, tried: bool) -> None:
        units = structure.units
        self.succeed = [False] * len(units)
        self.fail = [False] * len(units)
        self._tried = tried
        for unit in reversed(range(len(units))):
            kind = units.kinds[unit]
            if kind is UnitKind.RUNNER:
                stopped = structure.number[unit] in banned
                self.succeed[unit] = not stopped
                self.fail[unit] = structure.can_fail[unit] and (tried or not stopped)
            else:
                self._combine(unit, kind, units.children[unit])

    def _combine(self, unit: int, kind: UnitKind, children: tuple[int, ...]) -> None:
        succeed = [self.succeed[child] for child in children]
        fail = [self.fail[child] for child in children]
        # units beside each other all end, in whatever way, unless something is held back
        end = self._tried or all(s or f for s, f in zip(succeed, fail, strict=True))
        if kind is UnitKind.GUARD:
            self.succeed[unit] = _first(fail, succeed)
            self.fail[unit] = all(fail)
        elif kind is UnitKind.ALL:
            self.succeed[unit] = all(succeed)
            self.fail[unit] = any(fail) and end
        elif kind is UnitKind.ANY:
            self.succeed[unit] = any(succeed) and end
            self.fail[unit] = all(fail)
        else:
            self.succeed[unit] = all(succeed)
            self.fail[unit] = _first(succeed, fail)


def _first(passing: list[bool], ending: list[bool]) -> bool:
    """True if ``ending`` holds at some place, and ``passing`` everywhere before it."""
    for passes, ends in zip(passing, ending, strict=True):
        if ends:
            return True
        if not passes:
            return False
    return False
