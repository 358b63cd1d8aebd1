"""Markdown for the summary of a job, a comment or a wiki: a table of plans, then what was found.

Small plans with findings are drawn, in Mermaid's language, of which GitHub makes pictures.

Text from a plan stays text: what Markdown or HTML could take for markup is escaped.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.printable import clip, plain_markdown
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import Format, RenderOptions
from gpsfsm.report._words import (
    PRECISION,
    count,
    has_line,
    has_place,
    setting_line,
    suppressed_line,
    totals,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import PlanReport

_MOST_FINDINGS = 50
_MOST_PLANS = 500
_MOST_PICTURES = 10
_MAX_TEXT = 400
"""GitHub takes a megabyte of summary per step, so long reports are cut."""
_MOST_NODES = 60
_MOST_CHARACTERS = 40_000
"""Mermaid refuses a text of more than 50,000 characters."""
_LARGEST_SOURCE = 200_000
_FILE = "plan.xml"


def _render(report: Report, options: RenderOptions) -> str:
    by = f" {options.version}" if options.version else ""
    lines = [f"### gpsfsm{by}: {totals(report)}", ""]
    if report.plans:
        lines += ["| plan | verdict | errors | warnings |", "| --- | --- | ---: | ---: |"]
        lines += [_row(plan) for plan in report.plans[:_MOST_PLANS]]
        lines += _more(len(report.plans) - _MOST_PLANS, "plan")
        lines.append("")
    pairs = [
        (plan, each)
        for plan in report.plans
        for each in plan.findings
        if _serious(each) or each.rule in PRECISION
    ]
    pairs.sort(key=lambda pair: -pair[1].severity.rank)  # stable: else in the order of the report
    for plan, finding in pairs[:_MOST_FINDINGS]:
        lines += _finding(plan, finding)
    lines += _more(len(pairs) - _MOST_FINDINGS, "finding")
    lines += _taken_away(report)
    shown = [plan for plan in report.plans[:_MOST_PLANS] if any(map(_serious, plan.findings))]
    for plan in shown[:_MOST_PICTURES]:
        lines += _picture(plan)
    lines += _more(len(shown) - _MOST_PICTURES, "plan", "that could be drawn")
    return "".join(line + "\n" for line in lines)


def _row(plan: PlanReport) -> str:
    severities = [finding.severity for finding in plan.findings]
    counts = (severities.count(Severity.ERROR), severities.count(Severity.WARNING))
    verdict = plan.verdict.value
    shown = verdict if plan.verdict is Verdict.ACCEPTED else f"**{verdict}**"
    return f"| {_text(plan.path)} | {shown} | {counts[0]} | {counts[1]} |"


def _serious(finding: Finding) -> bool:
    return finding.severity is not Severity.INFO


def _finding(plan: PlanReport, finding: Finding) -> Iterator[str]:
    place = _text(plan.file_of(finding.location))
    if has_line(finding):
        place += f", line {finding.location.line}"
    elif has_place(finding):
        place += f", {_text(finding.location.element)}"
    head = f"**{finding.severity.value} {_text(finding.rule)} {_text(finding.name)}**"
    yield f"- {head} ({place}): {_text(finding.message)}"
    if finding.hint:
        yield f"  - hint: {_text(finding.hint)}"


def _taken_away(report: Report) -> Iterator[str]:
    """The findings that are not shown above, and why."""
    excused = [(plan, finding) for plan in report.plans for finding in plan.excused]
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


@dataclass(frozen=True, slots=True)
class Drawn:
    """A picture in Mermaid's language; or why the plan is too large for one; or neither."""

    mermaid: str = ""
    too_large: str = ""


def draw(plan: PlanReport) -> Drawn:
    """Draw a plan, with what findings are about marked; nothing if the text holds no plan."""
    if plan.source is None:
        return Drawn()
    if not can_be_drawn(plan):
        return Drawn(too_large=f"its text is longer than {_LARGEST_SOURCE:,} characters")
    automaton = automaton_of(plan)
    if automaton is None:
        return Drawn()
    for number, what in (
        (len(automaton.nodes), "nodes"),
        (len(automaton.plan.elements) - len(automaton.plan.runners) - 1, "controls"),
    ):
        if number > _MOST_NODES:
            return Drawn(too_large=f"it has {number:,} {what}, which is more than {_MOST_NODES}")
    from gpsfsm.model.drawing import automaton_to_mermaid

    text = automaton_to_mermaid(automaton, marks_of(plan, automaton.plan))
    if len(text) > _MOST_CHARACTERS:
        return Drawn(too_large="its labels are too long for Mermaid")
    return Drawn(text)


def can_be_drawn(plan: PlanReport) -> bool:
    """True if there is a text, and none so long that reading it again would take its time."""
    return plan.source is not None and len(plan.source) <= _LARGEST_SOURCE


def automaton_of(report: PlanReport) -> Automaton | None:
    """The automaton that was checked, None if the text holds no plan or the engine refuses it."""
    from gpsfsm.compile import compile_plan
    from gpsfsm.compile.plan_text import read_plan

    source = report.source or ""
    engine = report.facts.engine if report.facts is not None else None
    if engine is not None:
        return _on_engine(source, engine.name)
    plan = read_plan(source, file=_FILE).plan
    if plan is None and report.facts is not None:  # a model's answer, with prose around the plan
        plan = read_plan(source, file=_FILE, from_response=True).plan
    return None if plan is None else compile_plan(plan).automaton


def _on_engine(source: str, engine: str) -> Automaton | None:
    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile.engine_text import EngineReading, read_for_engine
    from gpsfsm.compile.plan_text import read_plan

    reading = read_for_engine(source, engine, _FILE, Library())
    if not isinstance(reading, EngineReading):
        body = read_plan(source, file=_FILE, from_response=True).body
        reading = read_for_engine(body, engine, _FILE, Library()) if body else reading
    return reading.compiled.automaton if isinstance(reading, EngineReading) else None


def marks_of(report: PlanReport, plan: Plan) -> dict[int, str]:
    """The codes of the findings of each element, by index."""
    codes: dict[str, list[str]] = {}
    for finding in report.findings:
        here = codes.setdefault(finding.location.element, [])
        if finding.rule not in here:
            here.append(finding.rule)
    codes.pop("", None)
    marks: dict[int, str] = {}
    for element in plan.elements:
        words = codes.get(plan.path(element)) if codes else None
        if words:
            marks[element.index] = ", ".join(words)
    return marks


FORMAT = Format(name="markdown", render=_render)
