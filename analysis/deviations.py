"""Canonical scenarios of the structural pass: the fewest failures, and the first of these.

If nothing fails but what always does, every unit ends in one way, its *usual* one. To end in the
other way it has to *deviate*: some runners in it have to fail. Which these are follows from its
children: those must deviate that cost the fewest failures, and at the same cost those that come
first, since the runners of a unit stand together in the document. So a scenario is a set of units
that deviate, and all runners elsewhere succeed if they can.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeVar

from gpsfsm.analysis.siblings import BEFORE, Need, Result, Siblings, successes_needed
from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.compile import Units

__all__ = ["Deviations"]

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
        found: list[Sequence[int]] = []
        for deviates in (True, False):
            first = (condition,) if deviates else ()
            chosen = 1 if self.usual[condition] is not deviates else 2
            if deviates and self.cost[condition] == IMPOSSIBLE:
                continue
            if chosen == len(children):
                if not wanted:
                    found.append(first)
            elif self.usual[children[chosen]] is wanted:
                found.append(first)
            elif self.cost[children[chosen]] != IMPOSSIBLE:
                found.append((*first, children[chosen]))
        return min(found, key=lambda units: sum(self.cost[unit] for unit in units))

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
        found: dict[bool, _Units] = {True: _NONE}
        for ancestor in self._ancestry(unit):
            triggers = self._triggers(ancestor)
            found = self._best(
                (like is turn, self._more(ancestor, (*triggers, *needs), units))
                for like, units in found.items()
                for turn, needs in self.siblings.turns(ancestor)
                if self.siblings.possible(ancestor, needs)
            )
        return self._told(found[same])

    def outliving(self, unit: int) -> Iterator[int]:
        """Numbers of the runners that fail so that the plan completes while the unit is active."""
        found: dict[Result, _Units] = {None: _NONE}
        for ancestor in self._ancestry(unit):
            triggers = self._triggers(ancestor)
            found = self._best(
                (result, self._more(ancestor, (*triggers, *needs), units))
                for before, units in found.items()
                for result, needs in self.siblings.ways(ancestor, before)
                if self.siblings.possible(ancestor, needs)
            )
        return self._told(found[True])

    def _triggers(self, unit: int) -> Sequence[Need]:
        """What triggers the unit, without what is usual anyway in a sequence or a guard."""
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

    def _best(self, found: Iterable[tuple[_End, _Units]]) -> dict[_End, _Units]:
        """The canonical units for each end."""
        best: dict[_End, _Units] = {}
        for end, units in found:
            other = best.get(end)
            if other is None or units.cost < other.cost:
                best[end] = units
            elif units.cost == other.cost and units is not other:
                best[end] = min(other, units, key=lambda each: sorted(self._told(each)))
        return best

    def _told(self, found: _Units) -> Iterator[int]:
        current: _Units | None = found
        while current is not None:
            yield from self.runners(current.units)
            current = current.others
