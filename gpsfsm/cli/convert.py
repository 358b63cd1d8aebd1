"""``gpsfsm convert``: a plan, behaviour tree or machine in another format."""

from __future__ import annotations

from dataclasses import dataclass

import click

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.cli._options import (
    LIMITS,
    LimitValues,
    config_options,
    limit_options,
    output_option,
    read_values,
    response_option,
)
from gpsfsm.errors import GpsfsmError
from gpsfsm.streams import check_writable, complain, form_of, write_text

_NO_PATH = """nothing to convert is given; name a file, or - for standard input. Example:
  gpsfsm convert tree.xml --to plan"""
_PROVED = ("plan", "tree", "scxml", "yasmin")  # as the registry has them, which loads more
_DRAWN = ("graphml", "json", "mermaid", "dot")


@dataclass(frozen=True, kw_only=True)
class ConvertCommand(LimitValues):
    """The options of ``gpsfsm convert``."""

    path: str
    to: str
    from_response: bool
    output_file: str


_HELP = """Write the plan, behaviour tree or machine in PATH in another format.

The result is read again and proved equivalent to the original. If the format cannot express a node,
gpsfsm names the node and writes nothing.

Exit code: 0 written, 1 the text has errors or the format cannot express it,
2 undecided, or the file cannot be read.

\b
Example:
  gpsfsm convert tree.xml --to plan -o plan.xml
"""


@click.command(
    "convert",
    cls=Command,
    section=Section.MEND,
    short_help="Write a plan, tree or machine in another format.",
    help=_HELP,
)
@click.argument("path", required=False, metavar="PATH", type=ANY_PATH)
@declare(
    "--to",
    required=True,
    metavar="FORMAT",
    common=True,
    help=f"{', '.join(_PROVED)}: proved to do the same; {', '.join(_DRAWN)}: the automaton.",
)
@output_option()
@response_option
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    """Write a plan, tree or machine in another format."""
    if not context.params["path"]:
        raise click.UsageError(_NO_PATH, context)
    values = read_values(context, ConvertCommand, {*LIMITS, "from_response"})
    check_writable(values.output_file, [values.path])
    return _run(values)


def _run(values: ConvertCommand) -> int:
    from gpsfsm.checking.approximations import tell_over_approximated
    from gpsfsm.checking.inputs import parse_named
    from gpsfsm.report import tell_errors

    parsed = parse_named(values.path, values.limits, from_response=values.from_response)
    if (code := tell_errors(parsed)) or parsed.plan is None:
        complain(f"{parsed.file}: the text has errors; fix them first")
        return code or 1
    tell_over_approximated("over-approximated here, and certain in what is written", parsed.plan)
    if values.to in _DRAWN:
        from gpsfsm.cli.show import DRAWINGS
        from gpsfsm.compile import compile_plan

        drawn = DRAWINGS[values.to](compile_plan(parsed.plan).automaton)
        write_text(drawn, values.output_file, form=form_of(values.to))
        return 0
    from gpsfsm.compile.formats import CannotSayError
    from gpsfsm.equivalence import convert_plan

    try:
        text = convert_plan(parsed.plan, values.to)
    except CannotSayError as error:
        path, elements = parsed.plan.path, parsed.plan.elements
        place = next((each for each in elements if path(each) == error.path), elements[0])
        where = f"{place.file or parsed.file}:{place.line}"
        complain(f"{where}: {values.to} cannot express {error.path}: {error.why}")
        return 1
    except GpsfsmError as error:
        raise GpsfsmError(f"{parsed.file}: not converted: {error}") from error
    write_text(text, values.output_file, form=form_of("graphml"))
    complain(f"{parsed.file}: written as {values.to}, proved to be equivalent")
    return 0
