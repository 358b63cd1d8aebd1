"""Text for people: findings with their source line, then a summary per plan and a total."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from gpsfsm.late import dataclass
from gpsfsm.model.finding import Confidence, Finding, Related, Scenario, Severity
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import (
    MAX_MESSAGE,
    excerpt,
    has_line,
    place,
    setting_line,
    split_lines,
    summary,
    suppressed_line,
    totals,
    where,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_MAX_LINE = 120
_MIN_LINE = 40
_MAX_RELATED = 10
_MAX_STORY = 50

_SEVERITY_STYLES = {Severity.ERROR: "1;31", Severity.WARNING: "1;33", Severity.INFO: "1;36"}
_VERDICT_STYLES = {Verdict.ACCEPTED: "1;32", Verdict.REJECTED: "1;31", Verdict.UNDECIDED: "1;35"}
_BOLD = "1"
_FRAME = "34"


def _render(report: Report, options: RenderOptions) -> str:
    pen = _Pen(options.color)
    lines: list[str] = []
    for plan in report.plans:
        if options.quiet:
            lines += (_head(pen, plan.path, finding) for finding in plan.findings)
            lines += _suppressed(plan)
        else:
            # Plans with findings stand apart, the others make a list of one line each.
            if lines and (plan.findings or plan.notes):
                lines.append("")
            lines += _plan(pen, plan, options.width)
    if options.statistics:
        lines += _statistics(pen, report, first=not lines)
    settings = [f"note: {setting_line(used)}" for used in report.settings]
    if options.quiet:  # who runs it has asked for less, but not whoever wrote a file
        lines += [line for line, used in zip(settings, report.settings, strict=True) if used.file]
    else:
        lines += [*([""] if lines else []), *settings, pen.paint(_BOLD, totals(report))]
    return "".join(line + "\n" for line in lines)


def findings_text(plan: PlanReport, options: RenderOptions) -> str:
    """The findings of a plan alone, for commands that sum up in their own words."""
    lines = _findings(_Pen(options.color), plan, options.width)
    return "".join(line + "\n" for line in lines)


@dataclass(frozen=True, slots=True)
class _Pen:
    """Writes in colours or without; ``edge`` is the width of the line numbers at the left."""

    color: bool
    edge: int = 1

    def paint(self, style: str, text: str) -> str:
        return f"\x1b[{style}m{text}\x1b[0m" if self.color else text

    def frame(self, mark: str, text: str, number: str = "") -> str:
        """Frame a line below a finding: line number or nothing, mark (``|`` or ``=``), text."""
        left = f" {number:>{self.edge}} {mark}"
        return f"{left if left.isspace() else self.paint(_FRAME, left)} {text}".rstrip()


def _plan(pen: _Pen, plan: PlanReport, columns: int | None) -> Iterator[str]:
    path = printable(plan.path)
    for note in plan.notes:
        yield f"{path}: note: {clip(note, MAX_MESSAGE)}"
    yield from _findings(pen, plan, columns)
    yield from _suppressed(plan)
    verdict = plan.verdict.value
    rest = summary(plan).removeprefix(verdict)
    yield f"{pen.paint(_BOLD, path)}: {pen.paint(_VERDICT_STYLES[plan.verdict], verdict)}{rest}"


def _findings(pen: _Pen, plan: PlanReport, columns: int | None) -> Iterator[str]:
    source = split_lines(plan.source) if plan.source and plan.findings else []
    for finding in plan.findings:
        below = _Pen(pen.color, edge=len(str(max(1, finding.location.line))))
        yield _head(pen, plan.path, finding)
        yield from _source(below, finding, source, columns)
        yield from _details(below, finding, plan.path)
        yield ""


def _suppressed(plan: PlanReport) -> Iterator[str]:
    """The findings that comments suppress: whoever wrote them may have written the plan."""
    for finding in plan.excused:
        yield suppressed_line(plan.path, finding)


def _head(pen: _Pen, path: str, finding: Finding) -> str:
    place_or_path = pen.paint(_BOLD, where(path, finding))
    severity = pen.paint(_SEVERITY_STYLES[finding.severity], finding.severity.value)
    rule = pen.paint(_BOLD, f"{finding.rule} {finding.name}")
    return f"{place_or_path}: {severity} {rule}: {clip(finding.message, MAX_MESSAGE)}"


def _source(pen: _Pen, finding: Finding, source: list[str], columns: int | None) -> Iterator[str]:
    line = finding.location.line
    if not has_line(finding) or line > len(source):
        return
    room = max(_MIN_LINE, min(_MAX_LINE, columns or _MAX_LINE))
    limit = room - pen.edge - len("  | ")
    shown = excerpt(source[line - 1], finding.location.column, length=finding.length, limit=limit)
    carets = pen.paint(_SEVERITY_STYLES[finding.severity], "^" * shown.carets)
    yield pen.frame("|", "")
    yield pen.frame("|", shown.text, number=str(line))
    yield pen.frame("|", " " * shown.offset + carets)


def _details(pen: _Pen, finding: Finding, path: str) -> Iterator[str]:
    if finding.location.element:
        yield pen.frame("|", f"(element {clip(finding.location.element, MAX_MESSAGE)})")
    if finding.scenario is not None:
        yield from _scenario(pen, finding.scenario)
    yield from _related(pen, finding.related, path)
    if finding.confidence is Confidence.HEURISTIC:
        yield pen.frame("=", "note: heuristic; what the plan intends is guessed")
    if finding.hint:
        yield pen.frame("=", f"hint: {clip(finding.hint, MAX_MESSAGE)}")


def _scenario(pen: _Pen, scenario: Scenario) -> Iterator[str]:
    yield pen.frame("=", f"scenario (ends {scenario.ends.value}):")
    story = scenario.story or tuple(
        f"{element}: {outcome.value}" for element, outcome in scenario.outcomes
    )
    digits = len(str(min(len(story), _MAX_STORY)))
    for number, sentence in enumerate(story[:_MAX_STORY], start=1):
        yield pen.frame(" ", f"{number:>{digits}}. {clip(sentence, MAX_MESSAGE)}")
    if len(story) > _MAX_STORY:
        yield pen.frame(" ", f"{'':{digits}}  and {len(story) - _MAX_STORY} more")


def _related(pen: _Pen, related: tuple[Related, ...], path: str) -> Iterator[str]:
    for other in related[:_MAX_RELATED]:
        about = clip(other.message or other.location.element, MAX_MESSAGE)
        yield pen.frame("=", f"also: {place(path, other.location)} {about}")
    if len(related) > _MAX_RELATED:
        yield pen.frame("=", f"and {len(related) - _MAX_RELATED} more")


def _statistics(pen: _Pen, report: Report, *, first: bool) -> Iterator[str]:
    """Tabulate the counts per rule and severity, by rule."""
    counts = _counts(finding for plan in report.plans for finding in plan.findings)
    suppressed = _counts(finding for plan in report.plans for finding in plan.suppressed)
    rows = sorted({*counts, *suppressed}, key=lambda row: (row[0], row[1], -row[2].rank))
    if not rows:
        return
    if not first:
        yield ""
    yield pen.paint(_BOLD, f"{'count':>7}  {'suppressed':>10}  {'severity':8}  rule")
    for row in rows:
        rule, name, severity = row
        shown = pen.paint(_SEVERITY_STYLES[severity], f"{severity.value:8}")
        yield f"{counts[row]:>7}  {suppressed[row]:>10}  {shown}  {rule} {name}"


def _counts(findings: Iterable[Finding]) -> Counter[tuple[str, str, Severity]]:
    return Counter((finding.rule, finding.name, finding.severity) for finding in findings)


FORMAT = Format(name="text", render=_render)
