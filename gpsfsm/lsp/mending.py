"""The fixes of one finding, each with its proof: what an editor offers where the cursor is."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.fixing.compare import better
from gpsfsm.fixing.draft import Draft
from gpsfsm.fixing.edit import Safety, apply_edits, compatible
from gpsfsm.fixing.fixer import proposals_of
from gpsfsm.fixing.registry import all_fixers
from gpsfsm.fixing.sameness import keeps
from gpsfsm.lsp.work import Mended
from gpsfsm.reading import holds_trees
from gpsfsm.selection import Selection

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.edit import Edit, Fix
    from gpsfsm.fixing.fixer import Fixer
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport

__all__ = ["fixable", "proved"]

_MOST = 4
"""Fixes that are offered for a finding."""
_MOST_TRIED = 8
_MOST_PROPOSALS = 500


def fixable(rule: str) -> bool:
    """Whether there is any fix for findings of this rule."""
    return any(rule in fixer.rules for fixer in all_fixers())


def proved(text: str, path: str, finding: Finding, options: CheckOptions) -> tuple[Mended, ...]:
    """The fixes for a finding that stand the test of ``gpsfsm fix``, the safe ones first."""
    if holds_trees(text, from_response=options.from_response):
        return ()  # the fixers know plans only
    plain = replace(options, selection=Selection())
    report = check_text(text, path, plain)
    if report.source is None:
        return ()
    draft = Draft(report.source, report, (finding,), plain)
    found: dict[tuple[Edit, ...], Mended] = {}
    for fixer, group in sorted(_groups(draft, finding), key=_order)[:_MOST_TRIED]:
        edits = tuple(edit for fix in group for edit in fix.edits)
        if edits not in found and _helps(draft, report, fixer, group):
            titles = dict.fromkeys(fix.title for fix in group)
            found[edits] = Mended("; ".join(titles), edits, _safe(group))
        if len(found) == _MOST:
            break
    return tuple(found.values())


def _groups(draft: Draft, finding: Finding) -> Iterator[tuple[Fixer, list[Fix]]]:
    """The fixes at this place; those of a tag may stand at its other end, and need each other."""
    place = draft.offset(finding)
    for fixer in all_fixers():
        if finding.rule not in fixer.rules:
            continue
        fixes = [
            fix
            for fix in proposals_of(fixer, draft, most=_MOST_PROPOSALS)
            if fix.rule == finding.rule and fix.edits and compatible([fix])
        ]
        here = [fix for fix in fixes if fix.at == place]
        yield from ((fixer, [fix]) for fix in here)
        together = compatible(fixes)
        if together and (not here or (len(together) > 1 and here[0] in together)):
            yield fixer, together


def _order(proposed: tuple[Fixer, list[Fix]]) -> tuple[bool, int]:
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
