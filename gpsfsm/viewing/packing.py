"""Long lists of like objects as columns, which is several times shorter.

``web/unpack.js`` makes the same document of it again. A list of at least ten objects becomes
``{"$columns": [column, …], "$rows": n}``; a column holds the values of one name, in the shortest
of these forms:

``{"name", "all"}``            the values
``{"name", "steps"}``          of whole numbers: the first one, then the differences
``{"name", "values", "of"}``   the different values, and which of them it is
``{"name", "at", "all"}``      which rows have such a value at all, and the values
"""

from __future__ import annotations

import json
from typing import Any

__all__ = ["packed", "unpacked"]

_FEWEST = 10
_MARK = "$columns"
_ABSENT = object()
_dump = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode


def packed(value: Any) -> Any:
    """The value with its long lists as columns; no object of it may have a name with ``$``."""
    if isinstance(value, dict):
        return {name: packed(found) for name, found in value.items()}
    if not isinstance(value, list):
        return value
    if len(value) < _FEWEST or not all(isinstance(each, dict) for each in value):
        return [packed(each) for each in value]
    names = dict.fromkeys(name for each in value for name in each)
    columns = [_column(name, [each.get(name, _ABSENT) for each in value]) for name in names]
    return {_MARK: columns, "$rows": len(value)}


def _column(name: str, found: list[Any]) -> dict[str, Any]:
    at = [row for row, value in enumerate(found) if value is not _ABSENT]
    if len(at) < len(found):
        return {"name": name, "at": at, "all": [packed(found[row]) for row in at]}
    forms: list[dict[str, Any]] = [{"name": name, "all": [packed(value) for value in found]}]
    if all(type(value) is int for value in found):
        steps = [now - before for before, now in zip([0, *found], found, strict=False)]
        forms.append({"name": name, "steps": steps})
    if all(isinstance(value, str | bool | int) for value in found):
        values: dict[tuple[type, Any], int] = {}
        of = [values.setdefault((type(value), value), len(values)) for value in found]
        forms.append({"name": name, "values": [value for _, value in values], "of": of})
    return min(forms, key=lambda form: len(_dump(form)))


def unpacked(value: Any) -> Any:
    """What was packed.

    >>> rows = [{"name": "a", "line": line} for line in range(1000, 1010)]
    >>> unpacked(packed({"rows": rows})) == {"rows": rows}
    True
    """
    if isinstance(value, list):
        return [unpacked(each) for each in value]
    if not isinstance(value, dict):
        return value
    if _MARK not in value:
        return {name: unpacked(found) for name, found in value.items()}
    rows: list[dict[str, Any]] = [{} for _ in range(value["$rows"])]
    for column in value[_MARK]:
        values = _values(column)
        for row, found in zip(column.get("at", range(len(rows))), values, strict=True):
            rows[row][column["name"]] = found
    return rows


def _values(column: dict[str, Any]) -> list[Any]:
    if "of" in column:
        return [column["values"][number] for number in column["of"]]
    if "steps" in column:
        found, value = [], 0
        for step in column["steps"]:
            value += step
            found.append(value)
        return found
    return [unpacked(each) for each in column["all"]]
