"""Parameters as Capabilities2 takes them, and what it hands over, as values of a run.

Its runners read a parameter as the one type that they expect, and the whole server ends if it has
another. So each goes as the type that its description says, and none goes without one:

    V2  CapabilityParameter(key="x", value=["1.5"], type=1)
    V1  <Runner interface="..." provider="..." x="1.5"/>

The codes are those that the server's own code counts with. The constants of the message differ from
them for vectors: a VECTOR_BOOL is 5, and the message calls it 4.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

from gpsfsm.execution.runner import RunnerError
from gpsfsm.model.capability import ValueType
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.capability import Input, Parameter, Provider

INT = 2
CODES = {
    ValueType.BOOL: 0,
    ValueType.DOUBLE: 1,
    ValueType.INT: INT,
    ValueType.STRING: 3,
    ValueType.BOOLS: 5,
    ValueType.DOUBLES: 6,
    ValueType.INTS: 7,
    ValueType.STRINGS: 8,
}
_TYPES = {code: kind for kind, code in CODES.items()}
_ITEMS = {
    ValueType.BOOLS: ValueType.BOOL,
    ValueType.DOUBLES: ValueType.DOUBLE,
    ValueType.INTS: ValueType.INT,
    ValueType.STRINGS: ValueType.STRING,
}
_LEAST_INT, _GREATEST_INT = -(1 << 31), (1 << 31) - 1
_LEAST_DOUBLE = 2.2250738585072014e-308
"""The least positive double that std::stod reads; it throws at those below."""
_MOST_TEXT = 1_000_000


@dataclass(frozen=True)
class Typed:
    """A parameter: its name, the code of its type, and its texts (one, unless it is a vector)."""

    key: str
    code: int
    texts: tuple[str, ...]


def typed(described: Provider, parameters: Mapping[str, RunValue]) -> list[Typed]:
    """The parameters of a runner. Raises RunnerError for one that would end the server."""
    taken: list[Input | Parameter] = [*described.inputs, *described.configuration]
    types = {each.name: each.type for each in taken if each.type is not ValueType.ANY}
    made = []
    for key, value in parameters.items():
        kind = types.get(key)
        if kind is None:
            raise RunnerError(
                f"the file of {described.name} does not say which type {clip(key, 100)!r} has, and "
                "one of the wrong type ends the capability server: add it to its definition"
            )
        items: Any = value if kind in _ITEMS else [value]
        if not isinstance(items, list):
            raise _unfit(key, value, kind)
        texts = tuple(_text(key, item, _ITEMS.get(kind, kind)) for item in items)
        made.append(Typed(key, CODES[kind], texts))
    return made


def _text(key: str, value: RunValue, kind: ValueType) -> str:
    if kind is ValueType.BOOL and isinstance(value, bool):
        return "true" if value else "false"
    if kind is ValueType.STRING and isinstance(value, str) and _is_sent_whole(value):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool):
        if kind is ValueType.DOUBLE and abs(value) <= sys.float_info.max:
            return repr(float(value)) if abs(value) >= _LEAST_DOUBLE else "0.0"
        if kind is ValueType.INT and _fits(value) and value == int(value):
            return str(int(value))
    raise _unfit(key, value, kind)


def _is_sent_whole(text: str) -> bool:
    """False for what no message holds: U+0000, and halves of characters."""
    return "\0" not in text and not any("\ud800" <= each <= "\udfff" for each in text)


def _fits(value: float) -> bool:
    return _LEAST_INT <= value <= _GREATEST_INT


def _unfit(key: str, value: RunValue, kind: ValueType) -> RunnerError:
    return RunnerError(
        f"{clip(repr(value), 100)} for {clip(key, 100)!r} is no {kind.value} as the capability "
        "server takes it, which would end at it"
    )


def as_xml(interface: str, provider: str, parameters: Iterable[Typed]) -> str:
    """The same as V1 takes them: attributes of an element."""
    named = [("interface", interface), ("provider", provider)]
    named += [(each.key, ",".join(each.texts)) for each in parameters]
    return f"<Runner {' '.join(f'{key}={quoteattr(text)}' for key, text in named)}/>"


def outputs(described: Provider, parameters: Iterable[Any]) -> dict[str, RunValue]:
    """The outputs in the parameters of an event, as far as the provider's file declares them."""
    types = {each.name: each.type for each in described.outputs}
    values: dict[str, RunValue] = {}
    left = _MOST_TEXT
    for each in parameters:
        left -= len(each.key) + sum(map(len, each.value))
        if left < 0:
            raise RunnerError(f"what {described.name} hands over is too long")
        if each.key not in types:
            continue
        kind = types[each.key]
        if kind is ValueType.ANY:
            kind = _TYPES.get(each.type, ValueType.STRINGS)
        texts = list(each.value)
        try:
            if kind in _ITEMS:
                values[each.key] = [_value(text, _ITEMS[kind]) for text in texts]
            elif texts:
                values[each.key] = _value(texts[0], kind)
        except ValueError:
            shown, key = clip(repr(texts), 100), clip(each.key, 100)
            raise RunnerError(
                f"{described.name} hands over {shown} for {key!r}, which is not a {kind.value}"
            ) from None
    return values


def reason(parameters: Iterable[Any]) -> str:
    """The message in the parameters of a failure; "" if there is none."""
    said = [each.value[0] for each in parameters if each.key == "message" and each.value]
    return clip(said[0], 1000) if said else ""


def _value(text: str, kind: ValueType) -> Any:
    if kind is ValueType.BOOL:
        return text == "true"
    if kind is ValueType.INT:
        return int(text)
    if kind is ValueType.DOUBLE:
        value = float(text)
        if not math.isfinite(value):
            raise ValueError
        return value
    return text
