"""``gpsfsm capabilities``: what is known about runners, and whether capability files are right."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import ANY_PATH, CommandGroup, Section, declare
from gpsfsm.cli._options import apply, folders_option, format_option
from gpsfsm.cli._running import ros_option
from gpsfsm.streams import Form, complain, terminal_width, write_text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.capabilities.load import Loaded

_MAX_WIDTH = 100
_FORMAT_VERSION = 1

_format = format_option("text", "json", text="Output format.")
_no_builtin = declare(
    "--no-builtin",
    "--no-builtin-capabilities",
    "no_builtin",
    is_flag=True,
    help="Leave out the built-in capabilities.",
)


def _library_options(command: Callable[..., Any]) -> Callable[..., Any]:
    return apply((folders_option("folders"), _no_builtin, _format), command)


@click.group(
    "capabilities",
    cls=CommandGroup,
    section=Section.MAINTAIN,
    short_help="List, show and check capabilities.",
)
def command() -> None:
    r"""List, show and check capabilities: parameters, inputs, outputs and effects of runners.

    \b
    Example:
      gpsfsm capabilities show WaypointRunner
    """


@command.command("list", short_help="List all interfaces.")
@_library_options
def _list(folders: Sequence[str], no_builtin: bool, output_format: str) -> int:
    r"""List all interfaces with their providers.

    \b
    Example:
      gpsfsm capabilities list --capabilities my_robot
    """
    library = _library(folders, no_builtin)
    from gpsfsm.capabilities.describe import list_data, list_lines

    if output_format == "json":
        write_text(_json({"capabilities": list_data(library)}), form=Form.JSON)
    else:
        write_text("".join(f"{line}\n" for line in list_lines(library)))
    if not library.interfaces:
        complain("there is no capability: the built-in ones are left out, and no others are named")
        return 2
    return 0


@command.command("show", short_help="Show a capability.")
@click.argument("name")
@_library_options
def _show(name: str, folders: Sequence[str], no_builtin: bool, output_format: str) -> int:
    r"""Show the interface or provider NAME, and how a plan writes it.

    NAME may be one of another dialect, and may lack its package if there is only one.

    \b
    Example:
      gpsfsm capabilities show WaypointRunner
    """
    library = _library(folders, no_builtin)
    from gpsfsm.capabilities.describe import find, show_data, show_lines

    entry = find(library, name)
    if output_format == "json":
        write_text(_json(show_data(entry)), form=Form.JSON)
    else:
        width = min(terminal_width() or _MAX_WIDTH, _MAX_WIDTH)
        write_text("".join(f"{line}\n" for line in show_lines(entry, width)))
    return 0


@command.command("check", short_help="Check capability files.")
@click.argument("folders", nargs=-1, required=True, metavar="DIR...", type=ANY_PATH)
@declare(
    "--fail-on",
    type=click.Choice(["error", "warning"]),
    default="error",
    show_default=True,
    help="Lowest severity that makes the exit code 1.",
)
@_no_builtin
@_format
def _check(folders: Sequence[str], fail_on: str, no_builtin: bool, output_format: str) -> int:
    r"""Check the capability files below the folders DIR, or single files.

    Exit code: 0 nothing found, 1 defects, 2 no capability could be read.

    \b
    Example:
      gpsfsm capabilities check my_robot --fail-on warning
    """
    loaded = _load(folders, no_builtin)
    library = loaded.library
    errors = sum(defect.severity == "error" for defect in loaded.defects)
    counts = {
        "files": loaded.files,
        "interfaces": len(library.interfaces),
        "providers": len(library.providers),
        "semantic_interfaces": len(library.semantic),
        "errors": errors,
        "warnings": len(loaded.defects) - errors,
    }
    if output_format == "json":
        write_text(
            _json({**counts, "defects": [_defect(each) for each in loaded.defects]}), form=Form.JSON
        )
    else:
        lines = [*map(str, loaded.defects), _summary(counts)]
        write_text("".join(f"{line}\n" for line in lines))
    if not (library.interfaces or library.providers or library.semantic):
        return 2
    return 1 if errors or (fail_on == "warning" and loaded.defects) else 0


@command.command("pull", short_help="Save what a robot offers as files.")
@declare(
    "-o",
    "--output",
    metavar="FOLDER",
    type=ANY_PATH,
    default="robot",
    show_default=True,
    help="Folder for the capability files and robot.yaml.",
)
@declare("--name", default="", metavar="NAME", help="Name of the robot. [default: FOLDER]")
@declare("--force", is_flag=True, help="Overwrite files in the folder.")
@ros_option
def _pull(output: str, name: str, force: bool, ros_args: Sequence[str]) -> int:
    """Save what the capability server of a robot offers.

    The folder gets a robot profile, robot.yaml, and files for capabilities that are not built in.
    With --robot FOLDER/robot.yaml a plan runs on the robot's own runners.

    Exit code: 0 everything written, 1 some of it does not fit and is listed, 2 no server.

    Example: gpsfsm capabilities pull -o my_robot
    """
    from gpsfsm.ros.pull import pull_into

    written, problems = pull_into(output, name, ros_args, force=force)
    for problem in problems:
        complain(problem)
    if written:
        write_text(f"{written}\n")
    return 1 if problems else 0


def _library(folders: Sequence[str], no_builtin: bool) -> Library:
    """The library that the options ask for; says so if there are defects in the files."""
    from gpsfsm.capabilities.library import Library
    from gpsfsm.capabilities.table import builtin

    library = Library() if no_builtin else builtin()
    if not folders:
        return library
    loaded = _load(folders, no_builtin)
    errors = [defect for defect in loaded.defects if defect.severity == "error"]
    if errors:
        count = "1 error" if len(errors) == 1 else f"{len(errors)} errors"
        complain(f"the capability files have {count}; 'gpsfsm capabilities check' lists them")
    return library.extended(loaded.library)


def _load(folders: Sequence[str], no_builtin: bool) -> Loaded:
    from gpsfsm.capabilities.library import Library
    from gpsfsm.capabilities.load import load_directories
    from gpsfsm.capabilities.table import builtin

    return load_directories(folders, base=Library() if no_builtin else builtin())


def _defect(defect: Any) -> dict[str, Any]:
    return {
        "file": defect.file,
        "line": defect.line,
        "column": defect.column,
        "severity": defect.severity.value,
        "message": defect.message,
        "hint": defect.hint,
    }


def _summary(counts: dict[str, int]) -> str:
    def many(key: str) -> str:
        word = key.replace("_", " ")
        return f"{counts[key]} {word.removesuffix('s') if counts[key] == 1 else word}"

    counted = ", ".join(many(key) for key in ("interfaces", "providers", "semantic_interfaces"))
    return f"{many('files')}: {counted}; {many('errors')}, {many('warnings')}"


def _json(data: dict[str, Any]) -> str:
    return json.dumps({"version": _FORMAT_VERSION, **data}, indent=2) + "\n"
