"""The campaigns of ``gpsfsm fuzz``, and single cases that it plays again."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.cli._reading import read_text, tell_errors
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.fuzzing.campaign import Campaign, Found
from gpsfsm.fuzzing.campaign_report import (
    UNBOUNDED,
    CampaignOptions,
    CampaignReport,
    campaign_json,
    campaign_report,
    campaign_text,
    chosen_properties,
    finding_of,
)
from gpsfsm.fuzzing.cases import Case, read_case, scenario_in
from gpsfsm.fuzzing.own_properties import property_of_task
from gpsfsm.fuzzing.properties import find_property
from gpsfsm.fuzzing.runs import play
from gpsfsm.fuzzing.subject import FAULTS, subject_of
from gpsfsm.model.printable import clip
from gpsfsm.report import RenderOptions
from gpsfsm.streams import Form, complain, progress_bar, terminal_width, wants_color, write_text
from gpsfsm.syntax import parse
from gpsfsm.tasks.load import load_task

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.cli.fuzz import FuzzCommand
    from gpsfsm.fuzzing.properties import Property
    from gpsfsm.fuzzing.subject import Subject, TimedScenario
    from gpsfsm.tasks.task import Task


def run_fuzzing(path: str, values: FuzzCommand) -> int:
    """Run a campaign and tell what it has found. Raises GpsfsmError."""
    name, content = read_text(path, values.limits)
    subject, source = _subject(values, name, content)
    if subject.admission is not None:
        for selector in subject.admission.unmatched:
            complain(f"the assumption matches no runner of the plan: {clip(selector, 200)}")
    properties = chosen_properties(values.properties, _task(values))
    options = CampaignOptions(
        seed=values.seed,
        runs=values.runs,
        time_s=values.time_s,
        jobs=values.jobs,
        corpus=values.corpus,
    )
    total = None if options.most == UNBOUNDED else options.most
    with progress_bar("runs", total) as progress:
        report = campaign_report(
            subject, properties, options, name=name, source=source, progress=progress
        )
    _write(report, values)
    if not report.campaign.runs:
        complain(f"{name}: the time was over before the first run, so nothing was tried")
        return 2
    return 1 if report.campaign.found else 0


def play_case(file: str, values: FuzzCommand) -> int:
    """Play a case once: 1 if its property is still broken. Raises GpsfsmError."""
    case = read_case(file)
    if values.path:
        name, content = read_text(values.path, values.limits)
    else:
        name, content = case.plan_file, case.plan.encode("utf-8", "surrogateescape")
    played = replace(
        values,
        assume=(),  # a case says what happens
        consistent=False,
        faults=values.faults or case.faults,
        timeout=(case.limit_s or 0.0) if values.timeout is None else values.timeout,
    )
    subject, source = _subject(played, name, content)
    scenario = scenario_in(case, subject)
    if scenario is None:
        raise UsageError(
            f"{case.file}: the case does not fit {name}: a runner that it names is not there, or "
            "cannot do what it says. Was the plan changed? Without a path the case is played on "
            "the plan that it holds"
        )
    campaign = _played(subject, scenario, _properties_for(case, values), case.seed)
    report = CampaignReport(name, source, case.seed, campaign)
    report.findings += [finding_of(found) for found in campaign.found]
    _write(report, values)
    return 1 if campaign.found else 0


def _played(
    subject: Subject, scenario: TimedScenario, properties: Sequence[Property], seed: int
) -> Campaign:
    run = play(subject, scenario, seed=seed)
    found = [Found(one, breach, run) for one in properties for breach in one.check(run)]
    return Campaign(tuple(properties), 1, found=found)


def _subject(values: FuzzCommand, name: str, content: bytes) -> tuple[Subject, str]:
    """The plan, ready to be run, and its text."""
    parsed = parse(content, file=name, limits=values.limits)
    if tell_errors(parsed) or parsed.plan is None:
        raise GpsfsmError(f"{name}: the text has errors; mend it first ('gpsfsm fix' may help)")
    if not parsed.plan.runners:
        raise GpsfsmError(f"{name}: the plan has no runner, so nothing can happen in it")
    library = values.library.library
    subject = subject_of(
        parsed.plan,
        faults=values.faults or tuple(FAULTS),
        limit_s="auto" if values.timeout is None else values.timeout or None,
        library=library,
        assumptions=values.assume,
        consistent=values.consistent,
    )
    return subject, parsed.text or ""


def _task(values: FuzzCommand) -> Task | None:
    return load_task(values.task) if values.task else None


def _properties_for(case: Case, values: FuzzCommand) -> list[Property]:
    """The property of a case. Code is imported only if the command line asks for it."""
    if values.properties or values.task:
        if values.properties:
            return chosen_properties(values.properties, _task(values))
        return [property_of_task(load_task(values.task or ""))]
    shown = clip(case.broken, 100)
    if case.broken == "task":
        raise UsageError(f"{case.file}: the case is about a task file; name it with --task")
    if ":" in case.broken:
        raise UsageError(
            f"{case.file}: the case is about the function {shown}; if you trust it, name it with "
            f"--property {shown}"
        )
    return [find_property(case.broken)]


def _write(report: CampaignReport, values: FuzzCommand) -> None:
    file = values.output_file
    if values.output_format == "json":
        write_text(campaign_json(report), file, form=Form.JSON)
        return
    color = wants_color("auto", file)
    text = campaign_text(report, RenderOptions(color=color, width=terminal_width(file)))
    write_text(text, file, form=Form.COLORED if color else Form.TEXT)
