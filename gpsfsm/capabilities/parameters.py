"""From the parameter entries of a file to parameters, inputs and outputs, with types and values."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from typing import TYPE_CHECKING, TypeVar

from gpsfsm.capabilities.defects import Notes, quoted
from gpsfsm.capabilities.reading import Items, Scalar
from gpsfsm.model.capability import Input, Output, Parameter, Source, ValueType
from gpsfsm.model.event import Event
from gpsfsm.model.plan import NOT_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.capabilities.entries import InputFile, OutputFile, ParameterFile
    from gpsfsm.capabilities.reading import FileModel
    from gpsfsm.model.plan import Value

_ATTRIBUTE = re.compile(r"[^\W\d][\w.\-]*")
_EVENTS = {
    "success": (Event.SUCCEEDED,),
    "failure": (Event.FAILED,),
    "both": (Event.SUCCEEDED, Event.FAILED),
}
_TYPES = "the types are string, bool, int, double, and lists such as string[]"


_Entry = TypeVar("_Entry", "ParameterFile", "InputFile", "OutputFile")
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


def parameters(entries: Sequence[ParameterFile], notes: Notes) -> tuple[Parameter, ...]:
    """The configuration parameters."""
    kept = _unique(entries, "parameter", notes)
    taken = _taken(kept)
    return tuple(_parameter(entry, taken, notes) for entry in kept)


def inputs(
    entries: Sequence[InputFile], configuration: Sequence[Parameter], *, notes: Notes
) -> tuple[Input, ...]:
    """The run-time inputs; ``configuration`` are the parameters that may stand in for them."""
    kept = _unique(entries, "input", notes)
    names = {parameter.name for parameter in configuration}
    taken = _taken(kept)
    return tuple(_input(entry, taken, names, notes=notes) for entry in kept)


def outputs(entries: Sequence[OutputFile], notes: Notes) -> tuple[Output, ...]:
    """The outputs, one per event."""
    by_name: dict[tuple[str, Event], Output] = {}
    for entry in entries:
        events = _EVENTS.get(entry.on)
        if events is None:
            message = f"{quoted(entry.on)} is nothing that an output can be handed over on"
            notes.error(entry.at("on"), message, "write success, failure or both")
            events = _EVENTS["success"]
        for event in events:
            if (entry.name, event) in by_name:
                message = f"the output {quoted(entry.name)} is described twice for one event"
                notes.error(entry.at("name"), message, "remove one of them")
                continue
            by_name[entry.name, event] = Output(
                name=entry.name,
                type=_type(entry, notes) if event is events[0] else value_or_any(entry),
                event=event,
                optional=entry.optional,
                status=entry.status,
                semantic_key=entry.semantic_key,
                aliases=tuple(dict.fromkeys(entry.aliases)),
                description=_one_line(entry.description),
                type_word=_other_word(entry),
            )
    return tuple(by_name.values())


def _other_word(entry: InputFile | OutputFile) -> str:
    """The type as it is written, "" where that is our name of it."""
    kind = value_type(entry.type) or ValueType.ANY
    return "" if entry.type == kind.value else entry.type


def value_or_any(entry: _Entry) -> ValueType:
    """The type of an entry, without a word about one that is not known."""
    return value_type(entry.type) or ValueType.ANY


def _parameter(entry: ParameterFile, taken: Counter[str], notes: Notes) -> Parameter:
    if entry.name in NOT_PARAMETERS or not _ATTRIBUTE.fullmatch(entry.name):
        message = f"a plan cannot give a parameter named {quoted(entry.name)}"
        notes.warning(entry.at("name"), message, "give it another name")
    kind = _type(entry, notes)
    default = _default(entry, kind, notes)
    minimum, maximum = _limits(entry, kind, notes)
    parameter = Parameter(
        name=entry.name,
        type=kind,
        required=_required(entry, default, notes),
        default=default,
        semantic_key=entry.semantic_key,
        aliases=_aliases(entry, taken, notes),
        minimum=minimum,
        maximum=maximum,
        choices=tuple(dict.fromkeys(entry.choices)),
        description=_one_line(entry.description),
    )
    _check_default(parameter, entry, notes)
    return parameter


def _input(
    entry: InputFile, taken: Counter[str], configuration: set[str], *, notes: Notes
) -> Input:
    kind = _type(entry, notes)
    default = _default(entry, kind, notes)
    fallback = entry.fallback_parameter
    if fallback and fallback not in configuration:
        message = f"there is no configuration parameter {quoted(fallback)} to fall back to"
        notes.error(
            entry.at("fallback_parameter"), message, _word_hint(fallback, configuration, notes)
        )
        fallback = ""
    return Input(
        name=entry.name,
        type=kind,
        required=_required(entry, default, notes),
        default=default,
        semantic_key=entry.semantic_key,
        aliases=_aliases(entry, taken, notes),
        satisfiable_from=_sources(entry, notes),
        fallback=fallback,
        description=_one_line(entry.description),
        demanded=entry.required is True,
        type_word=_other_word(entry),
    )


def _unique(entries: Sequence[_Entry], what: str, notes: Notes) -> list[_Entry]:
    by_name: dict[str, _Entry] = {}
    for entry in entries:
        if entry.name in by_name:
            message = f"the {what} {quoted(entry.name)} is described twice"
            notes.error(entry.at("name"), message, "remove one of them")
        else:
            by_name[entry.name] = entry
    return list(by_name.values())


def _type(entry: _Entry, notes: Notes) -> ValueType:
    kind = value_type(entry.type)
    if kind is None:
        hint = notes.near(entry.type.lower(), TYPE_WORDS) or _TYPES
        message = f"{quoted(entry.type)} is not a type, so any value is taken"
        notes.error(entry.at("type"), message, hint)
    return kind or ValueType.ANY


def _default(entry: ParameterFile | InputFile, kind: ValueType, notes: Notes) -> Value | None:
    written = entry.default
    if written is None or getattr(written, "value", "") is None:
        return None
    default = typed(written, kind)
    if default is None:
        wanted = f"of type {kind.value}" if kind else "a single finite value"
        message = f"the default of {quoted(entry.name)} is not {wanted}"
        notes.error(entry.at("default"), message, "change the type or the default")
    return default


def _required(entry: ParameterFile | InputFile, default: Value | None, notes: Notes) -> bool:
    if entry.required and entry.optional:
        message = f"{quoted(entry.name)} is both required and optional"
        notes.error(entry.at("optional"), message, "remove one of the two; it is taken as optional")
    if entry.optional or default is not None:
        return False
    if entry.required is not None:
        return entry.required
    return entry.optional is False or "default" not in entry.model_fields_set


def _limits(
    entry: ParameterFile, kind: ValueType, notes: Notes
) -> tuple[float | None, float | None]:
    for key in ("minimum", "maximum"):
        if getattr(entry, key) is not None and kind not in NUMBERS:
            message = f"{quoted(key)} is for numbers, and {quoted(entry.name)} is a {kind.value}"
            notes.error(entry.at(key), message, "remove it or change the type")
            return None, None
    low, high = entry.minimum, entry.maximum
    if low is not None and high is not None and low > high:
        message = f"the minimum {low:g} is greater than the maximum {high:g}"
        notes.error(entry.at("minimum"), message, "no value fits; change one of them")
        return None, None
    return low, high


def _check_default(parameter: Parameter, entry: ParameterFile, notes: Notes) -> None:
    default = parameter.default
    if default is None:
        return
    place = entry.at("default")
    if isinstance(default, int | float) and not isinstance(default, bool):
        if parameter.minimum is not None and default < parameter.minimum:
            notes.error(place, f"the default {default:g} is less than the minimum", "change one")
        if parameter.maximum is not None and default > parameter.maximum:
            notes.error(place, f"the default {default:g} is greater than the maximum", "change one")
    written = getattr(entry.default, "text", None)  # a list has none
    if parameter.choices and written is not None and written not in parameter.choices:
        choices = ", ".join(map(quoted, parameter.choices[:10]))
        message = f"the default of {quoted(parameter.name)} is not among its choices"
        notes.error(place, message, f"they are {choices}")


def _taken(entries: Sequence[ParameterFile] | Sequence[InputFile]) -> Counter[str]:
    """The number of meanings of each name and alias."""
    counts: Counter[str] = Counter()
    for entry in entries:
        names: set[str] = {entry.name, *entry.aliases}
        counts.update(names)
    return counts


def _aliases(entry: _Entry, taken: Counter[str], notes: Notes) -> tuple[str, ...]:
    """The aliases but for those that mean something else as well."""
    kept = []
    for alias in dict.fromkeys(entry.aliases):
        if alias == entry.name or taken[alias] > 1:
            message = f"the alias {quoted(alias)} is also another name here"
            notes.error(entry.at("aliases"), message, "remove it; a name can mean one thing only")
        else:
            kept.append(alias)
    return tuple(kept)


def _sources(entry: InputFile, notes: Notes) -> tuple[Source, ...]:
    words = [source.value for source in Source]
    sources = []
    for word in dict.fromkeys(entry.satisfiable_from):
        if word in words:
            sources.append(Source(word))
        else:
            message = f"an input cannot be satisfied from {quoted(word)}"
            hint = notes.near(word, words) or f"the sources are {', '.join(words)}"
            notes.error(entry.at("satisfiable_from"), message, hint)
    return tuple(sources)


def _word_hint(word: str, names: Iterable[str], notes: Notes) -> str:
    listed = sorted(names)
    near = notes.near(word, listed)
    return near or (f"there are {', '.join(map(quoted, listed[:10]))}" if listed else "add it")


def _one_line(text: str) -> str:
    return " ".join(text.split())


def described(entry: FileModel) -> str:
    """A description in one line; files break it as they like."""
    return _one_line(str(getattr(entry, "description", "")))


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
    """True if a value that a plan would write so is of this type."""
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
