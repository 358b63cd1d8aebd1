"""``gpsfsm fuzz``: run a plan while everything goes wrong, or see whether its checks notice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare, declare_file
from gpsfsm.cli._options import (
    LIMITS,
    LibraryValues,
    LimitValues,
    NumberRange,
    apply,
    config_options,
    format_option,
    jobs_option,
    library_options,
    limit_options,
    option,
    output_option,
    read_values,
    tell_narrowing,
    words,
)
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.model.printable import clip
from gpsfsm.model.story import PAPER_ENGINE
from gpsfsm.progress import progress_bar
from gpsfsm.streams import (
    Form,
    check_writable,
    complain,
    form_of,
    terminal_width,
    wants_color,
    write_text,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.fuzzing.campaign_report import CampaignReport
    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.model.plan import Plan
    from gpsfsm.tasks.task import Task

_NO_PATH = """no plan is given; name a file, or - for standard input. Example:
  gpsfsm fuzz plan.xml"""
_SETTINGS = frozenset(
    {
        *LIMITS,
        "capabilities",
        "builtin_capabilities",
        "robot",
        "jobs",
        "assume",
        "consistent",
        "engine",
    }
)
_OF_RUNS = ("faults", "timeout", "max_visits", "properties", "corpus", "replay")
_OF_MUTANTS = ("select", "ignore")
_OF_TASKS = ("GP6",)
_NOT_OF_A_CASE = ("runs", "time_s", "corpus", "jobs", "assume", "consistent")
_OTHER_ENGINE = """fuzz runs plans by the paper's semantics, not as {engine} does; if that will
  do, use --engine paper. To check or run a plan as the engine does, use
  gpsfsm check --engine {engine} or gpsfsm run --engine {engine}"""


def _budget_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about how much is tried."""
    options = (
        declare(
            "--seed",
            type=int,
            default=0,
            metavar="N",
            common=True,
            help="Random seed. [default: 0]",
        ),
        declare(
            "--runs",
            type=click.IntRange(1, 10**9),
            metavar="N",
            common=True,
            help="Number of runs or mutants. [default: 1000, or what --time allows]",
        ),
        declare(
            "--time",
            "time_s",
            type=NumberRange(0, 1e9, min_open=True),
            metavar="SECONDS",
            help="Start nothing new after this time.",
        ),
        jobs_option("Run or check"),
    )
    return apply(options, command, "Extent")


def _scenario_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about which scenarios there are."""
    options = (
        option("assume", help="Assume this, such as 'never fails: SpeechRunner'."),
        option("consistent"),
        option("engine", common=False),
    )
    return apply(options, command, "Scenarios")


def _run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about runs and what is to hold of them."""
    options = (
        option("faults", help="Faults to inject: failed, late, no-start, hang. [default: all]"),
        declare(
            "--timeout",
            type=NumberRange(0, 1e6),
            metavar="SECONDS",
            help="Time limit per action; beyond it, it is stopped and fails. 0: no limit. "
            "[default: 60, or longer if a runner is declared to take longer]",
        ),
        declare(
            "--max-visits",
            type=click.IntRange(1, 10**6),
            metavar="N",
            help="Cut a machine's run off after N visits. [default: 200]",
        ),
    )
    return apply((*options, *_WHAT_HOLDS), command, "Runs")


_WHAT_HOLDS = (
    declare(
        "--property",
        "properties",
        multiple=True,
        metavar="NAME",
        common=True,
        help="Check this property, or file.py:function, instead of the usual ones.",
    ),
    declare_file("--task", common=True, help="Check runs against this task file."),
    declare(
        "--corpus",
        metavar="DIR",
        type=ANY_PATH,
        help="Replay the cases in this folder; save new ones there.",
    ),
    declare("--replay", metavar="CASE", type=ANY_PATH, help="Replay only this case, once."),
)


