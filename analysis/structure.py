"""The structural pass: exact answers for independent outcomes, in linear time.

A plan whose outcomes are independent is read-once: every outcome is used in one place only. Then
what a unit can do follows from what its parts can do, and one pass from the leaves and one from
the root decide every question. All of this assumes ``Constraints.independent``: every instance
can succeed, some can also fail, none hangs. So every unit can succeed.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.compile import Compiled, UnitKind
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Iterator

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
    def can_fail(self) -> list[bool]:
        """Whether a unit, once triggered, can fail."""
        found = [False] * len(self.units)
        for unit in reversed(range(len(found))):
            kind, children = self.units.kinds[unit], self.units.children[unit]
            if kind is UnitKind.RUNNER:
                found[unit] = Outcome.FAILED in self.constraints.allowed[self.number[unit]]
            elif kind in (UnitKind.GUARD, UnitKind.ANY):
                found[unit] = all(found[child] for child in children)
            else:
                found[unit] = any(found[child] for child in children)
        return found

    @cached_property
    def reached(self) -> list[bool]:
        """Whether a unit can be triggered: a recovery's only if all before it can fail."""
        found = [False] * len(self.units)
        found[0] = True
        for unit, parent in enumerate(self.units.parents):
            if parent < 0:
                continue
            found[unit] = found[parent]
            position = self.units.positions[unit]
            if self.units.kinds[parent] is UnitKind.GUARD and position:
                before = self.units.children[parent][position - 1]
                # the one before is itself triggered only if all before it can fail
                found[unit] = found[before] and self.can_fail[before]
        return found

    @cached_property
    def fails_plan(self) -> list[bool]:
        """Whether some run gives up because the unit fails, and would not had it succeeded.

        What else must happen for that lies outside the unit: it must be reached, and every
        parallel_any and every recovery around it must have nothing left that saves the plan.
        """
        found = [False] * len(self.units)
        found[0] = True
        saviours = [  # positions of the children that cannot fail; two tell all
            [place for place, child in enumerate(children) if not self.can_fail[child]]
            for children in self.units.children
        ]
        for unit, parent in enumerate(self.units.parents):
            if parent < 0:
                continue
            kind, position = self.units.kinds[parent], self.units.positions[unit]
            found[unit] = found[parent] and self.reached[unit]
            if kind is UnitKind.ANY:
                found[unit] &= saviours[parent] in ([], [position])
            elif kind is UnitKind.GUARD:
                found[unit] &= not saviours[parent] or saviours[parent][-1] <= position
        return found

    def must_fail(self, unit: int) -> Iterator[int]:
        """The siblings that must fail, so that a failure of ``unit`` fails their parent."""
        parent = self.units.parents[unit]
        kind = self.units.kinds[parent]
        siblings = self.units.children[parent]
        if kind is UnitKind.ANY:
            return (sibling for sibling in siblings if sibling != unit)
        if kind is UnitKind.GUARD:
            return iter(siblings[self.units.positions[unit] + 1 :])
        return iter(())

    @cached_property
    def fewest(self) -> list[int]:
        """The fewest failures with which a unit fails; meaningless where it cannot."""
        found = [0] * len(self.units)
        for unit in reversed(range(len(found))):
            kind, children = self.units.kinds[unit], self.units.children[unit]
            if kind is UnitKind.RUNNER:
                found[unit] = 1
            elif kind in (UnitKind.GUARD, UnitKind.ANY):
                found[unit] = sum(found[child] for child in children)
            else:
                found[unit] = min(
                    (found[child] for child in children if self.can_fail[child]), default=0
                )
        return found

    def failing(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail in the canonical scenario in which ``unit`` fails.

        The fewest; among those the first in document order: of two units that fail at the same
        cost the earlier one has the earlier runners.
        """
        pending = [unit]
        while pending:
            current = pending.pop()
            kind, children = self.units.kinds[current], self.units.children[current]
            if kind is UnitKind.RUNNER:
                yield self.number[current]
            elif kind in (UnitKind.GUARD, UnitKind.ANY):
                pending.extend(children)
            else:
                able = [child for child in children if self.can_fail[child]]
                pending.append(min(able, key=lambda child: self.fewest[child]))

    def failing_before(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail in the canonical scenario that triggers ``unit``."""
        for ancestor in self.ancestry(unit):
            parent = self.units.parents[ancestor]
            if parent >= 0 and self.units.kinds[parent] is UnitKind.GUARD:
                for sibling in self.units.children[parent][: self.units.positions[ancestor]]:
                    yield from self.failing(sibling)

    def failing_beside(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that must fail too, so that one of ``unit`` ends the plan."""
        for ancestor in self.ancestry(unit):
            if self.units.parents[ancestor] >= 0:
                for sibling in self.must_fail(ancestor):
                    yield from self.failing(sibling)

    def ancestry(self, unit: int) -> Iterator[int]:
        """The unit and all units around it, up to the plan."""
        while unit >= 0:
            yield unit
            unit = self.units.parents[unit]

    @cached_property
    def survived(self) -> list[bool]:
        """Whether some run completes although the unit fails: a recovery or a unit beside it."""
        found = [False] * len(self.units)
        for unit, parent in enumerate(self.units.parents):
            if parent >= 0:
                kind, last = self.units.kinds[parent], len(self.units.children[parent]) - 1
                saved = (kind is UnitKind.ANY and last > 0) or (
                    kind is UnitKind.GUARD and self.units.positions[unit] < last
                )
                found[unit] = self.reached[unit] and (found[parent] or saved)
        return found

    @cached_property
    def outlived(self) -> list[bool]:
        """Whether some run completes while the unit has been triggered and has not ended yet.

        So it is beside another unit of a parallel_any, which succeeds first, and beside another
        unit of a parallel_all, which fails first, if the plan survives that. Whether the unit is
        triggered early enough is another matter: see ``late``.
        """
        found = [False] * len(self.units)
        failing = [sum(self.can_fail[child] for child in kids) for kids in self.units.children]
        for unit, parent in enumerate(self.units.parents):
            if parent >= 0:
                kind = self.units.kinds[parent]
                others = (kind is UnitKind.ANY and len(self.units.children[parent]) > 1) or (
                    kind is UnitKind.ALL
                    and self.survived[parent]
                    and failing[parent] > self.can_fail[unit]
                )
                found[unit] = self.reached[unit] and (found[parent] or others)
        return found

    def failing_to_outlive(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail in the canonical scenario in which ``unit`` is outlived.

        None but those that trigger it, if a parallel_any is around it; else also one unit beside
        it in a parallel_all.
        """
        yield from self.failing_before(unit)
        choices: list[list[int]] = []
        for ancestor in self.ancestry(unit):
            parent = self.units.parents[ancestor]
            kind = UnitKind.EMPTY if parent < 0 else self.units.kinds[parent]
            siblings = self.units.children[parent]
            if kind is UnitKind.ANY and len(siblings) > 1:
                return
            if kind is UnitKind.ALL and self.survived[parent]:
                able = [other for other in siblings if other != ancestor and self.can_fail[other]]
                if able:
                    cheapest = min(able, key=lambda child: self.fewest[child])
                    choices.append(sorted(self.failing(cheapest)))
        yield from min(choices, key=lambda failing: (len(failing), failing))

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
        completes with it at that instant, and the unit has to wait for an outcome.
        """
        size = len(self.units)
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
