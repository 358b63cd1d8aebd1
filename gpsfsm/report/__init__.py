"""Output formats: one module each, which defines ``FORMAT``; modules with ``_`` are helpers.

A format is found by the name of its module, so a new format is one new file. Other packages add
formats through the entry point group ``gpsfsm.formats``; they cannot replace a built-in one.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.plugins import find_plugin
from gpsfsm.report._format import Format, RenderOptions

if TYPE_CHECKING:
    from gpsfsm.model.report import Report

__all__ = ["Format", "RenderOptions", "find_format", "format_names", "render"]

_GROUP = "gpsfsm.formats"


@cache
def format_names() -> tuple[str, ...]:
    """Return the names of the built-in formats, ``text`` first; imports none of them."""
    modules = (module.name for module in pkgutil.iter_modules(__path__))
    names = (name for name in modules if not name.startswith("_"))
    return tuple(sorted(names, key=lambda name: (name != "text", name)))


def find_format(name: str) -> Format:
    """Return the format of this name; raises UsageError if there is none."""
    if name in format_names():
        found: Format = importlib.import_module(f"{__name__}.{name}").FORMAT
        return found
    return _find_foreign(name)


def render(report: Report, name: str = "text", *, options: RenderOptions | None = None) -> str:
    """Write the report in the format of this name."""
    return find_format(name).render(report, options or RenderOptions())


def _find_foreign(name: str) -> Format:
    """Look up a format of another package; only here, because that is slow."""
    found, offered = find_plugin(
        _GROUP, name, Format, noun="format", expected="gpsfsm.report.Format"
    )
    if found is not None:
        return found
    known = ", ".join((*format_names(), *offered))
    raise UsageError(f"there is no format '{name}'; the formats are: {known}")
