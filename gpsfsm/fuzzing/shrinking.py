"""Shrinking: the plainest scenario in which a run still breaks a property in the same way.

Fewest instances that do not succeed come first; among those the first ones in document order; then
the plainest faults; then the fewest and shortest durations that are not a second. Every step is
played; what is left has failed.
"""

from __future__ import annotations

import math
from itertools import combinations, islice
from typing import TYPE_CHECKING

from gpsfsm.fuzzing.subject import SIMPLE_MS, Fate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from gpsfsm.fuzzing.subject import Act, Subject, TimedScenario

_MOST_PLAYED = 4_000
_MOST_WORK = 1_000_000
_FEWER = 1_000
"""Scenarios with fewer or other faults that are tried, from the plainest one on."""
_SLOW_MS = 20_000
_MOST_SLOW = 20


def effort_for(subject: Subject) -> int:
    """The number of runs that a shrink may take: fewer of a large plan."""
    return max(100, min(_MOST_PLAYED, _MOST_WORK // max(1, len(subject.plan.elements))))


def shrink(
    subject: Subject,
    scenario: TimedScenario,
    fails: Callable[[TimedScenario], bool],
    *,
    most: int | None = None,
) -> TimedScenario:
    """The plainest scenario that fails, as far as ``most`` runs can find it.

    ``scenario`` fails. The result depends on the arguments alone.
    """
    shrinker = _Shrinker(subject, scenario, fails, effort_for(subject) if most is None else most)
    before: TimedScenario | None = None
    while before != shrinker.best and shrinker.left > 0:
        before = shrinker.best
        shrinker.fewer_faults()
        shrinker.first_faults()
        shrinker.plainer_faults()
        shrinker.plainer_durations()
    return shrinker.best


class _Shrinker:
    def __init__(
        self,
        subject: Subject,
        scenario: TimedScenario,
        fails: Callable[[TimedScenario], bool],
        most: int,
    ) -> None:
        self._subject = subject
        self._fails = fails
        self._tried: set[TimedScenario] = {scenario}
        self._searched: set[tuple[Fate, ...]] = set()
        self.best = scenario
        # who is stopped for being late has taken all of its time
        limit_ms = subject.limit_ms
        self._limit = () if limit_ms is None or limit_ms < 2 else (limit_ms - 1,)
        self.left = most

    def _try(self, scenario: TimedScenario) -> bool:
        """Take a scenario if it fails too; one that is not admitted is not played."""
        if scenario in self._tried or self.left <= 0 or not self._subject.admits(scenario):
            return False
        self.left -= 1
        self._tried.add(scenario)
        if not self._fails(scenario):
            return False
        self.best = scenario
        return True

    def _plain(self, numbers: Sequence[int], *, durations: bool = False) -> TimedScenario:
        """The best one with plain acts for some instances; or with plain durations alone."""
        acts = list(self.best.acts)
        for number in numbers if durations else self._with_equals(numbers):
            fate = acts[number].fate if durations else self._subject.fates[number][0]
            acts[number] = self._subject.act(number, fate)
        return type(self.best)(tuple(acts))

    def _with_equals(self, numbers: Sequence[int]) -> list[int]:
        """Instances, and those whose outcomes are the same as theirs."""
        together = self._subject.together
        return list(dict.fromkeys(each for number in numbers for each in together(number)))

    def _timed(self) -> list[int]:
        """The instances whose duration is not the plain one."""
        plain = self._subject.act
        return [
            number
            for number, act in enumerate(self.best.acts)
            if act != plain(number, act.fate) and act.fate is not Fate.HANG
        ]

    def _faulty(self) -> list[int]:
        fates = self._subject.fates
        return [
            number for number, act in enumerate(self.best.acts) if act.fate is not fates[number][0]
        ]

    def fewer_faults(self) -> None:
        """Let more and more instances succeed, first all, then half of them, then each."""
        every = range(len(self.best.acts))
        self._try(self._plain(every))
        self._try(self._plain(every, durations=True))
        self._reduce(self._faulty, self._plain)

    def plainer_durations(self) -> None:
        """Let more and more instances take a second, and the others less and less."""
        self._reduce(self._timed, lambda numbers: self._plain(numbers, durations=True))
        for number in self._timed():
            self._shorten(number)

    def _shorten(self, number: int) -> None:
        """Find the shortest duration in whole seconds: a few short ones, then by halving."""
        act = self.best.acts[number]

        def fails(duration_ms: float) -> bool:
            shorter = self._subject.act(number, act.fate, duration_ms)
            if shorter.duration_ms >= self.best.acts[number].duration_ms:
                return False
            return self._try(self.best.with_act(number, shorter))

        if any(fails(short) for short in (SIMPLE_MS, 2 * SIMPLE_MS, 3 * SIMPLE_MS)):
            return
        low, high = 3, math.ceil(act.duration_ms / 1_000)
        while high - low > 1:
            middle = (low + high) // 2
            if fails(middle * 1_000):
                high = middle
            else:
                low = middle

    def _reduce(
        self, left: Callable[[], list[int]], without: Callable[[Sequence[int]], TimedScenario]
    ) -> None:
        """Delta debugging: chunks of half the size whenever no chunk can be spared."""
        size = len(left())
        while size:
            spared = False
            numbers = left()
            for start in range(0, len(numbers), size):
                chunk = numbers[start : start + size]
                spared |= self._try(without(chunk))
            size = min(size, len(left())) if spared else size // 2

    def plainer_faults(self) -> None:
        """Put the plainest fault in the place of each."""
        for number in self._faulty():
            act = self.best.acts[number]
            for fate in self._subject.fates[number][1:]:
                if fate is act.fate:
                    break
                lasting = dict.fromkeys((SIMPLE_MS, act.duration_ms, *self._limit))
                acts = [self._subject.act(number, fate, lasts) for lasts in lasting]
                if any(self._try(self._replaced(number, lasts)) for lasts in acts):
                    break

    def _replaced(self, number: int, act: Act) -> TimedScenario:
        """The best one with another act of an instance, and another fate of those like it."""
        changed = self.best.with_act(number, act)
        for each in self._subject.together(number):
            if each != number and act.fate in self._subject.fates[each]:
                lasting = self.best.acts[each].duration_ms
                changed = changed.with_act(each, self._subject.act(each, act.fate, lasting))
        return changed

    def first_faults(self) -> None:
        """Try what is plainer than the best by the number of its faults, or by where they are."""
        kinds = dict.fromkeys((Fate.FAILED, *(self.best.acts[n].fate for n in self._faulty())))
        if tuple(kinds) in self._searched and len(self._faulty()) > 1:
            return
        self._searched.add(tuple(kinds))
        for acts in islice(self._plainer(tuple(kinds)), _FEWER):
            if self._try(type(self.best)(acts)):
                return

    def _plainer(self, kinds: tuple[Fate, ...]) -> Iterator[tuple[Act, ...]]:
        """Scenarios with fewer faults, and with as many but earlier ones, from the plainest on."""
        subject = self._subject
        able = [
            number
            for number, fates in enumerate(subject.fates)
            if set(kinds) & {*fates[1:]} and subject.together(number)[0] == number
        ]
        faulty = tuple(n for n in self._faulty() if subject.together(n)[0] == n)
        every = self._bases()
        for size in range(len(faulty) + 1):
            bases = every if size < len(faulty) else every[:2]
            for numbers in combinations(able, size):
                if size == len(faulty) and numbers >= faulty:
                    break
                for base in bases:
                    yield from self._with(base, numbers, kinds)

    def _bases(self) -> list[tuple[Act, ...]]:
        """Scenarios without faults: all plain, with the durations of the best, with a slow one."""
        fates = [fates[0] for fates in self._subject.fates]
        plain = tuple(self._subject.act(number, fate) for number, fate in enumerate(fates))
        timed = tuple(
            self._subject.act(number, fate, self.best.acts[number].duration_ms)
            for number, fate in enumerate(fates)
        )
        slow = [
            (*plain[:number], self._subject.act(number, fate, _SLOW_MS), *plain[number + 1 :])
            for number, fate in enumerate(fates[:_MOST_SLOW])
        ]
        return list(dict.fromkeys((plain, timed, *slow)))

    def _with(
        self, base: tuple[Act, ...], numbers: tuple[int, ...], kinds: tuple[Fate, ...]
    ) -> Iterator[tuple[Act, ...]]:
        for kind in kinds:
            if any(kind not in self._subject.fates[number] for number in numbers):
                continue
            acts = list(base)
            for number in self._with_equals(numbers):
                if kind not in self._subject.fates[number]:
                    continue
                acts[number] = self._subject.act(number, kind, base[number].duration_ms)
            yield tuple(acts)
            if not numbers:
                return
