"""Options as JSON and back: how a worker is told what the gate asks for.

Every kind of object has a form that leads back to it, so that new options are in it without
anybody's doing. What comes back is made of frozen data of gpsfsm and of nothing else.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

from gpsfsm.gating.verdicts import GateOptions

__all__ = ["options_of", "written"]

_OURS = "gpsfsm."


def written(options: GateOptions) -> bytes:
    """Options as JSON. Raises ValueError for what has no form."""
    return json.dumps(_plain(options), separators=(",", ":")).encode("ascii")


def options_of(text: bytes) -> GateOptions:
    """The options. Raises ValueError for what ``written`` does not write."""
    try:
        found = _made(json.loads(text))
    except (AttributeError, ImportError, TypeError) as error:
        raise ValueError(f"these are no options: {error}") from None
    if not isinstance(found, GateOptions):
        raise ValueError("these are no options")
    return found


def _plain(value: object) -> object:
    """Values of JSON stand for themselves, all others are a list that begins with what they are."""
    if isinstance(value, Enum):
        return ["enum", *_name(type(value)), value.value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, tuple):
        return ["tuple", *map(_plain, value)]
    if isinstance(value, frozenset):
        return ["set", *sorted(map(_plain, value), key=json.dumps)]
    if isinstance(value, Mapping):
        return ["map", *([_plain(key), _plain(each)] for key, each in value.items())]
    if is_dataclass(value) and not isinstance(value, type):
        parts = {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
        return ["data", *_name(type(value)), parts]
    raise ValueError(f"there is no form of a {type(value).__name__} among the options")


def _name(kind: type) -> tuple[str, str]:
    return kind.__module__, kind.__qualname__


def _made(value: Any) -> Any:
    if not isinstance(value, list):
        return value
    what, *parts = value
    if what == "tuple":
        return tuple(map(_made, parts))
    if what == "set":
        return frozenset(map(_made, parts))
    if what == "map":
        return {_made(key): _made(each) for key, each in parts}
    module, name, content = parts
    kind = _kind(module, name)
    if what == "enum" and issubclass(kind, Enum):
        return kind(content)
    if what == "data" and is_dataclass(kind):
        return kind(**{name: _made(each) for name, each in content.items()})
    raise ValueError(f"there is no {what} {module}.{name}")


def _kind(module: str, name: str) -> type:
    """A class of gpsfsm."""
    found = getattr(importlib.import_module(module), name) if module.startswith(_OURS) else None
    if not isinstance(found, type):
        raise ValueError(f"{module}.{name} is no class of gpsfsm")
    return found
