"""``gpsfsm check``: decide what can happen when plans are run, and tell what is wrong with them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.checking.config import settings_used
from gpsfsm.checking.option_table import BY_NAME
from gpsfsm.cli._help import ANY_PATH, Command, Section, declare, declare_file
from gpsfsm.cli._options import (
    CheckValues,
    FailValues,
    NumberRange,
    apply,
    capability_options,
    config_options,
    effort_options,
    engine_option,
    exit_code,
    field_option,
    jobs_option,
    limit_options,
    option,
    output_option,
    read_values,
    scenario_options,
    selection_options,
    tell_settings,
)
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.late import dataclass
from gpsfsm.progress import MANY, counted, progress_bar
from gpsfsm.streams import (
    STDOUT,
    Form,
    check_writable,
    terminal_width,
    to_stderr,
    wants_color,
    write_text,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.checking.inputs import Input
    from gpsfsm.model.report import PlanReport, Report
    from gpsfsm.report import RenderOptions

_NO_PATH = """no plan is given; name a file, a folder, or - for standard input. Example:
  gpsfsm check plan.xml"""


def _format_help() -> str:
    from gpsfsm.report import format_names

    return BY_NAME["format"].help.format(formats=", ".join(format_names()))


def _output_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is shown and where."""
    options = (
        option("format", help=_format_help()),
        output_option(),
        option("baseline"),
        declare("--no-baseline", is_flag=True, help="Ignore any configured baseline."),
        option("quiet", "-q"),
        option("verbose", "-v"),
        option("statistics"),
        jobs_option("Check"),
        field_option(),
        option("color"),
    )
    return apply(options, command, "Output")


def _fix_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about repairs."""
    options = (
        declare(
            "--fix", is_flag=True, common=True, help="Repair the plans in place, then check them."
        ),
        declare(
            "--unsafe-fixes", is_flag=True, help="With --fix or --diff: apply unsafe fixes too."
        ),
        declare(
            "--diff",
            is_flag=True,
            common=True,
            help="Show what --fix would change and what would remain.",
        ),
    )
    return apply(options, command, "Repairs")


@dataclass(frozen=True, kw_only=True)
class CheckCommand(CheckValues, FailValues):
    """The options of ``gpsfsm check``."""

    paths: Sequence[str]
    task: str | None
    format: str
    output_file: str
    baseline: str | None
    no_baseline: bool
    quiet: bool
    verbose: bool
    statistics: bool
    jobs: int | str
    color: str
    field: str | None
    fix: bool
    unsafe_fixes: bool
    diff: bool
    time_limit: float | None


@click.command(
    "check", cls=Command, section=Section.CHECK, short_help="Check plans and report findings."
)
@click.argument("paths", nargs=-1, metavar="PATH…", type=ANY_PATH)
@declare_file(
    "--task",
    common=True,
    help="Also check that the plans fulfil this task file.",
)
@_output_options
@selection_options
@_fix_options
@engine_option
@scenario_options
@capability_options
@effort_options
@option("require_proof")
@option("tolerate")
@declare(
    "--time-limit",
    type=NumberRange(0.1, 86_400.0),
    metavar="SECONDS",
    help="Time limit per plan and its reading; beyond it: undecided, exit code 2. [default: 600]",
)
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Check the plans in PATH…: files, folders (every *.xml in them), or - for stdin.

    Exit code: 0 no finding at or above --fail-on, 1 findings, 2 not checked.
    Settings can be in gpsfsm.toml, or in pyproject.toml under [tool.gpsfsm].

    \b
    Example:
      gpsfsm check plans/ --assume 'never fails: SpeechRunner' --fail-on warning
    """
    values = read_values(context, CheckCommand)
    if not all(values.paths) or not values.paths:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run(values)


