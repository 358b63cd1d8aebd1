"""Which runners can be needed at one instant: the structural pass of the analysis ``loading``.

A *load* is a set of runners (interface and provider), as the bits of a number: those of which an
instance in a unit is active at some instant. Since outcomes are independent and durations free,
units side by side are at any of their instants independently of each other, and the loads of a
unit follow from those of its children. Only the largest loads matter: subsets are dropped.

There may still be very many. So a first pass keeps only a few of the largest. What it finds is
possible, and mostly it is also as much as there can be: all runners, or as many as instances can be
active at once. Else a second pass keeps all loads, within a limit of steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from gpsfsm.analysis.structure import Structure

__all__ = ["UNKNOWN", "most_at_once"]

UNKNOWN = -1

_FEW = 16
"""Loads that the first pass keeps of a unit."""

_MAX_STEPS = 1_500_000
"""Loads that the second pass compares: some tenths of a second."""

_Loads = tuple[int, ...]
"""Loads, none of them a subset of another. Empty: the unit is never at such an instant."""

_IDLE: _Loads = (0,)
_NEVER: _Loads = ()


@dataclass(frozen=True, slots=True)
class _Unit:
    """The loads of a unit, by how far it is.

    ``runs``: it has been triggered and has not ended; ``succeeded``, ``failed``: it has, and some
    of its instances may run on; ``now``, ``lost``: it succeeds or fails at this very instant, by
    outcomes that come at this instant, which is not that of its trigger; ``begins``: this is the
    instant of its trigger; ``instant``: it succeeds at that instant.
    """

    runs: _Loads
    succeeded: _Loads
    failed: _Loads
    now: _Loads
    lost: _Loads
    begins: int
    instant: bool


class _TooMuch(Exception):  # noqa: N818  (not an error: there is no answer)
    """The limit of steps is reached."""


def most_at_once(structure: Structure, pairs: Sequence[int], kinds: int) -> int:
    """The greatest load of a plan, or UNKNOWN.

    ``pairs`` numbers the runners of the instances; ``kinds`` is how many of them some run needs.
    An instant counts up to that of the end of the run, which is the last.
    """
    instants = UnitKind.EMPTY in structure.units.kinds
    first = _Algebra(instants=instants, keep=_FEW)
    found = _load(structure, pairs, first)
    if first.complete or found == kinds:
        return found
    if not instants and found == _most_instances(structure):
        return found
    try:
        return _load(structure, pairs, _Algebra(instants=instants))
    except _TooMuch:
        return UNKNOWN


def _load(structure: Structure, pairs: Sequence[int], algebra: _Algebra) -> int:
    units = structure.units
    found: list[_Unit] = [_EMPTY] * len(units)
    for unit in reversed(range(len(units))):
        kind = units.kinds[unit]
        if kind is UnitKind.RUNNER:
            ended = _IDLE if structure.can_fail[unit] else _NEVER
            load = 1 << pairs[structure.number[unit]]
            found[unit] = _Unit((load,), _IDLE, ended, _IDLE, ended, load, instant=False)
        elif kind is not UnitKind.DEAD:
            combine = algebra.combined[kind]
            found[unit] = combine([found[child] for child in units.children[unit]])
    whole = found[0]
    loads = (*whole.runs, *whole.now, *whole.lost, *((whole.begins,) * whole.instant))
    return max(load.bit_count() for load in loads)


def _most_instances(structure: Structure) -> int:
    """At least as many instances as can be active at once, each counted for itself."""
    units = structure.units
    active = [1] * len(units)  # while the unit goes on, or when it has ended and left some behind
    for unit in reversed(range(len(units))):
        kind, children = units.kinds[unit], units.children[unit]
        if kind in (UnitKind.ALL, UnitKind.ANY):
            active[unit] = sum(active[child] for child in children)
        elif kind is not UnitKind.RUNNER:
            behind = [_left_behind(structure, active, child) for child in children]
            before = 0
            active[unit] = 0
            for child, left in zip(children, behind, strict=True):
                active[unit] = max(active[unit], before + active[child])
                before += left
    return active[0]


def _left_behind(structure: Structure, active: Sequence[int], unit: int) -> int:
    """At most so many instances go on in a unit that has ended."""
    return 0 if structure.units.kinds[unit] is UnitKind.RUNNER else active[unit]


_EMPTY = _Unit(_NEVER, _IDLE, _NEVER, _NEVER, _NEVER, 0, instant=True)


class _Algebra:
    """The loads of a unit from those of its children, within a limit of steps.

    ``instants``: some unit may end at the instant of its trigger. Without one, what ends a unit
    triggers nothing else at that instant, and ``now`` and ``lost`` hold nothing that ``runs`` does
    not hold; so they are left out. ``keep``: so many loads are kept of a unit, the largest;
    ``complete`` tells whether any was dropped. Without it, _TooMuch is raised at the limit.
    """

    def __init__(self, *, instants: bool, keep: int | None = None) -> None:
        self.complete = True
        self._instants = instants
        self._keep = keep
        self._left = _MAX_STEPS
        self.combined: dict[UnitKind, Callable[[list[_Unit]], _Unit]] = {
            UnitKind.EMPTY: self._sequence,
            UnitKind.SEQUENCE: self._sequence,
            UnitKind.GUARD: self._guard,
            UnitKind.ALL: self._all,
            UnitKind.ANY: self._any,
        }

    def _spend(self, steps: int) -> None:
        self._left -= steps
        if self._left < 0 and self._keep is None:
            raise _TooMuch

    def _either(self, *families: _Loads) -> _Loads:
        """One or the other."""
        if len(families) == 2 and families[0] == families[1]:
            return families[0]
        loads = set().union(*families)
        if len(loads) <= 1:
            return tuple(loads)
        kept: list[int] = []
        for load in sorted(loads, key=lambda load: (-load.bit_count(), load)):
            if len(kept) == self._keep:
                self.complete = False
                break
            if all(load & ~other for other in kept):
                kept.append(load)
            self._spend(1 + len(kept))
        return tuple(kept)

    def _both(self, one: _Loads, other: _Loads) -> _Loads:
        """Each at any of its instants; never, if one never is."""
        if not one or not other:
            return _NEVER
        if _IDLE in (one, other):
            return other if one == _IDLE else one
        self._spend(len(one) * len(other))
        return self._either(tuple(first | second for first in one for second in other))

    def _sequence(self, children: list[_Unit]) -> _Unit:
        """Each child after the success of the one before; these may have left something behind."""
        behind: _Loads = _IDLE
        runs = failed = now = lost = _NEVER
        begins, instant = 0, True
        for child in children:
            if instant:
                begins |= child.begins
            instant = instant and child.instant
            runs = self._either(runs, self._both(behind, child.runs))
            failed = self._either(failed, self._both(behind, child.failed))
            lost = self._either(lost, self._both(behind, child.lost))
            later = self._both(now, (child.begins,)) if child.instant else _NEVER
            now = self._either(later, self._both(behind, child.now))
            behind = self._both(behind, child.succeeded)
        return _Unit(runs, behind, failed, now, lost, begins, instant)

    def _guard(self, children: list[_Unit]) -> _Unit:
        """Each child after the failure of the one before."""
        behind: _Loads = _IDLE
        runs = succeeded = now = _NEVER
        lost = _NEVER
        for child in children:
            runs = self._either(runs, self._both(behind, child.runs))
            succeeded = self._either(succeeded, self._both(behind, child.succeeded))
            later = self._both(lost, (child.begins,)) if child.instant else _NEVER
            now = self._either(now, later, self._both(behind, child.now))
            lost = self._both(behind, child.lost)
            behind = self._both(behind, child.failed)
        return _Unit(runs, succeeded, behind, now, lost, children[0].begins, children[0].instant)

    def _all(self, children: list[_Unit]) -> _Unit:
        """Every child has succeeded, or some child has failed, or neither."""
        going = [self._either(child.runs, child.succeeded) for child in children]
        ready = [child.succeeded for child in children]
        succeeded = _IDLE
        for loads in ready:
            succeeded = self._both(succeeded, loads)
        return _Unit(
            runs=self._one(going, [child.runs for child in children]),
            succeeded=succeeded,
            failed=self._one(going, [child.failed for child in children]),
            now=self._one(ready, [child.now for child in children]) if self._instants else _NEVER,
            lost=self._one(going, [child.lost for child in children]) if self._instants else _NEVER,
            begins=_union(child.begins for child in children),
            instant=all(child.instant for child in children),
        )

    def _any(self, children: list[_Unit]) -> _Unit:
        """The same with the roles of success and failure exchanged, but for the first instant."""
        found = self._all([_exchanged(child) for child in children])
        return _Unit(
            runs=found.runs,
            succeeded=found.failed,
            failed=found.succeeded,
            now=found.lost,
            lost=found.now,
            begins=found.begins,
            instant=any(child.instant for child in children),
        )

    def _one(self, common: list[_Loads], special: list[_Loads]) -> _Loads:
        """At least one child is at an instant of its ``special``, the others of ``common``."""
        without: _Loads = _IDLE  # of those so far none is
        found: _Loads = _NEVER
        for usual, wanted in zip(common, special, strict=True):
            either = self._either(usual, wanted)
            found = self._either(self._both(found, either), self._both(without, wanted))
            without = self._both(without, usual)
        return found


def _exchanged(unit: _Unit) -> _Unit:
    return _Unit(
        unit.runs, unit.failed, unit.succeeded, unit.lost, unit.now, unit.begins, unit.instant
    )


def _union(loads: Iterable[int]) -> int:
    found = 0
    for load in loads:
        found |= load
    return found
