"""Messages of ROS 2 from and to what JSON has."""

from __future__ import annotations

import importlib
from typing import Any


def type_named(name: str) -> Any:
    """The class of a message, a service or an action: ``fabric_msgs/srv/ParsePlan``."""
    package, kind, short = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), short)


def as_json(message: Any) -> Any:
    """A message as JSON has it."""
    if hasattr(message, "get_fields_and_field_types"):
        return {name: as_json(getattr(message, name)) for name in fields(message)}
    if isinstance(message, str | bool | int | float | None):
        return message
    if isinstance(message, bytes):
        return message.hex()
    return [as_json(value) for value in message]


def filled(message: Any, values: dict[str, Any]) -> Any:
    """The message, with values for some of its fields."""
    for name, value in values.items():
        kind = fields(message)[name]
        if isinstance(value, dict):
            filled(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            element = _class_of(kind.removeprefix("sequence<").split(">")[0].split("[")[0])
            setattr(message, name, [filled(element(), each) for each in value])
        elif kind in ("float", "double"):
            setattr(message, name, float(value))
        else:
            setattr(message, name, value)
    return message


def fields(message: Any) -> dict[str, str]:
    """The names of a message's fields, with their types."""
    return dict(message.get_fields_and_field_types())


def _class_of(kind: str) -> Any:
    package, short = kind.split(",", maxsplit=1)[0].split("/")
    return type_named(f"{package}/msg/{short}")
