"""Baselines: an earlier JSON report whose findings are known and do not fail a check.

A finding is known by its plan's path, its rule and its element. The line is left out, so that an
edit above a finding does not make it new; two findings of one rule at one element need two entries.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError
from gpsfsm.inputs import read_file
from gpsfsm.selection import says_no_verdict
from gpsfsm.strict_json import DuplicateKeyError, strict_loads

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport, Report

__all__ = ["Baseline", "load_baseline"]

_VERSION = 1
_COMMENT = "comment"
_MAX_BYTES = 1 << 29

_Key = tuple[str, str, str]
"""Path, rule code, element path."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """The known findings, each as often as it was found."""

    known: Counter[_Key]

    def apply(self, report: Report) -> Report:
        """The report with its known findings moved to ``suppressed``; verdicts stay.

        What says that gpsfsm could not decide is never moved: it explains the exit code.
        """
        left = self.known.copy()
        return replace(report, plans=tuple(_apply(plan, left) for plan in report.plans))


def load_baseline(file: str | Path) -> Baseline:
    """Read the output of ``gpsfsm check --format json``.

    Raises InputError for a file that is missing or anything else.
    """
    try:
        content = read_file(file, _MAX_BYTES)
    except InputError as error:
        raise InputError(f"baseline {file} {error}") from error
    try:
        return Baseline(_known(strict_loads(content)))
    except (ValueError, RecursionError) as error:  # _UnfitError and what json raises
        named = isinstance(error, _UnfitError | DuplicateKeyError)
        reason = str(error) if named else "it is not JSON"
        raise InputError(
            f"baseline {file} is not a report of 'gpsfsm check --format json': {reason}"
        ) from error


class _UnfitError(ValueError):
    """JSON, but not a report that can be read."""


def _known(report: Any) -> Counter[_Key]:
    """Count the findings of a parsed report; unknown fields are ignored, missing ones are not."""
    version = _field(report, "version", int)
    if version != _VERSION:
        raise _UnfitError(f"its version is {version}, and this gpsfsm reads version {_VERSION}")
    known: Counter[_Key] = Counter()
    for plan in _field(report, "plans", list):
        path = os.path.normpath(_field(plan, "path", str))
        hidden = _field(plan, "suppressed_findings", list) if "suppressed_findings" in plan else ()
        excused = [each for each in hidden if _by_comment(each)]
        for finding in [*_field(plan, "findings", list), *excused]:
            element = _field(_field(finding, "location", dict), "element", str)
            known[path, _field(finding, "rule", str), element] += 1
    return known


def _by_comment(finding: Any) -> bool:
    """Whether a comment in the plan suppressed it: then it counts, as if it were shown."""
    return bool(_field(finding, "suppressed_by", str) == _COMMENT)


def _field(parent: Any, name: str, kind: type) -> Any:
    if not isinstance(parent, dict) or type(parent.get(name)) is not kind:  # True is an int
        raise _UnfitError(f"a field '{name}' is missing or not of the right type")
    return parent[name]


def _apply(plan: PlanReport, left: Counter[_Key]) -> PlanReport:
    """Move known findings, earlier ones first, and count them down in ``left``."""
    path = os.path.normpath(plan.path)
    shown: list[Finding] = []
    suppressed: list[Finding] = []
    moved: list[Finding] = []
    for finding in (*plan.findings, *plan.suppressed):
        key = (path, finding.rule, finding.location.element)
        counts = finding.suppressed_by in ("", _COMMENT) and not says_no_verdict(finding.rule)
        if counts and left[key] > 0:
            left[key] -= 1
            moved.append(replace(finding, suppressed_by="baseline"))
        else:
            (suppressed if finding.suppressed_by else shown).append(finding)
    if not moved:
        return plan
    return replace(plan, findings=tuple(shown), suppressed=(*suppressed, *moved))
