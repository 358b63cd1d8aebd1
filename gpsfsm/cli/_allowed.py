"""The options ``--allow-…`` of ``run`` and ``resume``, which say what real runners may reach."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._options import Values, apply, words
from gpsfsm.running.bounds import PERMISSIONS, permitted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

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


def permissions(values: AllowValues) -> dict[str, list[str]]:
    """The permissions of a command line, by option. Raises UsageError as ``permitted`` does."""
    chosen = {name: getattr(values, name) for name in PERMISSIONS}
    return {name: permitted(name, words(texts)) for name, texts in chosen.items() if texts}
