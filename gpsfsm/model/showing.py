"""The pictures of objects in notebooks, and their data for programs.

Data knows nothing of those who can draw or write it: these offer it here, and the package does that
for its own when it is imported (``gpsfsm/__init__.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Show = Callable[[Any], str | None]
"""Makes SVG or HTML of an object; None where it is too large for that."""

_SHOWS: dict[str, Show] = {}


def offer(name: str, show: Show) -> None:
    """Tell who shows objects that ask for ``name``; the last one counts."""
    _SHOWS[name] = show


def shown(name: str, value: object) -> str | None:
    """The object as SVG or HTML; None if nobody shows it, and then a notebook prints it."""
    show = _SHOWS.get(name)
    return None if show is None else show(value)


Make = Callable[[Any], Any]
"""Makes other data of an object."""

_MAKES: dict[str, Make] = {}


def offer_data(name: str, make: Make) -> None:
    """Tell who makes the data that objects ask for as ``name``; the last one counts."""
    _MAKES[name] = make


def as_data(name: str, value: object) -> Any:
    """The data of the object."""
    return _MAKES[name](value)
