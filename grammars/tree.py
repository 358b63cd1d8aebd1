"""Plans as trees in JSON, which servers write that take JSON schemas only, made into XML.

``{"plan": [step, …]}``, where a step is a runner
``{"interface": "…", "provider": "…", "parameters": {…}}`` (``provider`` is the interface where it
is not said) or a control ``{"control": "recovery", "steps": [step, …]}``. The text comes from a
model, so nothing about it is taken for granted; but what is wrong with the *plan* is for the check
to say, which says it better.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError, misused
from gpsfsm.grammars.forms import attribute_text, unwritable
from gpsfsm.grammars.rules import INDENT
from gpsfsm.model.printable import clip
from gpsfsm.strict_json import own_error
from gpsfsm.syntax.text import NAME

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

MAX_CHARACTERS = 4 * 1024 * 1024
"""Longer answers are no plans."""
MAX_LEVELS = 100
"""Levels of steps; the limit of the check is 200."""

_RUNNER = ("interface", "provider", "parameters")
_CONTROL = ("control", "steps")
_FENCE = "```"
_MAX_SHOWN = 60


class TreeError(GpsfsmError):
    """A text is not the tree of a plan; the message says where, what is wrong and what to write."""


def rendered(json_text: str) -> str:
    r"""Convert a plan from a JSON tree to XML, with one element per line.

    Raises TreeError if the text is not the tree of a plan.

    >>> step = '{"interface": "demo/Wait", "parameters": {"seconds": 2.5}}'
    >>> print(rendered('{"plan": [' + step + ']}'))
    <Plan>
        <Runner interface="demo/Wait" provider="demo/Wait" seconds="2.5"/>
    </Plan>
    """
    tree = _read(json_text)
    if not isinstance(tree, dict):
        raise _wrong("the answer", tree, 'an object {"plan": […]}')
    _only(tree, ("plan",), "the answer")
    lines = ["<Plan>", *_steps(tree.get("plan"), "plan", 1), "</Plan>"]
    return "\n".join(lines)


def _read(text: str) -> Any:
    value: object = text
    if not isinstance(value, str):
        raise misused("rendered", "a text of JSON", value)
    if len(text) > MAX_CHARACTERS:
        raise TreeError(
            f"the answer has {len(text):,} characters; a plan in JSON has at most "
            f"{MAX_CHARACTERS:,}"
        )
    try:
        return json.loads(
            _unfenced(text), object_pairs_hook=_unique, parse_constant=_refused, parse_int=_integer
        )
    except json.JSONDecodeError as raised:
        error = own_error(raised)
        place = f"line {error.lineno}, column {error.colno}"
        raise TreeError(f"the answer is not JSON: {error.msg} at {place}") from None
    except RecursionError:
        raise TreeError("the answer is nested too deeply to be a plan") from None


def _unfenced(text: str) -> str:
    """Without the code fence that models like to put around JSON."""
    bare = text.strip()
    if bare.startswith(_FENCE) and bare.endswith(_FENCE) and "\n" in bare:
        return bare.partition("\n")[2].removesuffix(_FENCE)
    return text


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    unique: dict[str, Any] = {}
    for key, value in pairs:
        if key in unique:
            raise TreeError(f"the answer has the key {_quoted(key)} twice in one object")
        unique[key] = value
    return unique


def _refused(word: str) -> Any:
    raise TreeError(f"{word} is not JSON, and no value of a plan")


def _integer(digits: str) -> int:
    if len(digits) > _MAX_SHOWN:
        raise TreeError(f"the number {digits[:20]}… has {len(digits)} digits; write a shorter one")
    return int(digits)


def _steps(steps: Any, place: str, level: int) -> Iterator[str]:
    if not isinstance(steps, list):
        raise _wrong(place, steps, "a list of steps")
    if level > MAX_LEVELS:
        raise TreeError(f"the plan is nested deeper than {MAX_LEVELS} levels")
    for number, step in enumerate(steps):
        yield from _step(step, f"{place}[{number}]", level)


def _step(step: Any, place: str, level: int) -> Iterator[str]:
    if not isinstance(step, dict):
        raise _wrong(place, step, "an object with 'interface' or 'control'")
    indent = INDENT * level
    if "control" in step:
        _only(step, _CONTROL, place)
        kind = _attribute("type", _text(step["control"], f"{place}.control"), place)
        yield f"{indent}<Control{kind}>"
        yield from _steps(step.get("steps"), f"{place}.steps", level + 1)
        yield f"{indent}</Control>"
        return
    _only(step, _RUNNER, place)
    interface = _text(step.get("interface"), f"{place}.interface")
    provider = _text(step.get("provider", interface), f"{place}.provider")
    attributes = [("interface", interface), ("provider", provider), *_parameters(step, place)]
    written = "".join(_attribute(name, value, place) for name, value in attributes)
    yield f"{indent}<Runner{written}/>"


def _parameters(step: dict[str, Any], place: str) -> Iterator[tuple[str, str]]:
    written = step.get("parameters", {})
    place = f"{place}.parameters"
    if not isinstance(written, dict):
        raise _wrong(place, written, "an object with a value for each parameter")
    for name, value in written.items():
        if NAME.fullmatch(name) is None or ":" in name or name in ("interface", "provider"):
            raise TreeError(f"{place}: {_quoted(name)} cannot be the name of a parameter")
        if value is not None:  # as if it were not there
            yield name, _value(value, f"{place}.{clip(name, _MAX_SHOWN)}")


def _value(value: Any, place: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        raise TreeError(f"{place}: the number is too great; write a smaller one")
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list):
        if any(isinstance(item, list | dict) or item is None for item in value):
            raise TreeError(f"{place}: a list of a plan holds texts, numbers, true and false only")
        written = [
            json.dumps(item, ensure_ascii=False) if isinstance(item, str) else _value(item, place)
            for item in value
        ]
        return f"[{', '.join(written)}]"
    return _text(value, place)


def _text(value: Any, place: str) -> str:
    if not isinstance(value, str):
        raise _wrong(place, value, "a text")
    return value


def _attribute(name: str, value: str, place: str) -> str:
    bad = unwritable(value)
    if bad:
        raise TreeError(
            f"{place}: {clip(name, _MAX_SHOWN)} holds the character U+{ord(bad):04X}, "
            "which no plan can hold; leave it out"
        )
    return f' {name}="{attribute_text(value)}"'


def _only(written: Iterable[str], allowed: tuple[str, ...], place: str) -> None:
    for key in written:
        if key not in allowed:
            names = ", ".join(f"'{name}'" for name in allowed)
            raise TreeError(
                f"{place}: the key {_quoted(key)} is unknown; the keys here are {names}"
            )


def _wrong(place: str, value: Any, wanted: str) -> TreeError:
    kinds = {dict: "an object", list: "a list", str: "a text", bool: "true or false"}
    kind = "nothing" if value is None else kinds.get(type(value), "a number")
    return TreeError(f"{place}: {kind} stands where {wanted} is needed")


def _quoted(text: str) -> str:
    return f"'{clip(text, _MAX_SHOWN)}'"
