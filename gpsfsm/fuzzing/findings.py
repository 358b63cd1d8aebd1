"""Findings of a campaign: a broken property with the run that shows it, in text and as JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.words import place
from gpsfsm.execution.records import Kind
from gpsfsm.fuzzing.subject import Fate
from gpsfsm.model.event import End, Event
from gpsfsm.model.finding import Finding, Related, Scenario, TraceStep
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Verdict
from gpsfsm.model.story import remark
from gpsfsm.report.json import scenario_as_data
from gpsfsm.report.text import findings_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.execution.records import Record
    from gpsfsm.fuzzing.campaign import Found
    from gpsfsm.fuzzing.campaign_report import CampaignReport
    from gpsfsm.fuzzing.runs import Run
    from gpsfsm.report import RenderOptions

RULE = "fuzz"
"""What stands where findings of a check have the code of their rule."""

_MAX_TRACE = 200
_MAX_STORY = 200
_SECOND = 1_000_000
_EVENTS = {Kind.STARTED: Event.STARTED, Kind.SUCCEEDED: Event.SUCCEEDED, Kind.FAILED: Event.FAILED}
_ENDINGS = {
    End.COMPLETED: "the plan completes",
    End.GAVE_UP: "the plan gives up",
    End.STUCK: "nothing more can happen: the plan is stuck",
}


def finding_of(failure: Found, *, hint: str = "") -> Finding:
    """The finding that a report shows."""
    run, breach = failure.run, failure.breach
    first = run.runner(breach.numbers[0]) if breach.numbers else run.plan.elements[0]
    others = tuple(Related(run.plan.location(run.runner(number))) for number in breach.numbers[1:])
    return Finding(
        rule=RULE,
        name=failure.broken.name,
        severity=failure.broken.severity,
        message=breach.message,
        location=run.plan.location(first),
        length=len(f"<{first.kind}"),
        related=others,
        scenario=scenario_of(run),
        hint=hint,
    )


def scenario_of(run: Run) -> Scenario:
    """The run as a counterexample; outcomes that are not listed are SUCCEEDED."""
    plan, acts = run.plan, run.scenario.acts
    trace = [
        TraceStep(_EVENTS[record.kind], plan.path(runner), runner.line)
        for moment in run.moments
        for record in moment.records
        if record.kind in _EVENTS
        for runner in (run.runner(record.node - 1),)
    ]
    return Scenario(
        outcomes=tuple(
            (plan.path(run.runner(number)), act.fate.outcome)
            for number, act in enumerate(acts)
            if act.fate is not Fate.SUCCEEDED
        ),
        ends=End(run.status.value),
        trace=tuple(trace[-_MAX_TRACE:]),
        trace_truncated=len(trace) > _MAX_TRACE,
        sentences=tuple(map(remark, _story(run))),
    )


def _story(run: Run) -> Iterator[str]:
    """The run in short sentences; of a long one the beginning and the end."""
    sentences = [
        f"{moment.at_us / _SECOND:.6g} s: {sentence}"
        for index, moment in enumerate(run.moments)
        for sentence in _sentences(run, index)
    ]
    if len(sentences) > _MAX_STORY:
        half = _MAX_STORY // 2
        sentences = [*sentences[:half], f"… {len(sentences) - 2 * half} more", *sentences[-half:]]
    yield from sentences


def _sentences(run: Run, index: int) -> Iterator[str]:
    for record in run.moments[index].records:
        if record.node >= 1 and record.node <= len(run.plan.runners):
            sentence = _sentence(record, stopping=index >= run.decided)
            if sentence:
                yield f"{place(run.runner(record.node - 1))} {sentence}"
    if index == run.decided:
        yield _ENDINGS[End(run.status.value)]


def _sentence(record: Record, *, stopping: bool) -> str:
    if record.kind is Kind.STARTED:
        return "starts"
    if record.kind is Kind.SUCCEEDED:
        return "succeeds"
    if record.kind is Kind.FAILED:
        return "does not start" if "could not be loaded" in record.message else "fails"
    if record.kind is Kind.TIMEOUT:
        return "has used up its time and is stopped"
    if record.kind is Kind.LATE:
        return "answers too late, which changes nothing"
    return "is stopped" if record.kind is Kind.STOPPED and stopping else ""


def finding_as_data(finding: Finding) -> dict[str, Any]:
    """A finding for JSON, with the fields that reports have."""
    return {
        "rule": finding.rule,
        "name": finding.name,
        "severity": finding.severity.value,
        "message": finding.message,
        "location": {
            "line": finding.location.line,
            "column": finding.location.column,
            "element": finding.location.element,
        },
        "related": [
            {"line": each.location.line, "column": each.location.column}
            | {"element": each.location.element, "message": each.message}
            for each in finding.related
        ],
        "scenario": None if finding.scenario is None else scenario_as_data(finding.scenario),
        "hint": finding.hint,
    }


_VERSION = 1


def campaign_text(report: CampaignReport, options: RenderOptions) -> str:
    """The findings, then a line for each property."""
    plan = PlanReport(
        report.name, Verdict.REJECT, None, tuple(report.findings), source=report.source
    )
    campaign = report.campaign
    lines = [f"{printable(report.name)}: {_runs(report)}"]
    for one in campaign.properties:
        count = sum(failure.broken.name == one.name for failure in campaign.found)
        more = campaign.more.get(one.name, 0)
        kinds = f"broken ({count + more} kind{'s'[: count + more > 1]})"
        result = kinds if count else "held" if campaign.runs else "not tried"
        shown = f", of which {count} are shown" if more else ""
        lines.append(f"  {result}{shown}: {clip(one.name, 60)}, {clip(one.holds, 200)}")
    return findings_text(plan, options) + "\n".join(lines) + "\n"


def _runs(report: CampaignReport) -> str:
    runs = report.campaign.runs
    parts = [f"{runs} run{'s' if runs != 1 else ''}", f"seed {report.seed}"]
    if report.replayed is not None and any(report.replayed):
        fitting, others = report.replayed
        parts.append(f"{fitting} of them from the corpus")
        if others:
            of = "of other plans or scenarios" if report.restricted else "of other plans"
            parts.append(f"{others} case{'s' if others != 1 else ''} {of} left out")
    if report.campaign.cut_off:
        parts.append("then the time was over")
    return ", ".join(parts)


def campaign_json(report: CampaignReport) -> str:
    """The same for programs."""
    return json.dumps(report.to_dict(), ensure_ascii=True, indent=2) + "\n"
