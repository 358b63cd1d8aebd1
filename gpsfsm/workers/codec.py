"""A codec for frozen data: dataclasses, enums, tuples, mappings as JSON, and back by their types.

It is used between us and a process that reads hostile text, in place of pickle: whatever has taken
over such a process can send nothing but data, and data that does not fit the types exactly is an
error. Encoding looks at values, decoding at type annotations, so that a new field needs nothing
here; only a type that its module imports for type checkers needs a line in ``_HOMES``. A dataclass
is an object with one key, its name, and its fields in order; so members of a union can be told
apart:

    Finding(rule="GP302", severity=Severity.ERROR)   {"Finding": ["GP302", "error"]}
    (1, 2.5, None)                                   [1, 2.5, null]
    {"a": frozenset({2, 1})}                         [["a", [1, 2]]]
"""

from __future__ import annotations

import importlib
import inspect
import json
import math
import sys
import types
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from typing import Any, Literal, Union

from gpsfsm.strict_json import strict_loads

_SCALARS = (bool, int, float, str, type(None))
_SHOWN = 60
_HOMES = {
    "Approximation": "gpsfsm.model.precision",
    "Breach": "gpsfsm.fuzzing.properties",
    "DecidedBy": "gpsfsm.tasks.deciding",
    "Edit": "gpsfsm.fixing.fixer",
    "End": "gpsfsm.model.event",
    "Fill": "gpsfsm.model.ros",
    "Event": "gpsfsm.model.event",
    "Formula": "gpsfsm.tasks.ltlf",
    "Location": "gpsfsm.model.plan",
    "Mapping": "collections.abc",
    "Mended": "gpsfsm.fixing.suggest",
    "Outcome": "gpsfsm.model.event",
    "Plan": "gpsfsm.model.plan",
    "PlanReport": "gpsfsm.model.report",
    "RosCall": "gpsfsm.model.ros",
    "Task": "gpsfsm.tasks.task",
    "TimedScenario": "gpsfsm.fuzzing.subject",
    "MachinePlan": "gpsfsm.compile.units",
    "TreeMachine": "gpsfsm.compile.units",
    "TreePlan": "gpsfsm.compile.units",
    "Value": "gpsfsm.model.plan",
}
"""The modules of types that other modules of messages import for type checkers only."""


def encode(value: object) -> bytes:
    """Data as JSON. Raises ValueError for what has no form."""
    return json.dumps(_to_plain(value), separators=(",", ":")).encode("ascii")


def decode(kind: Any, text: bytes) -> Any:
    """Data of this type. Raises ValueError for anything that ``encode`` does not make of it."""
    try:
        return _from_plain(kind, strict_loads(text))
    except (ValueError, MemoryError, NameError):  # NameError: ``_HOMES`` lacks a line
        raise
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    except Exception as error:  # no key of a mapping, or refused by a dataclass
        raise ValueError(f"{type(error).__name__}: {error}") from error


def result_type(work: object) -> Any:
    """The type that a callable object returns, by its annotation."""
    call = type(work).__call__
    returned = types.SimpleNamespace(__annotations__={"return": call.__annotations__["return"]})
    return _resolved(returned, vars(sys.modules[call.__module__]))["return"]


def _to_plain(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, _SCALARS):
        return value
    if isinstance(value, tuple):
        return [_to_plain(each) for each in value]
    if isinstance(value, frozenset):
        return sorted((_to_plain(each) for each in value), key=json.dumps)
    if isinstance(value, Mapping):
        return [[_to_plain(key), _to_plain(each)] for key, each in value.items()]
    if is_dataclass(value) and not isinstance(value, type):
        parts = [_to_plain(getattr(value, each.name)) for each in fields(value) if each.init]
        return {type(value).__name__: parts}
    raise ValueError(f"there is no JSON form of a {type(value).__name__}")


