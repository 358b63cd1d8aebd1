"""Options that several commands share, and how settings of a configuration file join them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import click
from click.core import ParameterSource

from gpsfsm.cli._streams import STDOUT
from gpsfsm.model.engine import ENGINES, PAPER_ENGINE

if TYPE_CHECKING:
    from gpsfsm.syntax import Limits

__all__ = [
    "LIMITS",
    "Decorator",
    "apply",
    "config_options",
    "engine_option",
    "folders_option",
    "format_option",
    "library_options",
    "limit_options",
    "limits_of",
    "output_option",
    "response_option",
    "settle",
    "words",
]

_Command = TypeVar("_Command", bound=Callable[..., Any])
Decorator: TypeAlias = Callable[[Callable[..., Any]], Callable[..., Any]]

LIMITS: Mapping[str, tuple[int, str]] = {
    "max_bytes": (64 * 1024 * 1024, "Bytes of a plan's text."),
    "max_depth": (200, "Levels of nesting."),
    "max_elements": (250_000, "Elements of a plan."),
    "max_attributes": (200, "Attributes of an element."),
    "max_attribute_length": (65_536, "Characters of an attribute."),
}
"""Defaults and help; repeated here so that --help need not load the front end."""

_ALLOWED = click.IntRange(min=1)
_ADDED = "Add the capability files below this folder. May be repeated."


def apply(options: Sequence[Decorator], command: _Command) -> _Command:
    """The command with these options; --help lists them in this order, above those it has."""
    for option in reversed(options):
        command = option(command)  # type: ignore[assignment]  # click gives the command back
    return command


def format_option(*formats: str, text: str) -> Decorator:
    """``--format`` as ``output_format``; the first of the formats is the default."""
    return click.option(
        "--format",
        "output_format",
        type=click.Choice(formats),
        default=formats[0],
        show_default=True,
        help=text,
    )


def output_option(
    *names: str, text: str = "Write to this file instead of standard output."
) -> Decorator:
    """``--output-file`` and its other names, such as ``-o``; standard output if it is not given."""
    return click.option(
        *names,
        "--output-file",
        default=STDOUT,
        metavar="FILE",
        type=click.Path(),
        help=text,
    )


def folders_option(name: str, *, text: str = _ADDED) -> Decorator:
    """``--capabilities``: folders of capability files, as ``name``."""
    return click.option(
        "--capabilities", name, multiple=True, metavar="DIR", type=click.Path(), help=text
    )


def library_options(command: _Command) -> _Command:
    """``--capabilities`` and ``--builtin-capabilities``: what is known of the robot's runners."""
    text = "Capability files that extend the built-in library; may be repeated."
    builtin = click.option(
        "--builtin-capabilities/--no-builtin-capabilities",
        default=True,
        help="Whether to use the built-in library of capabilities. [default: yes]",
    )
    return apply((folders_option("capabilities", text=text), builtin), command)


def response_option(command: _Command) -> _Command:
    """``--from-response`` and its opposite."""
    return click.option(
        "--from-response/--no-from-response",
        help="The text is a language model's raw answer: take the last plan in it.",
    )(command)


def engine_option(command: _Command) -> _Command:
    """``--engine``."""
    return click.option(
        "--engine",
        type=click.Choice(list(ENGINES)),
        default=PAPER_ENGINE,
        show_default=True,
        help="The engine that is to run the plan; paper: what the paper says.",
    )(command)


def limit_options(command: _Command) -> _Command:
    """``--max-bytes`` and the other limits on what is read."""
    for name, (default, text) in reversed(list(LIMITS.items())):
        option = "--" + name.replace("_", "-")
        help_text = f"{text} [default: {default}]"
        command = click.option(option, type=_ALLOWED, metavar="N", help=help_text)(command)
    return command


def limits_of(values: Mapping[str, Any]) -> Limits:
    """The limits among the values of a command's options."""
    from gpsfsm.syntax import Limits  # noqa: PLC0415  (loads the front end)

    return Limits(**{name: values[name] for name in LIMITS if values[name] is not None})


def config_options(command: _Command) -> _Command:
    """``--config`` and ``--isolated``."""
    isolated = click.option("--isolated", is_flag=True, help="Read no configuration file.")
    config = click.option(
        "--config",
        metavar="FILE",
        type=click.Path(),
        help="Read this configuration file instead of looking for one.",
    )
    return config(isolated(command))


def settle(context: click.Context, only: Iterable[str] | None = None) -> dict[str, Any]:
    """The values of all options: the command line's, else the configuration file's, else defaults.

    ``only`` names the options that a file may set. Raises ConfigError.
    """
    values = dict(context.params)
    file, isolated = values.pop("config"), values.pop("isolated")
    if isolated and file is not None:
        raise click.UsageError("--config and --isolated contradict each other", context)
    if isolated:
        return values
    for name, value in _settings(file).items():
        by_default = context.get_parameter_source(name) is ParameterSource.DEFAULT
        if by_default and (only is None or name in only):
            values[name] = value
    return values


def _settings(file: str | None) -> Mapping[str, Any]:
    from gpsfsm.config import find_config, load_config  # noqa: PLC0415  (not for --help)

    return (find_config() if file is None else load_config(file)).values


def words(texts: Iterable[str]) -> tuple[str, ...]:
    """``("GP1,GP2", "GP3")`` → ``("GP1", "GP2", "GP3")``.

    A text without any word stays, to be refused as such: it must not read as "no choice".
    """
    found: list[str] = []
    for text in texts:
        found += [word.strip() for word in text.split(",") if word.strip()] or [text]
    return tuple(found)
