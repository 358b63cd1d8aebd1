"""``gpsfsm show``: a plan and its automaton as a tree, a picture or data."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._options import LIMITS, config_options, limit_options, limits_of, settle
from gpsfsm.cli._reading import read_plan, tell_errors
from gpsfsm.cli._streams import (
    STDOUT,
    check_writable,
    complain,
    write_text,
)
from gpsfsm.errors import GpsfsmError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Plan

__all__ = ["COMMAND"]

_NO_PATH = """no plan is given; name a file, or - for standard input. Example:
  gpsfsm show plan.xml"""
_DOT_TIMEOUT_S = 60
_NO_DOT = """format svg needs the program 'dot' of Graphviz, which is not installed.
Install it (Debian, Ubuntu: apt install graphviz; macOS: brew install graphviz),
or use --format dot or --format mermaid."""


@click.command("show", short_help="Draw a plan.")
@click.argument("path", required=False, metavar="PATH", type=click.Path(allow_dash=True))
@click.option(
    "--format",
    type=click.Choice(["tree", "dot", "mermaid", "svg", "json"]),
    default="tree",
    show_default=True,
    help="tree: the plan; the others: its automaton.",
)
@click.option(
    "--output-file",
    default=STDOUT,
    metavar="FILE",
    type=click.Path(),
    help="Write to this file instead of standard output.",
)
@click.option(
    "--from-response/--no-from-response",
    help="The text is a language model's raw answer: take the last plan in it.",
)
@limit_options
@config_options
@click.pass_context
def COMMAND(context: click.Context, /, **_: object) -> int:  # noqa: N802  (it is an object)
    """Draw the plan in PATH, or in standard input for -.

    \b
    Exit code: 0 drawn, 1 the text has errors (it is drawn if it holds a plan), 2 not possible.

    \b
    Example:
      gpsfsm show plan.xml --format svg --output-file plan.svg
    """  # noqa: D301  (click wants the \b)
    values = settle(context, only={*LIMITS, "from_response"})
    if not values["path"]:
        raise click.UsageError(_NO_PATH, context)
    check_writable(values["output_file"], [values["path"]])
    return _run(values)


def _run(values: Mapping[str, Any]) -> int:
    parsed = read_plan(values["path"], limits_of(values), from_response=values["from_response"])
    code = tell_errors(parsed)
    if parsed.plan is None:
        complain(f"{parsed.file}: there is no plan that could be drawn")
        return max(code, 1)
    write_text(_DRAWINGS[values["format"]](parsed.plan), values["output_file"])
    return code


def _automaton(plan: Plan) -> Automaton:
    from gpsfsm.compile import compile_plan  # noqa: PLC0415

    return compile_plan(plan).automaton


def _tree(plan: Plan) -> str:
    from gpsfsm.model.drawing import plan_to_tree  # noqa: PLC0415

    return plan_to_tree(plan)


def _svg(plan: Plan) -> str:
    """Let Graphviz draw; no shell, no files, and not for ever."""
    import subprocess  # noqa: PLC0415  (slow to import; only svg needs it)

    program = shutil.which("dot")
    if program is None:
        raise GpsfsmError(_NO_DOT)
    try:
        done = subprocess.run(  # noqa: S603  (a fixed command; the plan is its input only)
            [program, "-Tsvg"],
            input=_automaton(plan).to_dot().encode("utf-8", "backslashreplace"),
            capture_output=True,
            timeout=_DOT_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise GpsfsmError(
            f"Graphviz has not drawn the plan within {_DOT_TIMEOUT_S} s; it may be too large. "
            "--format dot writes what it was given"
        ) from error
    except OSError as error:
        raise GpsfsmError(f"{program} cannot be run: {error.strerror or error}") from error
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "replace").strip() or f"exit code {done.returncode}"
        raise GpsfsmError(f"{program} has failed: {said[:500]}")
    return done.stdout.decode("utf-8", "replace")


_DRAWINGS: Mapping[str, Callable[[Plan], str]] = {
    "tree": _tree,
    "dot": lambda plan: _automaton(plan).to_dot(),
    "mermaid": lambda plan: _automaton(plan).to_mermaid(),
    "svg": _svg,
    "json": lambda plan: _automaton(plan).to_json(),
}
