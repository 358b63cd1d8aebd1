"""JSON that means one thing: an object in which a key is twice is an error.

Parsers differ in which of the two they take, so a text that one program has looked at could mean
something else to the next one.
"""

from __future__ import annotations

import json
from typing import Any

_LONGEST = 60


class DuplicateKeyError(ValueError):
    """A key is twice in an object; the text says which one."""


def strict_loads(text: str | bytes) -> Any:
    """The value of a JSON text. Raises ValueError, and RecursionError as ``json.loads`` does.

    >>> strict_loads('{"a": [{"b": 1, "b": 2}]}')
    Traceback (most recent call last):
    gpsfsm.strict_json.DuplicateKeyError: the key 'b' occurs twice
    """
    return json.loads(text, object_pairs_hook=_object)


def json_defect(file: str, error: Exception) -> str:
    """The message about a file that is not JSON, with line and column where they are known.

    ``error`` is what ``strict_loads`` raised.

    >>> try:
    ...     strict_loads("hello")
    ... except ValueError as error:
    ...     print(json_defect("a.json", error))
    a.json:1:1: is not JSON: Expecting value
    """
    if isinstance(error, json.JSONDecodeError):
        return f"{file}:{error.lineno}:{error.colno}: is not JSON: {error.msg}"
    if isinstance(error, UnicodeDecodeError):
        return f"{file}: is not UTF-8 text (byte {error.start + 1})"
    if isinstance(error, RecursionError):
        return f"{file}: is not JSON that can be read: it is nested too deeply"
    return f"{file}: is not JSON: {error}"[:500]


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) == len(pairs):
        return made
    seen: set[str] = set()
    for key, _ in pairs:
        if key in seen:
            raise DuplicateKeyError(f"the key {key[:_LONGEST]!a} occurs twice")
        seen.add(key)
    return made
