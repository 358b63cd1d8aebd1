"""``gpsfsm port``: rewrite a plan so that an original engine does what the paper says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import click

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.cli._options import (
    LIMITS,
    LibraryValues,
    LimitValues,
    config_options,
    library_options,
    limit_options,
    output_option,
    read_values,
    tell_narrowing,
)
from gpsfsm.errors import UsageError
from gpsfsm.model.story import ENGINES, PAPER_ENGINE
from gpsfsm.streams import STDOUT, check_writable, to_stderr

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.porting import Change, Ported

_NO_PATH = """no plan is given; name a file, or - for standard input. Example:
  gpsfsm port plan.xml --to fabric-v2"""
_TARGETS = [name for name in ENGINES if name != PAPER_ENGINE]
_SETTINGS = frozenset({*LIMITS, "capabilities", "builtin_capabilities", "robot"})
_PORTED = "the ported plan"
_MOST_CHARACTERS = 200
_MAX_LISTED = 50


@dataclass(frozen=True, kw_only=True)
class PortCommand(LimitValues, LibraryValues):
    """The options of ``gpsfsm port``."""

    path: str | None
    engine: str
    unsafe: bool
    diff: bool
    check: bool
    output_file: str


@click.command(
    "port", cls=Command, section=Section.MEND, short_help="Rewrite a plan for an original engine."
)
@click.argument("path", required=False, metavar="PATH", type=ANY_PATH)
@declare(
    "--to", "engine", type=click.Choice(_TARGETS), required=True, common=True, help="Target engine."
)
@declare(
    "--unsafe", is_flag=True, common=True, help="Write the closest plan if none is equivalent."
)
@declare("--diff", is_flag=True, common=True, help="Show what would change; write nothing.")
@declare(
    "--check", is_flag=True, common=True, help="Report by exit code alone whether it would change."
)
@output_option()
@library_options
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Rewrite the plan in PATH so that an engine runs it as the paper specifies.

    The new plan is proved equivalent for all outcomes. If no such plan exists, gpsfsm reports what
    would be lost and writes nothing, unless --unsafe is given.

    Exit code: 0 written, 1 the engine cannot do the same (or --diff or --check
    finds a change), 2 the plan could not be read, decided or written.

    \b
    Examples:
      gpsfsm port plan.xml --to fabric-v2 -o ported.xml
      gpsfsm port plan.xml --to fabric-v2 --unsafe --diff
    """
    values = read_values(context, PortCommand, _SETTINGS)
    tell_narrowing(values)
    if not values.path:
        raise click.UsageError(_NO_PATH, context)
    if (values.diff or values.check) and values.output_file != STDOUT:
        raise UsageError("--output cannot be combined with --diff or --check, which write no plan")
    check_writable(values.output_file, [values.path])
    return _run(values.path, values)


def _run(path: str, values: PortCommand) -> int:
    from gpsfsm.checking.inputs import read_named
    from gpsfsm.fixing.files import show_difference, write_plan
    from gpsfsm.porting import UnclearError, port
    from gpsfsm.report import tell_errors

    limits, engine = values.limits, values.engine
    name, data = read_named(path, limits.max_bytes)
    try:
        ported = port(
            *(data, engine),
            file=name,
            capabilities=values.library,
            limits=limits,
            unsafe=values.unsafe,
        )
    except UnclearError as error:
        tell_errors(error.parsed)
        raise
    to_stderr("".join(line + "\n" for line in _lines(ported, name, values)))
    if ported.text is None:
        return 1
    if values.diff and ported.changed:
        show_difference(ported.original, ported.text, name)
    if values.diff or values.check:
        return int(ported.changed)
    result = ported.text.encode() if ported.changed else data
    write_plan(result, ported.text, values.output_file)
    return 0


def _lines(ported: Ported, file: str, values: PortCommand) -> Iterator[str]:
    """The changes and the losses, one line each."""
    from gpsfsm.model.printable import clip, printable

    name, engine = clip(file, _MOST_CHARACTERS), values.engine
    for loss in ported.losses[:_MAX_LISTED]:
        place = f"{name}:{loss.line}:{loss.column}"
        yield printable(f"{place}: lost on {engine}: {loss.lost}")
        if loss.instead:
            how = "instead" if ported.text is not None else "with --unsafe"
            yield printable(f"  {how}: {loss.instead}")
        else:
            yield "  --unsafe does not help here: change the plan"
    if len(ported.losses) > _MAX_LISTED:
        yield f"{name}: and {len(ported.losses) - _MAX_LISTED:,} more losses"
    if ported.text is None:
        yield f"{name}: {engine} cannot run this plan as the paper specifies; nothing is written"
        return
    for note in ported.notes[:_MAX_LISTED]:
        yield printable(f"{name}:{note.line}:{note.column}: note: {note.text}")
    if len(ported.notes) > _MAX_LISTED:
        yield f"{name}: and {len(ported.notes) - _MAX_LISTED:,} more notes"
    if ported.change is not None:
        yield from _changes(ported.change, name, engine)
    elif not ported.changed:
        yield f"{name}: {engine} runs this plan as the paper specifies; no change is needed"
    else:
        would = "would be " if values.diff or values.check else ""
        yield f"{name}: {would}rewritten for {engine}; proved to behave the same there"


def _changes(change: Change, name: str, engine: str) -> Iterator[str]:
    """The first scenario in which the unsafe plan does something else."""
    from gpsfsm.equivalence.difference_text import difference_lines

    if change.difference is None:
        within = "" if change.decided else " within the limits"
        yield f"{name}: no scenario was found{within} in which the ported plan differs"
        return
    ported = replace(change.ported, file=_PORTED)
    which = "the first scenario" if change.difference.shortest else "a scenario"
    yield f"{name}: {_PORTED} is NOT equivalent; {which} that shows it:"
    yield from difference_lines(change.original, ported, change.difference)
    yield f"  (where a plan gives up according to the paper, it hangs on {engine})"
