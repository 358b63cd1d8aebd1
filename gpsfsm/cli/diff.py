"""``gpsfsm diff``: whether two plans do the same, or where they differ."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.cli._options import (
    LIMITS,
    LimitValues,
    NumberRange,
    config_options,
    format_option,
    limit_options,
    option,
    output_option,
    read_values,
    tell_narrowing,
)
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.streams import check_writable, complain, form_of, write_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.equivalence import Difference
    from gpsfsm.model.plan import Plan

_NO_PATHS = """two plans are needed; name two files, or one and - for standard input. Example:
  gpsfsm diff a.xml b.xml"""
_EQUAL, _DIFFERENT = 0, 1


@dataclass(frozen=True, kw_only=True)
class DiffCommand(LimitValues):
    """The options of ``gpsfsm diff``."""

    first: str | None
    second: str | None
    output_format: str
    assume: Sequence[str]
    consistent: bool
    tolerance: float
    from_response: bool
    output_file: str


@click.command(
    "diff", cls=Command, section=Section.CHECK, short_help="Compare the behaviour of two plans."
)
@click.argument("first", required=False, metavar="PATH", type=ANY_PATH)
@click.argument("second", required=False, metavar="PATH", type=ANY_PATH)
@format_option("text", "json", text="Output format.")
@option("assume", help="Assume this in both plans, such as 'never fails: SpeechRunner'.")
@option("consistent", help="Assume that equal actions have equal outcomes.")
@declare(
    "--tolerance",
    type=NumberRange(min=0.0),
    default=0.0,
    metavar="NUMBER",
    common=True,
    help="Treat numbers that differ by at most this as equal. [default: 0]",
)
@option("from_response", help="The texts are raw answers of a model: take the last plan in each.")
@output_option()
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Compare the behaviour of two plans; show the first scenario in which they differ.

    Names, layout, providers and the order of parallel units do not matter. Machines can be compared
    too.

    Exit code: 0 equivalent, 1 different, 2 undecided or not readable.

    \b
    Examples:
      gpsfsm diff a.xml b.xml
      gpsfsm diff --tolerance 0.01 --format json a.xml b.xml
    """
    values = read_values(context, DiffCommand, {*LIMITS, "from_response", "consistent", "assume"})
    tell_narrowing(values)
    paths = [path for path in (values.first, values.second) if path]
    if len(paths) < 2:
        raise click.UsageError(_NO_PATHS, context)
    if paths == ["-", "-"]:
        raise UsageError("only one of the plans can be standard input")
    check_writable(values.output_file, paths)
    return _run(paths, values)


def _run(paths: list[str], values: DiffCommand) -> int:
    from gpsfsm.checking.approximations import tell_over_approximated
    from gpsfsm.checking.inputs import parse_named
    from gpsfsm.report import tell_errors

    limits = values.limits
    parsed = [parse_named(path, limits, from_response=values.from_response) for path in paths]
    if wrong := [each for each in parsed if tell_errors(each) or each.plan is None]:
        raise GpsfsmError(
            f"{wrong[0].file}: the text has errors, so the plan is ambiguous; fix them first "
            "('gpsfsm fix' may help)"
        )
    plans = [each.plan for each in parsed if each.plan is not None]
    tell_over_approximated("compared is what was read, which allows more than the file", *plans)
    from gpsfsm.equivalence import compare

    difference = compare(
        *plans,
        consistent=values.consistent,
        assumptions=values.assume,
        tolerance=values.tolerance,
        second_opinion=True,
    )
    _tell_unmatched(plans, values.assume)
    if values.output_format == "json":
        text = _json(plans[0], plans[1], difference)
    else:
        restricted = bool(values.assume or values.consistent)
        text = _text(plans[0], plans[1], difference, restricted=restricted)
    write_text(text, values.output_file, form=form_of(values.output_format))
    return _EQUAL if difference is None else _DIFFERENT


def _tell_unmatched(plans: list[Plan], assumptions: Sequence[str]) -> None:
    """Say what no plan has: a misspelt name would otherwise pass as an assumption that holds."""
    if not assumptions:
        return
    from gpsfsm.analysis.constraints import constraints_of
    from gpsfsm.model.printable import clip

    first, second = (constraints_of(plan, assumptions=assumptions).unmatched for plan in plans)
    for text in first:
        if text in second:
            complain(f"the assumption matches no runner of either plan: {clip(text, 200)}")


def _text(first: Plan, second: Plan, difference: Difference | None, *, restricted: bool) -> str:
    from gpsfsm.equivalence.difference_text import difference_lines
    from gpsfsm.model.printable import clip

    names = f"{clip(first.file, 200)} and {clip(second.file, 200)}"
    if difference is None:
        which = " that the options admit" if restricted else ""
        return f"{names} do the same in every scenario{which}\n"
    which = "the first scenario" if difference.shortest else "a scenario (perhaps not the shortest)"
    lines = [
        f"{names} differ; {which} that shows it:",
        *difference_lines(first, second, difference),
    ]
    return "\n".join(lines) + "\n"


def _json(first: Plan, second: Plan, difference: Difference | None) -> str:
    from gpsfsm.equivalence.difference_text import comparison_as_data

    data = comparison_as_data(first, second, difference)
    return json.dumps(data, ensure_ascii=True, indent=2) + "\n"
