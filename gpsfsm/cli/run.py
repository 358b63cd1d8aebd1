"""``gpsfsm run``: check a plan, then run it, in virtual time or for real."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare, declare_file
from gpsfsm.cli._model import model_options, run_model_settings
from gpsfsm.cli._options import (
    LIMITS,
    LibraryValues,
    LimitValues,
    NumberRange,
    apply,
    config_options,
    engine_option,
    format_option,
    library_options,
    limit_options,
    option,
    read_values,
    response_option,
)
from gpsfsm.cli._running import (
    AllowValues,
    RegenerationValues,
    allow_options,
    permissions,
    regeneration_options,
    ros_option,
    ros_settings,
    via_option,
    wanted,
)
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.model.story import PAPER_ENGINE
from gpsfsm.running.bounds import MAX_PLANS, PERMISSIONS
from gpsfsm.streams import complain

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.capabilities.library import Capabilities, Library
    from gpsfsm.execution.journal import Heading
    from gpsfsm.generation.providers import ModelSettings
    from gpsfsm.running.admission import Admission
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.scenario import FromFile
    from gpsfsm.running.session import Submission
    from gpsfsm.running.terminal import Terminal
    from gpsfsm.watch.groot_stream import GrootStream

_NO_PATH = """no plan is given; name a file, or - for standard input. Example:
  gpsfsm run plan.xml"""
_EFFORT = ("rlimit", "total_rlimit")
_SETTINGS = frozenset(
    (*LIMITS, *_EFFORT, "from_response", "capabilities", "builtin_capabilities", "robot", "engine")
)


_OF_A_RUN = ("journal", "max_plans", "max_visits", "timeout", "bond", "groot", "verbose")
"""Options that say nothing of what a run would send."""

_RUNNER_OPTIONS = (
    declare_file(
        "--world",
        common=True,
        help="Simulate the runners in this world file.",
    ),
    declare_file(
        "--scenario",
        common=True,
        help="Replay a scenario from a JSON report of check.",
    ),
    declare(
        "--finding",
        type=click.IntRange(min=1),
        metavar="N",
        help="Number of the finding to replay. [default: the first with a scenario]",
    ),
    declare("--real", is_flag=True, common=True, help="Run real runners in real time."),
    declare(
        "--dry-run",
        is_flag=True,
        help="With --real: look at the robot and show what would be sent to it, but send nothing.",
    ),
    declare(
        "--seed",
        type=int,
        default=0,
        metavar="N",
        common=True,
        help="Random seed. [default: 0]",
    ),
    declare(
        "--failure",
        type=NumberRange(0, 1),
        metavar="P",
        common=True,
        help="Probability that an action fails. [default: 0.1]",
    ),
    declare(
        "--speed",
        type=NumberRange(0, 1e6, min_open=True),
        metavar="X",
        common=True,
        help="Simulated seconds per second. [default: no waiting]",
    ),
    declare(
        "--groot",
        metavar="[HOST:]PORT",
        help="Show a behaviour tree in Groot2; --speed then defaults to 1.",
    ),
    declare(
        "--timeout",
        type=NumberRange(0, 1e9, min_open=True),
        metavar="SECONDS",
        help="Time limit per action; beyond it, it is stopped and fails.",
    ),
)


def _runner_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about who acts."""
    return apply(_RUNNER_OPTIONS, command, "Runners")


@dataclass(frozen=True, kw_only=True)
class RunCommand(AllowValues, RegenerationValues, LibraryValues, LimitValues):
    """The options of ``gpsfsm run``; ``model`` are the settings of the one that is asked."""

    paths: Sequence[str]
    engine: str
    world: str | None
    scenario: str | None
    finding: int | None
    real: bool
    dry_run: bool
    seed: int
    failure: float | None
    speed: float | None
    timeout: float | None
    journal: str | None
    durability: str
    max_plans: int | None
    max_visits: int | None
    bond: float | None
    via: str | None
    ros_args: Sequence[str]
    force: bool
    groot: str | None
    output_format: str
    verbose: bool
    from_response: bool
    rlimit: int | None
    total_rlimit: int | None
    model: ModelSettings | None = None


