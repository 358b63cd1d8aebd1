"""The compiled table: a library as JSON, which needs neither YAML nor pydantic to be read.

One entry per line, values equal to their default left out, so that differences read well.
``python -m gpsfsm.capabilities.table runners`` writes ``runners/library.json``; with ``--check`` it
only tells whether that file is up to date.
"""

from __future__ import annotations

import json
import sys
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from gpsfsm.capabilities.library import Library
from gpsfsm.errors import GpsfsmError, InternalError
from gpsfsm.model.capability import (
    Effects,
    Filling,
    Input,
    Interface,
    Leaf,
    Outcomes,
    Output,
    Parameter,
    Permission,
    PromptBuffer,
    Provider,
    SemanticInterface,
    Source,
    Span,
    ValueType,
)
from gpsfsm.model.event import Event
from gpsfsm.model.ros import (
    Comparison,
    Condition,
    Durability,
    OnResume,
    Quality,
    Reliability,
    RosCall,
    RosKind,
)
from gpsfsm.streams import to_stderr

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

FILE = "library.json"
_VERSION = 1
_LISTS = ("interfaces", "providers", "semantic")
_Class = TypeVar("_Class")
_NAMES: dict[str, Callable[[Any], Any]] = {"type": ValueType, "aliases": tuple}
_Entry = TypeVar("_Entry", Interface, Provider, SemanticInterface)


def dump(library: Library) -> str:
    """The table of a library; equal libraries have equal tables."""
    parts = [f'"version":{_VERSION}', f'"complete":{json.dumps(library.complete)}']
    for name in _LISTS:
        rows = [f"\n{_compact(_bare(entry))}" for entry in getattr(library, name)]
        parts.append(f'"{name}":[{",".join(rows)}]')
    if library.leaves or library.blackboard:
        leaves = [f"\n{_compact(_bare(leaf))}" for leaf in library.leaves]
        parts.append(f'"leaves":[{",".join(leaves)}]')
        parts.append(f'"blackboard":{_compact(library.blackboard)}')
    return "{" + ",\n".join(parts) + "}\n"


