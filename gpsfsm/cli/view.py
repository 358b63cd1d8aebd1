"""``gpsfsm view``: plans as a page to look at, in one file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._check_options import (
    SETTINGS,
    capability_options,
    check_options_of,
    effort_options,
    scenario_options,
    settings_used,
    tell_settings,
)
from gpsfsm.cli._options import apply, config_options, engine_option, limit_options, settle
from gpsfsm.cli._streams import STDOUT, Form, check_writable, complain, write_text
from gpsfsm.errors import GpsfsmError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.checking import CheckOptions
    from gpsfsm.inputs import Input
    from gpsfsm.viewing.document import Viewed

__all__ = ["COMMAND"]

_NO_PATH = """no plan is given; name a file, a folder, or - for standard input. Example:
  gpsfsm view plan.xml"""
_HEAD = 4_096
_SYNTAX = ("GP1", "GP8")
"""How the codes of rules begin that are about the text."""


def _page_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """What is shown and where it is written."""
    options = (
        click.option(
            "-o",
            "--output-file",
            metavar="FILE",
            type=click.Path(),
            help="The page; - for standard output. [default: the plan's name with .html, here]",
        ),
        click.option(
            "--force", is_flag=True, help="Overwrite a file even if it is no page of gpsfsm."
        ),
        click.option("--open", "opens", is_flag=True, help="Show the page in the browser."),
        click.option("--diff", is_flag=True, help="Two plans side by side: do they do the same?"),
        click.option(
            "--task",
            metavar="FILE",
            type=click.Path(),
            help="A task file: grade the plans, and show where they leave the task.",
        ),
        click.option(
            "--select",
            multiple=True,
            metavar="CODES",
            help="Show only these rules: codes, names, prefixes (GP3) or ALL, with commas.",
        ),
        click.option("--ignore", multiple=True, metavar="CODES", help="Do not show these rules."),
    )
    return apply(options, command)


@click.command("view", short_help="Make a page that shows plans.")
@click.argument("paths", nargs=-1, metavar="PATH…", type=click.Path(allow_dash=True))
@_page_options
@engine_option
@scenario_options
@capability_options
@effort_options
@limit_options
@config_options
@click.pass_context
def COMMAND(context: click.Context, /, **_: object) -> int:  # noqa: N802  (it is an object)
    """Make a page of the plans in PATH…: files, folders (all *.xml in them), or - for stdin.

    The page is one file that needs no network: the plan as a tree, as an automaton and as text,
    with its findings, whose scenarios can be played. Texts with errors are shown as far as they go.

    \b
    Exit code: 0 written, 1 written, but a text has errors, 2 a plan could not be read, or nothing
    was written. Findings about what a plan does make no difference.

    \b
    Examples:
      gpsfsm view plan.xml --open
      gpsfsm view a.xml b.xml --diff -o a-and-b.html
    """  # noqa: D301  (click wants the \b)
    values = settle(context, [name for name in SETTINGS if name != "fail_on"])
    if not all(values["paths"]) or not values["paths"]:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run(values)


def _run(values: Mapping[str, Any]) -> int:
    from gpsfsm.inputs import find_inputs  # noqa: PLC0415  (these load the analyses)
    from gpsfsm.model.report import Report  # noqa: PLC0415
    from gpsfsm.viewing.document import document  # noqa: PLC0415
    from gpsfsm.viewing.page import page  # noqa: PLC0415

    options = _options(values)
    inputs = list(find_inputs(values["paths"]))
    if values["diff"] and len(inputs) != 2:
        raise UsageError(f"--diff compares two plans, and here are {len(inputs)}")
    target = _target(values, inputs)
    viewed, unread = _viewed(inputs, options)
    if unread == len(inputs):
        raise GpsfsmError("no plan could be read, so there is nothing to show")
    report = Report(tuple(each.report for each in viewed))
    tell_settings(settings_used(values, report).settings)
    text = page(document(viewed, options, diff=values["diff"]))
    write_text(text, target, form=Form.EXACT)
    if target != STDOUT:
        size = len(text.encode("utf-8", "backslashreplace"))
        complain(f"{target}: {_counted(len(inputs))}, {size / 1000:,.0f} kB")
    if values["opens"]:
        _open(target)
    return 2 if unread else int(any(map(_has_errors, viewed)))


def _options(values: Mapping[str, Any]) -> CheckOptions:
    if values["opens"] and values["output_file"] == STDOUT:
        raise UsageError("--open needs a file to open; leave out -o -")
    options = check_options_of(values)
    if values["task"] is None:
        return options
    from gpsfsm.tasks.load import load_task  # noqa: PLC0415  (loads pydantic and a YAML parser)

    return replace(options, task=load_task(values["task"]))


def _counted(plans: int) -> str:
    return "1 plan" if plans == 1 else f"{plans} plans"


def _target(values: Mapping[str, Any], inputs: Sequence[Input]) -> str:
    """Where the page goes. Raises UsageError rather than to overwrite what is no page of ours."""
    target: str = values["output_file"] or _named(inputs)
    check_writable(target, [found.path for found in inputs if not found.stdin])
    if target == STDOUT or values["force"] or not Path(target).is_file():
        return target
    from gpsfsm.viewing.page import is_report  # noqa: PLC0415

    try:
        with Path(target).open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise GpsfsmError(f"cannot write {target}: {error.strerror or error}") from error
    if head and not is_report(head):
        raise UsageError(
            f"{target} is there and no page that gpsfsm has written; name another file with -o, "
            "or overwrite it with --force"
        )
    return target


def _named(inputs: Sequence[Input]) -> str:
    """The name of a page that was given none."""
    if len(inputs) != 1:
        return "plans.html"
    stem = "" if inputs[0].stdin else Path(inputs[0].path).stem
    return f"{stem or 'plan'}.html"


def _viewed(inputs: Sequence[Input], options: CheckOptions) -> tuple[list[Viewed], int]:
    """What is known of each input, and how many could not be read."""
    from gpsfsm.checking import check_text, unreadable  # noqa: PLC0415
    from gpsfsm.errors import InputError  # noqa: PLC0415
    from gpsfsm.inputs import read_bytes  # noqa: PLC0415
    from gpsfsm.viewing.document import Viewed  # noqa: PLC0415

    found: list[Viewed] = []
    unread = 0
    for each in inputs:
        try:
            text = read_bytes(each, options.limits.max_bytes)
        except InputError as error:
            complain(f"{each.path}: {error}")
            found.append(Viewed(None, unreadable(each.path, str(error))))
            unread += 1
            continue
        found.append(Viewed(text, check_text(text, each.path, options)))
    return found, unread


def _has_errors(viewed: Viewed) -> bool:
    """Whether the text itself has errors, shown or not."""
    from gpsfsm.model.finding import Severity  # noqa: PLC0415

    report = viewed.report
    return any(
        finding.severity is Severity.ERROR and finding.rule.startswith(_SYNTAX)
        for finding in (*report.findings, *report.suppressed)
    )


def _open(target: str) -> None:
    """Show a file in the browser; that there is none is told, and no error."""
    import webbrowser  # noqa: PLC0415

    if not webbrowser.open(Path(target).resolve().as_uri()):
        complain(f"no browser was found; open {target} yourself")