def _mutation_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about mutants and what is to notice them."""
    options = (
        declare(
            "--mutate",
            is_flag=True,
            common=True,
            help="Mutate the plan and report mutants that no rule notices (with --task: the task).",
        ),
        option(
            "select", help="With --mutate: only these rules. [default: all, or GP6 with --task]"
        ),
        option("ignore", help="With --mutate: without these rules."),
    )
    return apply(options, command, "Mutants")


@dataclass(frozen=True, kw_only=True)
class FuzzCommand(LimitValues, LibraryValues):
    """The options of ``gpsfsm fuzz``."""

    path: str | None
    seed: int
    runs: int | None
    time_s: float | None
    jobs: int | str
    faults: Sequence[str]
    timeout: float | None
    max_visits: int | None
    properties: Sequence[str]
    task: str | None
    corpus: str | None
    replay: str | None
    assume: Sequence[str]
    consistent: bool
    engine: str
    mutate: bool
    select: Sequence[str]
    ignore: Sequence[str]
    output_format: str
    output_file: str


@click.command(
    "fuzz",
    cls=Command,
    section=Section.CHECK,
    short_help="Run a plan many times with random faults.",
)
@click.argument("path", required=False, metavar="[PATH]", type=ANY_PATH)
@_budget_options
@_run_options
@_scenario_options
@_mutation_options
@format_option("text", "json", text="Output format.")
@output_option()
@library_options
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Run the plan in PATH many times with random outcomes, delays and faults.

    Each run is checked against properties; a failure is reported with the simplest run that shows
    it. --mutate measures instead how many small changes to the plan its checks notice.

    Exit code: 0 nothing found, 1 a property broken or a mutant missed, 2 failed.

    \b
    Examples:
      gpsfsm fuzz plan.xml --seed 7 --corpus cases/
      gpsfsm fuzz plan.xml --property checks.py:speaks_before_it_moves
      gpsfsm fuzz plan.xml --mutate --task task.yaml
    """
    values = read_values(context, FuzzCommand, _SETTINGS)
    tell_narrowing(values)
    if not values.path and not values.replay:
        raise click.UsageError(_NO_PATH, context)
    _refuse_contradictions(values, context)
    check_writable(values.output_file, [each for each in (values.path,) if each])
    values = replace(values, faults=words(values.faults))
    if values.replay:
        return _play(values.replay, values)
    plan, source = _parsed(values)
    return _score(plan, values) if values.mutate else _fuzz(plan, source, values)


def _refuse_contradictions(values: FuzzCommand, context: click.Context) -> None:
    if values.engine != PAPER_ENGINE:
        raise UsageError(_OTHER_ENGINE.format(engine=values.engine))
    for name in ("task", "corpus", "replay", "path"):
        if getattr(values, name) == "":  # of a variable of the shell that is not set, say
            raise UsageError(f"--{name} needs a name, not an empty one")
    others = _OF_RUNS if values.mutate else _OF_MUTANTS
    for name in others:
        if getattr(values, name) not in (None, ()):
            option = "--property" if name == "properties" else f"--{name.replace('_', '-')}"
            if values.mutate:
                raise UsageError(f"{option} and --mutate cannot be used together")
            raise UsageError(f"{option} needs --mutate")
    if values.replay:
        for name in _NOT_OF_A_CASE:
            if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                raise UsageError(f"--{name.removesuffix('_s')} cannot be used with --replay")


def _parsed(values: FuzzCommand, *case: Any) -> tuple[Plan, str]:
    """The plan in PATH, or of a case (its file and content), with its text. Raises GpsfsmError."""
    from gpsfsm.checking.inputs import read_joined
    from gpsfsm.fuzzing.campaign_report import read_subject

    name, content = case or read_joined(values.path or "", values.limits)
    return read_subject(name, content, values.limits, with_task=bool(values.task))


def _task(values: FuzzCommand) -> Task | None:
    from gpsfsm.tasks.load import load_task

    return load_task(values.task) if values.task else None


def _subject(plan: Plan, values: FuzzCommand) -> Subject:
    """The plan, ready to be run. Raises GpsfsmError."""
    from gpsfsm.fuzzing.subject import FAULTS, MAX_VISITS, subject_of

    if not plan.runners:
        raise GpsfsmError(f"{plan.file}: the plan has no runner, so nothing can happen in it")
    return subject_of(
        plan,
        faults=values.faults or tuple(FAULTS),
        limit_s="auto" if values.timeout is None else values.timeout or None,
        library=values.library.library,
        assumptions=values.assume,
        consistent=values.consistent,
        most_visits=values.max_visits or MAX_VISITS,
    )


