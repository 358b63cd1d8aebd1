"""Whether a repaired text is better than the one before: the gate of every proposal."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

from gpsfsm.fixing.edit import apply_to
from gpsfsm.model.report import Verdict

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from gpsfsm.fixing.edit import Edit, Fix
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport

__all__ = ["HIDING", "better", "stage"]

HIDING = frozenset(
    [
        *("GP101", "GP102", "GP104", "GP105", "GP106", "GP107", "GP108", "GP110"),
        *("GP111", "GP114", "GP115", "GP116", "GP201", "GP202", "GP203", "GP205"),
        "GP212",
    ]
)
"""Rules behind whose findings others hide: what is wrong here keeps the rest from being read."""

_STAGES = (
    ("GP103", "GP116", "GP115"),
    ("GP102",),
    ("GP101",),
    ("GP104",),
    ("GP105",),
    ("GP106", "GP107", "GP110"),
    ("GP108", "GP109", "GP111", "GP112", "GP113", "GP114"),
    ("GP201", "GP202", "GP208", "GP209", "GP210", "GP212"),
    ("GP203", "GP204", "GP205", "GP206", "GP207"),
)
_STAGE = {rule: number for number, rules in enumerate(_STAGES) for rule in rules}
_VERDICTS = (Verdict.ACCEPT, Verdict.REJECT, Verdict.ERROR)
_MAX_KEY = 300


def stage(rule: str) -> int:
    """How early in reading a plan findings of this rule are met."""
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
    if before.verdict is not Verdict.ACCEPT and _does_nothing(after):
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
    hidden_from = min((stage(rule) for rule in rules & HIDING), default=len(_STAGES) + 1)
    return all(
        place.finding.rule in reveals
        or stage(place.finding.rule) > hidden_from
        or place.finding.rule in rules & HIDING
        for place in come
    )


def _does_nothing(report: PlanReport) -> bool:
    """Whether the plan is accepted and has no runner: a text that is no plan became one."""
    return (
        report.verdict is Verdict.ACCEPT and report.facts is not None and not report.facts.runners
    )


def _progress(rule: str, old: Sequence[_Place], new: Sequence[_Place]) -> bool:
    """Fewer findings of the rule; or, where one hides others, the first one comes later."""
    mine = [place.offset for place in old if place.finding.rule == rule]
    theirs = [place.offset for place in new if place.finding.rule == rule]
    if len(theirs) < len(mine):
        return True
    return rule in HIDING and bool(mine) and min(theirs) > min(mine)


def _places(report: PlanReport, edits: Sequence[Edit]) -> list[_Place]:
    text = report.source or ""
    # Line ends as the front end counts them, without changing offsets.
    lines = text.replace("\r\n", " \n").replace("\r", "\n").split("\n")
    starts = [0, *accumulate(len(line) + 1 for line in lines)]
    found: list[_Place] = []
    for finding in report.findings:
        place = finding.location
        offset = min(starts[min(place.line, len(lines)) - 1] + place.column - 1, len(text))
        end = text.find(">", offset, offset + _MAX_KEY)
        key = " ".join(text[offset : end if end >= 0 else offset + _MAX_KEY].split())
        found.append(_Place(finding, apply_to(offset, edits), key))
    return found


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
        known = there[place.finding.rule, place.offset]
        worst = max(known, key=lambda each: each.rank, default=None)
        if worst is not None and worst.rank >= place.rank:
            known.remove(worst)
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
