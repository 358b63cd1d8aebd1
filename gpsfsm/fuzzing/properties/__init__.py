"""Properties of runs: one module each, which defines ``PROPERTY``.

A property is found by the name of its module (``no_orphan.py`` is ``no-orphan``). Other packages
add properties through the entry point group ``gpsfsm.properties``; they cannot replace a built-in
one.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from gpsfsm.errors import UsageError
from gpsfsm.fuzzing.properties.base import Property
from gpsfsm.plugins import find_plugin

__all__ = ["default_properties", "find_property", "property_names"]

_GROUP = "gpsfsm.properties"


@cache
def property_names() -> tuple[str, ...]:
    """The names of the built-in properties, sorted."""
    modules = (module.name for module in pkgutil.iter_modules(__path__))
    return tuple(sorted(name.replace("_", "-") for name in modules if name != "base"))


def default_properties() -> tuple[Property, ...]:
    """The properties that every run is held against if none are named."""
    return tuple(built_in for built_in in map(_built_in, property_names()) if built_in.by_default)


def find_property(name: str) -> Property:
    """The property of this name. Raises UsageError if there is none.

    >>> find_property("no-orphan").holds
    'when the plan completes, no runner is active any more'
    """
    if name in property_names():
        return _built_in(name)
    plugin, offered = find_plugin(
        _GROUP, name, Property, noun="property", expected="gpsfsm.fuzzing.Property"
    )
    if plugin is not None:
        return plugin
    names = ", ".join((*property_names(), *offered))
    raise UsageError(
        f"there is no property '{name:.100}'; the properties are: {names}. One of your own is "
        "named module:function or file.py:function"
    )


def _built_in(name: str) -> Property:
    module = importlib.import_module(f"{__name__}.{name.replace('-', '_')}")
    built_in: Property = module.PROPERTY
    return built_in
