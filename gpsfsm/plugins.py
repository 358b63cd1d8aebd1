"""Additions of other packages by entry points, such as output formats and providers of models."""

from __future__ import annotations

from typing import TypeVar

from gpsfsm.errors import UsageError

T = TypeVar("T")


def find_plugin(
    group: str, name: str, kind: type[T], *, noun: str, expected: str
) -> tuple[T | None, tuple[str, ...]]:
    """The object that a package offers under this name, if one does, and all names on offer.

    Of several with one name it is the first in the order of their values. Raises UsageError if it
    fails to load or is no ``kind``; in messages it is a ``noun``, and should be ``expected``.
    """
    from importlib.metadata import entry_points

    offered = sorted(entry_points(group=group), key=lambda entry: (entry.name, entry.value))
    names = tuple(dict.fromkeys(entry.name for entry in offered))
    for entry in offered:
        if entry.name != name:
            continue
        called = f"the {noun} '{name}' ({entry.value})"
        try:
            plugin = entry.load()
        except Exception as error:  # whatever the other package does wrong
            raise UsageError(f"{called} fails to load: {error}") from error
        if not isinstance(plugin, kind):
            raise UsageError(f"{called} is not a {expected}")
        return plugin, names
    return None, names
