"""For the model that wrote the plan: what is wrong, why, what happens, what to write instead.

Short, since every word is paid for, and since small models lose the thread in long texts: the worst
findings first, of one rule a few only, a reason once per rule, no more than a screenful per plan.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import all_rules
from gpsfsm.model.finding import Confidence, Finding, Severity
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import count, has_line, split_lines, worst_first

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_MAX_FINDINGS = 12
_MAX_PER_RULE = 4
_MAX_STORY = 12
_MAX_RELATED = 3
_MAX_SENTENCES = 2
_MAX_LINE = 240
_MAX_TEXT = 400
_MAX_CORRECTION_LINES = 12

_REJECTED = "Your plan was rejected: {0}. Correct it and answer with the whole plan."
_UNDECIDED = "Your plan could not be checked, so it was rejected."
_ACCEPTED = "The plan is accepted."
_NOT_GOOD_ENOUGH = "The plan is not good enough yet."


def _render(report: Report, options: RenderOptions) -> str:
    several = len(report.plans) > 1
    parts = []
    if options.mended:
        repairs = "\n".join(f"- {repair}" for repair in options.mended)
        parts.append(f"These mistakes were mended for you:\n{repairs}")
    for plan in report.plans:
        lines = [f"# {printable(plan.path)}"] if several else []
        parts.append("\n".join([*lines, *_plan(plan, options)]))
    return "\n\n".join(parts or ["There is no plan."]) + "\n"


def _plan(plan: PlanReport, options: RenderOptions) -> Iterator[str]:
    findings = worst_first((*plan.findings, *plan.excused))
    serious = [each for each in findings if each.severity is not Severity.INFO]
    yield _verdict(plan, serious, options)
    chosen = _chosen(serious)
    source = split_lines(plan.source or "")
    explained: set[str] = set()
    for number, finding in enumerate(chosen, start=1):
        yield ""
        yield from _finding(finding, number, source)
        if finding.rule not in explained:
            explained.add(finding.rule)
            yield from _reason(finding)
        yield from _scenario(finding)
        yield from _remedy(plan, finding, options)
    if len(chosen) < len(serious):
        yield ""
        yield f"There are {len(serious) - len(chosen)} more like these."


def _verdict(plan: PlanReport, serious: Sequence[Finding], options: RenderOptions) -> str:
    errors = sum(finding.severity is Severity.ERROR for finding in serious)
    warnings = len(serious) - errors
    if plan.verdict is Verdict.ACCEPT:
        accepted = _ACCEPTED if options.good_enough else _NOT_GOOD_ENOUGH
        return accepted + (f" {count(warnings, 'warning')}:" if warnings else "")
    if plan.verdict is Verdict.ERROR:
        return _UNDECIDED
    counted = count(errors, "error") + (f", {count(warnings, 'warning')}" if warnings else "")
    return _REJECTED.format(counted)


def _chosen(serious: Sequence[Finding]) -> list[Finding]:
    """The first ones, of each rule a few."""
    seen: Counter[str] = Counter()
    chosen: list[Finding] = []
    for finding in serious:
        seen[finding.rule] += 1
        if seen[finding.rule] <= _MAX_PER_RULE and len(chosen) < _MAX_FINDINGS:
            chosen.append(finding)
    return chosen


def _finding(finding: Finding, number: int, source: Sequence[str]) -> Iterator[str]:
    kind = finding.severity.value.capitalize()
    if finding.confidence is Confidence.HEURISTIC:
        kind += " (what you intend is guessed)"
    place = f" at line {finding.location.line}" if has_line(finding) else ""
    yield f"{number}. {kind} {finding.rule}{place}: {clip(finding.message, _MAX_TEXT)}"
    line = finding.location.line
    if has_line(finding) and line <= len(source) and source[line - 1].strip():
        yield f"   You wrote: {clip(source[line - 1].strip(), _MAX_LINE)}"
    for other in finding.related[:_MAX_RELATED]:
        if other.message and other.location.line > 0:
            yield f"   See line {other.location.line}: {clip(other.message, _MAX_TEXT)}"


def _reason(finding: Finding) -> Iterator[str]:
    """The reason why it matters, in the words of the rule; a made-up finding may have its own."""
    reasons = {rule.code: rule.why for rule in all_rules()}
    if finding.rule in reasons:
        sentences = reasons[finding.rule].split(". ")
        why = ". ".join(sentences[:_MAX_SENTENCES]).removesuffix(".")
        yield f"   Why: {clip(why, _MAX_TEXT)}."


def _scenario(finding: Finding) -> Iterator[str]:
    scenario = finding.scenario
    if scenario is None or not scenario.story:
        return
    story = list(scenario.story)
    if len(story) > _MAX_STORY:  # how it ends matters more than how it begins
        story = [f"({len(story) - _MAX_STORY} steps before)", *story[-_MAX_STORY:]]
    events = "; ".join(clip(sentence.removesuffix("."), _MAX_TEXT) for sentence in story)
    yield f"   What can happen: {events}."


def _remedy(plan: PlanReport, finding: Finding, options: RenderOptions) -> Iterator[str]:
    if finding.hint:
        yield f"   Do: {clip(finding.hint, _MAX_TEXT)}"
    correct = options.correct
    lines = correct(plan, finding) if correct is not None else ()
    if lines:
        yield "   Write instead:"
        yield from (
            f"   {clip(line.rstrip(), _MAX_LINE)}" for line in lines[:_MAX_CORRECTION_LINES]
        )
        if len(lines) > _MAX_CORRECTION_LINES:
            yield "   …"


FORMAT = Format(name="llm", render=_render)
