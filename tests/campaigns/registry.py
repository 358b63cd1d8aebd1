"""The comparisons: each module of ``pairs`` holds one, as ``PAIR``, or several, as ``PAIRS``."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from tests.campaigns import pairs

if TYPE_CHECKING:
    from tests.campaigns.base import Pair

__all__ = ["all_pairs"]


@cache
def all_pairs() -> dict[str, Pair]:
    """All comparisons by name, in the order of their names."""
    found: list[Pair] = []
    for module in pkgutil.iter_modules(pairs.__path__):
        loaded = importlib.import_module(f"{pairs.__name__}.{module.name}")
        found += loaded.PAIRS if hasattr(loaded, "PAIRS") else [loaded.PAIR]
    return {pair.name: pair for pair in sorted(found, key=lambda pair: pair.name)}
