"""What task files look like: the border, in pydantic."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from gpsfsm.capabilities.reading import Items, Scalar, Table, kind_of
from gpsfsm.capabilities.schema import FileModel, Number, Text

__all__ = ["StepFile", "TaskFile"]


def _wrong(expected: str, node: object) -> PydanticCustomError:
    text = "must be {expected}, not {found}"
    return PydanticCustomError("shape", text, {"expected": expected, "found": kind_of(node)})


def _list(node: object) -> object:
    if isinstance(node, Items):
        return node
    raise _wrong("a list", node)


def _mapping(node: object) -> object:
    if isinstance(node, Table):
        return node
    raise _wrong("a mapping ('key: value' lines)", node)


def _some(node: object) -> object:
    """One text or a list of texts."""
    if isinstance(node, Scalar) and node.value is not None:
        return [node.text]
    if isinstance(node, Items):
        texts = [item.text for item in node if isinstance(item, Scalar) and item.value is not None]
        if len(texts) == len(node):
            return texts
    raise _wrong("a text or a list of texts", node)


def _action(node: object) -> object:
    """A name, or what an action looks like."""
    if isinstance(node, Table) or (isinstance(node, Scalar) and node.value is not None):
        return node
    raise _wrong("the name of an action or place, or a mapping", node)


def _actions(node: object) -> object:
    """A list of actions; one stands for itself."""
    return list(map(_action, node)) if isinstance(node, Items) else [_action(node)]


Some = Annotated[list[str], BeforeValidator(_some)]
Tables = Annotated[dict[str, Any], BeforeValidator(_mapping)]
Written = Annotated[Any, BeforeValidator(_action)]
Actions = Annotated[list[Any], BeforeValidator(_actions)]


class StepFile(FileModel):
    """An entry of ``steps``."""

    do: Written
    else_: Actions = Field(default_factory=list, alias="else")


class TaskFile(FileModel):
    """A task file."""

    task: Text = ""
    interface: Some = Field(default_factory=list)
    tolerance: Number | None = None
    places: Tables = Field(default_factory=dict)
    actions: Tables = Field(default_factory=dict)
    steps: Annotated[list[StepFile], BeforeValidator(_list)] = Field(default_factory=list)
    others: Text = "refused"
    allow: Actions = Field(default_factory=list)
    rules: Annotated[list[Tables], BeforeValidator(_list)] = Field(default_factory=list)
    not_answers: Some = Field(default_factory=list)
