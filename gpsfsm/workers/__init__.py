"""Doing one thing with many items: in this process, in several, or on a Ray cluster.

``map_items`` does it and gives the results in the order of the items, whatever the engine. An
engine is one module in ``gpsfsm.workers.builtin``; ``engine_of`` finds that which ``--jobs`` names.
Nothing in this package knows what the items are. The names below are loaded when they are first
used: the limits of memory and of time, which every check takes, are here too.
"""

from __future__ import annotations

import importlib
import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

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


# ---- A bound on the time of a part of this process -----------------------------------------------


class LateError(BaseException):
    """The time is up; nothing on its way takes it for a defect of what is done."""


@contextmanager
def alarm(seconds: float) -> Iterator[None]:
    """Raise LateError after this time, where the system can; what C code has begun ends before.

    A finaliser would swallow it, so it does not strike there, and comes again until it has struck.
    """
    can = hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread()
    if not can:
        yield
        return

    def strike(_number: int, frame: FrameType | None) -> None:
        while frame is not None:
            if frame.f_code.co_name == "__del__":
                return
            frame = frame.f_back
        raise LateError

    before = signal.signal(signal.SIGALRM, strike)
    signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)
    try:
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
    finally:  # it may have struck in there
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
