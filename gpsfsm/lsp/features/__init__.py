"""The requests that an editor can make: modules with a ``FEATURE``; a new one is a new file."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gpsfsm.lsp.session import Session

__all__ = ["Feature", "all_features"]


@dataclass(frozen=True, slots=True)
class Feature:
    """A request of the protocol: its name, what answers it, and what the editor is told of it."""

    method: str
    answer: Callable[[Session, Any], Awaitable[Any]]
    options: Any = None


@cache
def all_features() -> tuple[Feature, ...]:
    """All features, by the names of their modules."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    features: list[Feature] = []
    for name in names:
        module = importlib.import_module(f"{__name__}.{name}")
        features += [module.FEATURE, *getattr(module, "FURTHER", ())]
    return tuple(features)
