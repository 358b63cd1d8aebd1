"""What task files look like: the border, in pydantic."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from gpsfsm.capabilities.reading import Items, Scalar, Table
from gpsfsm.capabilities.shapes import (
    FileModel,
    ListOf,
    MappingOf,
    Number,
    Some,
    Text,
    wrong,
)

__all__ = ["StepFile", "TaskFile"]


def _action(node: object) -> object:
    """A name, or what an action looks like."""
    if isinstance(node, Table) or (isinstance(node, Scalar) and node.value is not None):
        return node
    raise wrong("the name of an action or place, or a mapping", node)


def _actions(node: object) -> object:
    """A list of actions; one stands for itself."""
    return list(map(_action, node)) if isinstance(node, Items) else [_action(node)]


Tables = MappingOf[Any]
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
    steps: ListOf[StepFile] = Field(default_factory=list)
    others: Text = "refused"
    allow: Actions = Field(default_factory=list)
    rules: ListOf[Tables] = Field(default_factory=list)
    not_answers: Some = Field(default_factory=list)
    nodes: Tables = Field(default_factory=dict)
