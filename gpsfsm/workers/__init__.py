"""Doing one thing with many items: in this process, in several, or on a Ray cluster.

``map_items`` does it and gives the results in the order of the items, whatever the engine. An
engine is one module in ``gpsfsm.workers.known``; ``engine_of`` finds the one that ``--jobs`` names.
Nothing in this package knows what the items are. The names below are loaded when they are first
used: the limit of memory, which every check takes, is here too.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gpsfsm.workers.engines import (
        LATER,
        Chunk,
        Engine,
        Kind,
        Later,
        Lost,
        Settled,
        Source,
        engine_of,
        jobs_of,
        map_items,
    )

__all__ = [
    "LATER",
    "Chunk",
    "Engine",
    "Kind",
    "Later",
    "Lost",
    "Settled",
    "Source",
    "engine_of",
    "jobs_of",
    "map_items",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(f"{__name__}.engines"), name)
