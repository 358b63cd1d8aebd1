"""The test of every proposal: a better text than before, and for a safe fix the same plan.

``better`` compares the reports before and after; ``keeps`` is the proof that a safe fix is one.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from enum import StrEnum
from itertools import accumulate
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import rule
from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.compile.units import MachinePlan
from gpsfsm.equivalence import UndecidedError, compare
from gpsfsm.equivalence.normal_form import Label, one_form
from gpsfsm.fixing.fixer import apply_to
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Verdict

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.compile import Compiled
    from gpsfsm.fixing.fixer import Edit, Fix
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Element, Plan
    from gpsfsm.model.report import PlanReport

HIDING = frozenset(
    [
        *("GP101", "GP102", "GP104", "GP105", "GP106", "GP107", "GP108", "GP110"),
        *("GP111", "GP114", "GP115", "GP116", "GP118", "GP201", "GP202", "GP203"),
        *("GP205", "GP212", "GP801", "GP802", "GP803", "GP805", "GP810", "GP811", "GP812"),
        *("GP814", "GP815", "GP817"),
    ]
)
"""Rules behind whose findings others hide: what is wrong here keeps the rest from being read."""

_STAGES = (
    ("GP103", "GP116", "GP115"),
    ("GP102",),
    ("GP101",),
    ("GP104",),
    ("GP118",),
    ("GP105",),
    ("GP106", "GP107", "GP110"),
    ("GP108", "GP109", "GP111", "GP112", "GP113", "GP114"),
    ("GP201", "GP202", "GP208", "GP209", "GP210", "GP212"),
    ("GP203", "GP204", "GP205", "GP206", "GP207"),
    ("GP814", "GP815"),
    ("GP801", "GP802", "GP812", "GP817"),
    ("GP803", "GP804", "GP805", "GP806", "GP807", "GP809", "GP810", "GP811", "GP818"),
)
_STAGE = {rule: number for number, rules in enumerate(_STAGES) for rule in rules}
_VERDICTS = (Verdict.ACCEPTED, Verdict.REJECTED, Verdict.UNDECIDED)
_MAX_KEY = 300
_NAMING = "GP2"
_DANGLING = "GP302"
_OF_TREE = "GP118"
_COORDINATES = "GP111"  # writes one parameter as two


def stage(rule: str) -> int:
    """The stage of reading a plan at which findings of this rule are met."""
    return _STAGE.get(rule, len(_STAGES))


@dataclass(frozen=True, slots=True)
class _Place:
    """A finding with its offset (in the later text) and the text of its tag."""

    finding: Finding
    offset: int
    key: str

    @property
    def rank(self) -> int:
        return self.finding.severity.rank


def better(
    before: PlanReport,
    after: PlanReport,
    fixes: Sequence[Fix],
    *,
    reveals: Collection[str] = (),
) -> bool:
    """True if the fixes have removed their findings and brought no other ones.

    What the findings that are gone have hidden may come to light: findings of later stages of
    reading, and those of ``reveals``. A text that was rejected does not become an accepted plan
    without a runner: something else was meant. The reports hold all findings, whatever is selected.
    """
    if _VERDICTS.index(after.verdict) > _VERDICTS.index(before.verdict):
        return False
    if before.verdict is not Verdict.ACCEPTED and _does_nothing(after):
        return False
    edits = sorted((edit for fix in fixes for edit in fix.edits), key=lambda edit: edit.start)
    old = _places(before, edits)
    new = _places(after, ())
    stayed, come = _match(old, new)
    targets = {(fix.rule, apply_to(fix.at, edits)) for fix in fixes}
    if any((place.finding.rule, place.offset) in targets for place in stayed):
        return False
    rules = {fix.rule for fix in fixes}
    if not all(_progress(rule, old, new) for rule in rules):
        return False
    if _traded(old, stayed, [place for place in come if place.finding.rule in reveals]):
        return False
    hidden_from = min((stage(rule) for rule in rules & HIDING), default=len(_STAGES) + 1)
    return all(
        place.finding.rule in reveals
        or stage(place.finding.rule) > hidden_from
        or place.finding.rule in rules & HIDING
        for place in come
    )


def _traded(old: Sequence[_Place], stayed: Sequence[_Place], revealed: Sequence[_Place]) -> bool:
    """True if what came to light is as bad as what is gone.

    An example, with errors, warnings and infos counted: a prompt that is flushed takes GP411 away,
    (0, 1, 0); if its answer is used by nothing and the buffer is sent too early, GP404 and GP412
    come, (0, 1, 1). That is not less, so nothing was mended. That a runner can fail from now on
    (GP302) is no defect that the edit made.
    """
    come = Counter(place.rank for place in revealed if place.finding.rule != _DANGLING)
    gone = Counter(place.rank for place in old) - Counter(place.rank for place in stayed)
    ranks = sorted({*come, *gone}, reverse=True)
    return bool(come) and [come[rank] for rank in ranks] >= [gone[rank] for rank in ranks]


def taken_away(
    before: PlanReport, after: PlanReport, fixes: Sequence[Fix]
) -> list[tuple[str, ...]]:
    """Per fix, the rules of the findings that went with its own: those nearest to its edits."""
    edits = sorted((edit for fix in fixes for edit in fix.edits), key=lambda edit: edit.start)
    old = _places(before, edits)
    stayed, _ = _match(old, _places(after, ()))
    left = Counter((place.finding.rule, place.offset) for place in stayed)
    mine = Counter((fix.rule, apply_to(fix.at, edits)) for fix in fixes)
    starts = [[apply_to(edit.start, edits) for edit in fix.edits] for fix in fixes]
    also: list[list[str]] = [[] for _ in fixes]
    for place in old:
        name = place.finding.rule, place.offset
        for counter in (left, mine):
            if counter[name]:
                counter[name] -= 1
                break
        else:
            near = min(
                range(len(fixes)),
                key=lambda each: min(abs(place.offset - start) for start in starts[each]),
            )
            also[near].append(place.finding.rule)
    return [tuple(sorted(rules)) for rules in also]


def _does_nothing(report: PlanReport) -> bool:
    """True if the plan is accepted and has no runner: a text that is no plan became one."""
    return (
        report.verdict is Verdict.ACCEPTED and report.facts is not None and not report.facts.runners
    )


def _progress(rule: str, old: Sequence[_Place], new: Sequence[_Place]) -> bool:
    """Fewer findings of the rule; or, where one hides others, the first one comes later.

    Of a tree inside a plan there is one finding for all elements: fewer of them are progress.
    """
    if rule == _OF_TREE:
        return _elements(old) > _elements(new)
    mine = [place.offset for place in old if place.finding.rule == rule]
    theirs = [place.offset for place in new if place.finding.rule == rule]
    if len(theirs) < len(mine):
        return True
    return rule in HIDING and bool(mine) and min(theirs) > min(mine)


def _elements(places: Sequence[_Place]) -> int:
    """The number of elements that a finding of a tree names."""
    trees = (place.finding for place in places if place.finding.rule == _OF_TREE)
    return sum(1 + len(finding.related) for finding in trees)


def _places(report: PlanReport, edits: Sequence[Edit]) -> list[_Place]:
    text = report.source or ""
    # Line ends as the front end counts them, without changing offsets.
    lines = text.replace("\r\n", " \n").replace("\r", "\n").split("\n")
    starts = [0, *accumulate(len(line) + 1 for line in lines)]
    places: list[_Place] = []
    for finding in report.findings:
        place = finding.location
        offset = min(starts[min(place.line, len(lines)) - 1] + place.column - 1, len(text))
        end = text.find(">", offset, offset + _MAX_KEY)
        key = " ".join(text[offset : end if end >= 0 else offset + _MAX_KEY].split())
        places.append(_Place(finding, apply_to(offset, edits), key))
    return places


def _match(old: Iterable[_Place], new: Iterable[_Place]) -> tuple[list[_Place], list[_Place]]:
    """The findings that stayed, and those that came.

    A finding is the same as before if rule and place are, else if rule and tag are: elements move.
    """
    there: dict[tuple[str, int], list[_Place]] = defaultdict(list)
    for place in old:
        there[place.finding.rule, place.offset].append(place)
    stayed: list[_Place] = []
    left: list[_Place] = []
    for place in new:
        earlier = there[place.finding.rule, place.offset]
        worst = max(earlier, key=lambda each: each.rank, default=None)
        if worst is not None and worst.rank >= place.rank:
            earlier.remove(worst)
            stayed.append(place)
        else:
            left.append(place)
    moved: Counter[tuple[str, int, str]] = Counter(
        (place.finding.rule, rank, place.key)
        for places in there.values()
        for place in places
        for rank in range(place.rank + 1)
    )
    come: list[_Place] = []
    for place in left:
        key = place.finding.rule, place.rank, place.key
        if moved[key] > 0:
            moved[key] -= 1
            stayed.append(place)
        else:
            come.append(place)
    return stayed, come


class Sameness(StrEnum):
    """The likeness of two texts.

    ``same``: they do the same (docs/tasks.md). ``renamed``: they do, but for the interfaces,
    providers and parameters of runners, which stand in the same places. ``different``: they do not.
    """

    SAME = "same"
    RENAMED = "renamed"
    DIFFERENT = "different"


def sameness(before: str, after: str, options: CheckOptions) -> Sameness | None:
    """Compare two texts; None if either has errors, or if it was not decided within a limit."""
    plans = _plans(before, after, options)
    if plans is None:
        return None
    proved = _by_form(*plans)
    if proved is not None:
        return proved
    try:
        difference = compare(*plans, decider="lockstep")
    except UndecidedError:
        return None
    return Sameness.SAME if difference is None else Sameness.DIFFERENT


def keeps(before: str, after: str, fixes: Iterable[Fix], options: CheckOptions) -> bool:
    """True if safe fixes provably keep what the plan does, where it was clear what it does.

    Fixes of names and of parameters may change these, and nothing else. Linear but for a logarithm.
    """
    plans = _plans(before, after, options)
    if plans is None:
        return True
    naming = any(fix.rule.startswith(_NAMING) or fix.rule == _COORDINATES for fix in fixes)
    proved = _by_form(*plans)
    return proved is Sameness.SAME or (naming and proved is Sameness.RENAMED)


def _plans(before: str, after: str, options: CheckOptions) -> tuple[Plan, Plan] | None:
    first = _plan(before, options)
    second = None if first is None else _plan(after, options)
    return None if first is None or second is None else (first, second)


def _plan(text: str, options: CheckOptions) -> Plan | None:
    """The plan of a text without errors."""
    read = read_plan(text, limits=options.limits, from_response=options.from_response)
    if any(rule(problem.rule).severity is Severity.ERROR for problem in read.problems):
        return None
    return read.plan


def _by_form(first: Plan, second: Plan) -> Sameness | None:
    """The likeness that the normal forms of the plans prove; None: they prove nothing."""
    compiled = compile_plan(first), compile_plan(second)
    if isinstance(first, MachinePlan) or isinstance(second, MachinePlan):
        return _by_parts(*compiled)
    numbers: dict[object, int] = {}
    labels = [
        [Label(numbers.setdefault(runner.action, len(numbers))) for runner in plan.runners]
        for plan in (first, second)
    ]
    if one_form(compiled, (labels[0], labels[1])):
        return Sameness.SAME
    if one_form(compiled, (_by_place(compiled[0]), _by_place(compiled[1]))):
        return Sameness.RENAMED
    return None


def _by_parts(first: Compiled, second: Compiled) -> Sameness | None:
    """The likeness of machines that have the same parts in the same places; None of others."""
    one, other = first.automaton, second.automaton
    nodes = [[(node.kind, node.need) for node in each.nodes] for each in (one, other)]
    if nodes[0] != nodes[1] or one.edges != other.edges or one.stops != other.stops:
        return None
    actions = [list(map(_done, each.plan.runners)) for each in (one, other)]
    return Sameness.SAME if actions[0] == actions[1] else Sameness.RENAMED


def _done(runner: Element) -> object:
    """The action of a runner; the words of a choice say only where it comes from."""
    return runner.interface if runner.interface in (CHOICE, TICK) else runner.action


def _by_place(compiled: Compiled) -> list[Label]:
    """Every instance is equal to the one in the same place of the other plan."""
    return [Label(number) for number in range(len(compiled.automaton.plan.runners))]
