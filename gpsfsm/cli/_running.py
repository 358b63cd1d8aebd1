"""Options of the commands that run plans: when one gives up, what runners reach, and the log."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import declare, declare_file
from gpsfsm.cli._model import ModelValues, task_of
from gpsfsm.cli._options import NumberRange, Values, apply, words
from gpsfsm.errors import UsageError
from gpsfsm.late import dataclass
from gpsfsm.logs import FORMATS, LEVELS, Format, Level
from gpsfsm.model.ros import VIA
from gpsfsm.running.bounds import (
    ATTEMPTS,
    MOST_ATTEMPTS,
    MOST_REGENERATIONS,
    MOST_S,
    REGENERATE_FOR_S,
    REGENERATIONS,
)

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.execution.records import RunValue
    from gpsfsm.generation.providers import ModelSettings

_NEED_MODEL = ("task", "task_file", "regenerations", "regenerate_for", "attempts")


def regeneration_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about the task, and about how often and how long a model may be asked."""
    options = (
        declare(
            "--task",
            metavar="TEXT",
            help="Task of the plan, sent to the model if it gives up. [default: the plan itself]",
        ),
        declare_file("--task-file", help="Read the task from this text file."),
        declare(
            "--regenerations",
            type=click.IntRange(0, MOST_REGENERATIONS),
            metavar="N",
            help="Maximum number of plans that the model writes after one gives up. "
            f"[default: {REGENERATIONS} with --model, else 0]",
        ),
        declare(
            "--regenerate-for",
            type=NumberRange(0, MOST_S, min_open=True),
            metavar="SECONDS",
            help=f"Time limit for all regenerations. [default: {REGENERATE_FOR_S:g}]",
        ),
        declare(
            "--attempts",
            type=click.IntRange(1, MOST_ATTEMPTS),
            metavar="N",
            help=f"Attempts per regeneration. [default: {ATTEMPTS}]",
        ),
    )
    return apply(options, command, "When a plan gives up")


@dataclass(frozen=True, kw_only=True)
class RegenerationValues(ModelValues):
    """The values of these options."""

    task: str | None
    task_file: str | None
    regenerations: int | None
    regenerate_for: float | None
    attempts: int | None


def wanted(values: RegenerationValues, model: ModelSettings | None) -> dict[str, RunValue]:
    """The regenerations as the headings of the runs keep them; ``model`` are its settings.

    A model that is configured for other commands alone does not write plans for a robot: that has
    to be asked for. Raises GpsfsmError.
    """
    flags = [
        f"--{name.replace('_', '-')}" for name in _NEED_MODEL if getattr(values, name) is not None
    ]
    if not (flags or values.model_name) or values.regenerations == 0:
        return {}
    if model is None:
        raise UsageError(f"{flags[0]} needs a model; name one with --model")
    options: dict[str, RunValue] = {
        "regenerations": values.regenerations or REGENERATIONS,
        "regenerate_for_s": values.regenerate_for or REGENERATE_FOR_S,
        "attempts": values.attempts or ATTEMPTS,
    }
    if values.task is not None or values.task_file is not None:
        options["task"] = task_of(values.task, values.task_file)
    return options


# --- what real runners may reach -----------------------------------------------------------------

ALLOW = (
    ("--allow-host", "HOST", "Host that an HttpRunner may reach; may be repeated."),
    ("--allow-program", "PROGRAM", "Program that a ProcessRunner may start; may be repeated."),
    (
        "--allow-function",
        "MODULE:NAME",
        "Function that a PythonRunner may call; may be repeated.",
    ),
    (
        *("--allow-module", "MODULE"),
        "Module whose runners capability files may name; may be repeated.",
    ),
)


def allow_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what real runners may reach."""
    options = [
        declare(name, multiple=True, metavar=metavar, help=text) for name, metavar, text in ALLOW
    ]
    return apply(options, command, "Permissions of real runners")


@dataclass(frozen=True, kw_only=True)
class AllowValues(Values):
    """The values of these options."""

    allow_host: Sequence[str]
    allow_program: Sequence[str]
    allow_function: Sequence[str]
    allow_module: Sequence[str]


def permissions(values: AllowValues, robot: Iterable[tuple[str, str]] = ()) -> dict[str, list[str]]:
    """The permissions of a command line and of a robot's profile, by option.

    Raises UsageError as ``permitted`` does.
    """
    from gpsfsm.running.bounds import PERMISSIONS, permitted

    chosen = {name: list(words(getattr(values, name))) for name in PERMISSIONS}
    for kind, text in robot:
        chosen[f"allow_{kind}"].append(text)
    return {name: permitted(name, texts) for name, texts in chosen.items() if texts}


def ros_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option of commands that make a node of ROS 2; ``ros_sections`` splits what follows it."""
    option = declare(
        "--ros-args",
        multiple=True,
        metavar="... [--]",
        help="ROS 2 node arguments such as -r old:=new, up to -- or the end of the line.",
    )
    return apply([option], command, "ROS 2")


def via_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option about which server has the runners of a robot act."""
    option = declare(
        "--via",
        type=click.Choice(VIA),
        help="With --real: use the runners of this server on the robot instead of gpsfsm's own.",
    )
    return apply([option], command, "ROS 2")


def ros_settings(
    capabilities: Capabilities, arguments: Sequence[str], via: str | None = None
) -> dict[str, Any]:
    """The place of the robot on the network, as the heading of a run holds it."""
    from gpsfsm.model.ros import RosSettings
    from gpsfsm.ros.node import refuse_malformed

    refuse_malformed(arguments)
    settings = RosSettings() if capabilities.robot is None else capabilities.robot.ros
    return replace(settings, arguments=tuple(arguments), via=via or settings.via).data()


# --- the log of commands that run until somebody ends them ----------------------------------------


@dataclass(frozen=True, kw_only=True)
class LogValues(Values):
    """The values of these options."""

    log_level: Level
    log_format: Format


def log_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what goes to standard error, and in which form."""
    return apply(
        (
            declare(
                "--log-level",
                type=click.Choice(LEVELS),
                default="info",
                show_default=True,
                help="Least important level to log.",
            ),
            declare(
                "--log-format",
                type=click.Choice(FORMATS),
                default="text",
                show_default=True,
                help="Format of the log on standard error; json: one object per line.",
            ),
        ),
        command,
        "Log",
    )
