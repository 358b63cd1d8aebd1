"""What ``gpsfsm fuzz`` does without ``--mutate``: a campaign, or one case."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.choice import choose_capabilities
from gpsfsm.cli._fuzz_progress import progress_bar
from gpsfsm.cli._options import limits_of
from gpsfsm.cli._reading import read_text, tell_errors
from gpsfsm.cli._streams import Form, complain, terminal_width, wants_color, write_text
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.fuzzing.acts import FAULTS
from gpsfsm.fuzzing.campaign import DEFAULT_RUNS, Campaign, Found, run_campaign
from gpsfsm.fuzzing.cases import Case, cases_in, keep_case, read_case, scenario_in
from gpsfsm.fuzzing.of_function import property_of
from gpsfsm.fuzzing.of_task import property_of_task
from gpsfsm.fuzzing.playing import play
from gpsfsm.fuzzing.properties import default_properties, find_property
from gpsfsm.fuzzing.subject import subject_of
from gpsfsm.fuzzing.telling import finding_as_data, finding_of
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import PlanReport, Verdict
from gpsfsm.report import RenderOptions
from gpsfsm.report.text import findings_text
from gpsfsm.syntax import parse
from gpsfsm.tasks.load import load_task

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.fuzzing.acts import TimedScenario
    from gpsfsm.fuzzing.properties.base import Property
    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.model.finding import Finding

__all__ = ["play_case", "run_fuzzing"]

_VERSION = 1
_UNBOUNDED = 10**9


def run_fuzzing(values: Mapping[str, Any]) -> int:
    """Run a campaign and tell what it has found. Raises GpsfsmError."""
    name, content = read_text(values["path"], limits_of(values))
    subject, source = _subject(values, name, content)
    if subject.admission is not None:
        for selector in subject.admission.unmatched:
            complain(f"the assumption matches no runner of the plan: {clip(selector, 200)}")
    properties = _properties(values)
    cases = cases_in(values["corpus"]) if values["corpus"] else []
    known = [(case, scenario_in(case, subject)) for case in cases]
    first = [found for _, found in known if found is not None and subject.admits(found)]
    runs = values["runs"] or (DEFAULT_RUNS if values["time_s"] is None else _UNBOUNDED)
    total = None if runs == _UNBOUNDED else len(first) + runs
    kept: dict[int, str] = {}

    def keep(found: Found) -> None:
        if values["corpus"]:  # at once: the campaign may be interrupted
            path = keep_case(found, source, values["corpus"], seed=values["seed"])
            kept[id(found)] = f"gpsfsm fuzz --replay {path} plays this run again"

    with progress_bar("runs", total) as tick:
        campaign = run_campaign(
            subject,
            properties,
            seed=values["seed"],
            runs=runs,
            time_s=values["time_s"],
            first=first,
            jobs=values["jobs"],
            tick=tick,
            keep=keep,
        )
    counts = (len(first), len(cases) - len(first))
    restricted = subject.admission is not None
    told = _Told(name, source, values["seed"], campaign, counts, restricted=restricted)
    told.findings += [finding_of(found, hint=kept.get(id(found), "")) for found in campaign.found]
    _write(told, values)
    if not campaign.runs:
        complain(f"{name}: the time was over before the first run, so nothing was tried")
        return 2
    return 1 if campaign.found else 0


def play_case(values: Mapping[str, Any]) -> int:
    """Play a case once: 1 if its property is still broken. Raises GpsfsmError."""
    case = read_case(values["replay"])
    if values["path"]:
        name, content = read_text(values["path"], limits_of(values))
    else:
        name, content = case.plan_file, case.plan.encode("utf-8", "surrogateescape")
    given = {
        **values,
        "assume": (),  # a case says what happens
        "consistent": False,
        "faults": values["faults"] or case.faults,
        "timeout": (case.limit_s or 0.0) if values["timeout"] is None else values["timeout"],
    }
    subject, source = _subject(given, name, content)
    scenario = scenario_in(case, subject)
    if scenario is None:
        raise UsageError(
            f"{case.file}: the case does not fit {name}: a runner that it names is not there, or "
            "cannot do what it says. Was the plan changed? Without a path the case is played on "
            "the plan that it holds"
        )
    campaign = _played(subject, scenario, _properties_for(case, values), case.seed)
    told = _Told(name, source, case.seed, campaign)
    told.findings += [finding_of(found) for found in campaign.found]
    _write(told, values)
    return 1 if campaign.found else 0


def _played(
    subject: Subject, scenario: TimedScenario, properties: Sequence[Property], seed: int
) -> Campaign:
    run = play(subject, scenario, seed=seed)
    found = [Found(one, breach, run) for one in properties for breach in one.check(run)]
    return Campaign(tuple(properties), 1, found=found)


def _subject(values: Mapping[str, Any], name: str, content: bytes) -> tuple[Subject, str]:
    """The plan, ready to be run, and its text."""
    parsed = parse(content, file=name, limits=limits_of(values))
    if tell_errors(parsed) or parsed.plan is None:
        raise GpsfsmError(f"{name}: the text has errors; mend it first ('gpsfsm fix' may help)")
    if not parsed.plan.runners:
        raise GpsfsmError(f"{name}: the plan has no runner, so nothing can happen in it")
    library = choose_capabilities(
        values["capabilities"], builtin=values["builtin_capabilities"]
    ).library
    subject = subject_of(
        parsed.plan,
        faults=values["faults"] or tuple(FAULTS),
        limit_s="auto" if values["timeout"] is None else values["timeout"] or None,
        library=library,
        assumptions=values["assume"],
        consistent=values["consistent"],
    )
    return subject, parsed.text or ""


def _properties(values: Mapping[str, Any]) -> list[Property]:
    found = (
        [_property(name) for name in dict.fromkeys(values["properties"])]
        if values["properties"]
        else list(default_properties())
    )
    if values["task"]:
        found.append(property_of_task(load_task(values["task"])))
    return found


def _property(name: str) -> Property:
    return property_of(name) if ":" in name else find_property(name)


def _properties_for(case: Case, values: Mapping[str, Any]) -> list[Property]:
    """The property of a case. Code is imported only if the command line asks for it."""
    if values["properties"] or values["task"]:
        asked = [_property(name) for name in dict.fromkeys(values["properties"])]
        task = [property_of_task(load_task(values["task"]))] if values["task"] else []
        return [*asked, *task]
    shown = clip(case.broken, 100)
    if case.broken == "task":
        raise UsageError(f"{case.file}: the case is about a task file; name it with --task")
    if ":" in case.broken:
        raise UsageError(
            f"{case.file}: the case is about the function {shown}; if you trust it, name it with "
            f"--property {shown}"
        )
    return [find_property(case.broken)]


# --- telling -------------------------------------------------------------------------------------


class _Told:
    """What is written: ``replayed`` counts the cases that fit the plan, and those that do not."""

    def __init__(
        self,
        name: str,
        source: str,
        seed: int,
        campaign: Campaign,
        replayed: tuple[int, int] | None = None,
        *,
        restricted: bool = False,
    ) -> None:
        self.name, self.source, self.seed = name, source, seed
        self.campaign, self.replayed = campaign, replayed
        self.restricted = restricted
        self.findings: list[Finding] = []


def _write(told: _Told, values: Mapping[str, Any]) -> None:
    file = values["output_file"]
    text = _json(told) if values["output_format"] == "json" else _text(told, file)
    form = Form.COLORED if wants_color("auto", file) else Form.TEXT
    write_text(text, file, form=Form.JSON if values["output_format"] == "json" else form)


def _text(told: _Told, file: str) -> str:
    report = PlanReport(told.name, Verdict.REJECT, None, tuple(told.findings), source=told.source)
    options = RenderOptions(color=wants_color("auto", file), width=terminal_width(file))
    campaign = told.campaign
    lines = [f"{printable(told.name)}: {_runs(told)}"]
    for one in campaign.properties:
        count = sum(found.broken.name == one.name for found in campaign.found)
        more = campaign.more.get(one.name, 0)
        kinds = f"broken ({count + more} kind{'s'[: count + more > 1]})"
        result = kinds if count else "held" if campaign.runs else "not tried"
        shown = f", of which {count} are shown" if more else ""
        lines.append(f"  {result}{shown}: {clip(one.name, 60)}, {clip(one.holds, 200)}")
    return findings_text(report, options) + "\n".join(lines) + "\n"


def _runs(told: _Told) -> str:
    runs = told.campaign.runs
    parts = [f"{runs} run{'s' if runs != 1 else ''}", f"seed {told.seed}"]
    if told.replayed is not None and any(told.replayed):
        fitting, others = told.replayed
        parts.append(f"{fitting} of them from the corpus")
        if others:
            of = "of other plans or scenarios" if told.restricted else "of other plans"
            parts.append(f"{others} case{'s' if others != 1 else ''} {of} left out")
    if told.campaign.cut_off:
        parts.append("then the time was over")
    return ", ".join(parts)


def _json(told: _Told) -> str:
    campaign = told.campaign
    data = {
        "fuzz": _VERSION,
        "plan": told.name,
        "seed": told.seed,
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
        "findings": [finding_as_data(finding) for finding in told.findings],
    }
    return json.dumps(data, ensure_ascii=True, indent=2) + "\n"
