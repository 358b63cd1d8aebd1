"""A bound on the memory of a process."""

from __future__ import annotations

__all__ = ["limit_memory"]


def limit_memory(megabytes: int) -> None:
    """Bound the memory of this process, if the system can; and let it leave no core dump.

    Raises OSError or ValueError if the system does not let it.
    """
    try:
        import resource  # noqa: PLC0415  (not on every system)
    except ImportError:
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = megabytes << 20
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    resource.setrlimit(resource.RLIMIT_AS, (wanted, wanted))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
