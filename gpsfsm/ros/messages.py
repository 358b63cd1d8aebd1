"""Messages of ROS 2: their definitions by name, and their fields by path.

A path is ``pose.pose.position.x``; ``poses[].pose.position.x`` stands for the field in each item of
a list, ``poses[first].header`` for that of one. What comes out of a message are values as runners
hand them over: texts, numbers, Booleans and lists of these. Names of definitions come from
capability files, which are not trusted: only packages that look like generated ones are imported.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import math
import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.model.printable import clip
from gpsfsm.model.ros import BEST_BY, WHOLE, steps
from gpsfsm.ros.node import RosError, distribution

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.ros import Steps

_TYPE = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Z][A-Za-z0-9]*)")
_SNAKE = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_SEQUENCE = re.compile(r"sequence<(.+?)(?:, *(\d+))?>|(.+)\[(\d+)\]")
_APART = re.compile(r"\s*[,;]\s*|\s+")
_DECIMAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_LARGEST_FLOAT = 3.4028234663852886e38
NUMBERS = ("int", "uint", "float", "double", "char")
"""The beginnings of the types of numbers."""
_MAX_ITEMS = 1_000_000
_MAX_DEPTH = 20
_OCCUPIED = 50  # of 100: how sure the map is that there is something


class MissingPackageError(RosError):
    """A package of definitions is not installed."""


class NoCountError(RosError):
    """Nothing makes the items of a list of messages."""


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
#
# The entries of a request are filled in together, field by field from the outside to the inside, so
# that all that make the items of one list are seen at once. For {"a[].x": [1, 2], "a[].y": 0} the
# field ``a`` has two entries: the first has one level of lists, as many as its path has "[]", so it
# makes two items, and each gets its own x; the second has none, and y = 0 goes into both.


class _Entry(NamedTuple):
    """A value on its way to its field, along the rest of its path.

    ``depth`` is how deep its lists are nested; ``lists`` how many are still before it, with that
    in which it ends.
    """

    path: tuple[str, ...]
    value: RunValue
    depth: int
    lists: int
    whole: str
    optional: bool

    def within(self, number: int | None = None) -> _Entry:
        """The entry behind the first name of its path: one item of its list, or all of it."""
        name, path = self.path[0], self.path[1:]
        lists = self.lists - name.endswith("[]")
        if number is None:
            return self._replace(path=path, lists=lists)
        assert isinstance(self.value, list)
        value, depth = self.value[number], self.depth - 1
        return self._replace(path=path, lists=lists, value=value, depth=depth)


def fill(
    message: Any, values: Mapping[str, RunValue], optional: Collection[str] = frozenset()
) -> None:
    """Set fields of a message by path. Raises RosError for a field or a value that does not fit.

    ``optional`` are paths that the definition need not have. Lists make the items of the lists in
    their paths, and all else goes into each item (docs/ros.md, "Fields and lists").
    """
    _fill(message, [_entry(message, *item, item[0] in optional) for item in values.items()])


def _entry(message: Any, path: str, value: RunValue, optional: bool) -> _Entry:
    kind, lists = "", path.count("[]")
    with suppress(RosError):  # said where the field is filled, unless it is optional
        kind = kind_at(message, path.replace("[]", "[all]"))
    if match := _SEQUENCE.fullmatch(kind):
        item = match[1] or match[3]
        if "/" in item:
            raise RosError(f"the field {path} is a list of messages: fill the fields of its items")
        value, lists = _items(value, path, is_text="string" in item), lists + 1
    elif lists:
        value = _listed(value)
    depth = _depth(value, path)[0] if lists else 0
    return _Entry(tuple(path.split(".")), value, depth, lists, path, optional)


def _fill(message: Any, entries: list[_Entry]) -> None:
    by_field: dict[str, list[_Entry]] = {}
    for entry in entries:
        by_field.setdefault(entry.path[0].removesuffix("[]"), []).append(entry)
    for name, those in by_field.items():
        try:
            kind = _kind(message, name)
        except _NoFieldError:
            if all(entry.optional for entry in those):
                continue
            raise
        _fill_field(message, name, kind, those)


def _fill_field(message: Any, name: str, kind: str, entries: list[_Entry]) -> None:
    ways = {(each.path[0] == name, len(each.path) == 1) for each in entries}
    if len(ways) > 1 or ((True, True) in ways and len(entries) > 1):
        both = " and ".join(each.whole for each in entries[:2])
        raise RosError(f"the field {name} of {_named(message)} is filled in two ways: {both}")
    if ways == {(True, True)}:
        setattr(message, name, _typed(entries[0].value, kind, entries[0].whole))
    elif ways == {(True, False)}:
        inner = getattr(message, name)
        if not _has_fields(inner):
            raise RosError(f"the field {name} of {_named(message)} is a {kind}, not a message")
        _fill(inner, [entry.within() for entry in entries])
    else:
        _fill_items(message, name, kind, entries)


def _fill_items(message: Any, name: str, kind: str, entries: list[_Entry]) -> None:
    where = f"{name} of {_named(message)}"
    match = _SEQUENCE.fullmatch(kind)
    if match is None or "/" not in (match[1] or match[3]) or any(not e.path[1:] for e in entries):
        raise RosError(f"the field {where} is not a list of messages")
    makers = [each for each in entries if each.depth >= each.lists]
    counts = {len(each.value) for each in makers if isinstance(each.value, list)}
    items = list(getattr(message, name))
    if match[4]:
        counts.add(int(match[4]))
    elif not counts and any(each.depth for each in entries):
        counts = {1}
    if len(counts) > 1:
        raise RosError(f"the lists for {where} differ in length, or do not fit it, a {kind}")
    if not counts and not items:
        raise NoCountError(f"nothing says how many items the list {where} has: fill it with a list")
    count = counts.pop() if counts else len(items)
    if not count:
        raise RosError(f"the list for {where} is empty")
    _fits_in(count, kind, where)
    if len(items) != count:
        items = [definition(_full(match[1] or match[3]))() for _ in range(count)]
        setattr(message, name, items)
    for number, item in enumerate(items):
        _fill(item, [each.within(number if each in makers else None) for each in entries])


def misfit(
    message: Any, path: str, value: RunValue | None = None, *, optional: bool = False
) -> str:
    """The reason why a value cannot be in a field, whatever else fills its message; "" if it can.

    Without a value: why none can.
    """
    try:
        kind = kind_at(message, path.replace("[]", "[all]"))
        if path.endswith("[]") or "/" in kind:
            return f"the field {path} is not a value but a {kind}: fill the fields of its messages"
        if value is None:
            return ""
        entry = _entry(message, path, value, optional)
        levels = min(entry.depth, entry.lists) - (_SEQUENCE.fullmatch(kind) is not None)
        for leaf in _leaves(entry.value, levels):
            _typed(leaf, kind, path)
    except _NoFieldError as error:
        return "" if optional else str(error)
    except RosError as error:
        return str(error)
    except ValueError:
        return f"{clip(path, 200)!r} is not a field"
    return ""


def _leaves(value: RunValue, levels: int) -> list[RunValue]:
    """The values within so many levels of lists."""
    if levels <= 0 or not isinstance(value, list):
        return [value]
    return [leaf for each in value for leaf in _leaves(each, levels - 1)]


def _depth(value: RunValue, path: str) -> tuple[int, bool]:
    """The levels of lists in a value, and whether there may be no more, as of an empty list.

    Raises RosError if its items differ in them.
    """
    if not isinstance(value, list):
        return 0, True
    depths = {_depth(each, path) for each in value}
    most = max((depth for depth, _ in depths), default=0)
    if any(exact and depth < most for depth, exact in depths):
        raise RosError(f"the items of the list for {path} are lists of different depth")
    return 1 + most, any(exact for _, exact in depths)


def _listed(value: RunValue) -> RunValue:
    """A text of numbers, between blanks, commas or semicolons, or in JSON, as a list.

    >>> _listed("1 2.5; -3"), _listed("[[1], [2]]"), _listed("map")
    ([1, 2.5, -3], [[1], [2]], 'map')
    """
    if not isinstance(value, str):
        return value
    try:
        if value.lstrip().startswith("["):
            return _json_list(value)
        return [_number(each) for each in _APART.split(value.strip())]
    except (ValueError, RecursionError):
        return value


def _number(text: str) -> int | float:
    if _DECIMAL.fullmatch(text) is None:
        raise ValueError(text)
    return float(text) if set(text) & set(".eE") else int(text)


def _json_list(text: str) -> list[RunValue]:
    """A list in JSON. Raises ValueError if it has something in it that is no value."""

    def refuse(constant: str) -> None:
        raise ValueError(constant)

    def checked(items: list[Any], depth: int) -> list[RunValue]:
        for each in items:
            if isinstance(each, list) and depth < _MAX_DEPTH:
                checked(each, depth + 1)
            elif not isinstance(each, bool | int | float | str):
                raise ValueError(each)
        return items

    return checked(json.loads(text, parse_constant=refuse), 0)


class _NoFieldError(RosError):
    """A definition lacks a field."""


def _full(name: str) -> str:
    """``geometry_msgs/Pose`` as ``geometry_msgs/msg/Pose``."""
    package, _, short = name.partition("/")
    return f"{package}/msg/{short}"


def _has_fields(value: Any) -> bool:
    return hasattr(value, "get_fields_and_field_types")


def _kind(message: Any, name: str) -> str:
    if not _has_fields(message):
        raise RosError(f"there is no field {name} in a {type(message).__name__}")
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
        assert isinstance(value, list), "texts have been taken apart"
        _fits_in(len(value), kind, f"the field {path}")
        return [_typed(each, match[1] or match[3], path) for each in value]
    if kind in ("float", "double"):
        if not isinstance(value, bool) and isinstance(value, int | float):
            return _real(value, kind, path)
    elif kind.startswith(("int", "uint", "octet", "byte", "char")):
        if not isinstance(value, bool) and isinstance(value, int | float) and value % 1 == 0:
            whole = _bounded(int(value), kind, path)
            return bytes([whole]) if kind == "octet" else whole
    elif kind == "boolean":
        if isinstance(value, bool):
            return value
    elif kind.startswith(("string", "wstring")):
        text = value if isinstance(value, str) else _as_json(value)
        most = re.search(r"\d+", kind)
        if text is not None and (most is None or len(text) <= int(most[0])):
            return text
    raise RosError(f"{clip(json.dumps(value), 100)} does not fit the field {path}, a {kind}")


def _as_json(value: RunValue) -> str | None:
    try:
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    except ValueError:  # JSON has no infinite numbers
        return None


def _items(value: RunValue, path: str, *, is_text: bool) -> list[RunValue]:
    """The items of a field that is a list. Raises RosError for a blank text.

    >>> _items("j1 j2", "a", is_text=True), _items("living room, hall", "a", is_text=True)
    (['j1', 'j2'], ['living room', 'hall'])
    """
    if not isinstance(value, str):
        return value if isinstance(value, list) else [value]
    if not value.strip():
        raise RosError(f"the text for the list {path} is empty")
    listed = _listed(value)
    if isinstance(listed, list) and (not is_text or value.lstrip().startswith("[")):
        return listed
    if not is_text:
        return [value]
    parts = re.split(r"[,;]", value) if re.search(r"[,;]", value) else value.split()
    return [part.strip() for part in parts]


def _fits_in(count: int, kind: str, where: str) -> None:
    match = _SEQUENCE.fullmatch(kind)
    assert match is not None
    most, exactly = match[2], match[4]
    if (most and count > int(most)) or (exactly and count != int(exactly)):
        raise RosError(f"{count} items do not fit {where}, a {kind}")


def _real(value: float, kind: str, path: str) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if math.isinf(number) != (value in (math.inf, -math.inf)) or (
        kind == "float" and _LARGEST_FLOAT < abs(number) < math.inf
    ):
        raise RosError(f"{clip(str(value), 100)} is too large for the field {path}, a {kind}")
    return number


def _bounded(value: int, kind: str, path: str) -> int:
    signed = kind.startswith("int")
    bits = int("".join(filter(str.isdigit, kind)) or 8)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if not low <= value <= high:
        raise RosError(f"{value} does not fit the field {path}, which is from {low} to {high}")
    return value


# --- reading --------------------------------------------------------------------------------------


def kind_at(message: Any, path: str) -> str:
    """The type of a field, by the definition, whatever is in its lists. Raises RosError.

    The type of ``poses[first].header.frame_id`` is ``string``, that of ``poses[]`` is ``int``.
    """
    kind = ""
    for name, pick in steps(path):
        kind = _kind(message, name)
        where, message = f"{name} of {_named(message)}", getattr(message, name)
        if pick is None:
            continue
        match = _SEQUENCE.fullmatch(kind)
        if match is None:
            raise RosError(f"the field {where} is not a list")
        if not pick:
            return "int"
        kind = match[1] or match[3]
        message = definition(_full(kind))() if "/" in kind else None
        if pick.startswith(BEST_BY):
            by = kind_at(message, pick.removeprefix(BEST_BY))
            if not by.startswith(("int", "uint", "float", "double")):
                raise RosError(f"the best of {where} is asked for by a {by}, not by a number")
    return kind


def has_field(message: Any, path: str) -> bool:
    """True if a definition has a field; its lists may be empty."""
    try:
        return path == WHOLE or bool(kind_at(message, path))
    except RosError:
        return False


def value_at(message: Any, path: str) -> RunValue | None:
    """The value of a field, or of all of a message, as a runner hands it over. Raises RosError.

    None stands for a number that has not been measured. What a path may pick from lists is in
    docs/ros.md, "Fields and lists".
    """
    if path == WHOLE:
        return as_value(message)
    kind_at(message, path)  # not to be kept from saying so by an empty list
    return _read(message, steps(path))


def _read(field: Any, path: Steps) -> RunValue | None:
    if not path:
        return as_value(field)
    (name, pick), rest = path[0], path[1:]
    inner = getattr(field, name)
    if pick is None:
        return _read(inner, rest)
    items = inner.tolist() if hasattr(inner, "tolist") else list(inner)
    if pick == "":
        return len(items)
    if pick == "all":
        return _handed_over([_read(each, rest) for each in items])
    if pick.startswith(BEST_BY):
        items = _best(items, steps(pick.removeprefix(BEST_BY)))
    if not items:
        raise RosError(f"there is none in {name} of {_named(field)}")
    return _read(items[-1 if pick == "last" else 0], rest)


def _best(items: list[Any], path: Steps) -> list[Any]:
    """The item whose field is the greatest, the first of several; none if no field has a value."""
    best: list[Any] = []
    most: float | None = None
    for item in items:
        score = _read(item, path)
        assert not isinstance(score, str | list), "the type of the field is a number"
        if score is not None and (most is None or score > most):
            best, most = [item], score
    return best


def as_value(field: Any) -> RunValue | None:
    """A field as a value: messages become text, a map the text that prompts know.

    None stands for a number that has not been measured.
    """
    if isinstance(field, float) and not math.isfinite(field):
        return None
    if isinstance(field, bool | int | float | str):
        return field
    if _has_fields(field):
        if {"info", "data"} <= set(field.get_fields_and_field_types()):
            return map_text(field)
        return json.dumps(_plain(field, 0), separators=(",", ":"))
    if isinstance(field, bytes | bytearray):
        return _handed_over(list(field))
    if hasattr(field, "tolist"):
        return _handed_over(field.tolist())
    if isinstance(field, list | tuple):
        return _handed_over([as_value(each) for each in field])
    raise RosError(f"a value of the type {type(field).__name__} cannot be handed over")


def _handed_over(items: list[Any]) -> list[RunValue]:
    if len(items) > _MAX_ITEMS:
        raise RosError(f"a list of {len(items):,} values is too long to be handed over")
    if any(each is None or (isinstance(each, float) and not math.isfinite(each)) for each in items):
        raise RosError("a list with numbers that have not been measured cannot be handed over")
    return items


def _plain(field: Any, depth: int) -> Any:
    """A message as JSON has it."""
    if depth > _MAX_DEPTH:
        raise RosError(f"a message is nested more than {_MAX_DEPTH} levels deep")
    if _has_fields(field):
        names = field.get_fields_and_field_types()
        return {name: _plain(getattr(field, name), depth + 1) for name in names}
    if hasattr(field, "tolist"):
        field = field.tolist()
    if isinstance(field, list | tuple):
        if len(field) > _MAX_ITEMS:
            raise RosError(f"a list of {len(field):,} values is too long to be handed over")
        return [_plain(each, depth + 1) for each in field]
    return as_value(field)


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