def _fuzz(plan: Plan, source: str, values: FuzzCommand) -> int:
    """Run a campaign, and tell its findings."""
    from gpsfsm.fuzzing.campaign_report import (
        UNBOUNDED,
        CampaignOptions,
        campaign_report,
        chosen_properties,
    )

    subject = _subject(plan, values)
    for selector in () if subject.admission is None else subject.admission.unmatched:
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
            subject, properties, options, name=plan.file, source=source, progress=progress
        )
    _write(report, values)
    if not report.campaign.runs:
        complain(f"{plan.file}: the time ran out before the first run, so nothing was tried")
        return 2
    return 1 if report.campaign.failures else 0


def _play(file: str, values: FuzzCommand) -> int:
    """Play a case once: 1 if its property is still broken. Raises GpsfsmError."""
    from gpsfsm.fuzzing.campaign_report import case_report, properties_of_case
    from gpsfsm.fuzzing.cases import read_case

    case = read_case(file)
    content = case.plan_file, case.plan.encode("utf-8", "surrogateescape")
    plan, source = _parsed(values, *(() if values.path else content))
    played = replace(
        values,
        assume=(),  # a case says what happens
        consistent=False,
        faults=values.faults or case.faults,
        timeout=(case.limit_s or 0.0) if values.timeout is None else values.timeout,
    )
    subject = _subject(plan, played)
    properties = properties_of_case(case, values.properties, _task(values))
    report = case_report(case, subject, properties, name=plan.file, source=source)
    _write(report, values)
    return 1 if report.campaign.failures else 0


def _write(report: CampaignReport, values: FuzzCommand) -> None:
    from gpsfsm.fuzzing.campaign_report import campaign_json, campaign_text
    from gpsfsm.report import RenderOptions

    file = values.output_file
    if values.output_format == "json":
        write_text(campaign_json(report), file, form=Form.JSON)
        return
    color = wants_color("auto", file)
    text = campaign_text(report, RenderOptions(color=color, width=terminal_width(file)))
    write_text(text, file, form=Form.COLORED if color else Form.TEXT)


def _score(plan: Plan, values: FuzzCommand) -> int:
    """Score the checks of a plan: 1 if they miss a mutant. Raises GpsfsmError."""
    from gpsfsm.fuzzing.mutation import DEFAULT_MUTANTS, Notice, mutate, score_json, score_text

    most = values.runs or (DEFAULT_MUTANTS if values.time_s is None else 10**9)
    options = _mutant_options(values)
    with progress_bar("mutants", None) as tick:
        score = mutate(
            *(plan, options),
            seed=values.seed,
            most=most,
            time_s=values.time_s,
            jobs=values.jobs,
            tick=tick,
        )
    by = "the task file notices" if values.task else "the rules notice"
    text = score_json(score) if values.output_format == "json" else score_text(score, by)
    write_text(text, values.output_file, form=form_of(values.output_format))
    if len(score.mutants) == score.count(Notice.UNDECIDED):
        why = "no mutant was decided" if score.mutants else "there was no mutant"
        complain(f"{plan.file}: {why}, so nothing was tried")
        return 2
    return 1 if score.count(Notice.MISSED) else 0


def _mutant_options(values: FuzzCommand) -> CheckOptions:
    """The options with which mutants are checked. Raises UsageError."""
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.analysis.rules import select_rules
    from gpsfsm.checking import CheckOptions
    from gpsfsm.checking.selection import Selection

    task = _task(values)
    select = words(values.select) or (_OF_TASKS if task is not None else ())
    ignore = words(values.ignore)
    select_rules((*select, *ignore))
    return CheckOptions(
        analysis=AnalysisOptions(assumptions=tuple(values.assume), consistent=values.consistent),
        limits=values.limits,
        selection=Selection.of(select, ignore),
        capabilities=values.library,
        task=task,
        trees=False,
    )
