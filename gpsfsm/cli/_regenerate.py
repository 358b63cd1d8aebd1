"""Options for when a plan gives up, and the rows that the headings of runs keep of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import declare, declare_file
from gpsfsm.cli._model import ModelValues
from gpsfsm.cli._options import NumberRange, apply
from gpsfsm.errors import UsageError
from gpsfsm.running.bounds import (
    ATTEMPTS,
    MOST_ATTEMPTS,
    MOST_REGENERATIONS,
    MOST_S,
    REGENERATE_FOR_S,
    REGENERATIONS,
)

if TYPE_CHECKING:
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
        from gpsfsm.cli._asking import task_of

        options["task"] = task_of(values.task, values.task_file)
    return options
