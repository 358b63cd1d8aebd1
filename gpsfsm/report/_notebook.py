"""Plans, automata and reports in notebooks: verdict, findings with their lines, and the picture.

Every text from outside goes through ``_text``, which leaves nothing of it but text.
"""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from gpsfsm.compile import compile_plan
from gpsfsm.model.finding import Confidence, Finding
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import Report
from gpsfsm.picture import automaton_to_svg
from gpsfsm.report import render
from gpsfsm.report._words import (
    MAX_MESSAGE,
    count,
    excerpt,
    has_line,
    has_place,
    split_lines,
    summary,
    suppressed_line,
    totals,
    worst_first,
)
from gpsfsm.report.markdown import automaton_of, can_be_drawn

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import PlanReport

_MOST_FINDINGS = 100
_MOST_PLANS = 50
_MOST_ROWS = 200
_MOST_NODES = 200
_MOST_NODES_ALONE = 2_000
_MOST_SENTENCES = 30
_COLUMNS = 100
_NO_FILE = "<text>"
"""The path of a text that stands in no file."""

_STYLE = """
.gpsfsm{font:13px ui-sans-serif,system-ui,sans-serif;text-align:left;max-width:70em}
.gpsfsm h4{margin:.6em 0 .2em}
.gpsfsm .finding{border-left:4px solid #8c959f;margin:.6em 0;padding:.1em .8em}
.gpsfsm .error{border-left-color:#cf222e}
.gpsfsm .warning{border-left-color:#bf8700;border-left-style:dashed}
.gpsfsm .info{border-left-color:#0969da;border-left-style:dotted}
.gpsfsm pre{margin:.3em 0;overflow-x:auto;text-align:left}
.gpsfsm p,.gpsfsm ol{margin:.2em 0}
.gpsfsm th,.gpsfsm td{text-align:left}
.gpsfsm .picture{overflow:auto;max-height:72em}
"""


def automaton_svg(automaton: Automaton) -> str | None:
    """The picture of an automaton; None for one that nobody could look at."""
    return automaton_to_svg(automaton) if len(automaton.nodes) <= _MOST_NODES_ALONE else None


def plan_svg(plan: Plan) -> str | None:
    """The picture of a plan's automaton."""
    return automaton_svg(compile_plan(plan).automaton)


def report_html(report: Report) -> str:
    """All plans of a report; a single one with its picture."""
    if len(report.plans) == 1:
        return plan_report_html(report.plans[0])
    parts = [f"<p><b>{_text(totals(report))}</b></p>"]
    for plan in report.plans[:_MOST_PLANS]:
        parts += _plan(plan)
    parts += _more(len(report.plans) - _MOST_PLANS, "plan")
    return _whole(parts)


def plan_report_html(plan: PlanReport) -> str:
    """One plan with its picture."""
    return _whole([*_plan(plan), *_picture(plan)])


def report_text(report: Report) -> str:
    """The report as ``gpsfsm check`` prints it."""
    return render(report, "text").rstrip()


def plan_report_text(plan: PlanReport) -> str:
    """The report of one plan as ``gpsfsm check`` prints it."""
    return report_text(Report((plan,)))


def finding_text(finding: Finding) -> str:
    """One finding in a line, after its place in the text, and its hint."""
    rule, message = f"{finding.rule} {finding.name}", clip(finding.message, MAX_MESSAGE)
    location = finding.location
    place = f"line {location.line}, column {location.column}" if location.line else location.element
    words = f"{printable(place)}: {finding.severity.value} {rule}: {message}"
    return f"{words}\nhint: {clip(finding.hint, MAX_MESSAGE)}" if finding.hint else words


def finding_html(finding: Finding) -> str:
    """One finding; the text of its line is not at hand."""
    return _whole(list(_finding(finding, [])))


def findings_html(
    title: str, summary_text: str, findings: Sequence[Finding], source: str, below: str
) -> str:
    """Findings in a text that no report is of, between a summary and lines of text."""
    lines = split_lines(source) if source else []
    parts = [_heading(title), f"<p><b>{_text(summary_text)}</b></p>"]
    for finding in findings[:_MOST_FINDINGS]:
        parts += _finding(finding, lines)
    parts += _more(len(findings) - _MOST_FINDINGS, "finding")
    return _whole([*parts, f"<pre>{escape(below)}</pre>"])


