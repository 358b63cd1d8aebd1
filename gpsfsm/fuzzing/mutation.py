"""Mutation: whether what is checked of a plan is enough to notice that the plan was changed."""

from __future__ import annotations

import random
import re
import time
from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from gpsfsm.checking import check_text
from gpsfsm.errors import UsageError
from gpsfsm.fuzzing.nodes import Tree
from gpsfsm.fuzzing.operators import operators
from gpsfsm.model.report import Verdict
from gpsfsm.syntax import parse
from gpsfsm.tasks.equivalence import UndecidedError, compare

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.checking import CheckOptions
    from gpsfsm.fuzzing.operators import Mutation
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import PlanReport

__all__ = ["DEFAULT_MUTANTS", "Mutant", "Notice", "Score", "mutate"]

DEFAULT_MUTANTS = 1_000
_NO_VERDICT = "GP9"
_LINE = re.compile(r"\bline \d+( column \d+)?|\blines \d+ (to|and) \d+")


class Notice(StrEnum):
    """What becomes of a mutant.

    EQUAL: it does the same as the plan, so that there is nothing to notice. UNDECIDED: a limit was
    met before it was known.
    """

    EQUAL = "equal"
    NOTICED = "noticed"
    MISSED = "missed"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Mutant:
    """A changed plan; ``by`` are the rules that notice it."""

    mutation: Mutation
    notice: Notice
    by: tuple[str, ...] = ()


@dataclass(slots=True)
class Score:
    """What became of the mutants, in the order of the operators, then of the document.

    ``possible``: so many changes there are, of which some lead to the same mutant. ``cut_off``: the
    time was over before all that were drawn were tried. ``known`` is how many findings the plan
    itself has.
    """

    plan: Plan
    possible: int
    known: int
    mutants: list[Mutant] = field(default_factory=list)
    cut_off: bool = False

    def count(self, notice: Notice) -> int:
        """How many mutants became that."""
        return sum(each.notice is notice for each in self.mutants)

    @property
    def score(self) -> float | None:
        """The part that is noticed of what is to be noticed; None: there is nothing to notice."""
        noticed, missed = self.count(Notice.NOTICED), self.count(Notice.MISSED)
        return noticed / (noticed + missed) if noticed + missed else None


def mutate(
    plan: Plan,
    options: CheckOptions,
    *,
    seed: int = 0,
    most: int = DEFAULT_MUTANTS,
    time_s: float | None = None,
    clock: Callable[[], float] = time.monotonic,
    tick: Callable[[int, int], object] = lambda _done, _all: None,
) -> Score:
    """Check the mutants of a plan; of more than ``most`` as many are drawn from the seed.

    A mutant is noticed if its check has a finding that the check of the plan has not: of another
    rule, or about another action. Raises UsageError for options that make no sense, and if the plan
    itself cannot be decided.
    """
    original = str(Tree(plan))
    before = _read(original, plan.file, options)
    if before is None:
        raise UsageError(f"{plan.file}: the plan is too large to be written anew; raise the limits")
    report = check_text(original, plan.file, options)
    if report.verdict is Verdict.ERROR:
        raise UsageError(f"{plan.file}: the plan itself cannot be decided: {_why(report)}")
    known = _findings(report, before)
    mutations = [found for operator in operators() for found in operator.mutations(plan)]
    score = Score(plan, len(mutations), known.total())
    chosen = _chosen(mutations, seed, most)
    seen = {original}
    began = clock()
    for done, mutation in enumerate(chosen, start=1):
        if time_s is not None and clock() - began >= time_s:
            score.cut_off = True
            break
        tree = Tree(plan)
        mutation.change(tree)
        text = str(tree)
        if text not in seen:
            seen.add(text)
            score.mutants.append(_tried(mutation, text, before, known, options))
        tick(done, len(chosen))
    return score


def _chosen(mutations: list[Mutation], seed: int, most: int) -> list[Mutation]:
    if len(mutations) <= most:
        return mutations
    source = random.Random(f"{seed}:mutants")  # noqa: S311  (no secret; the same everywhere)
    return [mutations[number] for number in sorted(source.sample(range(len(mutations)), most))]


def _tried(
    mutation: Mutation,
    text: str,
    before: Plan,
    known: Counter[tuple[str, ...]],
    options: CheckOptions,
) -> Mutant:
    after = _read(text, before.file, options)
    if after is None:
        return Mutant(mutation, Notice.UNDECIDED)
    try:
        same = compare(before, after) is None
    except UndecidedError:
        same = None
    if same:
        return Mutant(mutation, Notice.EQUAL)
    report = check_text(text, before.file, options)
    new = _findings(report, after) - known
    if new:
        return Mutant(mutation, Notice.NOTICED, tuple(sorted({key[0] for key in new})))
    if same is None or report.verdict is Verdict.ERROR:
        return Mutant(mutation, Notice.UNDECIDED)
    return Mutant(mutation, Notice.MISSED)


def _read(text: str, file: str, options: CheckOptions) -> Plan | None:
    """The plan; None: a change has taken it beyond a limit, such as that of depth."""
    return parse(text, file=file, limits=options.limits).plan


def _findings(report: PlanReport, plan: Plan) -> Counter[tuple[str, ...]]:
    """What the findings are about, whatever the lines are on which it stands."""
    elements = {plan.path(element): element for element in plan.elements}
    found: Counter[tuple[str, ...]] = Counter()
    for finding in report.findings:
        if finding.rule.startswith(_NO_VERDICT):
            continue
        element = elements.get(finding.location.element)
        if element is None or element.parent < 0:
            found[(finding.rule, _LINE.sub("line", finding.message))] += 1
        else:
            given = sorted((each.name, each.text) for each in element.attributes)
            found[
                (finding.rule, element.kind.value, *(f"{name}={text}" for name, text in given))
            ] += 1
    return found


def _why(report: PlanReport) -> str:
    told: list[Finding] = [each for each in report.findings if each.rule.startswith(_NO_VERDICT)]
    return told[0].message if told else "it is not known why"
