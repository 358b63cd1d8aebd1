"""What ``gpsfsm prompt`` and ``gpsfsm generate`` share: from their options to a prompt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from gpsfsm.cli._options import apply, folders_option
from gpsfsm.errors import InputError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.generation.prompts.builder import PromptOptions
    from gpsfsm.generation.providers.settings import ModelSettings

__all__ = ["ASKING", "asking_options", "budgeted", "capabilities_of", "prompt_options", "task_of"]

_Command = TypeVar("_Command", bound="Callable[..., Any]")
_MAX_BYTES = 1 << 20
_ANSWER_PART, _FOLLOW_UP_PART = 3, 4
"""Which part of a context is for the answer at most, and for showing it again with findings."""

ASKING = frozenset({"capabilities", "builtin_capabilities"})
"""Options of these that a configuration file may set."""


_WHAT = (
    click.argument("task", required=False),
    click.option(
        "--task-file",
        metavar="FILE",
        type=click.Path(),
        help="Read the task from a text file; - is standard input.",
    ),
)
_OFFERED = (
    folders_option("capabilities"),
    click.option(
        "--builtin-capabilities/--no-builtin-capabilities",
        default=None,
        help="Whether the built-in capabilities are offered. [default: yes]",
    ),
    click.option(
        "--interface",
        "only",
        multiple=True,
        metavar="PATTERN",
        help="Offer these interfaces only, such as 'nav2_capabilities/*'. May be repeated.",
    ),
)
_KNOWN = (
    click.option(
        "--world",
        metavar="FILE",
        type=click.Path(),
        help="Tell where the robot of this world is, and the places that have names.",
    ),
    click.option(
        "--facts",
        "fact_files",
        multiple=True,
        metavar="FILE",
        type=click.Path(),
        help="Tell what stands in this text file. May be repeated.",
    ),
    click.option(
        "--example",
        "example_files",
        multiple=True,
        metavar="FILE",
        type=click.Path(),
        help="Show this plan as an example. May be repeated.",
    ),
)


def asking_options(command: _Command) -> _Command:
    """The task, what is offered, and what is known."""
    return apply((*_WHAT, *_OFFERED, *_KNOWN), command)


def task_of(task: str | None, task_file: str | None) -> str:
    """The task; raises UsageError for none, two or a long one, InputError for a bad file."""
    if task is not None and task_file is not None:
        raise UsageError("give the task or --task-file, not both")
    if task_file is not None:
        task = _text(task_file)
    if task is None or not task.strip():
        raise UsageError("there is no task: say in quotes what the robot is to do")
    from gpsfsm.generation.prompts.builder import MAX_TASK  # noqa: PLC0415  (loads the front end)

    if len(task.strip()) > MAX_TASK:  # a run would find out when its plan has given up
        raise UsageError(f"the task is longer than {MAX_TASK:,} characters")
    return task.strip()


def capabilities_of(values: Mapping[str, Any]) -> Capabilities:
    """The capabilities that are offered; raises ConfigError if files are defective."""
    from gpsfsm.capabilities.choice import choose_capabilities  # noqa: PLC0415
    from gpsfsm.errors import ConfigError  # noqa: PLC0415

    found = choose_capabilities(
        values["capabilities"], builtin=values["builtin_capabilities"] is not False
    )
    if found.defects:
        raise ConfigError("\n".join(found.defects))
    return found


def budgeted(model: ModelSettings) -> tuple[ModelSettings, str]:
    """Settings under which an answer leaves room for what is asked, and a note if they differ."""
    if model.context_tokens is None:
        return model, ""
    most = model.context_tokens // _ANSWER_PART
    if model.max_tokens <= most:
        return model, ""
    note = f"an answer may have {most:,} tokens, a third of the context"
    return replace(model, max_tokens=most), note


def prompt_options(values: Mapping[str, Any], model: ModelSettings) -> PromptOptions:
    """How to ask a model of which this is known."""
    from gpsfsm.generation.prompts.builder import PromptOptions  # noqa: PLC0415

    facts = [_text(file) for file in values["fact_files"]]
    if values["world"] is not None:
        from gpsfsm.generation.prompts.surroundings import known_of  # noqa: PLC0415
        from gpsfsm.simulation.load import load_world  # noqa: PLC0415  (YAML and pydantic)

        facts.insert(0, "\n".join(known_of(load_world(values["world"]))))
    return PromptOptions(
        only=tuple(values["only"]),
        context=tuple(facts),
        examples=tuple(_example(file) for file in values["example_files"]),
        context_tokens=model.context_tokens,
        answer_tokens=model.max_tokens,
        follow_up_tokens=(model.context_tokens or 0) // _FOLLOW_UP_PART,
    )


def _text(file: str) -> str:
    """The content of a text file, not empty."""
    from gpsfsm.inputs import STDIN, Input, read_bytes  # noqa: PLC0415  (loads the front end)

    found = Input(STDIN, stdin=True) if file == "-" else Input(str(Path(file)))
    try:
        content = read_bytes(found, _MAX_BYTES)
        if len(content) > _MAX_BYTES:
            raise InputError(f"is larger than {_MAX_BYTES} bytes")
        text = content.decode("utf-8-sig")
    except InputError as error:
        raise InputError(f"{found.path}: {error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{found.path}: is not UTF-8 text (byte {error.start + 1})") from error
    if not text.strip():
        raise InputError(f"{found.path}: is empty")
    return text


def _example(file: str) -> str:
    """A plan to show; one that cannot be read teaches nothing good."""
    from gpsfsm.syntax import parse  # noqa: PLC0415  (loads the front end)

    text = _text(file)
    parsed = parse(text, file=file)
    if parsed.plan is None or parsed.problems:
        first = parsed.problems[0]
        where = f"{file}:{first.location.line}:{first.location.column}"
        raise InputError(f"{where}: this example is no good plan: {first.message}")
    return text.strip()
