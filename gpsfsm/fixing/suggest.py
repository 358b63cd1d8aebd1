"""The lines that would mend a finding, for the model that wrote the plan.

A model answers with a whole plan that is checked again, so a line that may change what the plan
means (an unsafe fix) is good advice too. A suggestion must stand the test of every fix.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.fixing.compare import better
from gpsfsm.fixing.draft import Draft
from gpsfsm.fixing.edit import Safety, apply_edits, compatible
from gpsfsm.fixing.fixer import proposals_of
from gpsfsm.fixing.registry import all_fixers
from gpsfsm.model.finding import Severity
from gpsfsm.selection import Selection
from gpsfsm.syntax.lines import Lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.fixing.edit import Edit, Fix
    from gpsfsm.fixing.fixer import Fixer
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport

__all__ = ["Suggestions"]

_START_TAG = re.compile(r"<[A-Za-z]")
_MAX_CHARACTERS = 20_000
_MAX_CHECKS = 24
_MAX_PROPOSALS = 50
_MAX_LINES = 30


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
            if found := self._lines(draft, fixer, group, fix):
                return found
        return ()

    def _lines(self, draft: Draft, fixer: Fixer, group: Sequence[Fix], fix: Fix) -> tuple[str, ...]:
        """What the fix writes, if the group that it belongs to helps and it writes no error."""
        edits = [edit for each in group for edit in each.edits]
        text = apply_edits(draft.text, edits)
        report = check_text(text, draft.report.path, self._options)
        if not better(draft.report, report, group, reveals=fixer.reveals):
            return ()
        first, last = _span(draft.text, text, fix, edits)
        wrong = (
            first <= found.location.line <= last
            for found in report.findings
            if found.severity is Severity.ERROR
        )
        lines = text.splitlines()[first - 1 : last]
        if any(wrong) or len(lines) > _MAX_LINES or not self._can_be_run("\n".join(lines)):
            return ()
        return tuple(lines)

    def _can_be_run(self, lines: str) -> bool:
        """Whether there are runners or controls in them, and runners as they should be.

        In the plan itself, mistakes elsewhere can keep runners from being looked at.
        """
        report = check_text(f"<Plan>\n{lines}\n</Plan>", "<lines>", self._options)
        wrong = (each.rule for each in report.findings if each.severity is Severity.ERROR)
        return _START_TAG.search(lines) is not None and not any(
            rule.startswith("GP2") for rule in wrong
        )


def _proposals(draft: Draft, finding: Finding) -> Iterator[tuple[Fixer, list[Fix], Fix]]:
    """What fixers would do about this finding, alone and with others of its rule.

    Those that wait to be asked for are not asked.
    """
    place = draft.offset(finding)
    for fixer in all_fixers():
        if finding.rule not in fixer.rules or fixer.asked:
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
