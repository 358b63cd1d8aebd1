"""Values of attributes, written so that an engine reads the type that the runner takes."""

from __future__ import annotations

from typing import NamedTuple

from gpsfsm.compile.fabric.typing import typed as typed_by_engine
from gpsfsm.model.capability import ValueType
from gpsfsm.model.engine import OptionType
from gpsfsm.model.plan import value_key
from gpsfsm.syntax.values import typed

__all__ = ["Spelling", "respelled"]

_OPTIONS = {
    ValueType.DOUBLE: OptionType.DOUBLE,
    ValueType.INT: OptionType.INT,
    ValueType.STRING: OptionType.STRING,
    ValueType.BOOL: OptionType.BOOL,
}
_BOOLS = {"true": "true", "1": "true", "false": "false", "0": "false"}


class Spelling(NamedTuple):
    """Another way to write a value. Not ``safe``: it is another value."""

    text: str
    safe: bool


def respelled(text: str, wanted: ValueType) -> Spelling | None:
    """How to write a value so that fabric-v2 reads ``wanted``; None if there is no way.

    >>> respelled("1", ValueType.DOUBLE), respelled("42", ValueType.STRING)
    (Spelling(text='1.0', safe=True), Spelling(text='42 ', safe=False))
    >>> respelled("far", ValueType.DOUBLE)
    """
    if wanted is ValueType.STRING:
        new: str | None = text + " "
    elif wanted is ValueType.BOOL:
        new = _BOOLS.get(text.strip().lower())
    elif wanted is ValueType.DOUBLE:
        new = _double(text)
    else:
        new = _integer(text)
    if new is None or typed_by_engine("", new).type is not _OPTIONS.get(wanted):
        return None
    return Spelling(new, value_key(typed(new)) == value_key(typed(text)))


def _double(text: str) -> str | None:
    """``1`` → ``1.0``."""
    value = typed(text.strip())
    if isinstance(value, bool | str):
        return None
    return f"{value}.0" if isinstance(value, int) else text.strip()


def _integer(text: str) -> str | None:
    """``1.0`` → ``1``."""
    value = typed(text.strip())
    if isinstance(value, bool | str):
        return None
    return str(int(value)) if isinstance(value, int) or value.is_integer() else None
