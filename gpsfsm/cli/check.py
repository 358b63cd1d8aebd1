"""``gpsfsm check``: decide what can happen when plans are run, and tell what is wrong with them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.analysis.options import DEFAULT_MAX_SCENARIOS, MAX_RLIMIT, AnalysisOptions
from gpsfsm.cli._options import config_options, limit_options, limits_of, settle, words
from gpsfsm.cli._streams import (
    STDOUT,
    check_writable,
    terminal_width,
    wants_color,
    write_text,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.inputs import Input
    from gpsfsm.model.finding import Severity
    from gpsfsm.model.report import PlanReport, Report
    from gpsfsm.report import RenderOptions

__all__ = ["COMMAND"]

_NO_PATH = """no plan is given; name a file, a folder, or - for standard input. Example:
  gpsfsm check plan.xml"""
_MANY = 20
"""More inputs than this take long enough for a progress bar."""


def _format_help() -> str:
    from gpsfsm.report import format_names  # noqa: PLC0415  (imports no format)

    return f"How to write the report: {', '.join(format_names())}. [default: text]"


def _output_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is shown and where."""
    options = (
        click.option("--format", default="text", metavar="NAME", help=_format_help()),
        click.option(
            "--output-file",
            default=STDOUT,
            metavar="FILE",
            type=click.Path(),
            help="Write the report to this file instead of standard output.",
        ),
        click.option(
            "--select",
            multiple=True,
            metavar="CODES",
            help="Show only these rules: codes, names, prefixes (GP3) or ALL, with commas.",
        ),
        click.option("--ignore", multiple=True, metavar="CODES", help="Do not show these rules."),
        click.option(
            "--fail-on",
            type=click.Choice(["error", "warning", "never"]),
            default="error",
            show_default=True,
            help="The least severity of a finding that makes the exit code 1.",
        ),
        click.option(
            "--baseline",
            metavar="FILE",
            type=click.Path(),
            help="An earlier report (--format json); findings in it do not fail.",
        ),
        click.option(
            "--no-baseline", is_flag=True, help="Use no baseline, even if one is configured."
        ),
        click.option("-q", "--quiet/--no-quiet", help="Findings only, one line each."),
        click.option("--statistics/--no-statistics", help="Count the findings per rule."),
        click.option(
            "--color",
            type=click.Choice(["auto", "always", "never"]),
            default="auto",
            show_default=True,
            help="Colours; auto: only on a terminal.",
        ),
    )
    return _apply(options, command)


def _scenario_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is read and what may happen."""
    options = (
        click.option(
            "--assume",
            multiple=True,
            metavar="TEXT",
            help="Consider only runs where this holds, e.g. 'never fails: SpeechRunner'.",
        ),
        click.option(
            "--consistent/--no-consistent", help="Equal actions of a plan have equal outcomes."
        ),
        click.option(
            "--faults",
            multiple=True,
            metavar="LIST",
            help="What can happen to a runner: failed, no-start, hang. [default: failed]",
        ),
        click.option(
            "--from-response/--no-from-response",
            help="The text is a language model's raw answer: take the last plan in it.",
        ),
    )
    return _apply(options, command)


def _capability_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is known of the robot."""
    options = (
        click.option(
            "--capabilities",
            multiple=True,
            metavar="DIR",
            type=click.Path(),
            help="Capability files that extend the built-in library; may be repeated.",
        ),
        click.option(
            "--builtin-capabilities/--no-builtin-capabilities",
            default=True,
            help="Whether to use the built-in library of capabilities. [default: yes]",
        ),
        click.option(
            "--deadline",
            type=float,
            metavar="SECONDS",
            help="What a run may take at most, as far as durations are declared.",
        ),
        click.option(
            "--energy-limit",
            type=float,
            metavar="JOULES",
            help="The energy that a run may take at most, as far as it is declared.",
        ),
    )
    return _apply(options, command)


