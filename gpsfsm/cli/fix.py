"""``gpsfsm fix``: repair plans without a language model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import click

from gpsfsm.checking.config import settings_used
from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.cli._options import (
    SETTINGS,
    CheckValues,
    FailValues,
    capability_options,
    config_options,
    engine_option,
    exit_code,
    field_option,
    idle_options,
    limit_options,
    option,
    output_option,
    read_values,
    scenario_options,
    tell_settings,
)
from gpsfsm.fixing.files import Outcome, Wish, check_target, fix_inputs, takes_stdout, total_line
from gpsfsm.streams import to_stderr, write_text

if TYPE_CHECKING:
    from collections.abc import Sequence

_NO_PATH = """no plan is given; name a file, a folder, or - for standard input. Example:
  gpsfsm fix plan.xml --diff"""


@dataclass(frozen=True, kw_only=True)
class FixCommand(CheckValues, FailValues):
    """The options of ``gpsfsm fix``."""

    paths: Sequence[str]
    unsafe_fixes: bool
    diff: bool
    output_file: str | None
    field: str | None
    quiet: bool


@click.command(
    "fix", cls=Command, section=Section.MEND, short_help="Repair plans without a language model."
)
@click.argument("paths", nargs=-1, metavar="PATH…", type=ANY_PATH)
@declare(
    "--unsafe-fixes",
    is_flag=True,
    common=True,
    help="Also apply fixes that may change what the plan means.",
)
@declare("--diff", is_flag=True, common=True, help="Show what would change; write nothing.")
@output_option(
    "Write the repaired plan to this file and leave the original as it is.", default=None
)
@field_option()
@declare("-q", "--quiet", is_flag=True, help="Print errors only.")
@option("select", help="Fix only findings of these rules.")
@option("ignore")
@option("fail_on")
@option("allow_suppressions")
@scenario_options
@capability_options
@engine_option
@option("solver")
@option("rlimit")
@option("total_rlimit")
@idle_options("fix")
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Repair the plans in PATH…: files, folders (every *.xml in them), or - for stdin.

    A fix is kept only if a new check shows that it removes its finding and adds no other. Files
    change in place; standard input and JSON lines go to standard output.

    Exit code: 0 no finding at or above --fail-on remains, 1 some remain (or
    --diff shows a change), 2 a plan could not be read, checked or written.

    \b
    Example:
      gpsfsm fix plans/ --unsafe-fixes --diff
    """
    values = read_values(context, FixCommand, SETTINGS)
    if not all(values.paths) or not values.paths:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run(values)


def _run(values: FixCommand) -> int:
    from gpsfsm.checking.inputs import find_inputs
    from gpsfsm.model.report import Report

    options = values.options()
    wish = Wish(values.unsafe_fixes, values.diff, values.output_file)
    inputs = list(find_inputs(values.paths, values.field))
    check_target(inputs, wish)
    say = to_stderr if takes_stdout(inputs, wish) else write_text
    outcomes: list[Outcome] = []
    for outcome, lines in fix_inputs(inputs, options, wish):
        outcomes.append(outcome)
        if not values.quiet:
            say(lines + _left(outcome))
    if not values.quiet:
        say(total_line(outcomes, wish))
    report = settings_used(values, Report(tuple(outcome.report for outcome in outcomes)))
    tell_settings(report.settings)
    code = exit_code(values, report)
    if any(outcome.unwritten for outcome in outcomes):
        return 2
    return max(code, int(wish.diff and any(outcome.changed for outcome in outcomes)))


def _left(outcome: Outcome) -> str:
    """The errors and warnings that remain, one line each."""
    from gpsfsm.model.finding import Severity
    from gpsfsm.model.report import Report
    from gpsfsm.report import RenderOptions, render

    report = outcome.report
    errors = tuple(each for each in report.findings if each.severity is Severity.ERROR)
    shown = replace(report, findings=errors)
    return render(Report((shown,)), options=RenderOptions(quiet=True))
