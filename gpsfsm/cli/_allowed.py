"""The options ``--allow-…`` of ``run`` and ``resume``, which say what real runners may reach."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._options import Values, apply, words
from gpsfsm.running.bounds import PERMISSIONS, permitted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

_OPTIONS = (
    ("--allow-host", "HOST", "A host that an HttpRunner may reach; may be repeated."),
    ("--allow-program", "PROGRAM", "A program that a ProcessRunner may start; may be repeated."),
    (
        "--allow-function",
        "MODULE:NAME",
        "A function that a PythonRunner may call; may be repeated.",
    ),
    (
        *("--allow-module", "MODULE"),
        "A module from which capability files may name runners; may be repeated.",
    ),
)


def allow_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about what real runners may reach."""
    options = [
        click.option(name, multiple=True, metavar=metavar, help=text)
        for name, metavar, text in _OPTIONS
    ]
    return apply(options, command)


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
    chosen = {name: list(words(getattr(values, name))) for name in PERMISSIONS}
    for kind, text in robot:
        chosen[f"allow_{kind}"].append(text)
    return {name: permitted(name, texts) for name, texts in chosen.items() if texts}


def reach_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of a gate about what plans may reach."""
    options = [
        click.option(name, multiple=True, metavar=metavar, help=text)
        for name, metavar, text in _OPTIONS
        if name != "--allow-module"
    ]
    return apply(options, command)


def reached(values: Any) -> list[tuple[str, str]]:
    """The values of these options: kind and value. Raises UsageError as ``permitted`` does."""
    return [
        (name.removeprefix("allow_"), text)
        for name in PERMISSIONS
        for text in permitted(name, words(getattr(values, name, ())))
    ]
