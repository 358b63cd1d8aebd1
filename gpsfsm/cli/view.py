"""``gpsfsm view``: plans as a page to look at, in one file."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from gpsfsm.checking.config import settings_used
from gpsfsm.cli._help import ANY_PATH, Command, Section, declare, declare_file
from gpsfsm.cli._options import (
    SETTINGS,
    CheckValues,
    apply,
    capability_options,
    config_options,
    effort_options,
    engine_option,
    limit_options,
    option,
    output_option,
    read_values,
    scenario_options,
    tell_settings,
)
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.streams import STDOUT, Form, check_writable, complain, write_text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.checking.inputs import Input
    from gpsfsm.viewing.plans import Viewed

_NO_PATH = """no plan is given; name a file, a folder, or - for standard input. Example:
  gpsfsm view plan.xml"""
_HEAD = 4_096
_WRITTEN = ParameterSource.COMMANDLINE
_SYNTAX = ("GP1", "GP8")
"""How the codes of rules begin that are about the text."""


def _page_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what is shown and where it is written."""
    options = (
        output_option("The page. [default: the plan's name with .html, here]", default=None),
        declare(
            "--force", is_flag=True, common=True, help="Overwrite a file that is not a gpsfsm page."
        ),
        declare("--open", "opens", is_flag=True, common=True, help="Open the page in the browser."),
        declare("--diff", is_flag=True, common=True, help="Compare two plans side by side."),
        declare_file("--task", common=True, help="Grade the plans against this task file."),
        option("select"),
        option("ignore"),
    )
    return apply(options, command, "The page")


@dataclass(frozen=True, kw_only=True)
class ViewCommand(CheckValues):
    """The options of ``gpsfsm view``."""

    paths: Sequence[str]
    output_file: str | None
    force: bool
    opens: bool
    diff: bool
    task: str | None


@click.command(
    "view",
    cls=Command,
    section=Section.CHECK,
    short_help="Write a page that shows plans and findings.",
)
@click.argument("paths", nargs=-1, metavar="PATH…", type=ANY_PATH)
@_page_options
@engine_option
@scenario_options
@capability_options
@effort_options
@option("require_proof")
@option("tolerate")
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Write a page that shows the plans in PATH…: files, folders, or - for stdin.

    The page is one file that needs no network: tree, automaton and text of each plan, with its
    findings and scenarios that play step by step.

    Exit code: 0 written, 1 written but a text has errors, 2 not written.

    \b
    Examples:
      gpsfsm view plan.xml --open
      gpsfsm view a.xml b.xml --diff -o a-and-b.html
    """
    values = read_values(context, ViewCommand, [name for name in SETTINGS if name != "fail_on"])
    if not all(values.paths) or not values.paths:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run(values, _check_words(context))


def _check_words(context: click.Context) -> str:
    """The options of this command line that `gpsfsm check` has too, for a shell."""
    from gpsfsm.cli import check

    shared = {option.name for option in check.command.params} - {"paths", "output_file", "diff"}
    words: list[str] = []
    for each in context.command.params:
        name = each.name or ""
        if name not in shared or context.get_parameter_source(name) is not _WRITTEN:
            continue
        value = context.params[name]
        flag = max(each.opts, key=len)
        if isinstance(value, bool):
            words.append(flag if value else each.secondary_opts[0])
        else:
            values = value if isinstance(value, tuple) else (value,)
            words += [word for one in values for word in (flag, str(one))]
    return shlex.join(words)


def _run(values: ViewCommand, check: str) -> int:
    from gpsfsm.checking.inputs import find_inputs
    from gpsfsm.model.report import Report
    from gpsfsm.progress import MANY, counted, progress_bar
    from gpsfsm.viewing.document import document, view_input
    from gpsfsm.viewing.page import page

    options = _options(values)
    inputs = list(find_inputs(values.paths))
    if values.diff and len(inputs) != 2:
        raise UsageError(f"--diff compares two plans, not {len(inputs)}")
    target = _target(values, inputs)
    with progress_bar("checking", len(inputs), at_least=MANY) as tick:
        views = (view_input(each, options, complain) for each in inputs)
        viewed = list(counted(views, len(inputs), tick))
    unread = sum(each.text is None for each in viewed)
    if unread == len(inputs):
        raise GpsfsmError("no plan could be read, so there is nothing to show")
    report = Report(tuple(each.report for each in viewed))
    tell_settings(settings_used(values, report).settings)
    text = page(document(viewed, options, diff=values.diff) | {"check": check})
    write_text(text, target, form=Form.EXACT)
    wrong = sum(map(_has_errors, viewed))
    if target != STDOUT:
        size = len(text.encode("utf-8", "backslashreplace"))
        errors = f"; {wrong} with errors in the text" if wrong else ""
        complain(f"{target}: {_counted(len(inputs))}, {size / 1000:,.0f} kB{errors}")
    if values.opens:
        _open(target)
    idle = [each for view in viewed for each in view.report.findings if each.rule == "GP908"]
    for each in idle:
        complain(each.message)
    return 2 if unread or idle else int(wrong > 0)


def _options(values: ViewCommand) -> CheckOptions:
    if values.opens and values.output_file == STDOUT:
        raise UsageError("--open needs a file to open; leave out -o -")
    options = values.options()
    if values.task is None:
        return options
    from gpsfsm.tasks.load import load_task

    return replace(options, task=load_task(values.task))


def _counted(plans: int) -> str:
    return "1 plan" if plans == 1 else f"{plans} plans"


def _target(values: ViewCommand, inputs: Sequence[Input]) -> str:
    """The file of the page. Raises UsageError rather than to overwrite what is no page of ours."""
    target: str = values.output_file or _named(inputs)
    check_writable(target, [each.path for each in inputs if not each.stdin])
    if target == STDOUT or values.force or not Path(target).is_file():
        return target
    from gpsfsm.viewing.page import is_report

    try:
        with Path(target).open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise GpsfsmError(f"cannot write {target}: {error.strerror or error}") from error
    if head and not is_report(head):
        raise UsageError(
            f"{target} exists and is not a page that gpsfsm wrote; name another file with -o, "
            "or overwrite it with --force"
        )
    return target


def _named(inputs: Sequence[Input]) -> str:
    """The name of a page that was given none."""
    if len(inputs) != 1:
        return "plans.html"
    stem = "" if inputs[0].stdin else Path(inputs[0].path).stem
    return f"{stem or 'plan'}.html"


def _has_errors(viewed: Viewed) -> bool:
    """True if the text itself has errors, shown or not."""
    from gpsfsm.model.finding import Severity

    report = viewed.report
    return any(
        finding.severity is Severity.ERROR and finding.rule.startswith(_SYNTAX)
        for finding in (*report.findings, *report.suppressed)
    )


def _open(target: str) -> None:
    """Show a file in the browser; that there is none is told, and no error."""
    import webbrowser

    if not webbrowser.open(Path(target).resolve().as_uri()):
        complain(f"no browser was found; open {target} yourself")
