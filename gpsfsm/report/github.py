"""Annotations for GitHub Actions: one workflow command per finding.

GitHub shows only the first ten annotations of a step, so the most severe ones come first.
"""

from __future__ import annotations

from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import MAX_MESSAGE, has_line, setting_line, totals
from gpsfsm.streams import Form

_COMMANDS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "notice"}


def _render(report: Report, _: RenderOptions) -> str:
    pairs = [(plan, finding) for plan in report.plans for finding in _counting(plan)]
    pairs.sort(key=lambda pair: -pair[1].severity.rank)  # stable: else in the order of the report
    lines = [_undecided(plan) for plan in report.plans if _is_silent(plan)]
    lines += [_annotation(plan.path, finding) for plan, finding in pairs]
    lines += [f"::notice title=settings::{_data(setting_line(used))}" for used in report.settings]
    return "".join(line + "\n" for line in [*lines, totals(report)])


def _counting(plan: PlanReport) -> list[Finding]:
    """The findings of a plan, those as well that only a comment in it suppresses."""
    return [*plan.findings, *plan.excused]


def _is_silent(plan: PlanReport) -> bool:
    """True if a plan that could not be decided would be passed over in silence."""
    return plan.verdict is Verdict.UNDECIDED and not any(
        finding.severity is Severity.ERROR for finding in plan.findings
    )


def _undecided(plan: PlanReport) -> str:
    return f"::error file={_property(plan.path)},title=undecided::the plan is undecided"


def _annotation(path: str, finding: Finding) -> str:
    location = finding.location
    properties = [f"file={_property(location.file or path)}"]
    if has_line(finding):
        properties.append(f"line={location.line}")
        if location.column > 0:
            end = location.column + max(1, finding.length)
            properties += [f"col={location.column}", f"endColumn={end}"]
    properties.append(f"title={_property(f'{finding.rule} {finding.name}')}")
    message = _data(finding.message)
    if finding.suppressed_by:
        message += f"%0A{_data(f'suppressed by a comment: {finding.justification}')}"
    if finding.hint:
        message += f"%0A{_data(f'hint: {finding.hint}')}"
    return f"::{_COMMANDS[finding.severity]} {','.join(properties)}::{message}"


def _data(text: str) -> str:
    """Line breaks are escapes already, like all that is not printable."""
    return clip(text, MAX_MESSAGE).replace("%", "%25")


def _property(text: str) -> str:
    return printable(text).replace("%", "%25").replace(":", "%3A").replace(",", "%2C")


FORMAT = Format(name="github", render=_render, form=Form.COMMANDS)
