"""The fixers: every module of ``gpsfsm.fixing.fixes`` with a ``FIXER``; a new one is a new file."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from gpsfsm.fixing import fixes

if TYPE_CHECKING:
    from gpsfsm.fixing.fixer import Fixer

__all__ = ["all_fixers"]


@cache
def all_fixers() -> tuple[Fixer, ...]:
    """All fixers, by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(fixes.__path__))
    found = (
        importlib.import_module(f"{fixes.__name__}.{name}") for name in names if name[0] != "_"
    )
    return tuple(module.FIXER for module in found)
