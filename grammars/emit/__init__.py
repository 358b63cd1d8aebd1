"""Formats of grammars; a module of this package lists its own as ``FORMATS``.

A new format may be a new file.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.generation.language_model import Constraint
    from gpsfsm.grammars.writable import Alphabet


@dataclass(frozen=True, slots=True)
class Format:
    """A way to write a grammar. It has one of two functions.

    ``emit`` writes the plans over an alphabet to a depth, for a server that speaks ``constraint``;
    ``fixed`` gives the schema of all plans, whatever the capabilities. ``file`` is the name of the
    file that is shipped.
    """

    name: str
    file: str
    emit: Callable[[Alphabet, int], str] | None = None
    fixed: Callable[[], str] | None = None
    constraint: Constraint | None = None


@cache
def _formats() -> Mapping[str, Format]:
    """The formats by name, sorted."""
    names = (each.name for each in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    listed = {one.name: one for module in modules for one in module.FORMATS}
    return {name: listed[name] for name in sorted(listed)}


def format_names() -> tuple[str, ...]:
    """The names of the formats, sorted."""
    return tuple(_formats())


def find_format(name: str) -> Format:
    """The format of this name; raises UsageError if there is none."""
    if name not in _formats():
        names = ", ".join(format_names())
        raise UsageError(f"there is no format '{name}' of grammars; the formats are {names}")
    return _formats()[name]
