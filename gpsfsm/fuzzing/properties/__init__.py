"""Properties of runs, and their breaches.

A module of this package lists its properties as ``PROPERTIES``; a new one may be a new file. Other
packages add properties through the entry point group ``gpsfsm.properties``; they cannot replace a
built-in one.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.model.finding import Severity
from gpsfsm.plugins import find_plugin

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from gpsfsm.fuzzing.runs import Run

_GROUP = "gpsfsm.properties"


@dataclass(frozen=True, slots=True)
class Breach:
    """A breach of a property by a run.

    ``numbers`` are the instances concerned, the most important one first; () means the run as a
    whole. Breaches with the same ``about`` are reported once, in the simplest scenario.
    """

    message: str
    numbers: tuple[int, ...] = ()
    about: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Property:
    """A property that every run must have; ``holds`` states it in a few words.

    ``check`` yields the breaches in one run, in an order that depends on the run alone.
    ``by_default``: the property is checked unless other properties are named.
    """

    name: str
    holds: str
    check: Callable[[Run], Iterable[Breach]]
    severity: Severity = Severity.ERROR
    by_default: bool = False


@dataclass(frozen=True, slots=True)
class _Guarded:
    """The check of somebody else's property, whose failure is a UsageError that names it."""

    name: str
    check: Callable[[Run], Iterable[Breach]]

    def __call__(self, run: Run) -> list[Breach]:
        try:
            breaches: list[Any] = list(self.check(run))
        except (MemoryError, GpsfsmError):
            raise
        except Exception as error:  # whatever the other package does wrong
            reason = f"{type(error).__name__}: {error}"
            raise UsageError(f"the property {self.name} cannot be checked: {reason}") from error
        for each in breaches:
            if not isinstance(each, Breach):
                kind = type(each).__name__
                raise UsageError(f"the property {self.name} must yield Breach objects, not {kind}")
        return breaches


def guarded(theirs: Property) -> Property:
    """A property of a user or of another package, the failures of which are theirs."""
    return replace(theirs, check=_Guarded(theirs.name, theirs.check))


@cache
def _built_in() -> Mapping[str, Property]:
    """The built-in properties by name, sorted."""
    names = (each.name for each in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    listed = {one.name: one for module in modules for one in module.PROPERTIES}
    return {name: listed[name] for name in sorted(listed)}


def property_names() -> tuple[str, ...]:
    """The names of the built-in properties, sorted."""
    return tuple(_built_in())


def default_properties() -> tuple[Property, ...]:
    """The properties that every run is held against if none are named."""
    return tuple(one for one in _built_in().values() if one.by_default)


def find_property(name: str) -> Property:
    """The property of this name. Raises UsageError if there is none.

    >>> find_property("no-orphan").holds
    'when the plan completes, no runner is active any more'
    """
    if name in _built_in():
        return _built_in()[name]
    plugin, offered = find_plugin(
        _GROUP, name, Property, noun="property", expected="gpsfsm.fuzzing.Property"
    )
    if plugin is not None:
        return guarded(plugin)
    names = ", ".join((*property_names(), *offered))
    raise UsageError(
        f"there is no property '{name:.100}'; the properties are: {names}. One of your own is "
        "named module:function or file.py:function"
    )
