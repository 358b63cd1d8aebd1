"""``gpsfsm grammar``: the plan language as a grammar or schema for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from gpsfsm.cli._help import Command, Section, declare
from gpsfsm.cli._options import Values, folders_option, option, output_option, read_values
from gpsfsm.streams import Form, check_writable, complain, write_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.grammars import Alphabet, Format

_FORMATS = ("gbnf", "json-schema", "lark", "rnc", "rng", "xsd")
_DEPTH = 6
_MAX_DEPTH = 32
_MOST_LINES = 5


@dataclass(frozen=True, kw_only=True)
class GrammarCommand(Values):
    """The options of ``gpsfsm grammar``."""

    format: str
    folders: Sequence[str]
    no_builtin_capabilities: bool
    robot: str | None
    only: Sequence[str]
    depth: int | None
    output_file: str


@click.command(
    "grammar", cls=Command, section=Section.GENERATE, short_help="Write the grammar of plans."
)
@declare(
    "--format",
    type=click.Choice(_FORMATS),  # repeated here so that --help need not load them
    required=True,
    help="gbnf, lark and json-schema constrain a language model; rnc, rng and xsd are for editors.",
)
@folders_option("folders")
@declare("--no-builtin-capabilities", is_flag=True, help="Leave out the built-in capabilities.")
@option("robot")
@declare(
    "--interface",
    "only",
    multiple=True,
    metavar="GLOB",
    help="Allow only these interfaces, such as 'nav2_capabilities/*'; may be repeated.",
)
@declare(
    "--depth",
    type=click.IntRange(1, _MAX_DEPTH),
    metavar="N",
    help=f"Maximum nesting depth; 1 allows runners only. [default: {_DEPTH}]",
)
@output_option()
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Write the grammar of plans.

    The formats gbnf (llama.cpp, vLLM, SGLang), lark (OpenAI) and json-schema (Ollama and others)
    are made from the capabilities: a model constrained by one can write only well-formed plans with
    declared runners and parameters of the right types. The schemas rnc, rng and xsd describe every
    plan, whatever the capabilities.

    \b
    Example:
      gpsfsm grammar --format gbnf --interface 'nav2_capabilities/*'
    """
    values = read_values(context, GrammarCommand)
    check_writable(values.output_file, ())
    from gpsfsm.grammars import find_format

    grammar = find_format(values.format)
    if grammar.fixed is not None:
        _refuse_choices(context, grammar)
        write_text(grammar.fixed(), values.output_file, form=Form.EXACT)
        return 0
    assert grammar.emit is not None
    words = _words(values)
    depth = _DEPTH if values.depth is None else values.depth
    write_text(grammar.emit(words, depth), values.output_file, form=Form.EXACT)
    return 0


def _refuse_choices(context: click.Context, grammar: Format) -> None:
    names = {
        "folders": "--capabilities",
        "no_builtin_capabilities": "--no-builtin-capabilities",
        "only": "--interface",
        "depth": "--depth",
    }
    flags = [name for key, name in names.items() if context.params[key]]
    if flags:
        raise click.UsageError(
            f"{flags[0]} has no effect on {grammar.name}, which describes every plan; "
            "use --format gbnf, lark or json-schema",
            context,
        )


def _words(values: GrammarCommand) -> Alphabet:
    """The runners that the options ask for; says which cannot be allowed."""
    from gpsfsm.capabilities.library import choose_capabilities
    from gpsfsm.grammars import alphabet

    only: Sequence[str] = values.only
    chosen = choose_capabilities(
        values.folders, builtin=not values.no_builtin_capabilities, robot=values.robot
    )
    if chosen.defects:
        count = "1 error" if len(chosen.defects) == 1 else f"{len(chosen.defects)} errors"
        complain(f"the capability files have {count}; 'gpsfsm capabilities check' lists them")
    words = alphabet(chosen.library, only or None)
    if values.folders or only:  # of the built-in library it is known
        _tell_left_out(words)
    return words


def _tell_left_out(words: Alphabet) -> None:
    from gpsfsm.model.printable import clip

    for each in words.left_out[:_MOST_LINES]:
        complain(f"{clip(each.name, 200)} is left out: {each.why}")
    more = len(words.left_out) - _MOST_LINES
    if more > 0:
        complain(f"{more} more are left out")
