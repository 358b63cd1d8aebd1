"""``gpsfsm fuzz``: run a plan while everything goes wrong, or see whether its checks notice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from gpsfsm.cli._options import (
    LIMITS,
    LibraryValues,
    LimitValues,
    NumberRange,
    apply,
    config_options,
    engine_option,
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
from gpsfsm.errors import UsageError
from gpsfsm.model.engine_names import PAPER_ENGINE
from gpsfsm.streams import check_writable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_NO_PATH = """no plan is given; name a file, or - for standard input. Example:
  gpsfsm fuzz plan.xml"""
_SETTINGS = frozenset(
    {*LIMITS, "capabilities", "builtin_capabilities", "jobs", "assume", "consistent", "engine"}
)
_OF_RUNS = ("faults", "timeout", "properties", "corpus", "replay")
_OF_MUTANTS = ("select", "ignore")
_NOT_OF_A_CASE = ("runs", "time_s", "corpus", "jobs", "assume", "consistent")
_OTHER_ENGINE = """fuzz runs plans as the paper says, not as {engine} does; if that will do, say
  --engine paper. What the engine makes of a plan is told by
  gpsfsm check --engine {engine}, and gpsfsm run --engine {engine} runs it so"""


def _budget_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about how much is tried."""
    options = (
        click.option("--seed", type=int, default=0, metavar="N", help="Seed. [default: 0]"),
        click.option(
            "--runs",
            type=click.IntRange(1, 10**9),
            metavar="N",
            help="So many runs, or mutants. [default: 1000; with --time as many as it allows]",
        ),
        click.option(
            "--time",
            "time_s",
            type=NumberRange(0, 1e9, min_open=True),
            metavar="SECONDS",
            help="Begin nothing new after so many seconds.",
        ),
        jobs_option("Run or check"),
    )
    return apply(options, command)


def _scenario_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about which scenarios there are."""
    options = (
        option(
            "assume",
            help="Draw only scenarios where this holds, e.g. 'never fails: SpeechRunner'.",
        ),
        option("consistent"),
        engine_option,
    )
    return apply(options, command)


def _run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about runs and what is to hold of them."""
    options = (
        option(
            "faults",
            help="What may happen: failed, late, no-start, hang. [default: all]",
        ),
        click.option(
            "--timeout",
            type=NumberRange(0, 1e6),
            metavar="SECONDS",
            help="What an action may take; then it is stopped and has failed. 0: anything. "
            "[default: 60, or longer if a runner is declared to take longer]",
        ),
        click.option(
            "--property",
            "properties",
            multiple=True,
            metavar="NAME",
            help="Hold runs against this property, or against the function module:function or "
            "file.py:function, and not against the usual ones; may be repeated.",
        ),
        click.option(
            "--task", metavar="FILE", type=click.Path(), help="Hold runs against this task file."
        ),
        click.option(
            "--corpus",
            metavar="DIR",
            type=click.Path(),
            help="Play the cases in this folder first, and keep there what is found.",
        ),
        click.option(
            "--replay", metavar="CASE", type=click.Path(), help="Play only this case, once."
        ),
    )
    return apply(options, command)


def _mutation_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about mutants and what is to notice them."""
    options = (
        click.option(
            "--mutate",
            is_flag=True,
            help="Change the plan instead, and tell which changes the rules do not notice; with "
            "--task, which the task file does not.",
        ),
        option(
            "select",
            help="With --mutate: only these rules. [default: all; GP6 with --task]",
        ),
        option("ignore", help="With --mutate: not these rules."),
    )
    return apply(options, command)


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


@click.command("fuzz", short_help="Run a plan while everything goes wrong.")
@click.argument("path", required=False, metavar="[PATH]", type=click.Path(allow_dash=True))
@_budget_options
@_run_options
@_scenario_options
@_mutation_options
@format_option("text", "json", text="text: for people; json: for programs.")
@output_option("-o")
@library_options
@limit_options
@config_options
@click.pass_context
def COMMAND(context: click.Context, /, **_: object) -> int:  # noqa: N802  (it is an object)
    """Run the plan in PATH very often, in virtual time and with chance outcomes, durations, late
    answers, actions that hang and runners that do not start, and hold every run against properties.

    What breaks one is told with the plainest run that shows it. With --mutate, tell how many small
    changes of the plan its checks notice.

    \b
    Exit code: 0 nothing was found; 1 a property is broken, or a mutant is missed; 2 it could not
    be done.

    \b
    Examples:
      gpsfsm fuzz plan.xml --seed 7 --corpus cases/
      gpsfsm fuzz plan.xml --property checks.py:speaks_before_it_moves --time 60 --jobs 4
      gpsfsm fuzz plan.xml --mutate --task task.yaml
    """  # noqa: D205, D301  (click wants it like that)
    values = read_values(context, FuzzCommand, _SETTINGS)
    tell_narrowing(values)
    if not values.path and not values.replay:
        raise click.UsageError(_NO_PATH, context)
    _refuse_contradictions(values, context)
    check_writable(values.output_file, [each for each in (values.path,) if each])
    if values.mutate:
        from gpsfsm.cli._mutating import run_mutants

        return run_mutants(values.path or "", values)
    from gpsfsm.cli._fuzzing import play_case, run_fuzzing

    values = replace(values, faults=words(values.faults))
    if values.replay:
        return play_case(values.replay, values)
    return run_fuzzing(values.path or "", values)


def _refuse_contradictions(values: FuzzCommand, context: click.Context) -> None:
    if values.engine != PAPER_ENGINE:
        raise UsageError(_OTHER_ENGINE.format(engine=values.engine))
    for name in ("task", "corpus", "replay", "path"):
        if getattr(values, name) == "":  # of a variable of the shell that is not set, say
            raise UsageError(f"--{name} needs a name, not an empty one")
    others = _OF_RUNS if values.mutate else _OF_MUTANTS
    for name in others:
        if getattr(values, name) not in (None, ()):
            option = "--property" if name == "properties" else f"--{name}"
            how = "contradict each other" if values.mutate else "needs --mutate"
            told = f"{option} and --mutate {how}" if values.mutate else f"{option} {how}"
            raise UsageError(told)
    if values.replay:
        for name in _NOT_OF_A_CASE:
            if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                told = name.removesuffix("_s")
                raise UsageError(f"--{told} has no meaning with --replay")
