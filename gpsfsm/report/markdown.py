"""Markdown for the summary of a job, a comment or a wiki: a table of plans, then what was found.

Small plans with findings are drawn, in Mermaid's language, of which GitHub makes pictures.

Text from a plan stays text: what Markdown or HTML could take for markup is escaped.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.printable import clip, plain_markdown
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report._drawn import draw
from gpsfsm.report._format import Format, RenderOptions
from gpsfsm.report._words import VERDICTS, count, has_line, setting_line, suppressed_line, totals

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["FORMAT"]

_MOST_FINDINGS = 50
_MOST_PLANS = 500
_MOST_PICTURES = 10
_MAX_TEXT = 400
"""GitHub takes a megabyte of summary per step, so long reports are cut."""


def _render(report: Report, options: RenderOptions) -> str:
    by = f" {options.version}" if options.version else ""
    lines = [f"### gpsfsm{by}: {totals(report)}", ""]
    if report.plans:
        lines += ["| plan | verdict | errors | warnings |", "| --- | --- | ---: | ---: |"]
        lines += [_row(plan) for plan in report.plans[:_MOST_PLANS]]
        lines += _more(len(report.plans) - _MOST_PLANS, "plan")
        lines.append("")
    found = [(plan, each) for plan in report.plans for each in plan.findings if _serious(each)]
    found.sort(key=lambda pair: -pair[1].severity.rank)  # stable: else in the order of the report
    for plan, finding in found[:_MOST_FINDINGS]:
        lines += _finding(plan, finding)
    lines += _more(len(found) - _MOST_FINDINGS, "finding")
    lines += _taken_away(report)
    shown = [plan for plan in report.plans[:_MOST_PLANS] if any(map(_serious, plan.findings))]
    for plan in shown[:_MOST_PICTURES]:
        lines += _picture(plan)
    lines += _more(len(shown) - _MOST_PICTURES, "plan", "that could be drawn")
    return "".join(line + "\n" for line in lines)


def _row(plan: PlanReport) -> str:
    severities = [finding.severity for finding in plan.findings]
    counts = (severities.count(Severity.ERROR), severities.count(Severity.WARNING))
    verdict = VERDICTS[plan.verdict]
    shown = verdict if plan.verdict is Verdict.ACCEPT else f"**{verdict}**"
    return f"| {_text(plan.path)} | {shown} | {counts[0]} | {counts[1]} |"


def _serious(finding: Finding) -> bool:
    return finding.severity is not Severity.INFO


def _finding(plan: PlanReport, finding: Finding) -> Iterator[str]:
    place = _text(plan.path) + (f", line {finding.location.line}" if has_line(finding) else "")
    head = f"**{finding.severity.value} {_text(finding.rule)} {_text(finding.name)}**"
    yield f"- {head} ({place}): {_text(finding.message)}"
    if finding.hint:
        yield f"  - hint: {_text(finding.hint)}"


def _taken_away(report: Report) -> Iterator[str]:
    """What is not shown above, and why."""
    excused = [
        (plan, each)
        for plan in report.plans
        for each in plan.suppressed
        if each.suppressed_by == "comment"
    ]
    for plan, finding in excused[:_MOST_FINDINGS]:
        yield f"- {_text(suppressed_line(plan.path, finding))}"
    yield from _more(len(excused) - _MOST_FINDINGS, "suppressed finding")
    yield from (f"- {_text(setting_line(used))}" for used in report.settings)


def _picture(plan: PlanReport) -> Iterator[str]:
    drawn = draw(plan)
    if drawn.mermaid:
        yield from ("", f"{_text(plan.path)}:", "", "```mermaid")
        yield from drawn.mermaid.splitlines()
        yield "```"
    elif drawn.too_large:
        yield from ("", f"No picture of {_text(plan.path)}: {drawn.too_large}.")


def _more(number: int, what: str, remark: str = "") -> list[str]:
    words = " ".join(filter(None, (count(number, f"more {what}"), remark)))
    return ["", f"and {words}"] if number > 0 else []


def _text(text: str) -> str:
    """Text and nothing else, not too long."""
    return plain_markdown(clip(text, _MAX_TEXT))


FORMAT = Format(name="markdown", render=_render)