@click.command(
    "run", cls=Command, section=Section.RUN, short_help="Run a plan, simulated or for real."
)
@click.argument("paths", nargs=-1, metavar="[PATH]...", type=ANY_PATH)
@engine_option
@_runner_options
@allow_options
@declare_file(
    "--journal",
    common=True,
    help="Journal: record every event before it takes effect.",
)
@declare(
    "--durability",
    type=click.Choice(["power", "process", "none"]),
    default="power",
    show_default=True,
    help="What the journal survives: a power failure, the end of the process, or nothing.",
)
@declare(
    "--max-plans",
    type=click.IntRange(min=1),
    metavar="N",
    help="Maximum number of plans to run, including submitted ones. [default: 20]",
)
@declare(
    "--max-visits",
    type=click.IntRange(min=1),
    metavar="N",
    help="Cancel a machine's run after N visits. [default: 1000; --real: none]",
)
@declare(
    "--bond",
    type=NumberRange(0, 1e6, min_open=True),
    metavar="SECONDS",
    help="With --real: stop if no line arrives on standard input for this long.",
)
@via_option
@ros_option
@declare(
    "--force", is_flag=True, common=True, help="Run the plan despite errors; the journal notes it."
)
@format_option("auto", "plain", "json", text="auto: a live tree on a terminal, else lines.")
@declare("--verbose", is_flag=True, help="Show every event.")
@model_options(timeout="--model-timeout")
@regeneration_options
@library_options
@response_option
@option("rlimit")
@option("total_rlimit")
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Check the plan in PATH (- for standard input) and run it.

    Runners are simulated with random outcomes unless --world, --scenario or --real is given.
    Several plans run one after the other.

    Exit code: 0 completed; 1 not completed, or not run because of errors;
    2 could not run; 3 in doubt; 130 cancelled with Ctrl-C. For several plans, the worst.

    \b
    Example:
      gpsfsm run plan.xml --seed 7 --journal run.db
    """
    values = read_values(context, RunCommand, _SETTINGS, named=True)
    if not values.paths:
        raise click.UsageError(_NO_PATH, context)
    _refuse_no_name(values)
    _refuse_contradictions(values)
    if values.groot is not None and not values.real:
        values = replace(values, speed=values.speed or 1.0)  # else it is over at once
    return _run(replace(values, model=run_model_settings(context, real=values.real)))


def _refuse_no_name(values: RunCommand) -> None:
    for name in ("journal", "world", "scenario"):
        if getattr(values, name) == "":  # of a variable of the shell that is not set, say
            raise UsageError(f"--{name} needs the name of a file, not an empty one")


def _refuse_contradictions(values: RunCommand) -> None:
    chosen = [f"--{name}" for name in ("world", "scenario", "real") if getattr(values, name)]
    if len(chosen) > 1:
        raise UsageError(f"{' and '.join(chosen)} cannot be used together")
    if values.finding is not None and not values.scenario:
        raise UsageError("--finding needs --scenario")
    if values.failure is not None and chosen:
        raise UsageError(f"--failure cannot be used with {chosen[0]}")
    if values.real and values.speed is not None:
        raise UsageError("--real and --speed cannot be used together")
    if values.paths.count("-") > 1:
        raise UsageError("standard input holds only one plan, but - was given more than once")
    if values.bond is not None and "-" in values.paths:
        raise UsageError("--bond cannot be used with a plan on standard input")
    if len(values.paths) > (values.max_plans or MAX_PLANS):
        raise UsageError("there are more plans than --max-plans allows; raise it or pass fewer")
    if len(values.paths) > 1 and values.scenario:
        raise UsageError("--scenario takes one plan")
    if idle := [name for name in _OF_A_RUN if values.dry_run and getattr(values, name)]:
        raise UsageError(f"--dry-run and --{idle[0].replace('_', '-')} cannot be used together")
    for name in (*PERMISSIONS, "bond", "via", "ros_args", "dry_run"):
        if getattr(values, name) and not values.real:
            raise UsageError(f"--{name.replace('_', '-')} needs --real")
    # outcomes that are drawn, or taken from a scenario, ask nobody
    if values.model_name and not (values.world or values.real):
        raise UsageError("--model needs --world or --real")


def _run(values: RunCommand) -> int:
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.running.admission import Admission, Refused
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.scenario import check_scenario, read_scenario
    from gpsfsm.running.session import Submission
    from gpsfsm.running.terminal import Show, Terminal

    plans = _plans(values)
    groot = _groot(values, plans)
    capabilities = values.library
    scenario = None
    if values.scenario:
        scenario = read_scenario(values.scenario, plans[0][0], values.finding)
    base = _heading(values, capabilities, scenario)
    silent = scenario is not None  # those who look at a finding know of it
    analysis = AnalysisOptions(**{k: v for k in _EFFORT if (v := getattr(values, k)) is not None})
    how = (base, capabilities, values.limits)
    admission = Admission(*how, force=values.force, silent=silent, trees=True, analysis=analysis)
    show = Show(
        output_format=values.output_format,
        verbose=values.verbose,
        at_once=values.speed is not None,
        titled=len(plans) > 1,
        claim="" if scenario is None else scenario.ends,
    )
    interruption = Interruption()
    terminal = Terminal(show, interruption)
    submitted = []
    with ExitStack() as stack:
        admission.get_ready([text for _, text in plans], stack)
        for name, text in plans:
            decision = admission.decide(text, name)
            terminal.decided(decision)
            submitted.append(Submission(name, text, decision))
        if len(submitted) == 1:  # no journal is made for a plan that is not run
            if isinstance(decision, Refused):
                return decision.code
            if scenario is not None and values.scenario:
                plan = decision.prepared.compiled.automaton.plan
                check_scenario(scenario, plan, values.scenario)
        if groot is not None:
            terminal.groot = stack.enter_context(groot)
        return _drive((base, admission, terminal), submitted, interruption, capabilities, values)


def _groot(values: RunCommand, plans: Sequence[tuple[str, str]]) -> GrootStream | None:
    if values.groot is None:
        return None
    from gpsfsm.watch.groot_stream import stream_of

    return stream_of(values.groot, plans, from_response=values.from_response)


def _plans(values: RunCommand) -> list[tuple[str, str]]:
    """The names and texts of the plans of the command line. Raises GpsfsmError."""
    from gpsfsm.checking.inputs import read_joined
    from gpsfsm.running.admission import as_text

    contents = [read_joined(path, values.limits) for path in values.paths]
    return [(name, as_text(content)) for name, content in contents]


# --- the run -------------------------------------------------------------------------------------


def _heading(
    values: RunCommand,
    capabilities: Capabilities,
    scenario: FromFile | None,
) -> Heading:
    """The heading that all runs have in common."""
    from gpsfsm.capabilities.table import dump
    from gpsfsm.execution.journal import Heading
    from gpsfsm.running import prepare
    from gpsfsm.running.scenario import engine_for

    mode, world = prepare.DRAWN, b""
    options: dict[str, Any] = {}
    if values.from_response:
        options["from_response"] = True
    engine = engine_for(values.engine, scenario, values.scenario or "")
    if engine != PAPER_ENGINE:
        options["engine"] = engine
    bounds = {"max_visits": values.max_visits, "timeout_s": values.timeout}
    if values.max_plans != MAX_PLANS:
        bounds = {"max_plans": values.max_plans, **bounds}
    options |= {name: bound for name, bound in bounds.items() if bound is not None}
    if values.world:
        mode, world = prepare.WORLD, _world(values.world, capabilities.library)
    elif scenario is not None:
        mode = prepare.SCENARIO
        options["outcomes"] = [f"{element}={outcome}" for element, outcome in scenario.outcomes]
        options["order"] = list(scenario.order)
        if scenario.no_start:
            options["no_start"] = True
    elif values.real:
        mode = prepare.REAL
        options |= permissions(values, capabilities.allow or ())
        options["ros"] = ros_settings(capabilities, values.ros_args, values.via)
        options["nonce"] = os.urandom(8).hex()  # no two real actions ever have the same key
    elif values.failure is not None:
        options["failure"] = values.failure
    if values.model is not None:
        options["model"] = values.model.spec
    options |= wanted(values, values.model)
    return Heading(
        plan=b"",
        capabilities=dump(capabilities.library),
        world=world,
        seed=values.seed,
        mode=mode,
        options=options,
    )


def _world(file: str, library: Library) -> bytes:
    """The content of a world file that makes sense with a library. Raises GpsfsmError."""
    from gpsfsm.files import read_whole
    from gpsfsm.simulation.load import read_world

    try:
        content = read_whole(file, 1 << 26)
    except GpsfsmError as error:
        raise GpsfsmError(f"{file}: {error}") from error
    read_world(content, file=file, library=library)
    return content


def _drive(
    made: tuple[Heading, Admission, Terminal],
    plans: list[Submission],
    interruption: Interruption,
    capabilities: Capabilities,
    values: RunCommand,
) -> int:
    """Run the plans and tell how they ended."""
    from gpsfsm.execution.bond import Bond
    from gpsfsm.running.drivers import Shared
    from gpsfsm.running.session import OneWorld, Session
    from gpsfsm.watch.console import keyboard

    if values.dry_run:
        from gpsfsm.running.looking import rehearse

        return rehearse(plans, values.model, as_json=values.output_format == "json")
    base, _, terminal = made
    bond = None if values.bond is None else Bond(values.bond)
    with ExitStack() as stack:
        stack.enter_context(interruption)
        if bond is None and "-" not in values.paths:
            terminal.keys = keyboard(values.output_format, interruption, stack)
        journal = None
        if values.journal:
            from gpsfsm.execution.journal import Journal

            journal = stack.enter_context(Journal(values.journal, values.durability))
            if journal.note:
                complain(journal.note)
        shared = Shared()
        if values.model is not None:
            from gpsfsm.running.model_access import model_of_run

            shared.model = model_of_run(base, values.model, capabilities, stack)
        session = Session(
            *made,
            journal=journal,
            setting=OneWorld(shared),
            interruption=interruption,
            speed=values.speed,
        )
        session.run(plans, bond=bond)
        return terminal.exit_code()
