"""Which scenarios there are, where outcomes are assumed to be tied to each other (semantics, 4.1).

A scenario that is drawn and not admitted is mended: as much as possible of what was drawn stays.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

from gpsfsm.analysis.constraints import Constraints, constraints_of
from gpsfsm.errors import GpsfsmError, UsageError

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable, Sequence

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.compile import Compiled
    from gpsfsm.fuzzing.acts import Fate
    from gpsfsm.model.event import Outcome

__all__ = ["Admission", "admission_of"]

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
        """Whether a scenario is admitted."""
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
        found = [self._possible(number, fate) for number, fate in enumerate(fates)]
        for group in self._groups.values():
            self._spread(found, group[0], found[source.choice(group)])
        if self.admits(found):
            return found
        for number, outcome in self._solved_for(found, source).items():
            if found[number].outcome is not outcome:
                self._spread(found, number, self._of_outcome(number, outcome))
        return found

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
        """Outcomes of the instances that formulas speak of: one after the other stays or changes.

        The order is drawn, so that it is not always the same ones that change.
        """
        from gpsfsm.analysis.solver import Inconclusive  # noqa: PLC0415  (only for formulas)

        solver, names = self._solver
        spoken = list(self._spoken)
        source.shuffle(spoken)
        fixed: dict[int, Outcome] = {}
        told: list[str] = []
        try:
            for number in spoken:
                drawn = fates[number].outcome
                others = [each.outcome for each in self._fates[number]]
                for outcome in dict.fromkeys((drawn, *others)):
                    name = names.get((number, outcome))
                    if name is not None and solver.must_check([*told, name]):
                        fixed[number] = outcome
                        told.append(name)
                        break
                else:
                    raise UsageError(_NO_SCENARIO)
        except Inconclusive:
            raise GpsfsmError("z3 met its limit on the assumptions") from None
        return fixed

    @cached_property
    def _spoken(self) -> tuple[int, ...]:
        """The instances that formulas speak of, one for all that share an outcome."""
        from gpsfsm.analysis.assumptions import runners  # noqa: PLC0415  (only for formulas)

        spoken = {n for formula in self.constraints.formulas for n in runners(formula)}
        return tuple(sorted(map(self.head, spoken)))

    @property
    def _solver(self) -> tuple[Solver, dict[tuple[int, Outcome], str]]:
        """z3, and the names of the outcomes that it is asked about."""
        if self._solved is None:
            from gpsfsm.analysis.budget import Purse  # noqa: PLC0415  (only for formulas)
            from gpsfsm.analysis.solver import Solver  # noqa: PLC0415

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
    from gpsfsm.model.event import Outcome  # noqa: PLC0415

    every = [frozenset(fate.outcome for fate in each) for each in fates]
    found = constraints_of(
        compiled.automaton.plan,
        faults=("no-start", "hang"),
        consistent=consistent,
        assumptions=assumptions,
    )
    allowed = [one & other for one, other in zip(every, found.allowed, strict=True)]
    for group in found.groups:
        common = frozenset.intersection(*(allowed[number] for number in group))
        for number in group:
            allowed[number] = common
    if not all(allowed):
        raise UsageError(_NO_SCENARIO)
    constraints = replace(
        found,
        allowed=tuple(allowed),
        no_start=any(Outcome.NO_START in each for each in allowed),
        hang=any(Outcome.HANG in each for each in allowed),
    )
    return Admission(compiled, fates, constraints)
