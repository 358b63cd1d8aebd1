"""``gpsfsm show``: a plan and its automaton as a tree, a picture or data."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

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
from gpsfsm.errors import UsageError
from gpsfsm.streams import Form, check_writable, complain, form_of, write_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.compile.engine_text import EngineText
    from gpsfsm.model.automaton import Automaton

_NO_PATH = """no plan is given; name a file, or - for standard input. Example:
  gpsfsm show plan.xml"""
_PAPER = "paper"
# repeated here so that --help need not load the compiler
ENGINES = ("fabric-v1", "fabric-v2", "fabric-v3")


@dataclass(frozen=True, kw_only=True)
class ShowCommand(LimitValues):
    """The options of ``gpsfsm show``."""

    path: str
    format: str
    engine: str
    all_stops: bool
    from_response: bool
    output_file: str


@click.command(
    "show", cls=Command, section=Section.CHECK, short_help="Draw a plan or its automaton."
)
@click.argument("path", required=False, metavar="PATH", type=ANY_PATH)
@declare(
    "--format",
    type=click.Choice(["tree", "dot", "mermaid", "svg", "json", "graphml", "connections"]),
    default="tree",
    show_default=True,
    common=True,
    help="tree: the plan; connections: the engine's; others: the automaton.",
)
@declare(
    "--engine",
    type=click.Choice((_PAPER, *ENGINES)),
    default=_PAPER,
    show_default=True,
    common=True,
    help="Show the plan as this engine builds it.",
)
@declare("--all-stops", is_flag=True, help="svg: draw all stops, even if they are many.")
@output_option()
@response_option
@limit_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Draw the plan, behaviour tree or machine in PATH, or - for standard input.

    With --engine, draw what an original engine makes of it.

    Exit code: 0 drawn, 1 the text has errors (it is drawn if it holds a plan)
    or the engine rejects it, 2 not possible.

    \b
    Example:
      gpsfsm show plan.xml --format svg -o plan.svg
    """
    if not context.params["path"]:
        raise click.UsageError(_NO_PATH, context)
    values = read_values(context, ShowCommand, {*LIMITS, "from_response"})
    check_writable(values.output_file, [values.path])
    _check_options(values)
    return _run(values) if values.engine == _PAPER else _on_engine(values)


def _check_options(values: ShowCommand) -> None:
    """Raise UsageError for options that do not fit together."""
    if values.format == "connections" and values.engine == _PAPER:
        raise UsageError(f"--format connections needs --engine, which is {' or '.join(ENGINES)}")
    if values.all_stops and values.format != "svg":
        raise UsageError("--all-stops needs --format svg: all other formats hold every stop")
    if values.engine != _PAPER and values.from_response:
        raise UsageError("--from-response does not fit --engine, which reads the text as it is")


def _on_engine(values: ShowCommand) -> int:
    """Write what an engine makes of the text; say where it refuses it."""
    from gpsfsm.checking.inputs import read_named
    from gpsfsm.model.engine import Crashed, EnginePlan
    from gpsfsm.model.printable import printable

    name, text = read_named(values.path, values.limits.max_bytes)
    show = _connections if values.format == "connections" else _engine_automaton
    reading = show(values, name, text)
    if reading is None or isinstance(reading.result, EnginePlan):
        return 0
    what = "crashes on" if isinstance(reading.result, Crashed) else "refuses"
    place = f"{printable(name)}:{reading.line}:{reading.column}"
    complain(f"{place}: {values.engine} {what} this text: {printable(reading.result.reason)}")
    return 1


def _connections(values: ShowCommand, name: str, text: bytes) -> EngineText:
    from gpsfsm.compile.engine_text import read_connections
    from gpsfsm.compile.fabric import PROFILES, listing

    reading = read_connections(text, values.engine, file=name, limits=values.limits)
    data = listing(reading.result, PROFILES[values.engine])
    write_text(json.dumps(data, indent=2) + "\n", values.output_file, form=Form.JSON)
    return reading


def _engine_automaton(values: ShowCommand, name: str, text: bytes) -> EngineText | None:
    """Draw the engine's automaton; gives back what it makes of a text that it refuses."""
    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile.engine_text import EngineReading, read_for_engine

    reading = read_for_engine(text, values.engine, name, Library(), values.limits)
    if not isinstance(reading, EngineReading):
        return reading
    _draw(values, reading.compiled.automaton)
    return None


def _run(values: ShowCommand) -> int:
    from gpsfsm.checking.inputs import parse_named
    from gpsfsm.compile import compile_plan
    from gpsfsm.report import tell_errors

    parsed = parse_named(values.path, values.limits, from_response=values.from_response)
    code = tell_errors(parsed)
    if parsed.plan is None:
        complain(f"{parsed.file}: there is no plan that could be drawn")
        return max(code, 1)
    _draw(values, compile_plan(parsed.plan).automaton)
    return code


def _draw(values: ShowCommand, automaton: Automaton) -> None:
    draw = partial(_svg, all_stops=True) if values.all_stops else DRAWINGS[values.format]
    write_text(draw(automaton), values.output_file, form=form_of(values.format))


def _tree(automaton: Automaton) -> str:
    from gpsfsm.model.drawing import machine_to_text, plan_to_tree
    from gpsfsm.model.labels import is_machine

    return machine_to_text(automaton) if is_machine(automaton) else plan_to_tree(automaton.plan)


def _svg(automaton: Automaton, *, all_stops: bool = False) -> str:
    from gpsfsm.picture import automaton_to_svg

    return automaton_to_svg(automaton, all_stops=all_stops)


def _graphml(automaton: Automaton) -> str:
    from gpsfsm.compile.machine_files import automaton_to_graphml

    return automaton_to_graphml(automaton)


DRAWINGS: Mapping[str, Callable[[Automaton], str]] = {
    "tree": _tree,
    "dot": lambda automaton: automaton.to_dot(),
    "mermaid": lambda automaton: automaton.to_mermaid(),
    "svg": _svg,
    "json": lambda automaton: automaton.to_json(),
    "graphml": _graphml,
}
