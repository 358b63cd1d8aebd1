"""What one leaf of the unit tree allows: structural answers about pairs of runner instances.

Each walks from a runner up to the plan. Like ``structure`` this is exact for independent outcomes
only (``Constraints.independent``): every unit can succeed, and what one unit does never depends on
another beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from gpsfsm.analysis.structure import Structure

__all__ = ["Avoiding", "Can", "Paths"]


class Can(NamedTuple):
    """Whether a unit can succeed, and whether it can fail, under some condition."""

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
        """What the parent can do if the child can do no more than ``can`` says."""
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
        """Whether in some run ``unit`` succeeds (or fails) and ``other`` is triggered.

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
        """Whether runner ``unit`` can be triggered before all successes that are held back."""
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
        """Whether some run completes in which ``unit`` succeeds and none of the others is tried.

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
    """What units can do without something of some runners (``banned``, by number).

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
    """Whether ``ending`` holds at some place, and ``passing`` everywhere before it."""
    for passes, ends in zip(passing, ending, strict=True):
        if ends:
            return True
        if not passes:
            return False
    return False
