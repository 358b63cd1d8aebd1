"""A campaign on one plan with its properties, its corpus of cases and its findings: a report."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.compile import MachinePlan
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.fuzzing.campaign import DEFAULT_RUNS, Campaign, Failure, run_campaign
from gpsfsm.fuzzing.cases import Case, cases_in, keep_case, scenario_in
from gpsfsm.fuzzing.own_properties import property_of, property_of_function, property_of_task
from gpsfsm.fuzzing.properties import Property, default_properties, find_property
from gpsfsm.fuzzing.runs import play, scenario_of
from gpsfsm.model.finding import Finding, Related
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Verdict
from gpsfsm.report import RenderOptions, tell_errors
from gpsfsm.report.json import finding_as_data
from gpsfsm.report.text import findings_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.model.plan import Plan
    from gpsfsm.progress import Tick
    from gpsfsm.syntax import Limits
    from gpsfsm.tasks.task import Task

_VERSION = 1
RULE = "fuzz"
"""What stands where findings of a check have the code of their rule."""

UNBOUNDED = 10**9
"""The number of runs where time alone bounds a campaign."""


def finding_of(failure: Failure, *, hint: str = "") -> Finding:
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


@dataclass(slots=True)
class CampaignReport:
    """A campaign with its findings.

    - ``replayed``: the number of corpus cases that fit the plan, and of those that do not.
    - ``restricted``: the options exclude scenarios that the plan has.
    - ``machine``: the plan is a machine.
    """

    name: str
    source: str
    seed: int
    campaign: Campaign
    replayed: tuple[int, int] | None = None
    restricted: bool = False
    machine: bool = False
    findings: list[Finding] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """True if there was at least one run and no run broke a property."""
        return self.campaign.runs > 0 and not self.campaign.failures

    def _repr_html_(self) -> str:
        """The findings and the properties, for notebooks."""
        from gpsfsm.report._notebook import findings_html

        properties = "\n".join(_property_lines(self))
        return findings_html(self.name, _runs(self), self.findings, self.source, properties)

    def _repr_pretty_(self, printer: Any, _cycle: bool) -> None:
        """The same as text, where nothing draws: IPython on a terminal."""
        printer.text(str(self))

    def __str__(self) -> str:
        """The same for ``print``."""
        return campaign_text(self, RenderOptions()).rstrip()

    def to_dict(self) -> dict[str, Any]:
        """The output of ``gpsfsm fuzz --format json`` (docs/fuzzing.md)."""
        campaign = self.campaign
        return {
            "fuzz": _VERSION,
            "plan": self.name,
            "seed": self.seed,
            "runs": campaign.runs,
            "cut_off": campaign.cut_off,
            **({"unended": campaign.unended} if self.machine else {}),
            "properties": [
                {
                    "name": one.name,
                    "holds": one.holds,
                    "broken": campaign.broken_kinds(one),
                }
                for one in campaign.properties
            ],
            "findings": [finding_as_data(finding) for finding in self.findings],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignOptions:
    """The budget of a campaign, and the folder with its cases.

    ``runs`` None: 1,000, or as many as ``time_s`` allows. ``jobs`` says where they are played
    (docs/scale.md). Cases in the folder ``corpus`` come first, and what is found is kept there.
    """

    seed: int = 0
    runs: int | None = None
    time_s: float | None = None
    jobs: int | str = 1
    corpus: str | None = None

    @property
    def most(self) -> int:
        """So many runs are drawn at most."""
        return self.runs or (DEFAULT_RUNS if self.time_s is None else UNBOUNDED)


def read_subject(
    name: str, content: bytes, limits: Limits, *, with_task: bool = False
) -> tuple[Plan, str]:
    """The plan or machine that is to run, and its text.

    Raises GpsfsmError for a text with errors, which are written to standard error, and UsageError
    for a machine ``with_task``.
    """
    parsed = read_plan_or_machine(content, file=name, limits=limits)
    wrong = tell_errors(parsed)
    if parsed.machine and (wrong or parsed.plan is None):
        raise GpsfsmError(f"{name}: the machine has errors; fix it first")
    if wrong or parsed.plan is None:
        raise GpsfsmError(f"{name}: the text has errors; fix it first ('gpsfsm fix' may help)")
    if with_task:
        refuse_task(parsed.plan)
    return parsed.plan, parsed.text or ""


def refuse_task(plan: Plan) -> None:
    """Raise UsageError for a machine: tasks speak of plans."""
    if isinstance(plan, MachinePlan):
        raise UsageError("a task applies to plans; check a machine against your own property")


def campaign_report(
    subject: Subject,
    properties: Sequence[Property],
    options: CampaignOptions,
    *,
    name: str,
    source: str,
    progress: Tick | None = None,
) -> CampaignReport:
    """Run a campaign on the plan with this name and text. Raises GpsfsmError."""
    cases = cases_in(options.corpus) if options.corpus else []
    scenarios = (scenario_in(case, subject) for case in cases)
    first = [each for each in scenarios if each is not None and subject.admits(each)]
    hints: dict[int, str] = {}

    def keep(failure: Failure) -> None:
        if options.corpus:  # at once: the campaign may be interrupted
            path = keep_case(failure, source, options.corpus, seed=options.seed)
            hints[id(failure)] = f"gpsfsm fuzz --replay {path} plays this run again"

    campaign = run_campaign(
        subject,
        properties,
        seed=options.seed,
        runs=options.most,
        time_s=options.time_s,
        first=first,
        jobs=options.jobs,
        progress=progress,
        keep=keep,
    )
    counts = (len(first), len(cases) - len(first))
    restricted = subject.admission is not None
    report = CampaignReport(name, source, options.seed, campaign, counts, restricted=restricted)
    report.machine = subject.is_machine
    report.findings += [
        finding_of(failure, hint=hints.get(id(failure), "")) for failure in campaign.failures
    ]
    return report


def case_report(
    case: Case, subject: Subject, properties: Sequence[Property], *, name: str, source: str
) -> CampaignReport:
    """Play a case once on the plan of this name and text. Raises UsageError if it does not fit."""
    scenario = scenario_in(case, subject)
    if scenario is None:
        raise UsageError(
            f"{case.file}: the case does not fit {name}: a runner that it names does not exist, or "
            "cannot have that outcome. Was the plan changed? Without a path, the case is played on "
            "the plan that it holds"
        )
    run = play(subject, scenario, seed=case.seed)
    breaches = [Failure(one, breach, run) for one in properties for breach in one.check(run)]
    campaign = Campaign(tuple(properties), 1, failures=breaches)
    report = CampaignReport(name, source, case.seed, campaign)
    report.findings += [finding_of(each) for each in breaches]
    return report


def properties_of_case(case: Case, chosen: Sequence[str], task: Task | None) -> list[Property]:
    """The properties that are named, else that of the case.

    A case is data: code is imported, and a task read, only where they are named. Raises UsageError.
    """
    if chosen:
        return chosen_properties(chosen, task)
    if task is not None:
        return [property_of_task(task)]
    if case.broken == "task":
        raise UsageError(f"{case.file}: the case is about a task file; name it with --task")
    if ":" in case.broken:
        shown = clip(case.broken, 100)
        raise UsageError(
            f"{case.file}: the case is about the function {shown}; if you trust it, name it with "
            f"--property {shown}"
        )
    return [find_property(case.broken)]


def chosen_properties(
    chosen: Sequence[str | Property | Callable[..., Any]], task: Task | None
) -> list[Property]:
    """The properties to hold runs against: those that are named, else the usual ones; the task.

    One with a colon in its name is a function of a module or file. Raises UsageError.
    """
    named = [_property(each) for each in dict.fromkeys(chosen)] or list(default_properties())
    return named if task is None else [*named, property_of_task(task)]


def _property(chosen: object) -> Property:
    if isinstance(chosen, Property):
        return chosen
    if isinstance(chosen, str):
        return property_of(chosen) if ":" in chosen else find_property(chosen)
    if callable(chosen):
        return property_of_function(chosen, getattr(chosen, "__name__", "property"))
    raise UsageError(f"a property is its name or a function of a run, not {chosen!r:.40}")


def campaign_text(report: CampaignReport, options: RenderOptions) -> str:
    """The findings, then a line for each property."""
    plan = PlanReport(
        report.name, Verdict.REJECTED, None, tuple(report.findings), source=report.source
    )
    lines = [f"{printable(report.name)}: {_runs(report)}", *_property_lines(report)]
    return findings_text(plan, replace(options, verbose=True)) + "\n".join(lines) + "\n"


def _property_lines(report: CampaignReport) -> Iterator[str]:
    campaign = report.campaign
    for one in campaign.properties:
        count, more = campaign.broken_kinds(one), campaign.more.get(one.name, 0)
        kinds = f"broken ({count} kind{'s'[: count > 1]})"
        result = kinds if count else "held" if campaign.runs else "not tried"
        shown = f", of which {count} are shown" if more else ""
        yield f"  {result}{shown}: {clip(one.name, 60)}, {clip(one.holds, 200)}"


def _runs(report: CampaignReport) -> str:
    runs = report.campaign.runs
    parts = [f"{runs} run{'s' if runs != 1 else ''}", f"seed {report.seed}"]
    if report.replayed is not None and any(report.replayed):
        fitting, others = report.replayed
        parts.append(f"{fitting} of them from the corpus")
        if others:
            of = "of other plans or scenarios" if report.restricted else "of other plans"
            parts.append(f"{others} case{'s' if others != 1 else ''} {of} left out")
    if report.campaign.unended:
        parts.append(f"{report.campaign.unended} of them cut off by --max-visits")
    if report.campaign.cut_off:
        parts.append("then the time ran out")
    return ", ".join(parts)


def campaign_json(report: CampaignReport) -> str:
    """The same for programs."""
    return json.dumps(report.to_dict(), ensure_ascii=True, indent=2) + "\n"
