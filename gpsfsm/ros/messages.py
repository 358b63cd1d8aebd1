"""Messages of ROS 2: their definitions by name, and their fields by path.

A path is ``pose.pose.position.x``; ``poses[].pose.position.x`` stands for the field in each item of
a list. What comes out of a message are values as runners hand them over: texts, numbers, Booleans
and lists of these. Names of definitions come from capability files, which are not trusted: only
packages that look like generated ones are imported.
"""

from __future__ import annotations

import array
import importlib
import importlib.util
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.model.printable import clip
from gpsfsm.ros.node import RosError, distribution

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from gpsfsm.execution.records import RunValue

WHOLE = "."
"""In place of a path: all of a message, as text."""

_TYPE = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Z][A-Za-z0-9]*)")
_SNAKE = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_SEQUENCE = re.compile(r"sequence<(.+?)(?:, *\d+)?>|(.+)\[\d+\]")
_MAX_ITEMS = 1_000_000
_MAX_DEPTH = 20
_OCCUPIED = 50  # of 100: how sure the map is that there is something


class MissingPackageError(RosError):
    """A package of definitions is not installed."""


def definition(name: str) -> Any:
    """The class of a definition such as ``nav2_msgs/action/NavigateToPose``.

    Raises MissingPackageError, which names the package of the system that brings it, and RosError
    if the package has no such definition.
    """
    match = _TYPE.fullmatch(name)
    if match is None:
        raise RosError(
            f"{clip(name, 200)!r} is not a definition: write package/msg|srv|action/Name"
        )
    package, kind, short = match.groups()
    module = f"_{_SNAKE.sub('_', short).lower()}"
    spec = importlib.util.find_spec(package)
    folders = [] if spec is None else list(spec.submodule_search_locations or ())
    if not folders:
        raise MissingPackageError(
            f"the messages of {package} are not installed: "
            f"apt install ros-{distribution()}-{package.replace('_', '-')}, or source the "
            "workspace that has them"
        )
    if not any((Path(folder) / kind / f"{module}.py").is_file() for folder in folders):
        raise RosError(f"{package} has no {kind} {short}: another version of it is installed")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), short)
    except (ImportError, AttributeError) as error:
        raise RosError(f"{name} cannot be used: {clip(str(error), 300)}") from None


def first_definition(names: Iterable[str]) -> tuple[str, Any]:
    """The first of some definitions that is installed. Raises RosError with all that is missing."""
    problems = []
    for name in names:
        try:
            return name, definition(name)
        except RosError as error:
            problems.append(str(error))
    raise RosError("; ".join(problems))


# --- filling --------------------------------------------------------------------------------------


def fill(
    message: Any, values: Mapping[str, RunValue], optional: Collection[str] = frozenset()
) -> None:
    """Set fields of a message by path. Raises RosError for a field or a value that does not fit.

    ``optional`` are paths that the definition need not have. A path with ``[]`` takes a list, or a
    text of numbers, and makes as many items as it has; any other value goes into each item that
    others have made.
    """
    values = {path: _listed(value) if "[]" in path else value for path, value in values.items()}
    lists = {path: value for path, value in values.items() if isinstance(value, list)}
    for path in [*lists, *(path for path in values if path not in lists)]:
        try:
            _set(message, path.split("."), values[path], path)
        except _NoFieldError as error:
            if path not in optional:
                raise RosError(str(error)) from None


def _listed(value: RunValue) -> RunValue:
    """A text of numbers, between blanks, commas or semicolons, as a list; all else as it is.

    >>> _listed("1 2.5; -3"), _listed("map")
    ([1.0, 2.5, -3.0], 'map')
    """
    if not isinstance(value, str):
        return value
    try:
        return [float(each) for each in re.split(r"[\s,;]+", value.strip())]
    except ValueError:
        return value


class _NoFieldError(RosError):
    """A definition lacks a field."""


def _set(message: Any, path: list[str], value: RunValue, whole: str) -> None:
    name, rest = path[0], path[1:]
    bare = name.removesuffix("[]")
    kind = _kind(message, bare)
    if name == bare:
        if rest:
            _set(getattr(message, bare), rest, value, whole)
        else:
            setattr(message, bare, _typed(value, kind, whole))
        return
    match = _SEQUENCE.fullmatch(kind)
    if match is None or not rest:
        raise RosError(f"the field {bare} of {_named(message)} is not a list of messages")
    items = getattr(message, bare)
    if isinstance(value, list):
        if not items:
            items = [definition(_full(match[1] or match[2]))() for _ in value]
            setattr(message, bare, items)
        if len(items) != len(value):
            raise RosError(f"the lists for {bare} of {_named(message)} differ in length")
        for item, each in zip(items, value, strict=True):
            _set(item, rest, each, whole)
    else:
        for item in items:
            _set(item, rest, value, whole)


