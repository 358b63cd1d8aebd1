"""Formats of other tools: each is one module here, with an object ``FORMAT`` (or ``FORMATS``).

A format is recognised by the outermost element of a text, or by what it imports, and read without
anything in it being executed. What it holds becomes a graph of networkx, and that a machine with
the places of its own file (docs/machines.md). Other packages add formats by the entry-point group
``gpsfsm.machine_formats``.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.compile.machines import ReadMachine
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.syntax.source import Limits

GROUP = "gpsfsm.machine_formats"
"""The entry-point group of formats."""


class CannotSayError(Exception):
    """A node that a format has no words for: its path in the automaton, and why."""

    def __init__(self, path: str, why: str) -> None:
        super().__init__(f"{path}: {why}")
        self.path, self.why = path, why


@dataclass(frozen=True, slots=True)
class Format:
    """A format of state machines.

    ``recognises`` looks at a text and the name of its file, in time linear in the text; it never
    raises. ``read`` never raises for anything in a text. ``write`` raises CannotSayError.
    """

    name: str
    about: str
    recognises: Callable[[str, str], bool]
    read: Callable[[str, str, Limits], ReadMachine] | None = None
    write: Callable[[Automaton], str] | None = None


@cache
def formats() -> dict[str, Format]:
    """All formats, by name."""
    rows: list[Format] = []
    for module in pkgutil.iter_modules(__path__):
        loaded = importlib.import_module(f"{__name__}.{module.name}")
        if isinstance(getattr(loaded, "FORMAT", None), Format):
            rows.append(loaded.FORMAT)
        rows += getattr(loaded, "FORMATS", ())
    rows += _others()
    return {each.name: each for each in sorted(rows, key=lambda each: each.name)}


def _others() -> Iterator[Format]:
    """The formats of other packages. Raises UsageError for one that fails to load."""
    from importlib.metadata import entry_points

    for entry in sorted(entry_points(group=GROUP), key=lambda entry: (entry.name, entry.value)):
        try:
            loaded = entry.load()
        except Exception as error:  # whatever the other package does wrong
            raise UsageError(f"the format '{entry.name}' fails to load: {error}") from error
        if not isinstance(loaded, Format):
            raise UsageError(f"the format '{entry.name}' ({entry.value}) is no Format")
        yield loaded


def format_of(text: str, file: str) -> Format | None:
    """The format of a text; None for what none recognises."""
    return next(
        (each for each in formats().values() if each.read and each.recognises(text, file)), None
    )
