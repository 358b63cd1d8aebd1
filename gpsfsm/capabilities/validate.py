"""Fitting what a file holds into a model, and saying what does not fit."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from pydantic import ValidationError

from gpsfsm.capabilities.defects import Notes, Place, quoted
from gpsfsm.capabilities.reading import Items, Scalar, Table
from gpsfsm.capabilities.shapes import FileModel

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["validate"]

_ROUNDS = 5
_Model = TypeVar("_Model", bound=FileModel)


def validate(model: type[_Model], table: Table, notes: Notes) -> _Model | None:
    """The table as a model. What does not fit is noted as an error, and left out if it can be.

    Only of a capability is a part of any use.
    """
    for _ in range(_ROUNDS if notes.kind == "capability" else 1):
        try:
            found = model.model_validate(table)
        except ValidationError as error:
            if not _prune(table, error, notes):
                return None
        else:
            _note_unknown_keys(found, notes)
            return found
    return None


def _prune(root: Table, error: ValidationError, notes: Notes) -> bool:
    """Note the errors and take the wrong values out; False if the root itself is wrong."""
    wrong: dict[tuple[int | str, ...], None] = {}
    for found in error.errors(include_url=False, include_input=False):
        path = _existing(root, found["loc"])
        if found["type"] == "missing" and len(path) == len(found["loc"]):
            notes.error(_place(root, path), f"{_title(path)} is empty", "write a value behind it")
        elif found["type"] == "missing":
            notes.error(_place(root, path), f"{_title(path)} has no '{found['loc'][-1]}'", "add it")
        else:
            notes.error(_place(root, path), f"{_title(path)} {found['msg']}")
        # Half of the outcomes could claim more than all of them.
        wrong[path[:1] if path[:1] == ("outcomes",) else path] = None
    if () in wrong:
        return False
    # The last item of a list first, so that the others keep their places.
    for path in sorted(wrong, key=lambda path: [str(part).zfill(9) for part in path], reverse=True):
        parent = _follow(root, path[:-1])
        step = path[-1]
        if isinstance(parent, Table) and isinstance(step, str):
            parent.pop(step, None)
        elif isinstance(parent, Items) and isinstance(step, int):
            del parent[step]
    return True


def _existing(root: Table, path: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """As much of the path as there is."""
    while path and _follow(root, path) is None:
        path = path[:-1]
    return path


def _follow(root: Table, path: tuple[int | str, ...]) -> object:
    node: object = root
    for step in path:
        if isinstance(node, Table) and isinstance(step, str):
            node = node.get(step)
        elif isinstance(node, Items) and isinstance(step, int) and step < len(node):
            node = node[step]
        else:
            return None
    return node


def _place(root: Table, path: tuple[int | str, ...]) -> Place:
    node = _follow(root, path)
    return node.place if path and isinstance(node, Scalar | Table | Items) else (1, 1)


def _title(path: tuple[int | str, ...]) -> str:
    """``'definition.configuration_parameters[2].type'``; the root is the file."""
    if not path:
        return "the file"
    shown = "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in path)
    return quoted(shown[1:])


def _note_unknown_keys(model: FileModel, notes: Notes) -> None:
    """The original stack ignores unknown keys silently; mostly they are misspelt."""
    known = [field.alias or name for name, field in type(model).model_fields.items()]
    otherwise = "it is ignored" if notes.kind == "capability" else f"known are {', '.join(known)}"
    for key in model.model_extra or {}:
        hint = notes.near(key, known) or otherwise
        notes.warning(model.at(key), f"the key {quoted(key)} is not known here", hint)
    for inner in _inner(model):
        _note_unknown_keys(inner, notes)


def _inner(model: FileModel) -> Iterator[FileModel]:
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, FileModel):
            yield value
        elif isinstance(value, list | dict):
            each = value.values() if isinstance(value, dict) else value
            yield from (item for item in each if isinstance(item, FileModel))
