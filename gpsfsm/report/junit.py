"""JUnit XML for continuous integration servers: one test case per plan.

A rejected plan is one failure, a plan that could not be decided one error. Each lists the findings
of level error; the others are output of the test case. One element each, because several servers
read only the first.
"""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.printable import clip
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import (
    MAX_MESSAGE,
    count,
    headline,
    setting_line,
    summary,
    suppressed_line,
)

if TYPE_CHECKING:
    from collections.abc import Iterator


def _render(report: Report, _: RenderOptions) -> str:
    errors = sum(plan.verdict is Verdict.UNDECIDED for plan in report.plans)
    failures = sum(plan.verdict is Verdict.REJECTED for plan in report.plans)
    counts = f'tests="{len(report.plans)}" failures="{failures}" errors="{errors}"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<testsuites name="gpsfsm" {counts}>',
        f'  <testsuite name="gpsfsm" {counts} skipped="0">',
        *(line for plan in report.plans for line in _case(plan)),
        *_settings(report),
        "  </testsuite>",
        "</testsuites>",
    ]
    return "".join(line + "\n" for line in lines)


def _settings(report: Report) -> Iterator[str]:
    if report.settings:
        lines = _content([setting_line(used) for used in report.settings])
        yield f"    <system-out>{lines}</system-out>"


def _case(plan: PlanReport) -> Iterator[str]:
    path = _attribute(plan.path)
    yield f'    <testcase classname="gpsfsm.check" name="{path}" file="{path}">'
    serious = [finding for finding in plan.findings if finding.severity is Severity.ERROR]
    others = [finding for finding in plan.findings if finding.severity is not Severity.ERROR]
    if plan.verdict is Verdict.UNDECIDED:
        yield _result("error", "the plan is undecided", plan, serious)
    elif plan.verdict is Verdict.REJECTED:
        yield _result("failure", "rejected for findings that are not shown", plan, serious)
    else:
        others = list(plan.findings)
    output = [headline(plan.path, finding) for finding in others]
    output += [suppressed_line(plan.path, finding) for finding in plan.excused]
    output.append(summary(plan))
    yield f"      <system-out>{_content(output)}</system-out>"
    yield "    </testcase>"


def _result(tag: str, message: str, plan: PlanReport, serious: list[Finding]) -> str:
    kind = "none"
    if serious:
        first = serious[0]
        kind = first.rule
        more = len(serious) - 1
        message = f"{first.rule} {first.name}: {first.message}"
        message += f" (and {count(more, 'further error')})" if more else ""
    lines = [line for finding in serious for line in _lines(plan.path, finding)]
    return (
        f'      <{tag} message="{_attribute(message)}" type="{_attribute(kind)}">'
        f"{_content(lines)}</{tag}>"
    )


def _lines(path: str, finding: Finding) -> Iterator[str]:
    yield headline(path, finding)
    if finding.scenario is not None:
        for number, sentence in enumerate(finding.scenario.story, start=1):
            yield f"  {number}. {clip(sentence, MAX_MESSAGE)}"
    if finding.hint:
        yield f"  hint: {clip(finding.hint, MAX_MESSAGE)}"


def _attribute(text: str) -> str:
    return escape(clip(text, MAX_MESSAGE))


def _content(lines: list[str]) -> str:
    """Printable text holds no character that XML forbids; only the markup must be escaped."""
    return escape("\n".join(lines), quote=False)


FORMAT = Format(name="junit", render=_render)
