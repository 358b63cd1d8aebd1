"""``gpsfsm grade``: grade answers of language models against a task."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.checking.option_table import NO_EFFECT
from gpsfsm.cli._help import ANY_PATH, Command, Section, declare, declare_file
from gpsfsm.cli._options import (
    SETTINGS,
    CheckValues,
    apply,
    config_options,
    field_option,
    idle_options,
    jobs_option,
    library_options,
    limit_options,
    option,
    output_option,
    read_values,
    tell_narrowing,
)
from gpsfsm.streams import check_writable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_NO_PATH = """no plan is given; name a file, a folder, or - for standard input. Example:
  gpsfsm grade --task task.yaml answers/"""
_SETTINGS = [name for name in SETTINGS if name not in {*NO_EFFECT["grade"], "fail_on"}]


def _table_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options about the table, and where it goes."""
    options = (
        declare_file("--task", required=True, common=True, help="Task file."),
        declare(
            *("--table", "--format", "table"),
            type=click.Choice(["text", "csv", "md", "json", "jsonl"]),
            default="text",
            show_default=True,
            common=True,
            help="Output format.",
        ),
        declare_file(
            "--labels", common=True, help="CSV of human grades (path, grade) to compare with."
        ),
        declare(
            "--by",
            metavar="COLUMNS",
            common=True,
            help="One row per group: folder, or columns of the labels.",
        ),
        jobs_option("Grade"),
        field_option(),
        output_option(),
    )
    return apply(options, command, "Grades")


@dataclass(frozen=True, kw_only=True)
class GradeCommand(CheckValues):
    """The options of ``gpsfsm grade``."""

    paths: Sequence[str]
    task: str
    table: str
    labels: str | None
    by: str | None
    jobs: int | str
    field: str | None
    output_file: str


@click.command(
    "grade", cls=Command, section=Section.GENERATE, short_help="Grade language models' answers."
)
@click.argument("paths", nargs=-1, metavar="PATH…", type=ANY_PATH)
@_table_options
@option("assume")
@option("consistent")
@option("faults")
@library_options
@option("solver")
@option("rlimit")
@limit_options
@idle_options("grade")
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Grade the answers in PATH…: files, folders (all *.xml in them), or - for standard input.

    \b
    success  reads as a plan, and the plan fulfils the task in every scenario
    partial  only one of the two
    failed   neither, or there is no plan, or it is the example of the prompt

    Exit code: 0 every answer has its grade, 2 one could not be read or decided.

    \b
    Example:
      gpsfsm grade --task task.yaml answers/ --table csv --labels labels.csv
      gpsfsm grade --task task.yaml answers/ --by folder
    """
    values = read_values(context, GradeCommand, ["jobs", *_SETTINGS])
    tell_narrowing(values)
    if not all(values.paths) or not values.paths:  # "" was a variable without a value
        raise click.UsageError(_NO_PATH, context)
    return _run(values)


def _run(values: GradeCommand) -> int:
    from gpsfsm.checking.inputs import find_inputs
    from gpsfsm.grading.grade_tables import GradeTable, columns_of, streamed, write_grades
    from gpsfsm.grading.grader import Grade, grade_inputs
    from gpsfsm.grading.labels import load_labels
    from gpsfsm.progress import MANY, counted, progress_bar
    from gpsfsm.tasks.load import load_task

    task, options = load_task(values.task), values.options()
    labels = None if values.labels is None else load_labels(values.labels)
    columns = columns_of(values.by, labels, values.table)
    inputs = list(find_inputs(values.paths, values.field))
    check_writable(values.output_file, [each.file for each in inputs if not each.stdin])
    with progress_bar("grading", len(inputs), at_least=MANY) as progress:
        grading = grade_inputs(inputs, task, options, jobs=values.jobs)
        grading = streamed(grading, labels, values.table, values.output_file)
        grades = list(counted(grading, len(inputs), progress))
    write_grades(GradeTable(grades, labels, columns), values.table, values.output_file)
    return 2 if not grades or any(one.grade is Grade.UNDECIDED for one in grades) else 0
