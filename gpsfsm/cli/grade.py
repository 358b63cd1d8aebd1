"""``gpsfsm grade``: grade answers of language models against a task."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._check_options import (
    SETTINGS,
    capability_options,
    check_options_of,
    effort_options,
    scenario_options,
    tell_narrowing,
)
from gpsfsm.cli._jobs import jobs_option
from gpsfsm.cli._options import apply, config_options, limit_options, output_option, settle
from gpsfsm.cli._streams import check_writable, form_of, write_message, write_text

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
            "--by",
            metavar="COLUMNS",
            help="A row for each group: 'folder', or columns of the labels such as model,task.",
        ),
        jobs_option("Grade"),
        output_option("-o"),
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
      gpsfsm grade --task task.yaml answers/ --by folder
    """  # noqa: D301  (click wants the \b)
    values = settle(context, ["jobs", *(name for name in SETTINGS if name not in _OF_A_CHECK)])
    tell_narrowing(values)
    if not all(values["paths"]) or not values["paths"]:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run({**values, "select": (), "ignore": (), "fail_on": "error"})


def _run(values: Mapping[str, Any]) -> int:
    from gpsfsm.cli._grades import Told, columns_of, told, written  # noqa: PLC0415
    from gpsfsm.evaluation.answers import grade_inputs  # noqa: PLC0415  (loads the analyses)
    from gpsfsm.evaluation.labels import load_labels  # noqa: PLC0415
    from gpsfsm.grading import Grade  # noqa: PLC0415
    from gpsfsm.inputs import find_inputs  # noqa: PLC0415
    from gpsfsm.tasks.load import load_task  # noqa: PLC0415

    task, options = load_task(values["task"]), check_options_of(values)
    labels = None if values["labels"] is None else load_labels(values["labels"])
    columns = columns_of(values["by"], labels)
    inputs = list(find_inputs(values["paths"]))
    check_writable(values["output_file"], [found.path for found in inputs if not found.stdin])
    grades = list(grade_inputs(inputs, task, options, jobs=values["jobs"]))
    all_of_it = Told(grades, labels, columns)
    table = values["table"]
    write_text(written(all_of_it, table), values["output_file"], form=form_of(table))
    if labels is not None and values["table"] == "csv":
        write_message(told(all_of_it))
    return 2 if not grades or any(one.grade is Grade.UNDECIDED for one in grades) else 0
