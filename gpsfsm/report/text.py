"""Text for people: findings with their source line, then a summary per plan and a total.

Short unless ``verbose``, so that the first screen says what matters: the worst findings first, an
info in one line, and of all scenarios that of the first of the worst.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import field
from typing import TYPE_CHECKING

from gpsfsm.late import dataclass
from gpsfsm.model.finding import Confidence, Finding, Related, Scenario, Severity
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import (
    MAX_MESSAGE,
    count,
    excerpt,
    has_line,
    place,
    setting_line,
    split_lines,
    summary,
    suppressed_line,
    totals,
    where,
    worst_first,
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
            lines += _plan(pen, plan, options)
    if options.statistics:
        lines += _statistics(pen, report, first=not lines)
    settings = [f"note: {setting_line(used)}" for used in report.settings]
    if options.quiet:  # who runs it has asked for less, but not whoever wrote a file
        lines += [line for line, used in zip(settings, report.settings, strict=True) if used.file]
    else:
        short = not options.verbose and any(map(_hides_something, report.plans))
        more = " (more with --verbose)" if short else ""
        lines += [*([""] if lines else []), *settings, pen.paint(_BOLD, totals(report)) + more]
    return "".join(line + "\n" for line in lines)


def findings_text(plan: PlanReport, options: RenderOptions) -> str:
    """The findings of a plan alone, for commands that sum up in their own words."""
    lines = _findings(_Pen(options.color), plan, options)
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


def _plan(pen: _Pen, plan: PlanReport, options: RenderOptions) -> Iterator[str]:
    path = printable(plan.path)
    for note in plan.notes:
        yield f"{path}: note: {clip(note, MAX_MESSAGE)}"
    yield from _findings(pen, plan, options)
    yield from _suppressed(plan)
    verdict = plan.verdict.value
    rest = summary(plan).removeprefix(verdict)
    yield f"{pen.paint(_BOLD, path)}: {pen.paint(_VERDICT_STYLES[plan.verdict], verdict)}{rest}"


def _findings(pen: _Pen, plan: PlanReport, options: RenderOptions) -> Iterator[str]:
    """The worst ones first. Entries of several lines stand apart, the others make a list."""
    entry = _Entry(plan, options.width)
    explained = _explained(plan)
    before: list[str] = []
    for finding in worst_first(plan.findings):
        below = _Pen(pen.color, edge=len(str(max(1, finding.location.line))))
        short = entry.short(below, finding, at_length=finding is explained)
        lines = list(entry.whole(below, finding) if options.verbose else short)
        if before and len(before) + len(lines) > 2:
            yield ""
        yield from lines
        before = lines
    if before:
        yield ""


def _explained(plan: PlanReport) -> Finding | None:
    """The first of the worst findings that has a scenario: it is always shown."""
    worst = max((finding.severity.rank for finding in plan.findings), default=0)
    alike = (finding for finding in plan.findings if finding.severity.rank == worst)
    return next((finding for finding in alike if finding.scenario is not None), None)


def _hides_something(plan: PlanReport) -> bool:
    """True if the short form of a plan's findings leaves out what the whole form has."""
    explained = _explained(plan)
    return any(
        finding.related
        or (finding is not explained and (finding.scenario or finding.severity is Severity.INFO))
        for finding in plan.findings
    )


@dataclass(frozen=True, slots=True)
class _Entry:
    """Writes the entries of the findings of one plan; ``columns`` are those of the terminal.

    ``sources`` are the lines of the files that were shown.
    """

    plan: PlanReport
    columns: int | None
    sources: dict[str, list[str]] = field(default_factory=dict)

    def short(self, pen: _Pen, finding: Finding, *, at_length: bool) -> Iterator[str]:
        """Head, code line and hint; of an info the head alone."""
        yield _head(pen, self.plan.path, finding) + _remarks(finding)
        if finding.severity is not Severity.INFO:
            yield from self._code(pen, finding)
        if finding.scenario is not None and at_length:
            yield from _scenario(pen, finding.scenario)
        if finding.severity is not Severity.INFO or at_length:
            yield from _hint(pen, finding)

    def whole(self, pen: _Pen, finding: Finding) -> Iterator[str]:
        """Head, code line, element, scenario, other places and hint."""
        yield _head(pen, self.plan.path, finding)
        code = list(self._code(pen, finding))
        yield from (pen.frame("|", ""), *code) if code else ()
        if finding.location.element:
            yield pen.frame("|", f"(element {clip(finding.location.element, MAX_MESSAGE)})")
        if finding.scenario is not None:
            yield from _scenario(pen, finding.scenario)
        yield from _related(pen, finding.related, self.plan.path)
        if finding.confidence is Confidence.HEURISTIC:
            yield pen.frame("=", "note: heuristic; this rule guesses what the plan intends")
        if finding.confidence is Confidence.MAY:
            yield pen.frame(
                "=", "note: not proved; every run that shows it is approximated (GP816)"
            )
        yield from _hint(pen, finding)

    def _code(self, pen: _Pen, finding: Finding) -> Iterator[str]:
        place = finding.location
        if place.file not in self.sources:
            text = self.plan.text_of(place)
            self.sources[place.file] = split_lines(text) if text else []
        source, line = self.sources[place.file], place.line
        if not has_line(finding) or line > len(source):
            return
        room = max(_MIN_LINE, min(_MAX_LINE, self.columns or _MAX_LINE))
        limit = room - pen.edge - len("  | ")
        shown = excerpt(source[line - 1], place.column, length=finding.length, limit=limit)
        carets = pen.paint(_SEVERITY_STYLES[finding.severity], "^" * shown.carets)
        yield pen.frame("|", shown.text, number=str(line))
        yield pen.frame("|", " " * shown.offset + carets)


def _suppressed(plan: PlanReport) -> Iterator[str]:
    """The findings that comments suppress: whoever wrote them may have written the plan."""
    for finding in plan.excused:
        yield suppressed_line(plan.path, finding)


def _head(pen: _Pen, path: str, finding: Finding) -> str:
    place_or_path = pen.paint(_BOLD, where(path, finding))
    severity = pen.paint(_SEVERITY_STYLES[finding.severity], finding.severity.value)
    rule = pen.paint(_BOLD, f"{finding.rule} {finding.name}")
    return f"{place_or_path}: {severity} {rule}: {clip(finding.message, MAX_MESSAGE)}"


def _remarks(finding: Finding) -> str:
    """``" (heuristic, +3 places)"``: what the whole form says in lines of their own."""
    remarks = ["heuristic"] if finding.confidence is Confidence.HEURISTIC else []
    remarks += ["not proved"] if finding.confidence is Confidence.MAY else []
    if finding.related:
        remarks.append("+" + count(len(finding.related), "place"))
    return f" ({', '.join(remarks)})" if remarks else ""


def _hint(pen: _Pen, finding: Finding) -> Iterator[str]:
    if finding.hint:
        yield pen.frame("=", f"hint: {clip(finding.hint, MAX_MESSAGE)}")


def _scenario(pen: _Pen, scenario: Scenario) -> Iterator[str]:
    yield pen.frame("=", f"scenario in which {scenario.ending}:")
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
