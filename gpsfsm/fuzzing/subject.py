"""The subject of a campaign: a compiled plan, what may befall its instances, and drawing that.

A scenario gives every instance an act: a fate, and how long it takes. ``draw`` makes the scenario
of the run with a number, as a function of the seed. Where outcomes are assumed to be tied to each
other (semantics, 4.1), a scenario that is drawn and not admitted is mended: as much as possible of
what was drawn stays.

An instance of a machine has an act for each of its first visits, and plain ones after these:

    runners A, B; 2 visits      acts A1 B1 A2 B2; those of the instance n: acts[n], acts[n + 2]
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from gpsfsm.analysis.constraints import Constraints, constraints_of
from gpsfsm.capabilities.library import bind, builtin_capabilities
from gpsfsm.compile import MachinePlan, compile_plan
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.errors import GpsfsmError, UsageError, misused, require_amount, require_list
from gpsfsm.execution.runner import seeded
from gpsfsm.model.event import Outcome
from gpsfsm.model.plan import Plan
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding

SIMPLE_MS = 1_000
"""What an action takes if nothing else is said."""


class Fate(StrEnum):
    """The fate of an action, from ordinary to unusual.

    LATE: it does not end within its time limit, is stopped and counts as failed, and then reports
    success. HANG: it never ends by itself. NO_START: its runner cannot be loaded.
    """

    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"
    LATE = "LATE"
    NO_START = "NO_START"
    HANG = "HANG"

    @property
    def outcome(self) -> Outcome:
        """The outcome that this is for a plan (semantics, 4.2); being late is failing."""
        return Outcome.FAILED if self is Fate.LATE else Outcome(self.value)


FAULTS: dict[str, Fate] = {
    "failed": Fate.FAILED,
    "late": Fate.LATE,
    "no-start": Fate.NO_START,
    "hang": Fate.HANG,
}
"""What ``--faults`` names."""


@dataclass(frozen=True, slots=True)
class Act:
    """The behaviour of one instance once it is triggered.

    ``duration_ms`` is positive and a whole number of microseconds: the time until the outcome. For
    LATE it is the time from the end of the time limit until the answer arrives, for HANG it has no
    meaning. An action with a declared duration of 0 seconds takes one microsecond.
    """

    fate: Fate = Fate.SUCCEEDED
    duration_ms: float = SIMPLE_MS

    @property
    def duration_us(self) -> int:
        """The duration in microseconds."""
        return round(self.duration_ms * 1_000)


@dataclass(frozen=True, slots=True)
class TimedScenario:
    """An act for every runner instance in document order; for a machine, visit by visit."""

    acts: tuple[Act, ...]

    @property
    def faults(self) -> tuple[int, ...]:
        """The numbers of the instances that do not succeed, ascending."""
        return tuple(
            number for number, act in enumerate(self.acts) if act.fate is not Fate.SUCCEEDED
        )

    def with_act(self, number: int, act: Act) -> TimedScenario:
        """A copy in which one instance has another act."""
        return TimedScenario((*self.acts[:number], act, *self.acts[number + 1 :]))


DEFAULT_LIMIT_S = 60.0
"""How long an action may take if nothing is said, and if it is not declared to take longer."""

VISITS = 8
"""So many visits of each instance of a machine have acts of their own."""

MAX_VISITS = 200
"""A run of a machine is cut off after so many visits, if nothing else is said."""

_SHORTEST_MS = 0.001

LONGEST_MS = 10**9
"""What is declared to take longer takes so long; no action may take longer."""


@dataclass(frozen=True)
class Subject:
    """A plan or machine that can be fuzzed; make it with ``subject_of``.

    ``faults`` are keys of ``FAULTS``. ``limit_ms`` is the time in milliseconds after which an
    action is stopped and has failed; None: no limit. ``admission`` decides which scenarios exist if
    outcomes depend on each other. For a machine, ``most_visits`` is where its runs are cut off, and
    ``permitted`` lists the outcomes that are assumed for each instance.
    """

    compiled: Compiled
    library: Library
    faults: tuple[str, ...]
    limit_ms: int | None
    admission: Admission | None = None
    most_visits: int | None = None
    permitted: tuple[frozenset[Outcome], ...] | None = None

    @property
    def is_machine(self) -> bool:
        """True for a machine, whose instances may be visited again and again."""
        return isinstance(self.plan, MachinePlan)

    @property
    def visits(self) -> int:
        """The number of visits of each instance that have acts of their own."""
        return VISITS if self.is_machine else 1

    def act_in(self, scenario: TimedScenario, number: int, visit: int) -> Act:
        """The act of an instance in one of its visits, counted from 1."""
        if visit > self.visits:
            return self.plain.acts[number]
        return scenario.acts[number + len(self.plan.runners) * (visit - 1)]

    @property
    def plan(self) -> Plan:
        """The plan."""
        return self.compiled.automaton.plan

    @property
    def apart(self) -> bool:
        """True if each instance has its own runner, which may fail to start by itself."""
        return "no-start" in self.faults

    @cached_property
    def fates(self) -> tuple[tuple[Fate, ...], ...]:
        """The possible fates of each act, the most ordinary first; never empty."""
        return self.visits * tuple(
            self._fates(number, binding) for number, binding in enumerate(self.compiled.bindings)
        )

    @cached_property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """The least and the greatest duration of each act, in milliseconds."""
        return self.visits * tuple(map(_bounds, self.compiled.bindings))

    @cached_property
    def plain(self) -> TimedScenario:
        """The most ordinary scenario: everything that can succeed does, in one second."""
        return TimedScenario(
            tuple(self.act(number, fates[0]) for number, fates in enumerate(self.fates))
        )

    def admits(self, scenario: TimedScenario) -> bool:
        """True if the assumptions admit the scenario."""
        return self.admission is None or self.admission.admits(act.fate for act in scenario.acts)

    def mended(self, scenario: TimedScenario, source: random.Random) -> TimedScenario:
        """A scenario that the assumptions admit, as similar to this one as possible."""
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
        """The instances whose outcome is the same in every scenario, including this one."""
        return (number,) if self.admission is None else self.admission.together(number)

    def act(self, number: int, fate: Fate, duration_ms: float = SIMPLE_MS) -> Act:
        """The act of an instance with the possible duration that is closest to ``duration_ms``.

        An instance that does not start has no least duration (semantics, 8.5).
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
        allowed_fates = {fate: fate in faults or fate is Fate.SUCCEEDED for fate in Fate}
        if binding is not None:
            outcomes = binding.provider.outcomes
            if outcomes.never_succeeds:
                allowed_fates |= {Fate.SUCCEEDED: False, Fate.LATE: False, Fate.FAILED: True}
            if self.bounds[number][1] <= (self.limit_ms or 0):
                allowed_fates[Fate.LATE] = False  # it is declared to end in time
            if binding.never_fails:
                allowed_fates |= dict.fromkeys((Fate.FAILED, Fate.LATE, Fate.NO_START), False)
            allowed_fates[Fate.HANG] |= outcomes.may_hang
        fates = tuple(fate for fate, possible in allowed_fates.items() if possible)
        if self.permitted is not None:
            fates = tuple(fate for fate in fates if fate.outcome in self.permitted[number])
            if not fates:
                raise UsageError(_NO_SCENARIO)
        if not fates:
            element = self.plan.runners[number]
            raise UsageError(
                f"{self.plan.file}:{element.line}:{element.column}: the capability file declares "
                "that this runner never fails and never succeeds; correct the file"
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
    most_visits: int = MAX_VISITS,
) -> Subject:
    """Prepare a plan or machine for ``play``; ``library`` defaults to the built-in one.

    - ``faults``: the faults that may occur.
    - ``limit_s``: the time in seconds after which an action is stopped. None: no limit. ``auto``:
      60 s, or twice the longest declared duration if that is more.
    - ``assumptions``, ``consistent`` (equal actions have equal outcomes): restrict the scenarios.
    - ``most_visits``: runs of a machine are cut off after so many visits. Its runners always start.

    Raises UsageError for a text without a plan, unknown faults, and assumptions that do not fit.
    """
    _refuse_misuse(plan, faults, limit_s, library, assumptions)
    plan = _plan_in(plan) if isinstance(plan, str | bytes) else plan
    machine = isinstance(plan, MachinePlan)
    if machine and "no-start" in faults:
        if set(faults) != set(FAULTS):  # somebody asks for it
            raise UsageError("runners of a machine always start: leave out the fault no-start")
        faults = [word for word in faults if word != "no-start"]
    described = library or builtin_capabilities().library
    compiled = compile_plan(plan, bindings=bind(plan, described), start_chain="no-start" in faults)
    if limit_s == "auto":
        limit_ms: int | None = _usual_limit_ms(compiled.bindings)
    else:
        limit_ms = None if limit_s is None else max(1, round(limit_s * 1_000))
    words = tuple(word for word in FAULTS if word in faults)
    subject = Subject(compiled, described, words, limit_ms)
    if machine:
        permitted = _permitted(plan, assumptions, consistent=consistent)
        subject = replace(subject, most_visits=most_visits, permitted=permitted)
        assert len(subject.plain.acts) == len(plan.runners) * VISITS
        return subject
    admission = admission_of(
        compiled, subject.fates, assumptions=assumptions, consistent=consistent
    )
    subject = replace(subject, admission=admission)
    subject.mended(subject.plain, seeded(0))  # raises if there is no scenario
    return subject


