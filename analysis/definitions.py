"""The scenario options read from their definitions (semantics, 4.1, 4.2 and 8.1), unprepared.

``constraints.py`` prepares the options for all deciders: it splits assumptions, restricts outcomes
and groups actions. A mistake there would be a mistake of every decider. So scenarios that are shown
and, of small inputs, the answers are held against this reading as well, which prepares nothing:
an assumption is the formula that was written, with the truth values that open outcomes leave it.

    'A fails or B fails', and with --consistent C has the action of A
    A SUCCEEDED is admitted: B FAILED, C SUCCEEDED make it a scenario
    A SUCCEEDED, C FAILED is not, nor is A SUCCEEDED, B SUCCEEDED
"""

from __future__ import annotations

from functools import cached_property
from itertools import product
from math import prod
from typing import TYPE_CHECKING

from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile.units import MachinePlan, TreeMachine
from gpsfsm.model.capability import OWN
from gpsfsm.model.event import Outcome
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    from gpsfsm.analysis.assumptions import Formula
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.compile import Compiled

MAX_EFFORT = 300_000
"""Outcomes in assumptions that are looked at for one purpose, before it is left open."""

Settled = dict[int, Outcome]
"""Outcomes by the number of their instance; all others are open."""


class Definitions:
    """The options of a check of one plan or machine.

    ``outcomes``: those of each instance by fault models and capability alone; ``formulas``: the
    assumptions; ``equals``: by instance those of equal actions, itself among them, if that counts.
    """

    def __init__(self, compiled: Compiled, options: AnalysisOptions) -> None:
        plan = self.plan = compiled.automaton.plan
        faults = {"no-start": Outcome.NO_START, "hang": Outcome.HANG}
        usual = {Outcome.SUCCEEDED, Outcome.FAILED}
        usual |= {outcome for fault, outcome in faults.items() if fault in options.faults}
        self.outcomes = [usual] * len(plan.runners)
        for number, binding in enumerate(compiled.bindings):
            if binding is not None:
                declared = binding.provider.outcomes
                never = {
                    Outcome.SUCCEEDED: declared.never_succeeds,
                    Outcome.FAILED: binding.never_fails,
                    Outcome.NO_START: binding.never_fails,
                }
                hangs = {Outcome.HANG} if declared.may_hang else set()
                self.outcomes[number] = {each for each in usual | hangs if not never.get(each)}
        self.formulas: list[Formula] = []
        if options.assumptions:
            from gpsfsm.analysis.assumptions import parse_assumption

            self.formulas = [
                parse_assumption(text).bind(plan).formula for text in options.assumptions
            ]
        self.effort = MAX_EFFORT
        self.consistent = options.consistent
        self.equals: dict[int, tuple[int, ...]] = {}
        if options.consistent:
            self._find_equals()

    def _find_equals(self) -> None:
        """Find equal actions; choices, ticks and conditions of a tree are none.

        Nor are choices that stand for what was not read exactly.
        """
        actions: dict[object, list[int]] = {}
        tree = self.plan.vocabulary is Vocabulary.TREE
        ties = self.plan.ties if isinstance(self.plan, TreeMachine) else ()
        conditions = {number for tie in ties for number in tie.runners}
        inexact = self.plan.inexact if isinstance(self.plan, MachinePlan) else ()
        for number, runner in enumerate(self.plan.runners):
            own = runner.interface in OWN and (tree or number + 1 in inexact)
            if number not in conditions and not own:
                actions.setdefault(runner.action, []).append(number)
        for members in actions.values():
            self.equals |= dict.fromkeys(members, tuple(members))

    def spoken(self) -> Iterator[frozenset[int]]:
        """The instances that each assumption speaks of."""
        if self.formulas:
            from gpsfsm.analysis.assumptions import runners

            yield from map(runners, self.formulas)

    @cached_property
    def plain(self) -> bool:
        """True if every instance succeeds or fails, and no option says more."""
        usual = {Outcome.SUCCEEDED, Outcome.FAILED}
        free = not (self.formulas or self.consistent)
        return free and all(outcomes == usual for outcomes in self.outcomes)

    def admit(self, outcomes: Sequence[Outcome]) -> bool:
        """True if this scenario obeys all options."""
        return (
            all(map(set.__contains__, self.outcomes, outcomes))
            and all(
                len({outcomes[number] for number in members}) == 1
                for members in {*self.equals.values()}
            )
            and (not self.formulas or self._may_hold(dict(enumerate(outcomes))))
        )

    def contradictory(self) -> bool:
        """True if there is no scenario. Raises InconclusiveError at a limit."""
        rows = [[self.outcomes[number] for number in each] for each in self.equals.values()]
        return not (
            all(self.outcomes) and all(set.intersection(*row) for row in rows) and self.admits({})
        )

    def admits(self, settled: Mapping[int, Outcome]) -> bool:
        """True if some scenario has these outcomes. Raises InconclusiveError at a limit."""
        start = self._extended({}, settled)
        pending = [] if start is None else [start]
        if start is not None:  # the shortest way: all others succeed, if they can
            rest = {
                each: max(self.outcomes[each], default=Outcome.FAILED)
                for each in self._spoken
                if each not in start
            }
            easiest = self._extended(start, rest)
            pending += [] if easiest is None or not rest else [easiest]
        while pending:
            self.effort -= 1 + len(self._spoken)
            if self.effort < 0:
                raise InconclusiveError
            partial = pending.pop()
            if not self._may_hold(partial):
                continue
            number = next((number for number in self._spoken if number not in partial), -1)
            if number < 0:
                return True
            for outcome in sorted(self.outcomes[number]):  # SUCCEEDED is the last, and tried first
                extended = self._extended(partial, {number: outcome})
                if extended is not None:
                    pending.append(extended)
        return False

    @cached_property
    def _spoken(self) -> list[int]:
        """The instances that assumptions speak of."""
        return sorted(frozenset().union(*self.spoken()))

    def scenarios(self, most: int) -> Iterator[tuple[Outcome, ...]]:
        """All scenarios. Raises InconclusiveError if there are more than so many combinations."""
        if prod(map(len, self.outcomes)) > most:
            raise InconclusiveError
        for outcomes in product(*map(sorted, self.outcomes)):
            if self.admit(outcomes):
                yield outcomes

    def _extended(self, settled: Settled, more: Mapping[int, Outcome]) -> Settled | None:
        """These outcomes and more, with those of equal actions; None if they cannot be."""
        extended = dict(settled)
        for number, outcome in more.items():
            for other in self.equals.get(number, (number,)):
                if extended.setdefault(other, outcome) is not outcome:
                    return None
        return extended if self._may_be(extended) else None

    def _may_be(self, settled: Mapping[int, Outcome]) -> bool:
        """True if each is an outcome of its instance, and the same for all of equal actions."""
        return all(
            outcome in self.outcomes[number]
            and settled.get(self.equals.get(number, (number,))[0], outcome) is outcome
            for number, outcome in settled.items()
        )

    def _may_hold(self, settled: Mapping[int, Outcome]) -> bool:
        def outcomes_of(number: int) -> Collection[Outcome]:
            return (settled[number],) if number in settled else self.outcomes[number]

        return all(True in truths(formula, outcomes_of) for formula in self.formulas)


