"""Doing one thing with many items: in this process, in several, or on a Ray cluster.

``map_items`` does it and gives the results in the order of the items, whatever the engine. An
engine is one module in ``gpsfsm.workers.builtin``; ``engine_of`` finds that which ``--jobs`` names.
Nothing in this package knows what the items are. The names below are loaded when they are first
used: the limit of memory, which every check takes, is here too.
"""

from __future__ import annotations

import importlib
import sys
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


# ---- Bounds on the memory of a process -----------------------------------------------------------


Z3_MB = 100
"""Megabytes that it takes to load z3 and to begin with it."""


_before: list[tuple[int, int]] = []
"""The bounds of this process before it was bound itself, if what it starts is not to be."""


def limit_memory(megabytes: int, *, itself_alone: bool = False) -> None:
    """Bound the memory of this process, if the system can; and let it leave no core dump.

    What it starts is bound as well, with ``itself_alone`` until ``lift_limit``. Raises OSError or
    ValueError if the system does not let it.
    """
    try:
        import resource
    except ImportError:
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = megabytes << 20
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    resource.setrlimit(resource.RLIMIT_AS, (wanted, hard if itself_alone else wanted))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if itself_alone:
        _before[:] = [(soft, hard)]


def lift_limit(pid: int) -> None:
    """Let a process that was started here have the memory that this one might have had."""
    if not _before:
        return
    import resource

    if hasattr(resource, "prlimit"):
        resource.prlimit(pid, resource.RLIMIT_AS, _before[0])


def require_memory(megabytes: int, *, module: str) -> None:
    """Raise MemoryError if this process is bounded, and cannot get so much more.

    To be called before a module is loaded that would crash; says nothing of one that is loaded.
    """
    if module not in sys.modules:
        require_free(megabytes << 20)


def require_free(size: int) -> None:
    """Raise MemoryError if this process is bounded, and cannot get so many bytes more.

    To be called before code that ends the process where its memory runs out.
    """
    try:
        import resource
    except ImportError:
        return
    if resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY:
        return
    import mmap

    try:
        mmap.mmap(-1, size).close()
    except OSError as error:
        raise MemoryError from error
