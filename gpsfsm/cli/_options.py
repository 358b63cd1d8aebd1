"""Options that several commands share, and how settings of a configuration file join them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

if TYPE_CHECKING:
    from gpsfsm.syntax import Limits

__all__ = ["LIMITS", "config_options", "limit_options", "limits_of", "settle", "words"]

_Command = TypeVar("_Command", bound=Callable[..., Any])

LIMITS: Mapping[str, tuple[int, str]] = {
    "max_bytes": (64 * 1024 * 1024, "Bytes of a plan's text."),
    "max_depth": (200, "Levels of nesting."),
    "max_elements": (250_000, "Elements of a plan."),
    "max_attributes": (200, "Attributes of an element."),
    "max_attribute_length": (65_536, "Characters of an attribute."),
}
"""Defaults and help; repeated here so that --help need not load the front end."""

_ALLOWED = click.IntRange(min=1)


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