def table_html(rows: Sequence[Sequence[str]], below: str) -> str:
    """A table, whose first row is its head, and lines of text below it."""
    head, *body = rows
    parts = ["<table>", f"<tr>{''.join(f'<th>{_text(cell)}</th>' for cell in head)}</tr>"]
    for row in body[:_MOST_ROWS]:
        parts.append(f"<tr>{''.join(f'<td>{_text(cell)}</td>' for cell in row)}</tr>")
    parts += ["</table>", *_more(len(body) - _MOST_ROWS, "row"), f"<pre>{escape(below)}</pre>"]
    return _whole(parts)


def fixed_html(diff: str, applied: Sequence[str], rest: PlanReport) -> str:
    """The repairs of a text, as a list and as differing lines, and the report on what is left."""
    listed = "".join(f"<li>{_text(each)}</li>" for each in applied[:_MOST_FINDINGS])
    parts = [f"<p><b>repaired</b></p><ol>{listed}</ol>" if listed else "<p>nothing repaired</p>"]
    parts += _more(len(applied) - _MOST_FINDINGS, "repair")
    parts += [f"<pre>{escape(diff)}</pre>"] if diff else []
    return _whole([*parts, *_plan(rest)])


def _whole(parts: list[str]) -> str:
    return f'<div class="gpsfsm"><style>{_STYLE}</style>\n' + "\n".join(parts) + "\n</div>\n"


def _plan(plan: PlanReport) -> Iterator[str]:
    yield _heading(plan.path)
    rest = summary(plan).removeprefix(plan.verdict.value)
    yield f"<p><b>{plan.verdict.value}</b>{_text(rest)}</p>"
    for note in plan.notes:
        yield f"<p>note: {_text(note)}</p>"
    sources: dict[str, list[str]] = {}  # the lines of each file
    for finding in worst_first(plan.findings)[:_MOST_FINDINGS]:
        file = finding.location.file
        if file not in sources:
            text = plan.text_of(finding.location)
            sources[file] = split_lines(text) if text else []
        yield from _finding(finding, sources[file])
    yield from _more(len(plan.findings) - _MOST_FINDINGS, "finding")
    for finding in plan.excused[:_MOST_FINDINGS]:
        yield f"<p>{_text(suppressed_line(plan.path, finding))}</p>"
    yield from _more(len(plan.excused) - _MOST_FINDINGS, "suppressed finding")


def _heading(path: str) -> str:
    """The file as a heading; a text of the notebook itself needs none."""
    return "" if path == _NO_FILE else f"<h4>{_text(path)}</h4>"


def _finding(finding: Finding, lines: list[str]) -> Iterator[str]:
    severity = finding.severity.value
    place = f", {_text(finding.location.words)}" if has_place(finding) else ""
    yield f'<div class="finding {severity}">'
    yield (
        f"<p><b>{severity} {_text(finding.rule)} {_text(finding.name)}</b>{place}: "
        f"{_text(finding.message)}</p>"
    )
    if has_line(finding) and finding.location.line <= len(lines):
        line, column = lines[finding.location.line - 1], finding.location.column
        shown = excerpt(line, column, length=finding.length, limit=_COLUMNS)
        carets = " " * shown.offset + "^" * shown.carets
        yield f"<pre>{escape(shown.text)}\n{carets}</pre>"
    yield from _story(finding)
    if finding.confidence is Confidence.HEURISTIC:
        yield "<p>note: heuristic; what the plan intends is guessed</p>"
    if finding.confidence is Confidence.MAY:
        yield "<p>note: not proved; every run that shows it is approximated (GP816)</p>"
    if finding.hint:
        yield f"<p>hint: {_text(finding.hint)}</p>"
    yield "</div>"


def _story(finding: Finding) -> Iterator[str]:
    if finding.scenario is None or not finding.scenario.story:
        return
    story = finding.scenario.story
    yield f"<details><summary>scenario in which {finding.scenario.ending}</summary><ol>"
    for sentence in story[:_MOST_SENTENCES]:
        yield f"<li>{_text(sentence)}</li>"
    yield "</ol>"
    yield from _more(len(story) - _MOST_SENTENCES, "event")
    yield "</details>"


def _picture(plan: PlanReport) -> Iterator[str]:
    if not can_be_drawn(plan):
        return
    automaton = automaton_of(plan)
    if automaton is None:
        return
    if len(automaton.nodes) > _MOST_NODES:
        yield f"<p>No picture: the plan has more than {_MOST_NODES} nodes.</p>"
        return
    yield f'<div class="picture">{automaton_to_svg(automaton)}</div>'


def _more(number: int, what: str) -> list[str]:
    return [f"<p>and {count(number, f'more {what}')}</p>"] if number > 0 else []


def _text(text: str) -> str:
    return escape(clip(text, MAX_MESSAGE))
