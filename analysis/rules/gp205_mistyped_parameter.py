"""GP205: a value that is not of the type that the parameter has."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.analysis.rules.names import (
    bound_parameters,
    expected_type,
    is_placeholder,
    short,
    written,
)
from gpsfsm.late import pattern
from gpsfsm.model.capability import ValueType
from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Attribute, Value

_TRUE = frozenset({"true", "1", "yes", "on", "y", "t"})
_FALSE = frozenset({"false", "0", "no", "off", "n", "f"})
_WITH_UNIT = pattern(r"\s*([+-]?[0-9]+(?:[.,][0-9]+)?)\s*[a-zA-Z°%]{0,10}\s*")
_MAX_NUMBER = 40
_WANTED = {
    ValueType.BOOL: "neither true nor false",
    ValueType.INT: "not an integer",
    ValueType.DOUBLE: "not a finite number",
}


def find(context: Context) -> Iterator[Finding]:
    """One finding per attribute, where it stands."""
    for number, binding, attribute, parameter in bound_parameters(context):
        wanted = expected_type(binding, parameter)
        if _fits(attribute.value, wanted) or is_placeholder(attribute):
            continue
        runner = context.runner(number)
        yield RULE.finding(
            f"{written(attribute)} is {_WANTED[wanted]}, and {short(runner.interface)} takes "
            "nothing else there",
            Location(attribute.line, attribute.column, context.plan.path(runner)),
            hint=_hint(attribute, wanted),
            length=len(attribute.name),
        )


def _fits(value: Value, wanted: ValueType) -> bool:
    if wanted is ValueType.BOOL:
        return isinstance(value, bool)
    if wanted not in (ValueType.INT, ValueType.DOUBLE):
        return True
    if isinstance(value, bool | str):
        return False
    return isinstance(value, int) or (wanted is ValueType.DOUBLE and math.isfinite(value))


def _hint(attribute: Attribute, wanted: ValueType) -> str:
    name, text = clip(attribute.name, 40), attribute.text
    if wanted is ValueType.BOOL:
        word = text[:_MAX_NUMBER].strip().lower()
        if word in _TRUE | _FALSE:
            return f'write {name}="{"true" if word in _TRUE else "false"}"'
        return f'write {name}="true" or {name}="false"'
    number = _number(attribute)
    if wanted is ValueType.DOUBLE:
        return f'write {name}="{number}"' if number else f'write a number, as in {name}="1.5"'
    if number and float(number).is_integer():
        return f'write {name}="{int(float(number))}"'
    return f'write an integer, as in {name}="3"'


def _number(attribute: Attribute) -> str:
    """The number that is meant by ``1,5``, ``1.5 m`` or ``90deg``; "" if none is."""
    match = _WITH_UNIT.fullmatch(attribute.text) if len(attribute.text) <= _MAX_NUMBER else None
    return match[1].replace(",", ".") if match else ""


RULE = Rule(
    code="GP205",
    name="mistyped-parameter",
    severity=Severity.ERROR,
    summary="The value of a parameter is not of the type that its provider expects.",
    why=(
        "Attributes are read as Boolean (exactly true or false), as integer, as floating-point "
        "number, or else as text. A runner that finds another type than it expects may take its "
        "whole process down."
    ),
    fix="write a value of the type that the capability file says",
    bad=plan(go(2.0, -0.5).replace('"2.0"', '"2.0 m"')),
    good=plan(go(2.0, -0.5)),
    find=find,
)
