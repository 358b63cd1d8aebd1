"""Runners that can be needed at one instant: the structural pass of the analysis ``loading``.

A *load* is a set of runners (interface and provider), as the bits of a number: those of which an
instance in a unit is active at some instant. Since outcomes are independent and durations free,
units side by side are at any of their instants independently of each other, and the loads of a
unit follow from those of its children. Only the largest loads matter: subsets are dropped.

    parallel_all(a, sequence(b, c))     with the bits a=1, b=2, c=4
    the sequence                        loads 2 and 4: one after the other
    the parallel_all                    loads 3 and 5; 1, 2 and 4 are subsets: two runners at once

There may still be very many. So a first pass keeps only a few of the largest. What it finds is
possible, and mostly it is also as much as there can be: all runners, or as many as instances can be
active at once. Else a second pass keeps all loads, within a limit of steps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.deviations import successes_needed
from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from gpsfsm.analysis.structure import Structure

UNKNOWN = -1

_FEW = 16
"""Loads that the first pass keeps of a unit."""

_MAX_STEPS = 1_500_000
"""Loads that the second pass compares: some tenths of a second."""

_PARALLEL = (UnitKind.ALL, UnitKind.ANY, UnitKind.COUNT, UnitKind.WAIT)

_MAX_COUNTED = 20_000
"""Children times sums of a parallel that counts."""

_Pair = tuple[int, int]

_Loads = tuple[int, ...]
"""Loads, none of them a subset of another. Empty: the unit is never at such an instant."""

_IDLE: _Loads = (0,)
_NEVER: _Loads = ()


class _Unit(NamedTuple):
    """The loads of a unit, by how far it is.

    ``runs``: it has been triggered and has not ended; ``succeeded``, ``failed``: it has, and some
    of its instances may run on; ``now``, ``lost``: it succeeds or fails at this very instant, by
    outcomes that come at this instant, which is not that of its trigger; ``begins``: this is the
    instant of its trigger; ``instant``: it succeeds (True) or fails (False) at that instant.
    """

    runs: _Loads
    succeeded: _Loads
    failed: _Loads
    now: _Loads
    lost: _Loads
    begins: int
    instant: bool | None


class _TooMuchError(Exception):
    """The limit of steps is reached."""


def most_at_once(structure: Structure, pairs: Sequence[int], kinds: int) -> int:
    """The greatest load of a plan, or UNKNOWN.

    ``pairs`` numbers the runners of the instances; ``kinds`` is how many of them some run needs.
    An instant counts up to that of the end of the run, which is the last.
    """
    instants = UnitKind.EMPTY in structure.units.kinds
    first = _Algebra(instants=instants, keep=_FEW)
    try:
        most = _load(structure, pairs, first)
        assert most <= kinds, "no instant needs runners that no run needs"
        if first.complete or most == kinds:
            return most
        if not instants and most == _most_instances(structure):
            return most
        return _load(structure, pairs, _Algebra(instants=instants))
    except _TooMuchError:
        return UNKNOWN


def _load(structure: Structure, pairs: Sequence[int], algebra: _Algebra) -> int:
    units = structure.units
    results: list[_Unit] = [_EMPTY] * len(units)
    for unit in reversed(range(len(units))):
        kind = units.kinds[unit]
        if kind is UnitKind.RUNNER:
            done = _IDLE if structure.can_succeed[unit] else _NEVER
            ended = _IDLE if structure.can_fail[unit] else _NEVER
            load = 1 << pairs[structure.number[unit]]
            results[unit] = _Unit((load,), done, ended, done, ended, load, instant=None)
        elif kind in (UnitKind.COUNT, UnitKind.WAIT):
            children = [results[child] for child in units.children[unit]]
            combined = algebra.count if kind is UnitKind.COUNT else algebra.wait
            results[unit] = combined(children, units.needs[unit])
        elif kind is not UnitKind.DEAD:
            combine = algebra.combined[kind]
            results[unit] = combine([results[child] for child in units.children[unit]])
    whole = results[0]
    at_once: _Loads = () if whole.instant is None else (whole.begins,)
    loads = (*whole.runs, *whole.now, *whole.lost, *at_once)
    return max(load.bit_count() for load in loads)


def _most_instances(structure: Structure) -> int:
    """At least as many instances as can be active at once, each counted for itself."""
    units = structure.units
    active = [0] * len(units)  # while the unit goes on,
    behind = [0] * len(units)  # and when it has ended and left some behind
    for unit in reversed(range(len(units))):
        kind, children = units.kinds[unit], units.children[unit]
        if kind is UnitKind.RUNNER:
            active[unit] = 1
        elif kind in _PARALLEL:
            active[unit] = sum(active[child] for child in children)
            # it ends with so many children at least, those that take the fewest with them
            needed = successes_needed(units, unit)
            ended = min(needed, len(children) - needed + 1)
            if kind is UnitKind.WAIT:
                ended = len(children)
            gone = sorted(active[child] - behind[child] for child in children)
            behind[unit] = active[unit] - sum(gone[:ended])
        else:
            for child in children:
                active[unit] = max(active[unit], behind[unit] + active[child])
                behind[unit] += behind[child]
        active[unit] = max(active[unit], behind[unit])
    return active[0]


_EMPTY = _Unit(_NEVER, _IDLE, _NEVER, _NEVER, _NEVER, 0, instant=True)


class _Algebra:
    """The loads of a unit from those of its children, within a limit of steps.

    ``instants``: some unit may end at the instant of its trigger. Without one, what ends a unit
    triggers nothing else at that instant, and ``now`` and ``lost`` hold nothing that ``runs`` does
    not hold; so they are left out. ``keep``: so many loads are kept of a unit, the largest;
    ``complete`` tells whether any was dropped. Without it, _TooMuchError is raised at the limit.
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
            UnitKind.NOT: _not,
            UnitKind.BRANCH: self._branch,
        }

    def _spend(self, steps: int) -> None:
        self._left -= steps
        if self._left < 0 and self._keep is None:
            raise _TooMuchError

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
        begins = 0
        ends: bool | None = True
        for child in children:
            if ends is True:
                begins |= child.begins
                ends = child.instant
            runs = self._either(runs, self._both(behind, child.runs))
            failed = self._either(failed, self._both(behind, child.failed))
            at_once = self._both(now, (child.begins,))
            lost = self._either(
                lost,
                self._both(behind, child.lost),
                at_once if child.instant is False else _NEVER,
            )
            now = self._either(
                at_once if child.instant is True else _NEVER, self._both(behind, child.now)
            )
            behind = self._both(behind, child.succeeded)
        return _Unit(runs, behind, failed, now, lost, begins, ends)

    def _guard(self, children: list[_Unit]) -> _Unit:
        """Each child after the failure of the one before: a sequence with the roles exchanged."""
        return _exchanged(self._sequence([_exchanged(child) for child in children]))

    def _branch(self, children: list[_Unit]) -> _Unit:
        """The second child after the success of the first, the third after its failure."""
        condition, then, *others = children
        otherwise = others[0] if others else _exchanged(_EMPTY)
        no = _exchanged(condition)
        one = self._sequence([condition._replace(failed=_NEVER, lost=_NEVER), then])
        other = self._sequence([no._replace(failed=_NEVER, lost=_NEVER), otherwise])
        ends = {True: one.instant, False: other.instant, None: None}
        return _Unit(
            runs=self._either(one.runs, other.runs),
            succeeded=self._either(one.succeeded, other.succeeded),
            failed=self._either(one.failed, other.failed),
            now=self._either(one.now, other.now),
            lost=self._either(one.lost, other.lost),
            begins=one.begins | other.begins,
            instant=ends[condition.instant],
        )

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
            instant=_all_at_once([child.instant for child in children]),
        )

    def _any(self, children: list[_Unit]) -> _Unit:
        """The same with the roles of success and failure exchanged."""
        return _exchanged(self._all([_exchanged(child) for child in children]))

    def count(self, children: list[_Unit], needed: int) -> _Unit:
        """So many children have succeeded, or so many have failed that this is impossible.

        Of a parallel in a behaviour tree, which never ends at the instant of its trigger.
        """
        spare = len(children) - needed
        if len(children) * (needed + 1) * (spare + 2) > _MAX_COUNTED:
            raise _TooMuchError
        whole = self._tally(
            [
                (((0, 0), child.runs), ((1, 0), child.succeeded), ((0, 1), child.failed))
                for child in children
            ],
            (needed, spare + 1),
        )
        return _Unit(
            runs=self._where(whole, lambda won, lost: won < needed and lost <= spare),
            succeeded=self._where(whole, lambda won, _: won == needed),
            failed=self._where(whole, lambda _, lost: lost == spare + 1),
            now=self._last(children, needed),
            lost=self._last([_exchanged(child) for child in children], spare + 1),
            begins=_union(child.begins for child in children),
            instant=None,
        )

    def wait(self, children: list[_Unit], needed: int) -> _Unit:
        """All children have ended, and so many have succeeded or not."""
        if len(children) * (needed + 1) > _MAX_COUNTED:
            raise _TooMuchError
        ended = [(((0, 1), child.succeeded), ((0, 0), child.failed)) for child in children]
        last = [
            (*options, ((1, 1), child.now), ((1, 0), child.lost))
            for options, child in zip(ended, children, strict=True)
        ]
        before = self._tally(ended, (1, needed))
        now = self._tally(last, (1, needed)) if self._instants else {}
        going = [self._either(child.succeeded, child.failed) for child in children]
        instants = [child.instant for child in children]
        return _Unit(
            runs=self._one(going, [child.runs for child in children]),
            succeeded=self._where(before, lambda _, won: won == needed),
            failed=self._where(before, lambda _, won: won < needed),
            now=self._where(now, lambda last, won: last > 0 and won == needed),
            lost=self._where(now, lambda last, won: last > 0 and won < needed),
            begins=_union(child.begins for child in children),
            instant=None if None in instants else instants.count(True) >= needed,
        )

    def _last(self, children: list[_Unit], needed: int) -> _Loads:
        """At this very instant the last of so many children succeeds."""
        if not self._instants:
            return _NEVER
        tally = self._tally(
            [
                (
                    ((0, 0), self._either(child.runs, child.failed, child.lost)),
                    ((1, 1), child.succeeded),
                    ((0, 1), child.now),
                )
                for child in children
            ],
            (needed, needed),
        )
        return self._where(tally, lambda before, after: before < needed == after)

    def _tally(
        self, children: Sequence[Sequence[tuple[_Pair, _Loads]]], most: _Pair
    ) -> dict[_Pair, _Loads]:
        """The loads of all children, by two sums over them; what is above ``most`` counts as it."""
        tally: dict[_Pair, _Loads] = {(0, 0): _IDLE}
        for options in children:
            new: dict[_Pair, _Loads] = {}
            for (one, other), loads in tally.items():
                for (first, second), more in options:
                    both = self._both(loads, more)
                    if both:
                        sums = min(one + first, most[0]), min(other + second, most[1])
                        new[sums] = self._either(new.get(sums, _NEVER), both)
            tally = new
        return tally

    def _where(self, tally: dict[_Pair, _Loads], wanted: Callable[[int, int], bool]) -> _Loads:
        return self._either(*(loads for sums, loads in tally.items() if wanted(*sums)))

    def _one(self, common: list[_Loads], special: list[_Loads]) -> _Loads:
        """At least one child is at an instant of its ``special``, the others of ``common``."""
        without: _Loads = _IDLE  # of those so far none is
        result: _Loads = _NEVER
        for usual, wanted in zip(common, special, strict=True):
            either = self._either(usual, wanted)
            result = self._either(self._both(result, either), self._both(without, wanted))
            without = self._both(without, usual)
        return result


def _exchanged(unit: _Unit) -> _Unit:
    instant = None if unit.instant is None else not unit.instant
    return _Unit(unit.runs, unit.failed, unit.succeeded, unit.lost, unit.now, unit.begins, instant)


def _all_at_once(instants: list[bool | None]) -> bool | None:
    """The end of a parallel_all of such units at the instant of its trigger."""
    if False in instants:
        return False
    return None if None in instants else True


def _not(children: list[_Unit]) -> _Unit:
    return _exchanged(children[0])


def _union(loads: Iterable[int]) -> int:
    union = 0
    for load in loads:
        union |= load
    return union