def _full(name: str) -> str:
    """``geometry_msgs/Pose`` as ``geometry_msgs/msg/Pose``."""
    package, _, short = name.partition("/")
    return f"{package}/msg/{short}"


def _kind(message: Any, name: str) -> str:
    fields: dict[str, str] = message.get_fields_and_field_types()
    if name not in fields:
        listed = ", ".join(fields) or "none"
        raise _NoFieldError(
            f"{_named(message)} has no field {name} (it has {listed}): "
            "its definition is of another version"
        )
    return fields[name]


def _named(message: Any) -> str:
    return type(message).__name__.replace("_", " ")


def _typed(value: RunValue, kind: str, path: str) -> Any:
    """A value as a field of some kind takes it."""
    match = _SEQUENCE.fullmatch(kind)
    if match is not None:
        items = value if isinstance(value, list) else [value]
        return [_typed(each, match[1] or match[2], path) for each in items]
    if kind in ("float", "double"):
        if not isinstance(value, bool) and isinstance(value, int | float):
            return float(value)
    elif kind.startswith(("int", "uint", "octet", "byte", "char")):
        if not isinstance(value, bool) and isinstance(value, int | float) and value == int(value):
            return _bounded(int(value), kind, path)
    elif kind == "boolean":
        if isinstance(value, bool):
            return value
    elif kind.startswith(("string", "wstring")):
        return value if isinstance(value, str) else json.dumps(value)
    raise RosError(f"{clip(json.dumps(value), 100)} does not fit the field {path}, a {kind}")


def _bounded(value: int, kind: str, path: str) -> int:
    signed = kind.startswith("int")
    bits = int("".join(filter(str.isdigit, kind)) or 8)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if not low <= value <= high:
        raise RosError(f"{value} does not fit the field {path}, which is from {low} to {high}")
    return value


# --- reading --------------------------------------------------------------------------------------


def has_field(message: Any, path: str) -> bool:
    """True if a message has a field."""
    try:
        _at(message, path)
    except RosError:
        return False
    return True


def value_at(message: Any, path: str) -> RunValue:
    """The value of a field, or of all of a message, as a runner hands it over. Raises RosError.

    A path that ends with ``[]`` is the length of a list.
    """
    field = _at(message, path)
    return len(field) if path.endswith("[]") else as_value(field)


def _at(message: Any, path: str) -> Any:
    if path == WHOLE:
        return message
    for name in path.split("."):
        bare = name.removesuffix("[]")
        _kind(message, bare)
        message = getattr(message, bare)
    return message


def as_value(field: Any, depth: int = 0) -> RunValue:
    """A field as a value: messages become text, a map the text that prompts know."""
    if isinstance(field, bool | int | float | str):
        return field
    if isinstance(field, bytes | bytearray | array.array) or hasattr(field, "tolist"):
        items = list(field) if isinstance(field, bytes | bytearray) else field.tolist()
        return _short(items)
    if hasattr(field, "get_fields_and_field_types"):
        if {"info", "data"} <= set(field.get_fields_and_field_types()):
            return map_text(field)
        return json.dumps(_plain(field, depth), separators=(",", ":"))
    if isinstance(field, list | tuple) and depth < _MAX_DEPTH:
        return _short([as_value(each, depth + 1) for each in field])
    raise RosError(f"a value of the type {type(field).__name__} cannot be handed over")


def _short(items: list[Any]) -> list[RunValue]:
    if len(items) > _MAX_ITEMS:
        raise RosError(f"a list of {len(items):,} values is too long to be handed over")
    return items


def _plain(field: Any, depth: int) -> Any:
    """A message as JSON has it."""
    if depth > _MAX_DEPTH:
        raise RosError(f"a message is nested more than {_MAX_DEPTH} levels deep")
    if hasattr(field, "get_fields_and_field_types"):
        names = field.get_fields_and_field_types()
        return {name: _plain(getattr(field, name), depth + 1) for name in names}
    if isinstance(field, list | tuple):
        return [_plain(each, depth + 1) for each in field]
    return as_value(field, depth)


def map_text(grid: Any) -> str:
    """A nav_msgs/OccupancyGrid as the text that OccupancyGridRunner hands over.

    A line with the size, the length of a cell and the origin, then the rows from south to north:
    ``#`` is a cell with something in it, ``?`` one that nobody has seen.
    """
    info = grid.info
    width, height = int(info.width), int(info.height)
    if width * height != len(grid.data) or width * height > _MAX_ITEMS:
        raise RosError(f"the map has {len(grid.data):,} cells, and says {width} x {height}")
    cells = "".join("#" if each >= _OCCUPIED else "?" if each < 0 else "." for each in grid.data)
    rows = [cells[begin : begin + width] for begin in range(0, len(cells), width or 1)]
    origin = info.origin.position
    head = f"width={width} height={height} resolution={info.resolution:g}"
    return "\n".join([f"{head} origin=({origin.x:g}, {origin.y:g})", *rows])
