"""The selection of findings that are shown: suppression comments, --select, --ignore, baselines.

A comment is written by the author of the plan, who may be a language model. So it names single
rules and gives a reason, or it suppresses nothing; and what it suppresses is listed.

A baseline is an earlier JSON report, whose findings do not fail a check. They are recognised by
their plan's path, their rule and their element. The line is left out, so that an edit above a
finding does not make it new; two findings of one rule at one element need two entries.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.rules import rule, says_no_verdict, select_rules
from gpsfsm.errors import InputError, UsageError
from gpsfsm.files import read_whole
from gpsfsm.late import dataclass
from gpsfsm.model.capability import ValueType
from gpsfsm.strict_json import DuplicateKeyError, strict_loads

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from gpsfsm.model.capability import Binding
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport, Report
    from gpsfsm.syntax import Suppression

_PACKED = "GP111"
_LISTS_OF_NUMBERS = (ValueType.INTS, ValueType.DOUBLES)
_HOW = "write <!-- gpsfsm: ignore GP302 because ... --> with a reason, and the rule's code or name"


@dataclass(frozen=True, slots=True)
class Selection:
    """``select`` and ``ignore`` hold rule codes; None selects all rules.

    What says that gpsfsm could not decide is always shown.
    """

    select: frozenset[str] | None = None
    ignore: frozenset[str] = frozenset()

    @classmethod
    def of(cls, select: Sequence[str] = (), ignore: Sequence[str] = ()) -> Selection:
        """From codes, names or prefixes as users write them; raises UsageError."""
        return cls(select_rules(tuple(select)) if select else None, select_rules(tuple(ignore)))

    def split(self, findings: Iterable[Finding]) -> tuple[list[Finding], list[Finding]]:
        """The findings that are shown, and the others (suppressed by an option)."""
        shown: list[Finding] = []
        hidden: list[Finding] = []
        for finding in findings:
            selected = self.select is None or finding.rule in self.select
            if says_no_verdict(finding.rule) or (selected and finding.rule not in self.ignore):
                shown.append(finding)
            else:
                hidden.append(replace(finding, suppressed_by="option"))
        return shown, hidden


def apply_suppressions(
    findings: Sequence[Finding], suppressions: Sequence[Suppression], *, analysed: bool = True
) -> tuple[list[Finding], list[Finding], list[Finding]]:
    """Split findings into kept and suppressed ones; third, a finding per useless suppression.

    ``analysed`` tells whether all findings are there, so that it is known which comments suppress
    nothing. A finding that is spread over several places is suppressed if each of them is excused.
    Of several comments that suppress a finding the last that was needed justifies it.
    """
    if not suppressions:
        return list(findings), [], []
    reasons: dict[int, str] = {}
    places = [_places(finding) for finding in findings]
    left = [set(each) for each in places]
    unused: list[Finding] = []
    for suppression in suppressions:
        codes, wrong = _meant(suppression)
        unused += [rule("GP905").finding(why, suppression.location, hint=_HOW) for why in wrong]
        for name, code in codes.items():
            covered = False
            for index, finding in enumerate(findings):
                if finding.rule != code or says_no_verdict(code):
                    continue
                excused = {each for each in places[index] if _inside(each, suppression.scope)}
                covered = covered or bool(excused)
                left[index] -= excused
                if not left[index]:
                    reasons.setdefault(index, suppression.reason)
            if not covered and analysed:
                message = f"{name} reports nothing here, so this comment suppresses nothing"
                unused.append(rule("GP905").finding(message, suppression.location))
    return (
        [finding for index, finding in enumerate(findings) if index not in reasons],
        [
            replace(finding, suppressed_by="comment", justification=reasons[index])
            for index, finding in enumerate(findings)
            if index in reasons
        ],
        unused,
    )


def _places(finding: Finding) -> frozenset[str]:
    """The elements that must be excused, each, for the finding to be."""
    return finding.elements if rule(finding.rule).spread else frozenset({finding.location.element})


def drop_repeated(findings: Iterable[Finding], *, by: Iterable[Finding]) -> list[Finding]:
    """The findings without those that findings among ``by`` report as well (``Finding.unless``)."""
    reported = {(finding.rule, element) for finding in by for element in finding.elements}
    return [
        finding
        for finding in findings
        if (finding.unless, finding.location.element) not in reported
    ]


def _inside(element: str, scope: str) -> bool:
    element = element.partition("@")[0]  # further uses of a node of a tree are that node
    return bool(scope) and (element == scope or element.startswith(scope + "/"))


def _meant(suppression: Suppression) -> tuple[dict[str, str], list[str]]:
    """The codes of the rules that a comment names, and what is wrong with it."""
    if not suppression.rules:
        return {}, ["this gpsfsm comment names no rule, so it suppresses nothing"]
    if not any(map(str.isalnum, suppression.reason)):
        return {}, ["this gpsfsm comment gives no reason, so it suppresses nothing"]
    codes, wrong = {}, []
    for name in suppression.rules:
        try:
            codes[name] = rule(name).code
        except UsageError:
            wrong.append(f"there is no rule '{name}': a comment must name each rule it suppresses")
    return codes, wrong


_VERSIONS = (1, 2, 3)
_COMMENT = "comment"
_MAX_BYTES = 1 << 29

_Key = tuple[str, str, str]
"""Path, rule code, element path."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """The known findings, each as often as it was found."""

    counts: Counter[_Key]

    def apply(self, report: Report) -> Report:
        """The report with its known findings moved to ``suppressed``; verdicts stay.

        What says that gpsfsm could not decide is never moved: it explains the exit code.
        """
        left = self.counts.copy()
        return replace(report, plans=tuple(_apply(plan, left) for plan in report.plans))


def load_baseline(file: str | Path) -> Baseline:
    """Read the output of ``gpsfsm check --format json``.

    Raises InputError for a file that is missing or anything else.
    """
    try:
        content = read_whole(file, _MAX_BYTES)
    except InputError as error:
        raise InputError(f"baseline {file} {error}") from error
    try:
        return Baseline(_counted(strict_loads(content)))
    except (ValueError, RecursionError) as error:  # _UnfitError and what json raises
        named = isinstance(error, _UnfitError | DuplicateKeyError)
        reason = str(error) if named else "it is not JSON"
        raise InputError(
            f"baseline {file} is not a report of 'gpsfsm check --format json': {reason}"
        ) from error


class _UnfitError(ValueError):
    """JSON, but not a report that can be read."""


def _counted(report: Any) -> Counter[_Key]:
    """Count the findings of a parsed report; unknown fields are ignored, missing ones are not."""
    version = _field(report, "version", int)
    if version not in _VERSIONS:
        versions = " and ".join(map(str, _VERSIONS))
        raise _UnfitError(f"its version is {version}, and this gpsfsm reads versions {versions}")
    counts: Counter[_Key] = Counter()
    for plan in _field(report, "plans", list):
        path = os.path.normpath(_field(plan, "path", str))
        hidden = _field(plan, "suppressed_findings", list) if "suppressed_findings" in plan else ()
        excused = [each for each in hidden if _by_comment(each)]
        for finding in [*_field(plan, "findings", list), *excused]:
            element = _field(_field(finding, "location", dict), "element", str)
            counts[path, _field(finding, "rule", str), element] += 1
    return counts


def _by_comment(finding: Any) -> bool:
    """True if a comment in the plan suppressed it: then it counts, as if it were shown."""
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


def without_lists(findings: list[Finding], bindings: Sequence[Binding | None]) -> list[Finding]:
    """The findings but those of texts of numbers for parameters that are lists of numbers."""
    if all(each.rule != _PACKED for each in findings):
        return findings
    lists = {
        (attribute.line, attribute.column)
        for binding in filter(None, bindings)
        for name, attribute in binding.written.items()
        if (parameter := binding.provider.parameter(name)) and parameter.type in _LISTS_OF_NUMBERS
    }
    return [
        each
        for each in findings
        if each.rule != _PACKED or (each.location.line, each.location.column) not in lists
    ]
