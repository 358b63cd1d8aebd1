"""JSON schema of the plan tree, for servers that take nothing else: Ollama, LM Studio, Gemini.

The answer is a tree in JSON; ``gpsfsm.grammars.rendered`` makes a plan of it. The schema has no
``$ref`` and no ``pattern``, which some servers refuse. So its texts are free, and one that reads as
a placeholder is for the check to find.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from gpsfsm.generation.language_model import Constraint
from gpsfsm.grammars.emit import Format
from gpsfsm.grammars.expressions import regular
from gpsfsm.grammars.forms import GREATEST, HARMLESS, FormKind
from gpsfsm.grammars.rules import DEPTH, MAX_CHILDREN, checked_depth
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from gpsfsm.grammars.forms import Form
    from gpsfsm.grammars.writable import Alphabet, Writable

_Schema = dict[str, Any]


def schema(words: Alphabet, depth: int = DEPTH, *, patterns: bool = False) -> _Schema:
    """The schema; with ``patterns`` texts are bound to those that read as no placeholder.

    Raises UsageError for a wrong depth.
    """
    runners = [_runner(runner, patterns=patterns) for runner in words.runners]
    steps = _steps(runners)
    for _ in range(checked_depth(depth) - 1):
        kinds = {"type": "string", "enum": [kind.value for kind in ControlType]}
        steps = _steps([*runners, _object({"control": kinds, "steps": steps})])
    return _object({"plan": steps})


def _steps(kinds: list[_Schema]) -> _Schema:
    items = kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
    return {"type": "array", "items": items, "minItems": 1, "maxItems": MAX_CHILDREN}


def _object(properties: dict[str, _Schema], required: list[str] | None = None) -> _Schema:
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties) if required is None else required,
        "additionalProperties": False,
    }


def _runner(runner: Writable, *, patterns: bool) -> _Schema:
    """The provider is said where it has another name than the interface."""
    properties = {"interface": _text(runner.interface)}
    if runner.provider != runner.interface:
        properties["provider"] = _text(runner.provider)
    needed = list(properties)
    if runner.slots:
        must = [slot.name for slot in runner.slots if slot.required]
        values = {slot.name: _value(slot.form, patterns=patterns) for slot in runner.slots}
        properties["parameters"] = _object(values, must)
        if must:
            needed.append("parameters")
    return _object(properties, needed)


def _text(text: str) -> _Schema:
    return {"type": "string", "enum": [text]}


def _value(form: Form, *, patterns: bool) -> _Schema:
    if form.is_boolean:
        return {"type": "boolean"}
    if form.kind is FormKind.CHOICE:
        return {"type": "string", "enum": list(form.choices)}
    if form.kind is FormKind.LIST:
        assert form.item is not None
        return {"type": "array", "items": _value(form.item, patterns=patterns)}
    if form.kind in (FormKind.INTEGER, FormKind.DECIMAL):
        return _number(form)
    if patterns:
        return {"type": "string", "pattern": f"^(?:{regular(HARMLESS)})$"}
    return {"type": "string"}


def _number(form: Form) -> _Schema:
    """Bounds that are beyond reach of the other grammars are brought within it."""
    low = None if form.low is None else max(form.low, -GREATEST)
    high = None if form.high is None else min(form.high, GREATEST)
    if form.kind is FormKind.INTEGER:
        least = -GREATEST if low is None else math.ceil(low)
        most = GREATEST if high is None else math.floor(high)
        return {"type": "integer", "minimum": least, "maximum": most}
    bounds = {"minimum": low, "maximum": high}
    limits = {key: _short(bound) for key, bound in bounds.items() if bound is not None}
    return {"type": "number", **limits}


def _short(bound: float) -> float:
    """``3`` for 3.0."""
    return int(bound) if float(bound).is_integer() else bound


def _emit(words: Alphabet, depth: int) -> str:
    return json.dumps(schema(words, depth), separators=(",", ":")) + "\n"


FORMATS = (Format("json-schema", "plan.schema.json", _emit, constraint=Constraint.JSON_SCHEMA),)
