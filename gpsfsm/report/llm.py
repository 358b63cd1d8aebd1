"""For the model that wrote the plan: what is wrong, why, what happens, what to write instead.

Short, since every word is paid for, and since small models lose the thread in long texts: the worst
findings first, of one rule a few only, a reason once per rule, no more than a screenful per plan.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import all_rules
from gpsfsm.late import pattern
from gpsfsm.model.finding import Confidence, Finding, Severity
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import (
    PRECISION,
    count,
    has_line,
    has_place,
    split_lines,
    worst_first,
)

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
_MAX_CORRECTION_LINE = 2000
_TAG = pattern(
    r"<(?P<end>/)?(?P<name>[A-Za-z_][\w.-]*+)(?:\"[^\"]*\"|'[^']*'|[^<>\"'/]|/(?!>))*+(?P<empty>/)?>"
)

_REJECTED = "Your plan was rejected: {0}. Correct it and answer with the whole plan."
_UNDECIDED = "Your plan is undecided: the check could not be completed."
_ACCEPTED = "The plan is accepted."
_NOT_GOOD_ENOUGH = "The plan is not good enough yet."


def _render(report: Report, options: RenderOptions) -> str:
    several = len(report.plans) > 1
    parts = []
    if options.mended:
        repairs = "\n".join(f"- {repair}" for repair in options.mended)
        parts.append(f"These mistakes were fixed for you:\n{repairs}")
    for plan in report.plans:
        lines = [f"# {printable(plan.path)}"] if several else []
        parts.append("\n".join([*lines, *_plan(plan, options)]))
    return "\n\n".join(parts or ["There is no plan."]) + "\n"


def _plan(plan: PlanReport, options: RenderOptions) -> Iterator[str]:
    findings = worst_first((*plan.findings, *plan.excused))
    serious = [each for each in findings if each.severity is not Severity.INFO]
    yield _verdict(plan, serious, options)
    for finding in plan.findings:
        if finding.rule in PRECISION:
            yield f"Note: {clip(finding.message, _MAX_TEXT)}."
    chosen = _chosen(serious)
    sources: dict[str, list[str]] = {}  # the lines of each file
    explained: set[str] = set()
    for number, finding in enumerate(chosen, start=1):
        yield ""
        place = finding.location
        if place.file not in sources:
            sources[place.file] = split_lines(plan.text_of(place))
        yield from _finding(finding, number, sources[place.file])
        if finding.rule not in explained:
            explained.add(finding.rule)
            yield from _reason(finding)
        yield from _scenario(finding)
        yield from _remedy(plan, finding, options)
    if len(chosen) < len(serious):
        yield ""
        more = len(serious) - len(chosen)
        yield f"There {'is' if more == 1 else 'are'} {more} more like these."


def _verdict(plan: PlanReport, serious: Sequence[Finding], options: RenderOptions) -> str:
    errors = sum(finding.severity is Severity.ERROR for finding in serious)
    warnings = len(serious) - errors
    if plan.verdict is Verdict.ACCEPTED:
        accepted = _ACCEPTED if options.good_enough else _NOT_GOOD_ENOUGH
        return accepted + (f" {count(warnings, 'warning')}:" if warnings else "")
    if plan.verdict is Verdict.UNDECIDED:
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
        kind += " (a guess at what you intend)"
    if finding.confidence is Confidence.MAY:
        kind += " (possible, not proved)"
    place = f" at {finding.location.words}" if has_place(finding) else ""
    yield f"{number}. {kind} {finding.rule}{place}: {clip(finding.message, _MAX_TEXT)}"
    line = finding.location.line
    if has_line(finding) and line <= len(source) and source[line - 1].strip():
        yield f"   You wrote: {_quoted(source[line - 1].strip())}"
    for other in finding.related[:_MAX_RELATED]:
        if other.message and other.location.line > 0:
            yield f"   See {other.location.words}: {clip(other.message, _MAX_TEXT)}"


def _quoted(line: str) -> str:
    """A line of the plan; elements that begin in it are closed behind a mark for the rest."""
    if len(line) > _MAX_LINE:
        return clip(line, _MAX_LINE)
    missing = "".join(_end_tags([line]))
    return clip(line, _MAX_LINE) + (f" … {missing}" if missing else "")


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
    correct = None if finding.location.file else options.correct  # of included files none is made
    lines = correct(plan, finding) if correct is not None else ()
    shown = [printable(line.rstrip()) for line in lines[:_MAX_CORRECTION_LINES]]
    if shown and max(map(len, shown)) <= _MAX_CORRECTION_LINE:  # half a tag helps nobody
        yield "   Write instead:"
        yield from (f"   {line}" for line in shown)
        if len(lines) > _MAX_CORRECTION_LINES:
            yield "   …"
        yield from (f"   {line}" for line in _end_tags(shown))


def _end_tags(lines: Sequence[str]) -> list[str]:
    """The end tags that a fragment of a plan lacks, each indented as its start tag is.

    None where its tags do not fit each other, for then nobody knows.

    >>> _end_tags(['  <Control type="recovery">', '    <Runner interface="a/Go"/>'])
    ['  </Control>']
    """
    opened: list[str] = []
    for line in lines:
        blank = line[: len(line) - len(line.lstrip())]
        for tag in _TAG.finditer(line):
            if tag["end"]:
                if opened and not opened.pop().endswith(f"/{tag['name']}>"):
                    return []
            elif not tag["empty"]:
                opened.append(f"{blank}</{tag['name']}>")
    return opened[::-1]


FORMAT = Format(name="llm", render=_render)
