"""The engines: every module of ``gpsfsm.workers.known`` with a ``KIND``."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.workers import known

if TYPE_CHECKING:
    from gpsfsm.workers.base import Engine, Kind

__all__ = ["all_kinds", "engine_of", "jobs_of"]


@cache
def all_kinds() -> tuple[Kind, ...]:
    """All kinds of engines, in the order in which they are asked."""
    names = sorted(module.name for module in pkgutil.iter_modules(known.__path__))
    kinds = [importlib.import_module(f"{known.__name__}.{name}").KIND for name in names]
    return tuple(sorted(kinds, key=lambda kind: kind.order))


def jobs_of(jobs: int | str) -> str:
    """The text of ``--jobs``, if there is an engine for it. Raises UsageError."""
    text = str(jobs).strip()
    if any(kind.accepts(text) for kind in all_kinds()):
        return text
    forms = "; ".join(kind.forms for kind in all_kinds())
    raise UsageError(f"there are no jobs '{text[:80]}'; possible are: {forms}")


def engine_of(
    jobs: int | str, items: int | None = None, *, timeout_s: float | None = None
) -> Engine:
    """The engine that ``--jobs`` names, for so many items (None: it is not known how many).

    ``timeout_s`` is what each of them may take. Raises UsageError if there is none, if it is not
    installed, or if it knows no time limits.
    """
    text = jobs_of(jobs)
    kind = next(kind for kind in all_kinds() if kind.accepts(text))
    if timeout_s is None:
        return kind.make(text, items)
    if kind.make_timed is None:
        raise UsageError(f"there is no time limit with --jobs {text}; use processes: --jobs N")
    return kind.make_timed(text, items, timeout_s)
