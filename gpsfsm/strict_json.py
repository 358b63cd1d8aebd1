"""JSON that means one thing: an object in which a key is twice is an error.

Parsers differ in which of the two they take, so a text that one program has looked at could mean
something else to the next one.
"""

from __future__ import annotations

import json
from typing import Any

_LONGEST = 60
_COMMA = "nothing follows this comma"
_REASONS = {
    "Expecting value": "a value is expected",
    "Expecting property name": "a key in double quotes is expected",
    "Expecting ':'": "a colon is expected",
    "Expecting ','": "a comma is expected, or the end of the list or object",
    "Extra data": "there is more after the value",
    "Unterminated string": "this string has no end",
    "Invalid control character": "a control character is not allowed in a string",
    "Invalid \\": "this escape is not allowed",
    "Illegal trailing comma": _COMMA,
    "Unexpected UTF-8 BOM": "the text begins with a byte order mark",
}
"""Our reasons for the messages of ``json``, by the beginnings of these."""


class DuplicateKeyError(ValueError):
    """A key is twice in an object; the text says which one."""


def strict_loads(text: str | bytes) -> Any:
    """The value of a JSON text. Raises ValueError, and RecursionError as ``json.loads`` does.

    An error in the syntax is the JSONDecodeError of ``own_error``.

    >>> strict_loads('{"a": [{"b": 1, "b": 2}]}')
    Traceback (most recent call last):
    gpsfsm.strict_json.DuplicateKeyError: the key 'b' occurs twice
    """
    try:
        return json.loads(text, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise own_error(error) from None


def own_error(error: json.JSONDecodeError) -> json.JSONDecodeError:
    """The same error in our words; those of Python, and some places, change with its version.

    >>> try:
    ...     json.loads('{"a": 1, }')
    ... except json.JSONDecodeError as error:
    ...     own_error(error)
    JSONDecodeError('nothing follows this comma: line 1 column 8 (char 7)')
    """
    reason = next((own for begin, own in _REASONS.items() if error.msg.startswith(begin)), "")
    before, at = error.doc[: error.pos].rstrip(), error.doc[error.pos : error.pos + 1]
    if at in ("]", "}") and before.endswith(","):  # Python 3.13 says so itself, at the comma
        return json.JSONDecodeError(_COMMA, error.doc, len(before) - 1)
    return json.JSONDecodeError(reason or error.msg, error.doc, error.pos)


def json_defect(file: str, error: Exception) -> str:
    """The message about a file that is not JSON, with line and column where they are known.

    ``error`` is what ``strict_loads`` raised.

    >>> try:
    ...     strict_loads("hello")
    ... except ValueError as error:
    ...     print(json_defect("a.json", error))
    a.json:1:1: is not JSON: a value is expected
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
