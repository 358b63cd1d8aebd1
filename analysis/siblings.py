"""What the units beside a unit make of its end: the steps of every walk over the tree of units.

Of n children of a sequence or a parallel_all all must succeed, of a guard or a parallel_any one,
of a counting parallel a number; it fails once that is impossible. An Inverter exchanges the ends of
its child, and a branch takes those of the child that its condition chooses. So every step asks for
some successes and some failures among the siblings. These end independently of each other, so it
is possible if so many of them can succeed, and so many can fail.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.compile import Units

__all__ = ["BEFORE", "REST", "Need", "Result", "Siblings", "successes_needed"]

Result = bool | None
"""How a unit ends: True if it succeeds, False if it fails; None while it has not ended."""

REST, BEFORE = -1, -2


class Need(NamedTuple):
    """At least so many successes and failures among some units.

    ``among`` is one unit, or REST: those that run beside a unit or after it, or BEFORE: those that
    run before it.
    """

    successes: int
    failures: int
    among: int = REST


_IN_ORDER = (UnitKind.SEQUENCE, UnitKind.GUARD, UnitKind.DEAD)


def successes_needed(units: Units, unit: int) -> int:
    """How many children must succeed so that the unit does; not for NOT and BRANCH."""
    kind = units.kinds[unit]
    if kind in (UnitKind.GUARD, UnitKind.ANY, UnitKind.DEAD):
        return 1
    counts = kind in (UnitKind.COUNT, UnitKind.WAIT)
    return units.needs[unit] if counts else len(units.children[unit])


class Siblings:
    """The steps from units to the units around them; ``succeed`` and ``fail`` say what units can.

    Unit indices are those of ``Compiled.units``. No step is asked for at the root.
    """

    def __init__(self, units: Units, succeed: Sequence[bool], fail: Sequence[bool]) -> None:
        self.units = units
        self.succeed = succeed
        self.fail = fail
        size = len(units)
        self._open = [True] * size  # those before it can end so that it is triggered
        self._count = [0] * size  # how many run beside it or after it,
        self._can_succeed = [0] * size  # how many of these can succeed,
        self._can_fail = [0] * size  # how many can fail,
        self._needed = [0] * size  # and how many of it and these must succeed
        for unit, kind in enumerate(units.kinds):
            children = units.children[unit]
            if kind in _IN_ORDER:
                self._in_order(children, succeed if kind is UnitKind.SEQUENCE else fail)
                if kind is not UnitKind.SEQUENCE:
                    for child in children:
                        self._needed[child] = 1
            elif kind is UnitKind.BRANCH:
                for child, able in zip(children[1:], (succeed, fail), strict=False):
                    self._open[child] = able[children[0]]
            elif kind is not UnitKind.NOT:
                self._side_by_side(unit, children)

    def _in_order(self, children: Sequence[int], going_on: Sequence[bool]) -> None:
        before = True
        for child in children:
            self._open[child] = before
            before = before and going_on[child]
        succeed = fail = 0
        for count, child in enumerate(reversed(children)):
            self._count[child], self._needed[child] = count, count + 1
            self._can_succeed[child], self._can_fail[child] = succeed, fail
            succeed += self.succeed[child]
            fail += self.fail[child]

    def _side_by_side(self, unit: int, children: Sequence[int]) -> None:
        succeed = sum(self.succeed[child] for child in children)
        fail = sum(self.fail[child] for child in children)
        needed = successes_needed(self.units, unit)
        for child in children:
            self._count[child], self._needed[child] = len(children) - 1, needed
            self._can_succeed[child] = succeed - self.succeed[child]
            self._can_fail[child] = fail - self.fail[child]

    def opened(self, unit: int) -> bool:
        """Whether the units before it can end so that it is triggered, if its parent is."""
        return self._open[unit]

    def possible(self, unit: int, needs: Sequence[Need]) -> bool:
        """Whether the siblings can do that."""
        for successes, failures, among in needs:
            if among == BEFORE:
                able = self._open[unit]
            elif among == REST:
                able = self._can_succeed[unit] >= successes and self._can_fail[unit] >= failures
            else:
                able = self.succeed[among] >= successes and self.fail[among] >= failures
            if not able:
                return False
        return True

    def among(self, unit: int, need: Need) -> Sequence[int]:
        """The units of which a need speaks, in document order."""
        if need.among >= 0:
            return (need.among,)
        parent, position = self.units.parents[unit], self.units.positions[unit]
        children = self.units.children[parent]
        if need.among == BEFORE:
            return children[:position]
        if self.units.kinds[parent] in _IN_ORDER:
            return children[position + 1 :]
        return [child for child in children if child != unit]

    def triggers(self, unit: int) -> Sequence[Need]:
        """What triggers the unit, if its parent is triggered."""
        parent, position = self.units.parents[unit], self.units.positions[unit]
        kind = self.units.kinds[parent]
        if position and kind in _IN_ORDER:
            succeed = kind is UnitKind.SEQUENCE
            return (Need(position * succeed, position * (not succeed), BEFORE),)
        if position and kind is UnitKind.BRANCH:
            return (Need(position == 1, position == 2, self.units.children[parent][0]),)
        return ()

    def ways(self, unit: int, result: Result) -> Iterator[tuple[Result, Sequence[Need]]]:
        """How the parent may end when the unit, once triggered, ends so; and what that needs."""
        parent = self.units.parents[unit]
        kind = self.units.kinds[parent]
        if kind is UnitKind.NOT:
            yield (None if result is None else not result), ()
        elif kind is UnitKind.BRANCH:
            yield from self._branch_ways(unit, result)
        elif result is None and (kind in _IN_ORDER or kind is UnitKind.WAIT):
            yield None, ()
        else:
            needed, count = self._needed[unit], self._count[unit]
            yield True, (Need(needed - (result is True), 0),)
            yield False, (Need(0, count + 2 - needed - (result is False)),)
            if result is None:
                yield None, (Need(needed - 1, count + 1 - needed),)

    def _branch_ways(self, unit: int, result: Result) -> Iterator[tuple[Result, Sequence[Need]]]:
        children = self.units.children[self.units.parents[unit]]
        chosen = 1 if result else 2
        if unit != children[0] or result is None:
            yield result, ()
        elif chosen == len(children):
            yield False, ()
        else:
            yield True, (Need(1, 0, children[chosen]),)
            yield False, (Need(0, 1, children[chosen]),)

    def turns(self, unit: int) -> Iterator[tuple[bool, Sequence[Need]]]:
        """Where the parent ends like the unit (True) or the other way round (False)."""
        parent = self.units.parents[unit]
        kind, children = self.units.kinds[parent], self.units.children[parent]
        if kind is UnitKind.NOT:
            yield False, ()
        elif kind is UnitKind.BRANCH and unit == children[0]:
            then, *otherwise = children[1:]
            yield True, (Need(1, 0, then), *(Need(0, 1, other) for other in otherwise))
            for other in otherwise:
                yield False, (Need(0, 1, then), Need(1, 0, other))
        elif kind is UnitKind.BRANCH:
            yield True, ()
        else:
            needed, count = self._needed[unit], self._count[unit]
            yield True, (Need(needed - 1, count + 1 - needed),)
