"""Options about a language model, about its prompt, and the settings that they make.

A command takes the first with ``@model_options()`` above ``@config_options``, and calls
``model_settings(context)``; what it wants to ask goes through ``find_model``. ``gpsfsm prompt`` and
``gpsfsm generate`` share the options of the prompt, ``@asking_options``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import click

from gpsfsm.cli._help import declare, declare_file
from gpsfsm.cli._options import NumberRange, Values, apply, folders_option, option
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.generation.prompt_builder import PromptOptions
    from gpsfsm.generation.providers import Configured, ModelSettings


_Command = TypeVar("_Command", bound=Callable[..., Any])
_TIMEOUT = "--timeout"

_FLAGS: Mapping[str, str] = {
    "model_name": "name",
    "model_base_url": "base_url",
    "model_temperature": "temperature",
    "model_max_tokens": "max_tokens",
    "model_timeout": "timeout",
    "model_retries": "retries",
    "model_context": "context",
}
MODEL_PARAMETERS = frozenset({*_FLAGS, "no_constrain"})
"""The names of the parameters: other than any key of a configuration file, so none is mistaken."""


_OPTIONS: Sequence[tuple[str, str, Any, str, str]] = (
    # option, parameter, type, what stands for a value, help
    (
        "--model",
        "model_name",
        str,
        "PROVIDER:MODEL",
        "Model, such as ollama:qwen3:8b. [env: GPSFSM_MODEL]",
    ),
    (
        "--base-url",
        "model_base_url",
        str,
        "URL",
        "URL of its server. [default: the provider's; env: GPSFSM_BASE_URL]",
    ),
    (
        "--temperature",
        "model_temperature",
        NumberRange(0, 2),
        "T",
        "Sampling temperature, where supported. [default: 0]",
    ),
    (
        "--max-tokens",
        "model_max_tokens",
        click.IntRange(1, 1_000_000),
        "N",
        "Maximum number of tokens in an answer. [default: 4096]",
    ),
    (
        _TIMEOUT,
        "model_timeout",
        NumberRange(0, 86_400, min_open=True),
        "SECONDS",
        "Time limit per request. [default: 300]",
    ),
    (
        "--retries",
        "model_retries",
        click.IntRange(0, 20),
        "N",
        "Retries after a transient failure. [default: 3]",
    ),
    (
        "--context",
        "model_context",
        click.IntRange(256, 100_000_000),
        "TOKENS",
        "Context window of the model. [default: unknown]",
    ),
)


@dataclass(frozen=True, kw_only=True)
class ModelValues(Values):
    """The name of a model, if one is given; all others are read by ``model_settings``."""

    model_name: str | None
    elsewhere = MODEL_PARAMETERS - {"model_name"}


def model_options(*, timeout: str = _TIMEOUT) -> Callable[[_Command], _Command]:
    """``--model`` and what belongs to it.

    ``timeout`` is for commands in which ``--timeout`` already says something else.
    """

    def decorate(command: _Command) -> _Command:
        options = [
            declare(
                timeout if option == _TIMEOUT else option,
                parameter,
                common=option == "--model",
                type=kind,
                metavar=metavar,
                help=text,
            )
            for option, parameter, kind, metavar, text in _OPTIONS
        ]
        free = declare(
            "--no-constrain", is_flag=True, help="Send no grammar, even if the server supports one."
        )
        return apply([*options, free], command, "The model")

    return decorate


def model_settings(context: click.Context) -> ModelSettings:
    """The settings that the command line, the environment and the configuration file make.

    ``settings.spec`` is "" if none of them names a model. Raises GpsfsmError.
    """
    from gpsfsm.generation.providers import settings_of

    flags, configured = model_flags(context)
    return settings_of(flags, configured=configured)


def run_model_settings(context: click.Context, *, real: bool) -> ModelSettings | None:
    """The settings of the model that is asked in a run; None if none is.

    A simulated run asks one only if the command line names it: that a model is configured for other
    commands must not make a simulation cost money.
    """
    if not real and not context.params["model_name"]:
        return None
    from gpsfsm.running.model_access import budgeted

    settings, _ = budgeted(model_settings(context))
    return settings if settings.spec else None


def model_flags(context: click.Context) -> tuple[Mapping[str, Any], Configured]:
    """The flags of the command line and the configuration files, as ``settings_of`` takes them."""
    params = context.params
    flags = {key: params.get(name) for name, key in _FLAGS.items()}
    flags["constrain"] = "never" if params.get("no_constrain") else None
    return flags, _configured(params)


def model_words(params: Mapping[str, Any]) -> list[str]:
    """The same options for another command, one that calls the timeout ``--timeout``."""
    words: list[str] = []
    for flag, parameter, *_ in _OPTIONS:
        if params.get(parameter) is not None:
            words += [flag, str(params[parameter])]
    return [*words, "--no-constrain"] if params.get("no_constrain") else words


def _configured(options: Mapping[str, Any]) -> Configured:
    """The tables ``[tool.gpsfsm.model]`` of the configuration files, and where keys may go.

    A file that ``--config`` names is read as that of a project, unless it is the user's own: to use
    a file is not to permit it hosts.
    """
    from gpsfsm.checking.config import Config, user_config_file
    from gpsfsm.cli._options import configs
    from gpsfsm.generation.providers import Configured

    project, user = Config(), Config()
    for each in configs(options.get("config"), isolated=options.get("isolated", False)):
        if each.own:
            user = each
        else:
            project = each
    return Configured(
        project=project.values.get("model", {}),
        user=user.values.get("model", {}),
        keys=user.keys,
        places=project.places,
        user_file=str(user_config_file() or ""),
    )


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
        raise ConfigError("\n".join(map(str, chosen.defects)))
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
