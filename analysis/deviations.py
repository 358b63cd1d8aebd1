"""Walks over the tree of units: what siblings must do, and the canonical scenarios that follow.

Siblings. Of n children of a sequence or a parallel_all all must succeed, of a guard or a
parallel_any one, of a counting parallel a number; it fails once that is impossible. An Inverter
exchanges the ends of its child, and a branch takes those of the child that its condition chooses.
So every step asks for some successes and some failures among the siblings. These end independently
of each other, so it is possible if so many of them can succeed, and so many can fail.

Deviations. If nothing fails but what always does, every unit ends in one way, its *usual* one. To
end in the other way it has to *deviate*: some runners in it have to fail. Which these are follows
from its children: those must deviate that cost the fewest failures, and at the same cost those that
come first, since the runners of a unit stand together in the document. So a scenario is a set of
units that deviate, and all runners elsewhere succeed if they can. For example:

    sequence(a, guard(b, c))    usually everything succeeds, so c never runs
    guard(b, c) fails           both must: its cost is 2
    the sequence fails          a deviates: its cost is 1, that of the guard 2
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeVar

from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.compile import Units

Result = bool | None
"""The end of a unit: True if it succeeds, False if it fails; None while it has not ended."""

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
    """The number of children that must succeed so that the unit does; not for NOT and BRANCH."""
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
        """True if the units before it can end so that it is triggered, if its parent is."""
        return self._open[unit]

    def possible(self, unit: int, needs: Sequence[Need]) -> bool:
        """True if the siblings can do that."""
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
        """The needs for the unit to be triggered, if its parent is."""
        parent, position = self.units.parents[unit], self.units.positions[unit]
        kind = self.units.kinds[parent]
        if position and kind in _IN_ORDER:
            succeed = kind is UnitKind.SEQUENCE
            return (Need(position * succeed, position * (not succeed), BEFORE),)
        if position and kind is UnitKind.BRANCH:
            return (Need(position == 1, position == 2, self.units.children[parent][0]),)
        return ()

    def ways(self, unit: int, result: Result) -> Iterator[tuple[Result, Sequence[Need]]]:
        """The ends of the parent when the unit, once triggered, ends so; and what they need."""
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
        """True where the parent ends like the unit, False where it ends the other way round."""
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


IMPOSSIBLE = -1

_End = TypeVar("_End", bool, Result)


class _Units(NamedTuple):
    """Units that deviate, with those of ``others``; ``cost`` counts the runners that fail."""

    cost: int
    units: Sequence[int]
    others: _Units | None


_GOING_ON = {UnitKind.SEQUENCE: True, UnitKind.GUARD: False}

_NONE = _Units(0, (), None)


class Deviations:
    """Scenarios for what the units of a plan do; unit indices are those of ``Compiled.units``."""

    def __init__(self, units: Units, siblings: Siblings, numbers: Sequence[int]) -> None:
        self.units = units
        self.siblings = siblings
        self.numbers = numbers  # of the runners, by unit
        size = len(units)
        self.usual = [True] * size  # whether the unit succeeds where nothing fails in vain
        self.cost = [IMPOSSIBLE] * size  # the fewest failures with which it ends the other way
        for unit in reversed(range(size)):
            self._settle(unit)
        self._plain = [True] * size  # whether those before it end as usual when it is triggered
        for unit, children in enumerate(units.children):
            going_on = _GOING_ON.get(units.kinds[unit])
            plain = True
            for child in children if going_on is not None else ():
                self._plain[child] = plain
                plain = plain and self.usual[child] is going_on

    def _settle(self, unit: int) -> None:
        kind, children = self.units.kinds[unit], self.units.children[unit]
        if kind is UnitKind.RUNNER:
            self.usual[unit] = self.siblings.succeed[unit]
        elif kind is UnitKind.NOT:
            self.usual[unit] = not self.usual[children[0]]
        elif kind is UnitKind.BRANCH:
            chosen = 1 if self.usual[children[0]] else 2
            self.usual[unit] = chosen < len(children) and self.usual[children[chosen]]
        else:
            successes = sum(self.usual[child] for child in children)
            self.usual[unit] = successes >= successes_needed(self.units, unit)
        able = self.siblings.fail if self.usual[unit] else self.siblings.succeed
        if able[unit]:
            own = kind is UnitKind.RUNNER
            self.cost[unit] = 1 if own else sum(self.cost[each] for each in self._inside(unit))
            assert self.cost[unit] > 0, "without a failure every unit ends as usual"

    def _inside(self, unit: int) -> Sequence[int]:
        """The children that deviate so that the unit does, which must be possible."""
        kind, children = self.units.kinds[unit], self.units.children[unit]
        if kind is UnitKind.NOT:
            return children
        if kind is UnitKind.BRANCH:
            return self._inside_branch(children, not self.usual[unit])
        needed = successes_needed(self.units, unit)
        if self.usual[unit]:
            return self._cheapest(children, Need(0, len(children) - needed + 1))
        return self._cheapest(children, Need(needed, 0))

    def _inside_branch(self, children: Sequence[int], wanted: bool) -> Sequence[int]:
        """Another end of the branch that is chosen, or of the condition, so that another is.

        At the same cost the condition, which comes first.
        """
        condition = children[0]
        choices: list[Sequence[int]] = []
        for deviates in (True, False):
            first = (condition,) if deviates else ()
            chosen = 1 if self.usual[condition] is not deviates else 2
            if deviates and self.cost[condition] == IMPOSSIBLE:
                continue
            if chosen == len(children):
                if not wanted:
                    choices.append(first)
            elif self.usual[children[chosen]] is wanted:
                choices.append(first)
            elif self.cost[children[chosen]] != IMPOSSIBLE:
                choices.append((*first, children[chosen]))
        return min(choices, key=lambda units: sum(self.cost[unit] for unit in units))

    def _cheapest(self, units: Sequence[int], need: Need) -> Sequence[int]:
        """Those of the units that deviate so that the need is met, which must be possible."""
        successes = sum(self.usual[unit] for unit in units)
        failures = len(units) - successes
        wanted, kind = max(
            (need.successes - successes, False),  # so many more of those that fail have to succeed,
            (need.failures - failures, True),  # or the other way round
        )
        if wanted <= 0:
            return ()
        able = [
            unit for unit in units if self.usual[unit] is kind and self.cost[unit] != IMPOSSIBLE
        ]
        assert len(able) >= wanted, "only what is possible is asked for"
        if wanted == 1:
            return (min(able, key=self.cost.__getitem__),)
        if wanted < len(able):
            able = sorted(sorted(able, key=self.cost.__getitem__)[:wanted])
        return able

    # -- scenarios --------------------------------------------------------------------------

    def runners(self, units: Iterable[int]) -> Iterator[int]:
        """Numbers of the runners that fail so that these units deviate."""
        pending = list(units)
        while pending:
            unit = pending.pop()
            if self.units.kinds[unit] is UnitKind.RUNNER:
                yield self.numbers[unit]
            else:
                pending.extend(self._inside(unit))

    def ending(self, unit: int, *, succeeds: bool) -> Iterator[int]:
        """Numbers of the runners that fail so that the unit, once triggered, ends so."""
        return self.runners(() if self.usual[unit] is succeeds else (unit,))

    def triggering(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail so that the unit is triggered."""
        for ancestor in self._ancestry(unit):
            for need in self._triggers(ancestor):
                among = self.siblings.among(ancestor, need)
                yield from self.runners(self._cheapest(among, need))

    def deciding(self, unit: int, *, same: bool) -> Iterator[int]:
        """Numbers of the runners that fail so that the plan ends like the unit.

        Or the other way round, if not ``same``. The unit is triggered then.
        """
        cheapest: dict[bool, _Units] = {True: _NONE}
        for ancestor in self._ancestry(unit):
            triggers = self._triggers(ancestor)
            cheapest = self._best(
                (like is turn, self._more(ancestor, (*triggers, *needs), units))
                for like, units in cheapest.items()
                for turn, needs in self.siblings.turns(ancestor)
                if self.siblings.possible(ancestor, needs)
            )
        return self._runners(cheapest[same])

    def outliving(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail so that the plan completes while the unit is active."""
        cheapest: dict[Result, _Units] = {None: _NONE}
        for ancestor in self._ancestry(unit):
            triggers = self._triggers(ancestor)
            cheapest = self._best(
                (result, self._more(ancestor, (*triggers, *needs), units))
                for before, units in cheapest.items()
                for result, needs in self.siblings.ways(ancestor, before)
                if self.siblings.possible(ancestor, needs)
            )
        return self._runners(cheapest[True])

    def _triggers(self, unit: int) -> Sequence[Need]:
        """The needs for a trigger of the unit, without what is usual in a sequence or a guard."""
        needs = self.siblings.triggers(unit)
        if self._plain[unit] and needs and needs[0].among == BEFORE:
            return ()
        return needs

    def _ancestry(self, unit: int) -> Iterator[int]:
        """The unit and the units around it, without the plan."""
        while self.units.parents[unit] >= 0:
            yield unit
            unit = self.units.parents[unit]

    def _more(self, unit: int, needs: Iterable[Need], others: _Units) -> _Units:
        for need in needs:
            units = self._cheapest(self.siblings.among(unit, need), need)
            if units:
                cost = others.cost + sum(self.cost[each] for each in units)
                others = _Units(cost, units, others)
        return others

    def _best(self, options: Iterable[tuple[_End, _Units]]) -> dict[_End, _Units]:
        """The canonical units for each end."""
        best: dict[_End, _Units] = {}
        for end, units in options:
            other = best.get(end)
            if other is None or units.cost < other.cost:
                best[end] = units
            elif units.cost == other.cost and units is not other:
                best[end] = min(other, units, key=lambda each: sorted(self._runners(each)))
        return best

    def _runners(self, units: _Units) -> Iterator[int]:
        current: _Units | None = units
        while current is not None:
            yield from self.runners(current.units)
            current = current.others