def _from_plain(kind: Any, value: Any) -> Any:
    """The value as one of this type."""
    kind = _meant(kind)
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if not _has_form(kind, value):
        raise ValueError(f"this is not a {getattr(kind, '__name__', kind)}: {_shown(value)}")
    if origin in (Union, types.UnionType):
        return _from_plain(next(each for each in arguments if _has_form(each, value)), value)
    if origin is tuple:
        return _tuple(arguments, value)
    if origin is frozenset:
        members = frozenset(_from_plain(arguments[0], each) for each in value)
        return _complete(members, value)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        items = [_tuple((*arguments, int)[:2], each) for each in value]  # a Counter counts in int
        made: Any = dict if inspect.isabstract(origin) else origin
        return made(_complete(dict(items), value))
    if _is_row(kind):
        return kind(*_tuple(tuple(_resolved(kind).values()), value))
    if _is_data(kind):
        hints, parts = _hints(kind), value[kind.__name__]
        if not isinstance(parts, list) or len(parts) != len(hints):
            raise ValueError(f"these are not the fields of a {kind.__name__}: {_shown(parts)}")
        named = zip(hints.items(), parts, strict=True)
        return kind(**{name: _from_plain(hint, part) for (name, hint), part in named})
    return kind(value) if isinstance(kind, type) and issubclass(kind, Enum) else value


def _has_form(kind: Any, value: Any) -> bool:
    """True if a JSON value has the form of values of this type, but for its parts."""
    kind = _meant(kind)
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (Union, types.UnionType):
        return any(_has_form(each, value) for each in arguments)
    if origin is Literal:
        return any(value == each and type(value) is type(each) for each in arguments)
    if _is_row(kind) or (
        isinstance(origin, type) and issubclass(origin, tuple | frozenset | Mapping)
    ):
        return isinstance(value, list)
    if _is_data(kind):
        return isinstance(value, dict) and set(value) == {kind.__name__}
    if isinstance(kind, type) and issubclass(kind, Enum):
        return any(value == each.value and type(value) is type(each.value) for each in kind)
    if kind is float:  # an int stays one, as type checkers allow, if a float can hold it
        is_int = type(value) is int and abs(value) <= sys.float_info.max
        return is_int or (type(value) is float and not math.isnan(value))
    return kind in _SCALARS and type(value) is kind


def _complete(made: Any, value: list[Any]) -> Any:
    """The collection, if it has all values of a list: none of them occurs twice."""
    if len(made) != len(value):
        raise ValueError("a member occurs twice")
    return made


def _shown(value: object) -> str:
    return str(value)[:_SHOWN] if isinstance(value, _SCALARS) else f"a {type(value).__name__}"


def _meant(kind: Any) -> Any:
    """The type of a name: an alias that has itself as a part."""
    name = kind.__forward_arg__ if isinstance(kind, typing.ForwardRef) else kind
    return getattr(importlib.import_module(_HOMES[name]), name) if isinstance(name, str) else kind


def _is_row(kind: Any) -> bool:
    """True for a named tuple."""
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def _is_data(kind: Any) -> bool:
    return isinstance(kind, type) and is_dataclass(kind)


def _tuple(kinds: tuple[Any, ...], value: Any) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise ValueError(f"these are not values: {_shown(value)}")
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        return tuple(_from_plain(kinds[0], each) for each in value)
    if len(value) != len(kinds):
        raise ValueError(f"these are not {len(kinds)} values: {_shown(value)}")
    return tuple(_from_plain(kind, each) for kind, each in zip(kinds, value, strict=True))


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """The types of the fields of a dataclass."""
    hints = _resolved(kind)
    return {each.name: hints[each.name] for each in fields(kind) if each.init}


def _resolved(annotated: Any, names: dict[str, Any] | None = None) -> dict[str, Any]:
    """The annotations of an object. Raises NameError for a type that is in no module known here."""
    homes: dict[str, Any] = {}
    while True:
        try:
            return typing.get_type_hints(annotated, names, homes)
        except NameError as error:
            if error.name not in _HOMES or error.name in homes:
                raise
            homes[error.name] = getattr(importlib.import_module(_HOMES[error.name]), error.name)
