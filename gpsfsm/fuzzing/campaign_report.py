"""A campaign on one plan with its properties, its corpus of cases and its findings: a report."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.fuzzing.campaign import DEFAULT_RUNS, Campaign, Found, run_campaign
from gpsfsm.fuzzing.cases import cases_in, keep_case, scenario_in
from gpsfsm.fuzzing.findings import finding_as_data, finding_of
from gpsfsm.fuzzing.own_properties import property_of, property_of_function, property_of_task
from gpsfsm.fuzzing.properties import default_properties, find_property
from gpsfsm.fuzzing.properties.base import Property

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.model.finding import Finding
    from gpsfsm.streams import Progress
    from gpsfsm.tasks.task import Task

_VERSION = 1
UNBOUNDED = 10**9
"""The number of runs where time alone bounds a campaign."""


@dataclass(slots=True)
class CampaignReport:
    """A campaign with its findings: ``replayed`` counts the cases that fit the plan, and others.

    ``restricted``: options leave out scenarios that the plan has.
    """

    name: str
    source: str
    seed: int
    campaign: Campaign
    replayed: tuple[int, int] | None = None
    restricted: bool = False
    findings: list[Finding] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """True if the plan was run at least once, and no run has broken a property."""
        return self.campaign.runs > 0 and not self.campaign.found

    def to_dict(self) -> dict[str, Any]:
        """What ``gpsfsm fuzz --format json`` prints (docs/fuzzing.md)."""
        campaign = self.campaign
        return {
            "fuzz": _VERSION,
            "plan": self.name,
            "seed": self.seed,
            "runs": campaign.runs,
            "cut_off": campaign.cut_off,
            "properties": [
                {
                    "name": one.name,
                    "holds": one.holds,
                    "broken": sum(found.broken.name == one.name for found in campaign.found)
                    + campaign.more.get(one.name, 0),
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


def campaign_report(
    subject: Subject,
    properties: Sequence[Property],
    options: CampaignOptions,
    *,
    name: str,
    source: str,
    progress: Progress | None = None,
) -> CampaignReport:
    """Run a campaign on the plan with this name and text. Raises GpsfsmError."""
    cases = cases_in(options.corpus) if options.corpus else []
    scenarios = (scenario_in(case, subject) for case in cases)
    first = [each for each in scenarios if each is not None and subject.admits(each)]
    hints: dict[int, str] = {}

    def keep(found: Found) -> None:
        if options.corpus:  # at once: the campaign may be interrupted
            path = keep_case(found, source, options.corpus, seed=options.seed)
            hints[id(found)] = f"gpsfsm fuzz --replay {path} plays this run again"

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
    report.findings += [
        finding_of(found, hint=hints.get(id(found), "")) for found in campaign.found
    ]
    return report


def chosen_properties(
    chosen: Sequence[str | Property | Callable[..., Any]], task: Task | None
) -> list[Property]:
    """The properties to hold runs against: those that are named, else the usual ones; the task.

    One with a colon in its name is a function of a module or file. Raises UsageError.
    """
    found = [_property(each) for each in dict.fromkeys(chosen)] or list(default_properties())
    return found if task is None else [*found, property_of_task(task)]


def _property(chosen: object) -> Property:
    if isinstance(chosen, Property):
        return chosen
    if isinstance(chosen, str):
        return property_of(chosen) if ":" in chosen else find_property(chosen)
    if callable(chosen):
        return property_of_function(chosen, getattr(chosen, "__name__", "property"))
    raise UsageError(f"a property is its name or a function of a run, not {chosen!r:.40}")
