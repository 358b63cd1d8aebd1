"""Check, propose, try, check again: until nothing more can be fixed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.analysis.rules import says_no_verdict
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking.selection import Selection
from gpsfsm.fixing.compare import better, keeps, stage, taken_away
from gpsfsm.fixing.draft import Draft
from gpsfsm.fixing.fixer import (
    Applied,
    Fix,
    Safety,
    all_fixers,
    apply_edits,
    came_from,
    compatible,
    proposals_of,
)
from gpsfsm.model.story import PAPER_ENGINE
from gpsfsm.syntax.source import read_source
from gpsfsm.syntax.text import Lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.fixing.fixer import Edit, Fixer
    from gpsfsm.model.report import PlanReport

_MAX_ROUNDS = 100
_MAX_CHECKS = 300
_MAX_CHARACTERS = 20_000_000
"""Code points checked in all: bounds the time, and the same on every machine."""

_MAX_PROPOSALS = 500
_MAX_PROBLEMS = 5_000
"""So many findings of a rule are compared: one that is not listed is not seen to be gone."""

_MAX_LOOKED_AT = 100_000


@dataclass(frozen=True, slots=True)
class Fixed:
    """A text after all fixes: the fixes applied, and the report on what remains.

    ``original`` and ``text`` are the decoded texts before and after, without a byte order mark, and
    "" if the input cannot be decoded. ``unsafe_left`` is the number of findings with unsafe fixes
    that were not requested and therefore not tried. ``failed`` maps the names of fixers that
    failed because of a defect to the errors. ``before`` and ``after`` are the numbers of selected
    findings in the two texts, also where the report lists only the first ones of a rule.
    """

    original: str
    text: str
    applied: tuple[Applied, ...]
    report: PlanReport
    unsafe_left: int = 0
    failed: Mapping[str, str] = field(default_factory=dict)
    before: int = 0
    after: int = 0

    @property
    def changed(self) -> bool:
        """True if the text was changed."""
        return bool(self.applied)

    def _repr_html_(self) -> str:
        """The repairs, the lines that differ, and the report on what is left, for notebooks."""
        from gpsfsm.report._notebook import fixed_html

        applied = [f"{each.rule}, line {each.line}: {each.title}" for each in self.applied]
        return fixed_html("\n".join(self._differing_lines()), applied, self.report)

    def _differing_lines(self) -> Iterator[str]:
        import difflib

        old, new = self.original.splitlines(), self.text.splitlines()
        return difflib.unified_diff(old, new, "before", "after", lineterm="")

    def _repr_pretty_(self, printer: Any, _cycle: bool) -> None:
        """The same as text, where nothing draws: IPython on a terminal."""
        printer.text("\n".join(self._differing_lines()) or "nothing repaired")

    def to_dict(self) -> dict[str, Any]:
        """The result as data: the text, the fixes and the report."""
        return {
            "changed": self.changed,
            "text": self.text,
            "applied": [
                {
                    "rule": each.rule,
                    "title": each.title,
                    "line": each.line,
                    "safety": each.safety,
                    "also": list(each.also),
                }
                for each in self.applied
            ],
            "before": self.before,
            "after": self.after,
            "unsafe_left": self.unsafe_left,
            "failed": dict(self.failed),
            "report": self.report.to_dict(),
        }


class _Proposal(NamedTuple):
    fix: Fix
    fixer: Fixer


def fix_text(
    text: str | bytes, options: CheckOptions | None = None, *, unsafe: bool = False, path: str = ""
) -> Fixed:
    """Fix what can be fixed without a language model; never raises for what is in the text.

    Only findings that ``options`` selects are fixed. A proposal is kept only if the check of the
    edited text shows that its finding is gone, no other finding is new and the verdict is no
    worse. ``unsafe`` also applies fixes that may change what the plan means.
    """
    options = options or CheckOptions()
    path = path or "<text>"
    report = check_text(text, path, options)
    original = report.source
    if original is None:  # nothing of a plan is in it, or it cannot be read
        original = read_source(text, options.limits).text or ""
    if not report.source or not report.findings:
        count = len(report.findings)
        return Fixed(original, original, (), report, before=count, after=count)
    session = _Session(_of_all_rules(text, path, options, report), options, path)
    before = session.count(report)
    session.run(Safety.SAFE)
    if unsafe:
        session.run(Safety.UNSAFE)
    left = 0 if unsafe else session.offers(Safety.UNSAFE)
    if session.applied:
        report = check_text(session.text, path, options)
    applied = tuple(session.applied)
    failed, after = session.failed, session.count(report)
    return Fixed(original, session.text, applied, report, left, failed, before, after)


def _plain(options: CheckOptions) -> CheckOptions:
    """The same check with all findings and without scenarios, which only explain."""
    analysis = replace(options.analysis, max_scenarios=0)
    limits = replace(options.limits, max_problems=max(options.limits.max_problems, _MAX_PROBLEMS))
    return replace(options, analysis=analysis, limits=limits, selection=Selection())


def _of_all_rules(
    text: str | bytes, path: str, options: CheckOptions, report: PlanReport
) -> PlanReport:
    """The report with all findings: the one there is, if nothing was left out of it.

    Where gpsfsm could not decide, looking for scenarios may have been the reason.
    """
    undecided = any(says_no_verdict(finding.rule) for finding in report.findings)
    default = options.selection == Selection() and options.engine == PAPER_ENGINE
    if default and not undecided and _is_whole(report, options):
        return report
    return check_text(text, path, _plain(options))


def _is_whole(report: PlanReport, options: CheckOptions) -> bool:
    """True if no rule has more findings than are listed."""
    listed = Counter(finding.rule for finding in report.findings)
    return max(listed.values(), default=0) < options.limits.max_problems


class _Session:
    """The repair of one text."""

    def __init__(self, report: PlanReport, options: CheckOptions, path: str) -> None:
        self.report, self.path = report, path
        self.options, self.plain = options, _plain(options)
        self.text = report.source or ""
        self.applied: list[Applied] = []
        self.failed: dict[str, str] = {}
        self._seen = {self.text}
        self._lines = Lines(self.text)
        self._history: list[list[Edit]] = []
        self._checks, self._characters = _MAX_CHECKS, _MAX_CHARACTERS + 3 * len(self.text)

    def run(self, safety: Safety) -> None:
        """Apply fixes until none helps any more; unsafe ones only where no safe one does."""
        for _ in range(_MAX_ROUNDS):
            draft = self._draft()
            proposals = self._proposals(draft, Safety.SAFE)
            if self._try_all(proposals):
                continue
            if safety is Safety.SAFE:
                return
            if not self._try_all(self._proposals(draft, Safety.UNSAFE)):
                return

    def offers(self, safety: Safety) -> int:
        """The number of findings for which there are proposals of this kind, not yet tried."""
        proposals = self._proposals(self._draft(), safety)
        return len({(proposal.fix.rule, proposal.fix.at) for proposal in proposals})

    def count(self, report: PlanReport) -> int:
        """The number of selected findings of the text as it is now, whose report this is."""
        if _is_whole(report, self.options):
            return len(report.findings)
        return len(self.options.selection.split(self.report.findings)[0])

    def _draft(self) -> Draft:
        shown, _ = self.options.selection.split(self.report.findings)
        return Draft(self.text, self.report, tuple(shown), self.options)

    def _proposals(self, draft: Draft, safety: Safety) -> list[_Proposal]:
        result: list[_Proposal] = []
        wanted = {finding.rule for finding in draft.wanted}
        for fixer in all_fixers():
            rules = wanted.intersection(fixer.rules)
            if not rules or not fixer.fits(trees=draft.trees):
                continue
            proposals = (
                fix
                for fix in proposals_of(fixer, draft, most=_MAX_LOOKED_AT, failed=self.failed)
                if fix.rule in rules and fix.safety is safety and fix.edits
            )
            result += (_Proposal(fix, fixer) for fix in islice(proposals, _MAX_PROPOSALS))
        return sorted(result, key=lambda each: (_order(each), each.fix.at, each.fix.rule))

    def _original(self, offset: int) -> int:
        """The offset in the text as it was given."""
        for edits in reversed(self._history):
            offset = came_from(offset, edits)
        return offset

    def _try_all(self, proposals: list[_Proposal]) -> bool:
        """Apply the first group that helps: all of a stage, all of a fixer, a single one."""
        for _, of_stage in groupby(proposals, key=_order):
            if any(self._attempt(group) for group in _groups(list(of_stage))):
                return True
        return False

    def _attempt(self, group: list[_Proposal]) -> bool:
        fixes = compatible(proposal.fix for proposal in group)
        text = apply_edits(self.text, (edit for fix in fixes for edit in fix.edits))
        if text in self._seen or self._checks <= 0 or self._characters < len(text):
            return False
        self._seen.add(text)  # also one that is refused: once is enough
        self._checks -= 1
        self._characters -= len(text)
        report = check_text(text, self.path, self.plain)
        reveals = frozenset[str]().union(*(proposal.fixer.reveals for proposal in group))
        if report.source is None or not better(self.report, report, fixes, reveals=reveals):
            return False
        safe = all(fix.safety is Safety.SAFE for fix in fixes)
        if safe and not keeps(self.text, text, fixes, self.options):
            return False
        for fix, also in zip(fixes, taken_away(self.report, report, fixes), strict=True):
            line = self._lines.position(self._original(fix.at))[0]
            self.applied.append(Applied(fix.rule, fix.title, line, fix.safety, also))
        edits = [edit for fix in fixes for edit in fix.edits]
        self._history.append(sorted(edits, key=lambda edit: (edit.start, edit.end)))
        self.text, self.report = text, report
        return True


def _order(proposal: _Proposal) -> int:
    """The order of proposals: what is met first in reading is fixed first."""
    return -1 if proposal.fixer.first else stage(proposal.fix.rule)


def _groups(proposals: list[_Proposal]) -> Iterator[list[_Proposal]]:
    """Larger groups first: most often all proposals are good, and then one check is enough.

    Else halves, quarters and so on: among a hundred with a bad one, few checks lead to that.
    """
    yield proposals
    names = list(dict.fromkeys(proposal.fixer.name for proposal in proposals))
    if len(names) > 1:
        for name in names:
            yield [proposal for proposal in proposals if proposal.fixer.name == name]
    size = len(proposals)
    while size > 1:
        size = (size + 1) // 2
        yield from (proposals[at : at + size] for at in range(0, len(proposals), size))
