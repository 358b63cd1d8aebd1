"""The group of all commands, which imports a command when it is needed."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._streams import give_up_stdout

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["Commands"]

_PACKAGE = "gpsfsm.cli"


class Commands(click.Group):
    """Finds commands by the names of the modules beside this one."""

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        """As click does, which shows --help and --version here."""
        with _until_the_reader_leaves():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        """As click does, which shows the help of a command here."""
        with _until_the_reader_leaves():
            return super().invoke(ctx)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of all commands."""
        return [name for name in _module_names() if self.get_command(ctx, name) is not None]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """The command of this name, or None."""
        if cmd_name not in _module_names():
            return None
        module = importlib.import_module(f"{_PACKAGE}.{cmd_name.replace('-', '_')}")
        found = getattr(module, "COMMAND", None)
        return found if isinstance(found, click.Command) else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, but with a word on what may be meant."""
        name = args[0]
        if name.startswith("-") or self.get_command(ctx, name) is not None:
            return super().resolve_command(ctx, args)
        known = self.list_commands(ctx)
        near = difflib.get_close_matches(name, known, n=1)
        if name.endswith(".xml") or Path(name).exists():
            hint = f"to check a plan: gpsfsm check {name}"
        elif near:
            hint = f"did you mean '{near[0]}'?"
        else:
            hint = f"the commands are {', '.join(known)}"
        raise click.UsageError(f"there is no command '{name}'; {hint}", ctx)


@contextmanager
def _until_the_reader_leaves() -> Iterator[None]:
    """``gpsfsm --help | head`` is no failure, whatever click thinks of it."""
    try:
        yield
    except BrokenPipeError:
        give_up_stdout()
        raise click.exceptions.Exit(0) from None


@cache
def _module_names() -> tuple[str, ...]:
    modules = pkgutil.iter_modules([str(Path(__file__).parent)])
    return tuple(
        sorted(found.name.replace("_", "-") for found in modules if not found.name.startswith("_"))
    )