def load(text: str) -> Library:
    """The library of a table that ``dump`` made; raises InternalError for anything else."""
    try:
        data = json.loads(text)
        if data["version"] != _VERSION:
            raise InternalError(f"the table of capabilities has version {data['version']}")
        return Library(
            interfaces=tuple(_make(Interface, row) for row in data["interfaces"]),
            providers=tuple(_make(Provider, row) for row in data["providers"]),
            semantic=tuple(_make(SemanticInterface, row) for row in data["semantic"]),
            complete=data["complete"],
            leaves=tuple(_make(Leaf, row) for row in data.get("leaves", ())),
            blackboard=_rows(data.get("blackboard", ())),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InternalError(f"the table of capabilities is damaged: {error}") from error


@cache
def builtin() -> Library:
    """The capabilities that come with gpsfsm."""
    file = resources.files("gpsfsm.runners") / FILE
    try:
        return load(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InternalError(f"the built-in capabilities cannot be read: {error}") from error


def _compact(data: object) -> str:
    return json.dumps(data, separators=(",", ":"))


def _bare(value: Any) -> Any:
    if is_dataclass(value):
        row = {}
        for each in fields(value):
            inner = getattr(value, each.name)
            # By type as well: a parameter's default of 0 is not False.
            default = _default(each)
            if type(inner) is not type(default) or inner != default:
                row[each.name] = _bare(inner)
        return row
    if isinstance(value, tuple):
        return [_bare(inner) for inner in value]
    return value


def _default(each: Field[Any]) -> object:
    if each.default_factory is not MISSING:
        return each.default_factory()
    return each.default


def _make(cls: type[_Class], row: Mapping[str, Any]) -> _Class:
    readers = _READERS[cls]
    return cls(
        **{key: readers[key](value) if key in readers else value for key, value in row.items()}
    )


def _each(cls: type[Any]) -> Callable[[Any], Any]:
    return lambda rows: tuple([_make(cls, row) for row in rows])


def _one(cls: type[Any]) -> Callable[[Any], Any]:
    return lambda row: _make(cls, row)


def _rows(rows: Any) -> Any:
    return tuple([tuple(row) for row in rows])


def _deep(rows: Any) -> Any:
    return tuple(map(_deep, rows)) if isinstance(rows, list) else rows


def _conditions(sets: Any) -> Any:
    return tuple(
        tuple(Condition(field, Comparison(word), value) for field, word, value in rows)
        for rows in sets
    )


def _reached(rows: Any) -> Any:
    return tuple([(Permission(what), parameter) for what, parameter in rows])


def _sources(words: Any) -> Any:
    return tuple([Source(word) for word in words])


_READERS: dict[type[Any], dict[str, Callable[[Any], Any]]] = {
    Parameter: {**_NAMES, "choices": tuple},
    Input: {**_NAMES, "satisfiable_from": _sources},
    Output: {**_NAMES, "event": Event},
    Span: {},
    Outcomes: {"unless": _rows},
    PromptBuffer: {},
    Effects: {"prompt_buffer": _one(PromptBuffer)},
    Interface: {"formerly": tuple},
    Filling: {"parts": _rows},
    Leaf: {"fillings": _each(Filling), "words": _rows},
    SemanticInterface: {"remappings": _rows},
    Provider: {
        "configuration": _each(Parameter),
        "inputs": _each(Input),
        "outputs": _each(Output),
        "depends_on": _rows,
        "remappings": _rows,
        "outcomes": _one(Outcomes),
        "duration": _one(Span),
        "energy": _one(Span),
        "resources": tuple,
        "effects": _one(Effects),
        "reaches": _reached,
        "ros": _one(RosCall),
    },
    RosCall: {
        "kind": RosKind,
        "types": tuple,
        "optional": tuple,
        "on_resume": OnResume,
        "request": _deep,
        "success": _conditions,
        "until": _conditions,
        "qos": _one(Quality),
        **dict.fromkeys(("outputs", "feedback", "frames"), _rows),
    },
    Quality: {"reliability": Reliability, "durability": Durability},
}


def relative(library: Library, folder: str | Path) -> Library:
    """The library with ``origin`` relative to the parent of ``folder``: the same everywhere."""
    parent = Path(folder).resolve().parent

    def shown(entry: _Entry) -> _Entry:
        return replace(entry, origin=Path(entry.origin).resolve().relative_to(parent).as_posix())

    return replace(
        library,
        interfaces=tuple(map(shown, library.interfaces)),
        providers=tuple(map(shown, library.providers)),
        semantic=tuple(map(shown, library.semantic)),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the table; exit code 0 done, 1 defects or not up to date, 2 not possible."""
    import argparse

    from gpsfsm.capabilities.load import load_directories

    parser = argparse.ArgumentParser(prog="python -m gpsfsm.capabilities.table")
    parser.add_argument("folder", help="the folder with the capability files")
    parser.add_argument("--check", action="store_true", help=f"only compare with {FILE}")
    options = parser.parse_args(arguments)
    target = Path(options.folder) / FILE
    try:
        loaded = load_directories([options.folder])
    except GpsfsmError as error:
        to_stderr(f"{error}\n")
        return 2
    if loaded.defects:
        to_stderr("".join(f"{defect}\n" for defect in loaded.defects))
        return 1
    table = dump(relative(loaded.library, options.folder))
    if not options.check:
        target.write_text(table, encoding="utf-8", newline="\n")
        return 0
    if target.is_file() and target.read_text(encoding="utf-8") == table:
        return 0
    to_stderr(f"{target} is not up to date; run 'make docs' or this without --check\n")
    return 1


if __name__ == "__main__":
    sys.exit(main())
