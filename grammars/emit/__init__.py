"""Formats of grammars: one module each, which defines ``FORMAT``; modules with ``_`` are helpers.

A format is found by the name of its module, so a new format is one new file.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from gpsfsm.errors import UsageError
from gpsfsm.grammars.emit._format import Format

__all__ = ["Format", "find_format", "format_names"]


@cache
def format_names() -> tuple[str, ...]:
    """The names of the formats, sorted; imports none of them."""
    modules = (module.name for module in pkgutil.iter_modules(__path__))
    return tuple(sorted(name.replace("_", "-") for name in modules if not name.startswith("_")))


def find_format(name: str) -> Format:
    """The format of this name; raises UsageError if there is none."""
    if name not in format_names():
        known = ", ".join(format_names())
        raise UsageError(f"there is no format '{name}' of grammars; the formats are {known}")
    module = importlib.import_module(f"{__name__}.{name.replace('-', '_')}")
    found: Format = module.FORMAT
    return found