def _effort_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about how to decide and how much to do."""
    options = (
        click.option(
            "--solver",
            type=click.Choice(["auto", "z3", "structural"]),
            default="auto",
            show_default=True,
            help="How to decide.",
        ),
        click.option(
            "--rlimit",
            type=click.IntRange(1, MAX_RLIMIT),
            metavar="N",
            help="z3's steps per question; beyond them the answer is 'unknown', exit code 2.",
        ),
        click.option(
            "--max-scenarios",
            type=click.IntRange(min=0),
            metavar="N",
            help=f"Scenarios per rule and plan. [default: {DEFAULT_MAX_SCENARIOS}]",
        ),
        click.option(
            "-j",
            "--jobs",
            type=click.IntRange(0, 256),
            default=1,
            metavar="N",
            help="Check in N processes; 0: one per core. [default: 1]",
        ),
    )
    return _apply(options, command)


def _apply(
    options: Sequence[Callable[[Callable[..., Any]], Callable[..., Any]]],
    command: Callable[..., Any],
) -> Callable[..., Any]:
    for option in reversed(options):
        command = option(command)
    return command


@click.command("check", short_help="Check plans.")
@click.argument("paths", nargs=-1, metavar="PATH…", type=click.Path(allow_dash=True))
@_output_options
@_scenario_options
@_capability_options
@_effort_options
@limit_options
@config_options
@click.pass_context
def COMMAND(context: click.Context, /, **_: object) -> int:  # noqa: N802  (it is an object)
    """Check the plans in PATH…: files, folders (all *.xml in them), or - for standard input.

    \b
    Exit code: 0 nothing at or above --fail-on, 1 findings, 2 a plan could not be checked.
    Settings may stand in a gpsfsm.toml or below [tool.gpsfsm] in a pyproject.toml.

    \b
    Example:
      gpsfsm check plans/ --assume 'never fails: SpeechRunner' --fail-on warning
    """  # noqa: D301  (click wants the \b)
    values = settle(context)
    if not all(values["paths"]) or not values["paths"]:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run(values)


def _run(values: Mapping[str, Any]) -> int:
    """Everything that can be wrong with the options is found before the first plan is read."""
    from gpsfsm.inputs import find_inputs  # noqa: PLC0415  (these load the analyses)
    from gpsfsm.model.report import Report  # noqa: PLC0415
    from gpsfsm.report import find_format  # noqa: PLC0415

    options = _check_options(values)
    output_format = find_format(values["format"])
    accept_known = _baseline(None if values["no_baseline"] else values["baseline"])
    inputs = list(find_inputs(values["paths"]))
    check_writable(values["output_file"], [found.path for found in inputs if not found.stdin])

    silent = values["quiet"] or len(inputs) <= _MANY
    plans = _check_all(inputs, options, values["jobs"], silent=silent)
    report = accept_known(Report(tuple(plans)))
    write_text(output_format.render(report, _render_options(values)), values["output_file"])
    return report.exit_code(_severity(values["fail_on"]))


def _check_options(values: Mapping[str, Any]) -> CheckOptions:
    from gpsfsm.api import check_options  # noqa: PLC0415
    from gpsfsm.capabilities.choice import choose_capabilities  # noqa: PLC0415

    given = {name: values[name] for name in ("rlimit", "max_scenarios") if values[name] is not None}
    analysis = AnalysisOptions(
        faults=words(values["faults"]),
        consistent=values["consistent"],
        assumptions=tuple(values["assume"]),
        solver=values["solver"],
        deadline_s=values["deadline"],
        energy_limit_j=values["energy_limit"],
        **given,
    )
    return check_options(
        analysis,
        select=words(values["select"]),
        ignore=words(values["ignore"]),
        from_response=values["from_response"],
        limits=limits_of(values),
        capabilities=choose_capabilities(
            values["capabilities"], builtin=values["builtin_capabilities"]
        ),
    )


def _baseline(file: str | None) -> Callable[[Report], Report]:
    if file is None:
        return lambda report: report
    from gpsfsm.baseline import load_baseline  # noqa: PLC0415

    return load_baseline(file).apply


def _check_all(
    inputs: Sequence[Input], options: CheckOptions, jobs: int, *, silent: bool
) -> Iterator[PlanReport]:
    from gpsfsm.parallel import check_inputs  # noqa: PLC0415

    reports = check_inputs(inputs, options, jobs=jobs)
    if silent or sys.stderr is None or not sys.stderr.isatty():
        yield from reports
        return
    with click.progressbar(
        reports, length=len(inputs), label="checking", file=sys.stderr, show_pos=True
    ) as shown:
        yield from shown


def _render_options(values: Mapping[str, Any]) -> RenderOptions:
    from gpsfsm import __version__  # noqa: PLC0415
    from gpsfsm.report import RenderOptions  # noqa: PLC0415

    return RenderOptions(
        color=wants_color(values["color"], values["output_file"]),
        quiet=values["quiet"],
        statistics=values["statistics"],
        width=terminal_width(values["output_file"]),
        version=__version__,
    )


def _severity(fail_on: str) -> Severity | None:
    from gpsfsm.model.finding import Severity  # noqa: PLC0415

    return None if fail_on == "never" else Severity(fail_on)
