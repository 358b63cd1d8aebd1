"""``gpsfsm grade``: grade answers of language models against a task."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._check_options import (
    SETTINGS,
    apply,
    capability_options,
    check_options_of,
    effort_options,
    scenario_options,
)
from gpsfsm.cli._options import config_options, limit_options, settle
from gpsfsm.cli._streams import STDOUT, check_writable, write_message, write_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

__all__ = ["COMMAND"]

_NO_PATH = """no plan is given; name a file, a folder, or - for standard input. Example:
  gpsfsm grade --task task.yaml answers/"""
_OF_A_CHECK = ("select", "ignore", "fail_on")
"""Settings that a grade does not depend on."""


def _table_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """What is written and where."""
    options = (
        click.option(
            "--task", required=True, metavar="FILE", type=click.Path(), help="The task file."
        ),
        click.option(
            "--table",
            type=click.Choice(["text", "csv", "md", "json"]),
            default="text",
            show_default=True,
            help="How to write the grades.",
        ),
        click.option(
            "--labels",
            metavar="FILE",
            type=click.Path(),
            help="Grades that people gave (CSV with path and grade): say how far they agree.",
        ),
        click.option(
            "-o",
            "--output-file",
            default=STDOUT,
            metavar="FILE",
            type=click.Path(),
            help="Write to this file instead of standard output.",
        ),
    )
    return apply(options, command)


@click.command("grade", short_help="Grade answers of language models against a task.")
@click.argument("paths", nargs=-1, metavar="PATH…", type=click.Path(allow_dash=True))
@_table_options
@scenario_options
@capability_options
@effort_options
@limit_options
@config_options
@click.pass_context
def COMMAND(context: click.Context, /, **_: object) -> int:  # noqa: N802  (it is an object)
    """Grade the answers in PATH…: files, folders (all *.xml in them), or - for standard input.

    \b
    success  the text reads as a plan, and the plan fulfils the task in every scenario
    partial  one of both
    failed   neither, or there is no plan, or the example of the prompt was returned

    Exit code: 0 every answer has its grade, 2 one could not be read or decided.

    \b
    Example:
      gpsfsm grade --task task.yaml answers/ --table csv --labels labels.csv
    """  # noqa: D301  (click wants the \b)
    values = settle(context, [name for name in SETTINGS if name not in _OF_A_CHECK])
    if not all(values["paths"]) or not values["paths"]:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run({**values, "select": (), "ignore": (), "fail_on": "error"})


def _run(values: Mapping[str, Any]) -> int:
    from gpsfsm.cli._grades import agreement_of, load_labels, told, written  # noqa: PLC0415
    from gpsfsm.errors import InputError  # noqa: PLC0415
    from gpsfsm.grading import Grade, Graded, Grader  # noqa: PLC0415  (loads the analyses)
    from gpsfsm.inputs import find_inputs, read_bytes  # noqa: PLC0415
    from gpsfsm.tasks.load import load_task  # noqa: PLC0415

    grader = Grader(load_task(values["task"]), check_options_of(values))
    labels = {} if values["labels"] is None else load_labels(values["labels"])
    inputs = list(find_inputs(values["paths"]))
    check_writable(values["output_file"], [found.path for found in inputs if not found.stdin])
    grades = []
    for found in inputs:
        try:
            text = read_bytes(found, grader.options.limits.max_bytes)
        except InputError as error:
            reason = f"not read: {error}"
            grades.append(Graded(found.path, Grade.UNDECIDED, False, None, reason))
        else:
            grades.append(grader.grade(text, found.path))
    agreement = agreement_of(grades, labels) if values["labels"] is not None else None
    write_text(written(grades, agreement, values["table"]), values["output_file"])
    if agreement is not None and values["table"] == "csv":
        write_message(told(agreement))
    return 2 if not grades or any(one.grade is Grade.UNDECIDED for one in grades) else 0
