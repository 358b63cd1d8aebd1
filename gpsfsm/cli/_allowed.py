"""The options ``--allow-…``, which say what real runners may reach, and their validation."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._options import Values, words
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

_MOST_SHOWN = 50


def allow_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what real runners may reach."""
    for option in reversed(
        (
            click.option(
                "--allow-host",
                multiple=True,
                metavar="HOST",
                help="A host that an HttpRunner may reach; may be repeated.",
            ),
            click.option(
                "--allow-program",
                multiple=True,
                metavar="PROGRAM",
                help="A program that a ProcessRunner may start; may be repeated.",
            ),
            click.option(
                "--allow-function",
                multiple=True,
                metavar="MODULE:NAME",
                help="A function that a PythonRunner may call; may be repeated.",
            ),
            click.option(
                "--allow-module",
                multiple=True,
                metavar="MODULE",
                help="A module from which capability files may name runners; may be repeated.",
            ),
        )
    ):
        command = option(command)
    return command


@dataclass(frozen=True, kw_only=True)
class AllowValues(Values):
    """The values of these options."""

    allow_host: Sequence[str]
    allow_program: Sequence[str]
    allow_function: Sequence[str]
    allow_module: Sequence[str]


def permissions(values: AllowValues) -> dict[str, list[str]]:
    """What a command line allows, by option. Raises UsageError as ``allowed`` does."""
    return {name: allowed(name, getattr(values, name)) for name in ALLOW if getattr(values, name)}


def recorded(options: Mapping[str, Any], allowed: Mapping[str, list[str]]) -> list[str]:
    """What the heading of a run allows and ``allowed`` does not: the options, as one writes them.

    A journal says what a run was allowed, which allows nothing: the file may come from anywhere.
    """
    found = [
        f"--{name.replace('_', '-')} {shlex.quote(text)}"
        for name in ALLOW
        for text in _texts(options.get(name))
        if text not in allowed.get(name, ())
    ]
    more = len(found) - _MOST_SHOWN
    return [*found[:_MOST_SHOWN], *([f"and {more} more"] if more > 0 else [])]


def _texts(value: object) -> list[str]:
    return [str(each) for each in value] if isinstance(value, list) else []


def allowed(option: str, texts: Iterable[str]) -> list[str]:
    """The values of one of these options, as runners get them.

    Raises UsageError for what would never allow anything, or something else than it seems to.
    """
    return [ALLOW[option](text) for text in words(texts)]


def _host(text: str) -> str:
    from gpsfsm.runners.generic.http import allowed_host, shown

    try:
        return allowed_host(text)
    except ValueError as error:
        raise UsageError(f"--allow-host {shown(text, 100)!r}: {error}") from None


def _program(text: str) -> str:
    if not text.strip() or "\0" in text:
        raise UsageError(
            f"--allow-program {text[:100]!r}: it names no program; write it as plans do, as in "
            "echo or /usr/bin/echo"
        )
    return text


def _function(text: str) -> str:
    module, _, name = text.partition(":")
    if not (_is_module(module) and name.isidentifier()):
        raise UsageError(
            f"--allow-function {text[:100]!r}: it names no function; write module:name, as in "
            "my_robot.tools:look"
        )
    return text


def _module(text: str) -> str:
    if not _is_module(text):
        raise UsageError(
            f"--allow-module {text[:100]!r}: it names no module; write its name as in an import, "
            "as in my_robot or my_robot.arm"
        )
    return text


def _is_module(text: str) -> bool:
    return all(part.isidentifier() for part in text.split("."))


ALLOW: dict[str, Callable[[str], str]] = {
    "allow_host": _host,
    "allow_program": _program,
    "allow_function": _function,
    "allow_module": _module,
}
"""How a value of each option is looked over."""