def _refuse_misuse(
    plan: object, faults: Sequence[str], limit_s: object, library: object, assumptions: object
) -> None:
    """Raise UsageError for arguments of ``subject_of`` that make no sense."""
    require_list("subject_of", "faults", faults)
    require_list("subject_of", "assumptions", assumptions)
    if not isinstance(plan, str | bytes | Plan):
        raise misused("subject_of", "the text of a plan, or a plan", plan)
    if library is not None and not hasattr(library, "bind"):
        raise misused("subject_of", "a gpsfsm.Library as library", library)
    for word in faults:
        if word not in FAULTS:
            raise UsageError(
                f"there is no fault '{word!s:.40}'; the faults are {', '.join(FAULTS)}"
            )
    if isinstance(limit_s, int | float) and not 0 < limit_s <= LONGEST_MS / 1_000:
        raise UsageError(f"the time limit must be a positive number of seconds, not {limit_s:g}")
    if limit_s is not None and limit_s != "auto":
        require_amount("subject_of", "limit_s", limit_s)


def _plan_in(text: str | bytes) -> Plan:
    """The plan or machine in a text. Raises UsageError if there is none."""
    parsed = read_plan_or_machine(text)
    if parsed.plan is None:
        message = parsed.problems[0].message if parsed.problems else "it is empty"
        raise UsageError(f"there is no plan in this text: {message}")
    return parsed.plan


