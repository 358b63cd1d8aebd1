"""The scenarios that there are: fault models, consistency, assumptions (semantics, section 4)."""

from __future__ import annotations

from dataclasses import field, fields
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.late import dataclass
from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from gpsfsm.analysis.assumptions import Deviations, Formula, Instances
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.plan import Plan

FAULTS = ("failed", "no-start", "hang")
"""The fault models: ``failed`` is always on, the others add outcomes."""


@dataclass(frozen=True)
class Constraints:
    """The scenarios of a plan.

    ``allowed[i]`` are the outcomes that runner instance i can have; ``groups`` are sets of
    instances whose outcomes are equal, ``consistent`` says that they come from equal actions;
    ``formulas`` are all other constraints.
    """

    allowed: tuple[frozenset[Outcome], ...]
    groups: tuple[tuple[int, ...], ...] = ()
    formulas: tuple[Formula, ...] = ()
    no_start: bool = False
    hang: bool = False
    unmatched: tuple[str, ...] = field(default=())
    consistent: bool = False

    @cached_property
    def independent(self) -> bool:
        """True if every instance decides for itself, may succeed, and ends once it has started.

        Then the structural pass is exact, also about values, prompts, resources and time.
        """
        plain = {Outcome.SUCCEEDED, Outcome.FAILED}
        return not (self.groups or self.formulas or self.no_start or self.hang) and all(
            Outcome.SUCCEEDED in outcomes and outcomes <= plain for outcomes in self.allowed
        )

    @cached_property
    def separate(self) -> bool:
        """True if every instance decides for itself, and ends once it is triggered.

        It may be that it never succeeds, or does not start.
        """
        return not (self.groups or self.formulas or self.hang) and all(self.allowed)

    def __getstate__(self) -> dict[str, object]:
        """The fields; what is derived from them holds functions, which no process can be sent."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def admit(self, outcomes: Sequence[Outcome]) -> bool:
        """True if a scenario obeys all constraints."""
        if not all(
            outcome in allowed for outcome, allowed in zip(outcomes, self.allowed, strict=True)
        ):
            return False
        if not all(len({outcomes[number] for number in group}) == 1 for group in self.groups):
            return False
        if not self.formulas:
            return True
        deviations = [
            (number, outcome)
            for number, outcome in enumerate(outcomes)
            if outcome is not Outcome.SUCCEEDED
        ]
        return all(holds(deviations) for holds in self._tests)

    @cached_property
    def _tests(self) -> tuple[Callable[[Deviations], bool], ...]:
        """The formulas as functions: most scenarios of a check differ in a few outcomes only."""
        from gpsfsm.analysis.assumptions import by_deviations

        return tuple(map(by_deviations, self.formulas))


def constraints_of(
    plan: Plan,
    *,
    faults: Iterable[str] = (),
    consistent: bool = False,
    assumptions: Iterable[str] = (),
    bindings: Sequence[Binding | None] = (),
) -> Constraints:
    """The scenarios of ``plan`` under the scenario options and the declared outcomes.

    Raises AssumptionError for an assumption that does not parse or select.
    """
    faults = set(faults)
    base = {Outcome.SUCCEEDED, Outcome.FAILED}
    if "no-start" in faults:
        base.add(Outcome.NO_START)
    if "hang" in faults:
        base.add(Outcome.HANG)
    allowed = [frozenset(base)] * len(plan.runners)
    for number, binding in enumerate(bindings):
        if binding is not None:
            allowed[number] = _declared(allowed[number], binding)
    hang = any(Outcome.HANG in outcomes for outcomes in allowed)
    formulas: list[Formula] = []
    unmatched: list[str] = []
    instances: Instances | None = None
    for text in assumptions:
        from gpsfsm.analysis.assumptions import Instances, parse_assumption, unary

        instances = instances or Instances(plan)
        bound = parse_assumption(text).bind(plan, instances)
        unmatched += bound.unmatched
        single = unary(bound.formula)
        if single is None:
            formulas.append(bound.formula)
            continue
        for number, outcomes in single.items():
            allowed[number] &= outcomes
    return Constraints(
        allowed=tuple(allowed),
        groups=_equal_actions(plan) if consistent else (),
        formulas=tuple(formulas),
        no_start="no-start" in faults,
        hang=hang,
        unmatched=tuple(dict.fromkeys(unmatched)),
        consistent=consistent,
    )


def constraints_under(options: AnalysisOptions, compiled: Compiled) -> Constraints:
    """The scenarios of a compiled plan under the options of a check; raises AssumptionError."""
    return constraints_of(
        compiled.automaton.plan,
        faults=options.faults,
        consistent=options.consistent,
        assumptions=options.assumptions,
        bindings=compiled.bindings,
    )


def _declared(outcomes: frozenset[Outcome], binding: Binding) -> frozenset[Outcome]:
    """The outcomes that the capability leaves (semantics, section 8.1)."""
    if binding.never_fails:
        outcomes -= {Outcome.FAILED, Outcome.NO_START}
    declared = binding.provider.outcomes
    if declared.never_succeeds:
        outcomes -= {Outcome.SUCCEEDED}
    if declared.may_hang:
        outcomes |= {Outcome.HANG}
    return outcomes


def _equal_actions(plan: Plan) -> tuple[tuple[int, ...], ...]:
    """The numbers of instances with equal actions, groups of one left out."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for number, runner in enumerate(plan.runners):
        groups.setdefault(runner.action, []).append(number)
    return tuple(tuple(group) for group in groups.values() if len(group) > 1)
