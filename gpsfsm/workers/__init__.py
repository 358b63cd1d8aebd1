"""Doing one thing with many items: in this process, in several, or on a Ray cluster.

``run`` does it and gives the results in the order of the items, whatever the engine. An engine is
one module in ``gpsfsm.workers.known``; ``engine_of`` finds the one that ``--jobs`` names. Nothing
in this package knows what the items are.
"""

from __future__ import annotations

from gpsfsm.workers.base import LATER, Chunk, Engine, Kind, Known, Later, Lost, Source
from gpsfsm.workers.registry import engine_of, jobs_of
from gpsfsm.workers.running import run

__all__ = [
    "LATER",
    "Chunk",
    "Engine",
    "Kind",
    "Known",
    "Later",
    "Lost",
    "Source",
    "engine_of",
    "jobs_of",
    "run",
]