def _run(values: CheckCommand) -> int:
    """Everything that can be wrong with the options is found before the first plan is read."""
    from gpsfsm.checking.check import options_for
    from gpsfsm.checking.inputs import find_inputs
    from gpsfsm.model.report import Report
    from gpsfsm.report import find_format

    options = _with_task(values.options(), values.task)
    output_format = find_format(values.format)
    apply_baseline = _baseline(None if values.no_baseline else values.baseline)
    inputs = list(find_inputs(values.paths, values.field, within_s=values.time_limit))
    options = options_for(inputs, options)
    check_writable(values.output_file, [each.file for each in inputs if not each.stdin])

    changed = False
    if values.unsafe_fixes and not (values.fix or values.diff):
        raise UsageError("--unsafe-fixes needs --fix or --diff; without them nothing is repaired")
    if values.fix or values.diff:
        plans, changed = _fix_all(inputs, options, values)
    else:
        plans = tuple(_check_all(inputs, options, values))
    report = settings_used(values, apply_baseline(Report(plans)))
    shown = _render_options(values, options)
    colored = shown.color and output_format.form is Form.TEXT
    form = Form.COLORED if colored else output_format.form
    write_text(output_format.render(report, shown), values.output_file, form=form)
    if values.format != "text" or values.output_file != STDOUT:
        tell_settings(report.settings)  # not every format has room for them
    return max(exit_code(values, report), int(changed))


def _with_task(options: CheckOptions, file: str | None) -> CheckOptions:
    if file is None:
        return options
    from gpsfsm.tasks.load import load_task

    return replace(options, task=load_task(file))


def _fix_all(
    inputs: Sequence[Input], options: CheckOptions, values: CheckCommand
) -> tuple[tuple[PlanReport, ...], bool]:
    """Repair the plans one after the other: their reports, and whether --diff has shown any."""
    from gpsfsm.fixing.files import Wish, check_target, fix_inputs

    if values.time_limit is not None:
        raise UsageError("--time-limit cannot be used with --fix or --diff: they check repeatedly")
    if values.diff and (values.format != "text" or values.fix):
        raise UsageError("--diff needs --format text, and cannot be used with --fix")
    if any(each.stdin for each in inputs) and not values.diff:
        raise UsageError("--fix changes files; 'gpsfsm fix -' repairs standard input")
    wish = Wish(values.unsafe_fixes, values.diff, in_place=True)
    check_target(inputs, wish)
    outcomes = []
    for outcome, lines in fix_inputs(inputs, options, wish):
        outcomes.append(outcome)
        if not values.quiet:
            to_stderr(lines)
    if any(outcome.unwritten for outcome in outcomes):
        raise GpsfsmError("not all plans could be written")
    changed = wish.diff and any(outcome.changed for outcome in outcomes)
    return tuple(outcome.report for outcome in outcomes), changed


def _baseline(file: str | None) -> Callable[[Report], Report]:
    if file is None:
        return lambda report: report
    from gpsfsm.checking.selection import load_baseline

    return load_baseline(file).apply


def _check_all(
    inputs: Sequence[Input], options: CheckOptions, values: CheckCommand
) -> Iterator[PlanReport]:
    jobs, limit_s = values.jobs, values.time_limit
    if str(jobs).strip() == "1" and limit_s is None:  # without what starts processes
        from gpsfsm.checking import check_in_time

        reports: Iterator[PlanReport] = (check_in_time(each, options) for each in inputs)
    else:
        from gpsfsm.checking.parallel import check_inputs, limit_of

        reports = check_inputs(inputs, options, jobs=jobs, time_limit_s=limit_of(jobs, limit_s))
    if values.quiet:
        yield from reports
        return
    with progress_bar("checking", len(inputs), at_least=MANY) as progress:
        yield from counted(reports, len(inputs), progress)


def _render_options(values: CheckCommand, options: CheckOptions) -> RenderOptions:
    from gpsfsm import __version__
    from gpsfsm.report import RenderOptions

    suggestions = None
    if values.format == "llm":
        from gpsfsm.fixing.suggest import Suggestions

        suggestions = Suggestions(options)
    return RenderOptions(
        color=wants_color(values.color, values.output_file),
        quiet=values.quiet,
        verbose=values.verbose,
        statistics=values.statistics,
        width=terminal_width(values.output_file),
        version=__version__,
        correct=suggestions,
    )
