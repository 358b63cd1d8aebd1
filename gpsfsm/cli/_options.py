"""Options that several commands share, and how settings of a configuration file join them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import click
from click.core import ParameterSource

from gpsfsm.cli._streams import STDOUT
from gpsfsm.model.engine import ENGINES, PAPER_ENGINE

if TYPE_CHECKING:
    from gpsfsm.config import Config
    from gpsfsm.syntax import Limits

__all__ = [
    "CONFIGURED",
    "LIMITS",
    "Decorator",
    "NumberRange",
    "apply",
    "config_options",
    "configs",
    "engine_option",
    "folders_option",
    "format_option",
    "library_options",
    "limit_options",
    "limits_of",
    "output_option",
    "response_option",
    "settle",
    "settle_named",
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

CONFIGURED = "configured"
"""Where the values of options say which of them a configuration file has set, and which one."""

_ALLOWED = click.IntRange(min=1)
_ADDED = "Add the capability files below this folder. May be repeated."


class NumberRange(click.FloatRange):
    """A range of finite numbers. click's own lets NaN pass, which is beyond no bound."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number that a text is. Raises BadParameter."""
        found = float(super().convert(value, param, ctx))
        if not math.isfinite(found):
            self.fail(f"{found} is not a finite number", param, ctx)
        return found


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
    isolated = click.option(
        "--isolated", is_flag=True, help="Read no configuration file, not even your own."
    )
    config = click.option(
        "--config",
        metavar="FILE",
        type=click.Path(),
        help="Read this configuration file instead of looking for one.",
    )
    return config(isolated(command))


def settle(context: click.Context, only: Iterable[str] | None = None) -> dict[str, Any]:
    """The values of all options: the command line's, else a configuration file's, else defaults.

    ``only`` names the options that a file may set. Raises ConfigError.
    """
    values = dict(context.params)
    file, isolated = values.pop("config"), values.pop("isolated")
    if isolated and file is not None:
        raise click.UsageError("--config and --isolated contradict each other", context)
    if isolated:
        return {**values, CONFIGURED: {}}
    _take(context, values, configs(file), only)
    return values


def settle_named(context: click.Context, only: Iterable[str]) -> dict[str, Any]:
    """The values of all options for a command that decides what may run.

    A configuration file counts only if the command line names it: the author of a plan may be the
    author of the files around it, and is no judge. Raises ConfigError.
    """
    values = dict(context.params)
    file, isolated = values.pop("config"), values.pop("isolated", False)
    if isolated and file is not None:
        raise click.UsageError("--config and --isolated contradict each other", context)
    from gpsfsm.config import load_config  # noqa: PLC0415  (not for --help)

    _take(context, values, [] if file is None else [load_config(file)], only)
    return values


def configs(file: str | None, *, isolated: bool = False) -> list[Config]:
    """The configuration files that hold: that of the project, or ``file``, then the user's own."""
    from gpsfsm.config import find_config, load_config, load_user_config  # noqa: PLC0415

    if isolated:
        return []
    first = find_config() if file is None else load_config(file)
    return [first] if first.own else [first, load_user_config()]


def _take(
    context: click.Context,
    values: dict[str, Any],
    files: Sequence[Config],
    only: Iterable[str] | None,
) -> None:
    """Give options the settings of the first file that has them, if the command line has none.

    ``values[CONFIGURED]`` says of each of these in which file it stands.
    """
    allowed = None if only is None else frozenset(only)
    places: dict[str, str] = {}
    for each in files:
        for name, value in each.values.items():
            by_default = context.get_parameter_source(name) is ParameterSource.DEFAULT
            if by_default and name not in places and (allowed is None or name in allowed):
                values[name], places[name] = value, each.file
    values[CONFIGURED] = places


def words(texts: Iterable[str]) -> tuple[str, ...]:
    """``("GP1,GP2", "GP3")`` → ``("GP1", "GP2", "GP3")``.

    A text without any word stays, to be refused as such: it must not read as "no choice".
    """
    found: list[str] = []
    for text in texts:
        found += [word.strip() for word in text.split(",") if word.strip()] or [text]
    return tuple(found)
