"""Type words and values of capability files."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

from gpsfsm.capabilities.reading import Items, Scalar
from gpsfsm.model.capability import ValueType

if TYPE_CHECKING:
    from gpsfsm.model.plan import Value

__all__ = ["NUMBERS", "TYPE_WORDS", "fits", "typed", "value_type"]

_BASES = {
    "string": "string",
    "str": "string",
    "bool": "bool",
    "boolean": "bool",
    "int": "int",
    "integer": "int",
    "double": "double",
    "float": "double",
    "number": "double",
}
TYPE_WORDS = tuple(_BASES) + tuple(f"{word}[]" for word in _BASES)
"""All words for types that files may use."""
NUMBERS = frozenset({ValueType.ANY, ValueType.INT, ValueType.DOUBLE})
"""The types of which a value may be a number."""
_MAX_DIGITS = 300


def value_type(word: str) -> ValueType | None:
    """The type that a word names; None if it names none."""
    if not word:
        return ValueType.ANY
    bare = word.strip().lower()
    base = _BASES.get(bare.removesuffix("[]").strip())
    if base is None:
        return None
    return ValueType(base + "[]" if bare.endswith("[]") else base)


def typed(node: object, wanted: ValueType) -> Value | None:
    """A written value as a value of this type; None if it is none.

    A list becomes the text of a JSON list.
    """
    if isinstance(node, Items):
        if not wanted.endswith("[]"):
            return None
        items = [typed(item, ValueType(wanted.removesuffix("[]"))) for item in node]
        return None if None in items else json.dumps(items, ensure_ascii=False)
    if not isinstance(node, Scalar) or node.value is None:
        return None
    if wanted is ValueType.ANY:
        return node.value if _finite(node.value) else None
    if wanted in (ValueType.STRING,) or wanted.endswith("[]"):
        return node.text
    return _read(node.value, wanted)


def fits(value: Value, wanted: ValueType) -> bool:
    """Whether a value that a plan would write so is of this type."""
    if wanted is ValueType.BOOL:
        return isinstance(value, bool)
    if wanted is ValueType.INT:
        return isinstance(value, int) and not isinstance(value, bool)
    if wanted is ValueType.DOUBLE:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return True


def _read(value: Value, wanted: ValueType) -> Value | None:
    """Types do not tell quoted values from others here, nor does the original stack."""
    if wanted is ValueType.BOOL:
        if isinstance(value, str):
            return {"true": True, "false": False}.get(value)
        return value if isinstance(value, bool) else None
    if isinstance(value, bool):
        return None
    try:
        number = _number(value) if isinstance(value, str) else value
        if wanted is ValueType.INT:
            return number if isinstance(number, int) else None
        return float(number) if _finite(number) else None
    except (ValueError, OverflowError):
        return None


def _number(text: str) -> float:
    if len(text) > _MAX_DIGITS:
        raise ValueError(text[:20])
    try:
        return int(text)
    except ValueError:
        return float(text)


def _finite(value: Value) -> bool:
    try:
        return isinstance(value, str) or math.isfinite(value)
    except OverflowError:
        return False
