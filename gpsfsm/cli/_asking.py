"""The options that ``gpsfsm prompt`` and ``gpsfsm generate`` share, and their way to a prompt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import click

from gpsfsm.cli._help import declare, declare_file
from gpsfsm.cli._options import Values, apply, folders_option, option
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.generation.prompt_builder import PromptOptions
    from gpsfsm.generation.providers import ModelSettings

_Command = TypeVar("_Command", bound="Callable[..., Any]")

ASKING = frozenset({"capabilities", "builtin_capabilities", "robot"})
"""Options of these that a configuration file may set."""


_WHAT = (
    click.argument("task", required=False),
    declare_file(
        "--task-file", common=True, help="Read the task from this file; - is standard input."
    ),
)
_OFFERED = (
    folders_option("capabilities"),
    declare(
        "--builtin-capabilities/--no-builtin-capabilities",
        default=None,
        help="Offer the built-in capabilities. [default: yes]",
    ),
    option("robot"),
    declare(
        "--interface",
        "only",
        multiple=True,
        metavar="PATTERN",
        common=True,
        help="Offer only these, such as 'nav2_capabilities/*'.",
    ),
)
_FACTS = (
    declare_file("--world", common=True, help="Include the robot's pose and the named places."),
    declare_file(
        "--facts",
        "fact_files",
        multiple=True,
        common=True,
        help="Include this text file; may be repeated.",
    ),
    declare_file(
        "--example",
        "example_files",
        multiple=True,
        common=True,
        help="Include this plan as an example; may be repeated.",
    ),
)


@dataclass(frozen=True, kw_only=True)
class AskingValues(Values):
    """The values of these options, and of those about the model."""

    task: str | None
    task_file: str | None
    capabilities: Sequence[str]
    builtin_capabilities: bool | None
    robot: str | None
    only: Sequence[str]
    world: str | None
    fact_files: Sequence[str]
    example_files: Sequence[str]
    output_format: str
    output_file: str


def asking_options(command: _Command) -> _Command:
    """The task, what is offered, and what is known."""
    return apply((*_WHAT, *_OFFERED, *_FACTS), command, "The prompt")


def task_of(task: str | None, task_file: str | None) -> str:
    """The task; raises UsageError for none, two or a long one, InputError for a bad file."""
    if task is not None and task_file is not None:
        raise UsageError("give the task or --task-file, not both")
    from gpsfsm.running.search import text_in, valid_task

    return valid_task(task if task_file is None else text_in(task_file))


def capabilities_of(values: AskingValues) -> Capabilities:
    """The capabilities that are offered; raises ConfigError if files are defective."""
    from gpsfsm.capabilities.library import choose_capabilities
    from gpsfsm.errors import ConfigError

    chosen = choose_capabilities(
        values.capabilities, builtin=values.builtin_capabilities is not False, robot=values.robot
    )
    if chosen.defects:
        raise ConfigError("\n".join(chosen.defects))
    return chosen


def prompt_options(values: AskingValues, model: ModelSettings) -> PromptOptions:
    """The options of a prompt for a model with these settings."""
    from gpsfsm.running.search import prompt_options as options_of

    return options_of(
        model,
        only=values.only,
        world=values.world,
        fact_files=values.fact_files,
        example_files=values.example_files,
    )
