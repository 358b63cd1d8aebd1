"""What is fuzzed: a compiled plan, and what may befall each of its instances."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from gpsfsm.capabilities.library import bind, builtin_capabilities
from gpsfsm.compile import compile_plan
from gpsfsm.errors import UsageError
from gpsfsm.fuzzing.acts import FAULTS, SIMPLE_MS, Act, Fate, TimedScenario
from gpsfsm.fuzzing.admission import admission_of
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile import Compiled
    from gpsfsm.fuzzing.admission import Admission
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.plan import Plan

__all__ = ["DEFAULT_LIMIT_S", "LONGEST_MS", "Subject", "in_ms", "subject_of"]

DEFAULT_LIMIT_S = 60.0
"""How long an action may take if nothing is said, and if it is not declared to take longer."""

_SHORTEST_MS = 0.001

LONGEST_MS = 10**9
"""What is declared to take longer takes so long; no action may take longer."""


@dataclass(frozen=True)
class Subject:
    """A plan that can be fuzzed; make it with ``subject_of``.

    ``faults`` are words of ``FAULTS``; ``limit_ms`` is what an action may take before it is stopped
    and has failed, None: as long as it likes. ``admission`` says which scenarios there are, where
    outcomes are tied to each other.
    """

    compiled: Compiled
    library: Library
    faults: tuple[str, ...]
    limit_ms: int | None
    admission: Admission | None = None

    @property
    def plan(self) -> Plan:
        """The plan."""
        return self.compiled.automaton.plan

    @property
    def apart(self) -> bool:
        """Whether each instance has a runner to itself, which may fail to start on its own."""
        return "no-start" in self.faults

    @cached_property
    def fates(self) -> tuple[tuple[Fate, ...], ...]:
        """What can become of each instance, the plainest first; never nothing."""
        return tuple(
            self._fates(number, binding) for number, binding in enumerate(self.compiled.bindings)
        )

    @cached_property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """The least and the greatest duration of each instance, in milliseconds."""
        return tuple(map(_bounds, self.compiled.bindings))

    @cached_property
    def plain(self) -> TimedScenario:
        """The plainest scenario: what can succeed succeeds, and takes a second."""
        return TimedScenario(
            tuple(self.act(number, fates[0]) for number, fates in enumerate(self.fates))
        )

    def admits(self, scenario: TimedScenario) -> bool:
        """Whether the assumptions admit a scenario."""
        return self.admission is None or self.admission.admits(act.fate for act in scenario.acts)

    def mended(self, scenario: TimedScenario, source: random.Random) -> TimedScenario:
        """A scenario that the assumptions admit, as much like this one as it may be."""
        if self.admission is None:
            return scenario
        fates = self.admission.mended([act.fate for act in scenario.acts], source)
        return TimedScenario(
            tuple(
                act if act.fate is fate else self.act(number, fate, act.duration_ms)
                for number, (act, fate) in enumerate(zip(scenario.acts, fates, strict=True))
            )
        )

    def together(self, number: int) -> tuple[int, ...]:
        """The instances that have the same outcome as this one in every scenario, with itself."""
        return (number,) if self.admission is None else self.admission.together(number)

    def act(self, number: int, fate: Fate, duration_ms: float = SIMPLE_MS) -> Act:
        """The act of an instance whose duration is closest to this one.

        What does not start heeds no least duration (semantics, 8.5).
        """
        if fate in (Fate.LATE, Fate.HANG):
            return Act(fate, duration_ms)
        least, greatest = self.bounds[number]
        if fate is Fate.NO_START:
            least = _SHORTEST_MS
        return Act(fate, min(max(duration_ms, least), greatest))

    def _fates(self, number: int, binding: Binding | None) -> tuple[Fate, ...]:
        faults = {FAULTS[word] for word in self.faults}
        if self.limit_ms is None:
            faults.discard(Fate.LATE)  # late for what?
        found = {fate: fate in faults or fate is Fate.SUCCEEDED for fate in Fate}
        if binding is not None:
            outcomes = binding.provider.outcomes
            if outcomes.never_succeeds:
                found |= {Fate.SUCCEEDED: False, Fate.LATE: False, Fate.FAILED: True}
            if self.bounds[number][1] <= (self.limit_ms or 0):
                found[Fate.LATE] = False  # it is declared to end in time
            if binding.never_fails:
                found |= dict.fromkeys((Fate.FAILED, Fate.LATE, Fate.NO_START), False)
            found[Fate.HANG] |= outcomes.may_hang
        fates = tuple(fate for fate, possible in found.items() if possible)
        if not fates:
            element = self.plan.runners[number]
            raise UsageError(
                f"{self.plan.file}:{element.line}:{element.column}: the capability file declares "
                "that this runner never fails and never succeeds; mend the file"
            )
        return fates


def _bounds(binding: Binding | None) -> tuple[float, float]:
    """In whole microseconds between the declared bounds; one is as short as a duration gets."""
    span = None if binding is None else binding.duration
    least, greatest = (0.0, math.inf) if span is None else span
    most = LONGEST_MS * 1_000
    low = min(max(1, math.ceil(round(least * 1_000_000, 3))), most)
    high = most if greatest == math.inf else int(min(round(greatest * 1_000_000, 3), most))
    return in_ms(low), in_ms(max(low, high))


def in_ms(duration_us: int) -> float:
    """Microseconds in milliseconds, a whole number of them as such."""
    whole, rest = divmod(duration_us, 1_000)
    return whole if not rest else duration_us / 1_000


def _usual_limit_ms(bindings: Sequence[Binding | None]) -> int:
    declared = [
        least if greatest == LONGEST_MS else greatest for least, greatest in map(_bounds, bindings)
    ]
    return max(round(DEFAULT_LIMIT_S * 1_000), math.ceil(2 * max(declared, default=0)))


def subject_of(
    plan: str | bytes | Plan,
    *,
    faults: Sequence[str] = tuple(FAULTS),
    limit_s: float | Literal["auto"] | None = "auto",
    library: Library | None = None,
    assumptions: Sequence[str] = (),
    consistent: bool = False,
) -> Subject:
    """Get a plan ready for being run; the default ``library`` is the built-in one.

    ``limit_s`` is what an action may take before it is stopped, None: as long as it likes;
    ``auto``: 60 seconds, or twice what any runner is declared to take. ``assumptions`` and
    ``consistent`` (equal actions have equal outcomes) say which scenarios there are. Raises
    UsageError for a text without a plan, for words that are no faults, and for assumptions that do
    not fit the plan or leave no scenario.
    """
    for word in faults:
        if word not in FAULTS:
            raise UsageError(f"there is no fault '{word:.40}'; known are {', '.join(FAULTS)}")
    if isinstance(limit_s, int | float) and not 0 < limit_s <= LONGEST_MS / 1_000:
        raise UsageError(f"the time limit must be a positive number of seconds, not {limit_s:g}")
    if isinstance(plan, str | bytes):
        parsed = parse(plan)
        if parsed.plan is None:
            told = parsed.problems[0].message if parsed.problems else "it is empty"
            raise UsageError(f"there is no plan in this text: {told}")
        plan = parsed.plan
    known = library or builtin_capabilities().library
    compiled = compile_plan(plan, bindings=bind(plan, known), start_chain="no-start" in faults)
    if limit_s == "auto":
        limit_ms: int | None = _usual_limit_ms(compiled.bindings)
    else:
        limit_ms = None if limit_s is None else max(1, round(limit_s * 1_000))
    words = tuple(word for word in FAULTS if word in faults)
    subject = Subject(compiled, known, words, limit_ms)
    admission = admission_of(
        compiled, subject.fates, assumptions=assumptions, consistent=consistent
    )
    subject = replace(subject, admission=admission)
    subject.mended(subject.plain, random.Random(0))  # noqa: S311  (whether there is a scenario)
    return subject
