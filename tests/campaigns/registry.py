"""The comparisons of ``pairs`` and the attacks of ``tests.attacks``.

Each module there holds one, as ``PAIR``, or several, as ``PAIRS``.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from tests import attacks
from tests.campaigns import pairs

if TYPE_CHECKING:
    from tests.campaigns.base import Pair

__all__ = ["all_pairs"]


@cache
def all_pairs() -> dict[str, Pair]:
    """All comparisons and attacks by name, in the order of their names."""
    listed: list[Pair] = []
    for package in (pairs, attacks):
        for module in pkgutil.iter_modules(package.__path__):
            loaded = importlib.import_module(f"{package.__name__}.{module.name}")
            listed += loaded.PAIRS if hasattr(loaded, "PAIRS") else [loaded.PAIR]
    return {pair.name: pair for pair in sorted(listed, key=lambda pair: pair.name)}