def _permitted(
    plan: Plan, assumptions: Sequence[str], *, consistent: bool
) -> tuple[frozenset[Outcome], ...] | None:
    """The outcomes of each instance of a machine; None: all. Raises UsageError."""
    if consistent:
        raise UsageError(
            "a machine is not run with --consistent: outcomes are chosen at each visit"
        )
    if not assumptions:
        return None
    constraints = constraints_of(plan, faults=("hang",), assumptions=assumptions)
    if constraints.formulas:
        raise UsageError("assumptions that tie runners together cannot be used with machines")
    if constraints.unmatched:
        raise UsageError(f"no runner of the machine matches {clip(constraints.unmatched[0], 200)}")
    return tuple(constraints.allowed)


_DURATIONS_MS = (1_000, 2_000, 3_000, 5_000, 8_000, 20_000)
_MOST_DECLARED = 8
_OUTLASTS = "one outlasts the others"
_TIMINGS = ("all alike", "mixed", "mixed", _OUTLASTS)
_WITHOUT_LIMIT_MS = 1_000_000
_RATES = (0.05, 0.2, 0.5)
"""How likely it is that an action does not succeed; one of them is drawn for a run."""
_MOST_ALONE = 100
"""So many instances have their faults alone, one after the other."""


def draw(subject: Subject, seed: int, index: int) -> TimedScenario:
    """The scenario of a run.

    In the first run nothing goes wrong, in the next ones each fault of each instance comes alone,
    and then there are as many as chance will have it. Durations are drawn from few values, so that
    some instances end together, within what the capability files declare. What the assumptions do
    not admit is mended.
    """
    source = seeded(f"{seed}:{index}")
    if index == 0:
        return subject.mended(subject.plain, source)
    alone = _alone(subject, index - 1)
    rate, timing = source.choice(_RATES), source.choice(_TIMINGS)
    slow = source.randrange(len(subject.fates))
    if alone is None and source.random() < 1 / 3:
        # one fault, while an instance goes on that is most likely beside it: a race
        number = source.randrange(len(subject.fates))
        alone = number, source.choice(subject.fates[number][1:] or subject.fates[number])
        timing = _OUTLASTS
        if source.random() < 0.5:
            slow = min(max(number + source.choice((-2, -1, 1, 2)), 0), len(subject.fates) - 1)
    durations = (*_DURATIONS_MS, *_beside_declared(subject))
    acts: list[Act] = []
    for number, fates in enumerate(subject.fates):
        fate = fates[0]
        if alone is not None:
            fate = alone[1] if number == alone[0] else fate
        elif source.random() < rate and len(fates) > 1:
            fate = source.choice(fates[1:])
        drawn: float = SIMPLE_MS
        if timing == "mixed":
            drawn = source.choice(durations)
            if not subject.bounds[number][0] <= drawn <= subject.bounds[number][1]:
                drawn = source.choice(_declared(subject, number))
        elif timing == _OUTLASTS and number == slow:
            drawn = (subject.limit_ms or _WITHOUT_LIMIT_MS) - 1
        acts.append(subject.act(number, fate, drawn))
    return subject.mended(TimedScenario(tuple(acts)), source)


