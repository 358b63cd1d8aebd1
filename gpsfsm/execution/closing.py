"""Ending coroutines that do not want to end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Coroutine

__all__ = ["close"]

_DEEPEST = 1_000  # coroutines that wait for each other


def close(awaited: Coroutine[Any, Any, Any]) -> bool:
    """Give a coroutine no further turn; whether it agrees, or goes on waiting all the same."""
    waiting: list[object] = []
    inner: object = awaited
    while inner is not None and len(waiting) < _DEEPEST:
        waiting.append(inner)
        inner = getattr(inner, "cr_await", None)
    try:
        awaited.close()
    except BaseException:  # it goes on waiting, or fails while it cleans up
        for kept in waiting:
            _keep_for_ever(kept)
        return all(getattr(kept, "cr_frame", None) is None for kept in waiting)
    return True


def _keep_for_ever(kept: object) -> None:
    """Never free an object, not even when the interpreter ends.

    Freeing a coroutine closes it once more; one that catches that and goes on in a loop would keep
    the process from ever ending.
    """
    import ctypes  # noqa: PLC0415  (rarely needed)

    ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))
