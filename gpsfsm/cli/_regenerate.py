"""What is asked for when a plan gives up: options, and what the headings of runs keep of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._options import NumberRange
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from gpsfsm.execution.chain import Policy
    from gpsfsm.execution.records import RunValue

__all__ = ["ATTEMPTS", "MOST_ATTEMPTS", "policy_of", "regeneration_options", "wanted"]

REGENERATIONS, REGENERATE_FOR_S, ATTEMPTS = 3, 600.0, 3
MOST_REGENERATIONS, MOST_S, MOST_ATTEMPTS = 100, 1e6, 100
_ASKED_FOR = ("task", "task_file", "regenerations", "regenerate_for", "attempts")


def regeneration_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """What is to be achieved, and how often and how long a model may be asked."""
    for option in reversed(
        (
            click.option(
                "--task",
                metavar="TEXT",
                help="What the plan is for: told to the model when it gives up. "
                "[default: the plan itself]",
            ),
            click.option(
                "--task-file",
                metavar="FILE",
                type=click.Path(),
                help="Read the task from a text file.",
            ),
            click.option(
                "--regenerations",
                type=click.IntRange(0, MOST_REGENERATIONS),
                metavar="N",
                help="How many plans the model may write behind one that gave up. "
                f"[default: {REGENERATIONS} with --model, else 0]",
            ),
            click.option(
                "--regenerate-for",
                type=NumberRange(0, MOST_S, min_open=True),
                metavar="SECONDS",
                help=f"How long it may take for all of them. [default: {REGENERATE_FOR_S:g}]",
            ),
            click.option(
                "--attempts",
                type=click.IntRange(1, MOST_ATTEMPTS),
                metavar="N",
                help=f"How often it is asked for each of them. [default: {ATTEMPTS}]",
            ),
        )
    ):
        command = option(command)
    return command


def wanted(values: Mapping[str, Any]) -> dict[str, RunValue]:
    """What is asked for, as the headings of the runs keep it; ``model`` are its settings or None.

    A model that is configured for other commands alone does not write plans for a robot: that has
    to be asked for. Raises GpsfsmError.
    """
    given = [f"--{name.replace('_', '-')}" for name in _ASKED_FOR if values[name] is not None]
    if not (given or values["model_name"]) or values["regenerations"] == 0:
        return {}
    if values["model"] is None:
        raise UsageError(f"{given[0]} needs a model that is asked; name one with --model")
    found: dict[str, RunValue] = {
        "regenerations": values["regenerations"] or REGENERATIONS,
        "regenerate_for_s": values["regenerate_for"] or REGENERATE_FOR_S,
        "attempts": values["attempts"] or ATTEMPTS,
    }
    if values["task"] is not None or values["task_file"] is not None:
        from gpsfsm.cli._asking import task_of  # noqa: PLC0415  (few runs have a task)

        found["task"] = task_of(values["task"], values["task_file"])
    return found


def policy_of(options: Mapping[str, RunValue]) -> Policy | None:
    """How far plans are continued, by the heading of a run; None for not at all.

    Never further than the options allow, whatever a journal says.
    """
    continuations, total_s = options.get("regenerations"), options.get("regenerate_for_s")
    if type(continuations) is not int:
        return None
    from gpsfsm.execution.chain import Policy  # noqa: PLC0415  (few runs ask a model)

    wished = total_s if isinstance(total_s, int | float) else MOST_S
    bounded = MOST_S if wished > MOST_S else float(wished)  # no number is left for Policy to refuse
    return Policy(min(continuations, MOST_REGENERATIONS), bounded)