def _alone(subject: Subject, index: int) -> tuple[int, Fate] | None:
    """The one fault of a run, and the instance that has it; None: they are drawn."""
    for number, fates in enumerate(subject.fates[:_MOST_ALONE]):
        if index < len(fates) - 1:
            return number, fates[1 + index]
        index -= len(fates) - 1
    return None


def _declared(subject: Subject, number: int) -> tuple[float, float, float]:
    """Of what is declared of an instance: one end, the other, and a value between them."""
    least, greatest = subject.bounds[number]
    highest = min(greatest, max(least, 20_000))
    return least, highest, in_ms(round((least + highest) * 500))


def _beside_declared(subject: Subject) -> list[float]:
    """A second more than what runners are declared to take: others may outlast them."""
    ends = {end for bounds in subject.bounds for end in bounds if 1 < end < LONGEST_MS}
    longer = (end + 1_000 for end in sorted(ends) if end >= 1_000)
    most = LONGEST_MS if subject.limit_ms is None else subject.limit_ms - 1
    return [duration for duration in longer if duration <= most][-_MOST_DECLARED:]


_NO_SCENARIO = (
    "the assumptions, --consistent and --faults admit no scenario of this plan; drop or correct "
    "one of them"
)


class Admission:
    """The scenarios of a plan that are admitted; ``fates`` are what can become of each instance."""

    def __init__(
        self,
        compiled: Compiled,
        fates: Sequence[Sequence[Fate]],
        constraints: Constraints,
    ) -> None:
        self._compiled = compiled
        self._fates = fates
        self.constraints = constraints
        self._heads = {n: group[0] for group in constraints.groups for n in group}
        self._groups = {group[0]: group for group in constraints.groups}
        self._solved: tuple[Solver, dict[tuple[int, Outcome], str]] | None = None

    def __reduce__(self) -> tuple[type[Admission], tuple[object, ...]]:
        return Admission, (self._compiled, self._fates, self.constraints)  # z3 stays here

    @property
    def unmatched(self) -> tuple[str, ...]:
        """The selectors of the assumptions that select nothing in this plan."""
        return self.constraints.unmatched

    def admits(self, fates: Iterable[Fate]) -> bool:
        """True if a scenario is admitted."""
        return self.constraints.admit([fate.outcome for fate in fates])

    def head(self, number: int) -> int:
        """The first of the instances that have the same outcome as this one."""
        return self._heads.get(number, number)

    def together(self, number: int) -> tuple[int, ...]:
        """The instances that have the same outcome as this one, itself among them."""
        return self._groups.get(self.head(number), (number,))

    def mended(self, fates: Sequence[Fate], source: random.Random) -> list[Fate]:
        """Fates that are admitted, those that were drawn as far as they can stay.

        Raises UsageError if no scenario is admitted, GpsfsmError if z3 cannot tell.
        """
        possible = [self._possible(number, fate) for number, fate in enumerate(fates)]
        for group in self._groups.values():
            self._spread(possible, group[0], possible[source.choice(group)])
        if self.admits(possible):
            return possible
        for number, outcome in self._solved_for(possible, source).items():
            if possible[number].outcome is not outcome:
                self._spread(possible, number, self._of_outcome(number, outcome))
        return possible

    def _possible(self, number: int, fate: Fate) -> Fate:
        allowed = self.constraints.allowed[number]
        if fate.outcome in allowed:
            return fate
        return next(each for each in self._fates[number] if each.outcome in allowed)

    def _of_outcome(self, number: int, outcome: Outcome) -> Fate:
        return next(each for each in self._fates[number] if each.outcome is outcome)

    def _spread(self, fates: list[Fate], number: int, fate: Fate) -> None:
        """Give this fate to all that share the outcome of an instance."""
        for each in self.together(number):
            same = fate in self._fates[each]
            fates[each] = fate if same else self._of_outcome(each, fate.outcome)

    def _solved_for(self, fates: Sequence[Fate], source: random.Random) -> dict[int, Outcome]:
        """Outcomes of the instances of formulas: each stays or changes, in an order drawn."""
        from gpsfsm.analysis.solver import InconclusiveError

        solver, names = self._solver
        spoken = list(self._spoken)
        source.shuffle(spoken)
        fixed: dict[int, Outcome] = {}
        kept: list[str] = []
        try:
            for number in spoken:
                drawn = fates[number].outcome
                others = [each.outcome for each in self._fates[number]]
                for outcome in dict.fromkeys((drawn, *others)):
                    name = names.get((number, outcome))
                    if name is not None and solver.must_check([*kept, name]):
                        fixed[number] = outcome
                        kept.append(name)
                        break
                else:
                    raise UsageError(_NO_SCENARIO)
        except InconclusiveError:
            raise GpsfsmError("z3 reached its limit on the assumptions") from None
        return fixed

    @cached_property
    def _spoken(self) -> tuple[int, ...]:
        """The instances that formulas speak of, one for all that share an outcome."""
        from gpsfsm.analysis.assumptions import runners

        spoken = {n for formula in self.constraints.formulas for n in runners(formula)}
        return tuple(sorted(map(self.head, spoken)))

    @property
    def _solver(self) -> tuple[Solver, dict[tuple[int, Outcome], str]]:
        """z3, and the names of the outcomes that it is asked about."""
        if self._solved is None:
            from gpsfsm.analysis.options import Purse
            from gpsfsm.analysis.solver import Solver

            solver = Solver(self._compiled, self.constraints, purse=Purse(1 << 62))
            names = {
                (number, outcome): solver.name(solver.encoding.outcome(number, (outcome,)))
                for number in self._spoken
                for outcome in sorted(self.constraints.allowed[number])
            }
            self._solved = solver, names
        return self._solved


def admission_of(
    compiled: Compiled,
    fates: Sequence[Sequence[Fate]],
    *,
    assumptions: Sequence[str],
    consistent: bool,
) -> Admission | None:
    """The scenarios that are admitted; None: all are.

    Raises UsageError (AssumptionError is one) for what does not parse or select, and if no scenario
    is left.
    """
    if not assumptions and not consistent:
        return None
    from gpsfsm.model.event import Outcome

    every = [frozenset(fate.outcome for fate in each) for each in fates]
    tied = constraints_of(
        compiled.automaton.plan,
        faults=("no-start", "hang"),
        consistent=consistent,
        assumptions=assumptions,
    )
    allowed = [one & other for one, other in zip(every, tied.allowed, strict=True)]
    for group in tied.groups:
        common = frozenset.intersection(*(allowed[number] for number in group))
        for number in group:
            allowed[number] = common
    if not all(allowed):
        raise UsageError(_NO_SCENARIO)
    no_start, hang = (
        any(outcome in each for each in allowed) for outcome in (Outcome.NO_START, Outcome.HANG)
    )
    constraints = replace(tied, allowed=tuple(allowed), no_start=no_start, hang=hang)
    return Admission(compiled, fates, constraints)
