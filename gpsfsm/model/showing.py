"""How objects show themselves in notebooks.

Data knows nothing of those who can draw it: these offer it here, and the package does that for its
own when it is imported (``gpsfsm/__init__.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["Show", "offer", "shown"]

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
