"""The fixes of one finding, each with its proof: as lines for a model, as edits for an editor.

A model answers with a whole plan that is checked again, so a line that may change what the plan
means (an unsafe fix) is good advice too. A suggestion must stand the test of every fix. An editor
is offered where its cursor is what ``gpsfsm fix`` would do there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking.selection import Selection
from gpsfsm.fixing.compare import better, keeps
from gpsfsm.fixing.draft import Draft
from gpsfsm.fixing.fixer import Safety, all_fixers, apply_edits, compatible, proposals_of
from gpsfsm.model.finding import Severity
from gpsfsm.syntax.text import Lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.fixing.fixer import Edit, Fix, Fixer
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport

_START_TAG = re.compile(r"<[A-Za-z]")
_MAX_CHARACTERS = 20_000
_MAX_CHECKS = 24
_MAX_PROPOSALS = 50
_MAX_LINES = 30
_MOST_OFFERED = 4
"""Fixes that are offered for a finding."""
_MOST_TRIED = 8
_MOST_GROUPED = 500


class Suggestions:
    """Called with a report and one of its findings: the corrected lines, none if none are known.

    ``options`` are those with which the plan was checked. Bounded per plan: long plans get no
    suggestions, and after a number of checks there are no more.
    """

    def __init__(self, options: CheckOptions | None = None) -> None:
        options = options or CheckOptions()
        analysis = replace(options.analysis, max_scenarios=0)
        self._options = replace(options, analysis=analysis, selection=Selection())
        self._shown: PlanReport | None = None
        self._report: PlanReport | None = None
        self._checks = 0

    def __call__(self, plan: PlanReport, finding: Finding, /) -> tuple[str, ...]:
        """The lines, as they would stand in the plan."""
        if plan.source is None or len(plan.source) > _MAX_CHARACTERS:
            return ()
        if self._shown is not plan:
            self._shown, self._report = plan, check_text(plan.source, plan.path, self._options)
            self._checks = _MAX_CHECKS
        assert self._report is not None
        draft = Draft(plan.source, self._report, tuple(plan.findings), self._options)
        for fixer, group, fix in sorted(_proposals(draft, finding), key=_order):
            if self._checks <= 0:
                break
            self._checks -= 1
            if lines := self._lines(draft, fixer, group, fix):
                return lines
        return ()

    def _lines(self, draft: Draft, fixer: Fixer, group: Sequence[Fix], fix: Fix) -> tuple[str, ...]:
        """The lines that the fix writes, if its group helps and it writes no error."""
        edits = [edit for each in group for edit in each.edits]
        text = apply_edits(draft.text, edits)
        report = check_text(text, draft.report.path, self._options)
        if not better(draft.report, report, group, reveals=fixer.reveals):
            return ()
        first, last = _span(draft.text, text, fix, edits)
        wrong = (
            first <= finding.location.line <= last
            for finding in report.findings
            if finding.severity is Severity.ERROR
        )
        lines = text.splitlines()[first - 1 : last]
        if any(wrong) or len(lines) > _MAX_LINES or not self._can_be_run("\n".join(lines)):
            return ()
        return tuple(lines)

    def _can_be_run(self, lines: str) -> bool:
        """True if there are runners or controls in them, and runners as they should be.

        In the plan itself, mistakes elsewhere can keep runners from being looked at.
        """
        report = check_text(f"<Plan>\n{lines}\n</Plan>", "<lines>", self._options)
        wrong = (each.rule for each in report.findings if each.severity is Severity.ERROR)
        return _START_TAG.search(lines) is not None and not any(
            rule.startswith("GP2") for rule in wrong
        )


def _proposals(draft: Draft, finding: Finding) -> Iterator[tuple[Fixer, list[Fix], Fix]]:
    """The fixes that fixers propose for this finding, alone and with others of its rule."""
    place = draft.offset(finding)
    for fixer in all_fixers():
        if finding.rule not in fixer.rules or not fixer.fits(trees=draft.trees):
            continue
        fixes = [
            fix
            for fix in proposals_of(fixer, draft, most=_MAX_PROPOSALS)
            if fix.rule == finding.rule and fix.edits
        ]
        together = compatible(fixes)
        for fix in fixes:
            if fix.at == place:
                yield fixer, [fix], fix
                if fix in together and len(together) > 1:
                    yield fixer, together, fix


def _order(proposal: tuple[Fixer, list[Fix], Fix]) -> tuple[object, ...]:
    fixer, group, fix = proposal
    return (fix.safety is not Safety.SAFE, len(group), fixer.name, fix.title)


def _span(before: str, after: str, fix: Fix, edits: Sequence[Edit]) -> tuple[int, int]:
    """The first and the last line of the new text that one fix has written; none: last < first."""
    ordered = sorted(edits, key=lambda edit: (edit.start, edit.end))
    start = min(edit.start for edit in fix.edits)
    end = max(edit.end for edit in fix.edits)
    shift = sum(len(e.text) - (e.end - e.start) for e in ordered if e.start < start)
    grown = sum(len(e.text) - (e.end - e.start) for e in ordered if start <= e.start <= end)
    old = set(before[:end].splitlines()[before[:start].count("\n") :])
    lines = Lines(after)
    first, last = lines.position(start + shift)[0], lines.position(end + shift + grown)[0]
    new = after.splitlines()
    while first <= last and (new[first - 1 : first] or [""])[0] in old | {""}:
        first += 1
    while first <= last and (new[last - 1 : last] or [""])[0] in old | {""}:
        last -= 1
    return first, last


@dataclass(frozen=True, slots=True)
class Mended:
    """A fix that is proved, with its edits."""

    title: str
    edits: tuple[Edit, ...]
    safe: bool


def fixable(rule: str) -> bool:
    """True if there is any fix for findings of this rule."""
    return any(rule in fixer.rules for fixer in all_fixers())


def proved(text: str, path: str, finding: Finding, options: CheckOptions) -> tuple[Mended, ...]:
    """The fixes for a finding that stand the test of ``gpsfsm fix``, the safe ones first."""
    plain = replace(options, selection=Selection())
    report = check_text(text, path, plain)
    if report.source is None:
        return ()
    draft = Draft(report.source, report, (finding,), plain)
    mended: dict[tuple[Edit, ...], Mended] = {}
    for fixer, group in sorted(_groups(draft, finding), key=_simplest)[:_MOST_TRIED]:
        edits = tuple(edit for fix in group for edit in fix.edits)
        if edits not in mended and _helps(draft, report, fixer, group):
            titles = dict.fromkeys(fix.title for fix in group)
            mended[edits] = Mended("; ".join(titles), edits, _safe(group))
        if len(mended) == _MOST_OFFERED:
            break
    return tuple(mended.values())


def _groups(draft: Draft, finding: Finding) -> Iterator[tuple[Fixer, list[Fix]]]:
    """The fixes at this place; those of a tag may stand at its other end, and need each other."""
    place = draft.offset(finding)
    for fixer in all_fixers():
        if finding.rule not in fixer.rules or not fixer.fits(trees=draft.trees):
            continue
        fixes = [
            fix
            for fix in proposals_of(fixer, draft, most=_MOST_GROUPED)
            if fix.rule == finding.rule and fix.edits and compatible([fix])
        ]
        here = [fix for fix in fixes if fix.at == place]
        yield from ((fixer, [fix]) for fix in here)
        together = compatible(fixes)
        if together and (not here or (len(together) > 1 and here[0] in together)):
            yield fixer, together


def _simplest(proposed: tuple[Fixer, list[Fix]]) -> tuple[bool, int]:
    return not _safe(proposed[1]), len(proposed[1])


def _safe(group: list[Fix]) -> bool:
    return all(fix.safety is Safety.SAFE for fix in group)


def _helps(draft: Draft, report: PlanReport, fixer: Fixer, group: list[Fix]) -> bool:
    text = apply_edits(draft.text, (edit for fix in group for edit in fix.edits))
    after = check_text(text, report.path, draft.options)
    if after.source is None or not better(report, after, group, reveals=fixer.reveals):
        return False
    rule = group[0].rule
    fewer = _count(after, rule) < _count(report, rule)
    return fewer and (not _safe(group) or keeps(draft.text, text, group, draft.options))


def _count(report: PlanReport, rule: str) -> int:
    return sum(finding.rule == rule for finding in report.findings)