def truths(formula: Formula, outcomes_of: Callable[[int], Collection[Outcome]]) -> set[bool]:
    """The truth values that a formula may have; where each outcome is settled, the one it has."""
    from gpsfsm.analysis.assumptions import formula as kinds

    if isinstance(formula, kinds.Constant):
        return {formula.value}
    if isinstance(formula, kinds.Atom):
        return {outcome in formula.outcomes for outcome in outcomes_of(formula.runner)}
    if isinstance(formula, kinds.Agree):
        rows = [set(outcomes_of(number)) for number in formula.runners]
        common, every = set.intersection(*rows), set.union(*rows)
        return {agree for agree, may in ((True, common), (False, len(every) > 1)) if may}
    parts = [truths(part, outcomes_of) for part in formula.parts]
    if isinstance(formula, kinds.Not):
        return {not value for value in parts[0]}
    if isinstance(formula, kinds.Iff):
        return {one is other for one in parts[0] for other in parts[1]}
    least, most = len(parts), len(parts)
    if isinstance(formula, kinds.Or):
        least = 1
    elif isinstance(formula, kinds.Count):
        least, most = formula.least, formula.most
    sure, possible = (sum(part == {True} for part in parts), sum(True in part for part in parts))
    true, false = possible >= least and sure <= most, sure < least or possible > most
    return {value for value, may in ((True, true), (False, false)) if may}
