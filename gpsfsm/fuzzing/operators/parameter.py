"""Change the value of a parameter, or leave the parameter out."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.fuzzing.operators.base import Mutation, Operator
from gpsfsm.model.plan import NOT_PARAMETERS
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.operators.base import Tree
    from gpsfsm.model.plan import Plan, Value

_NAME = "parameter"


def _mutations(plan: Plan) -> Iterator[Mutation]:
    for runner in plan.runners:
        index = runner.index
        for attribute in runner.attributes:
            if attribute.name in NOT_PARAMETERS:
                continue
            name, text = clip(attribute.name, 40), _other(attribute.value)
            change = partial(_change, index=index, name=attribute.name, text=text)
            summary = f"changes {name} of {place(runner)} to '{clip(text, 40)}'"
            yield Mutation(_NAME, index, summary, change)
            left_out = partial(_leave_out, index=index, name=attribute.name)
            yield Mutation(_NAME, index, f"leaves out {name} of {place(runner)}", left_out)


def _other(value: Value) -> str:
    """Another value of the same type."""
    if isinstance(value, bool):
        return "false" if value else "true"
    if isinstance(value, int):
        return str(value + 1)
    if isinstance(value, float):
        greater = value + 1.0
        return repr(greater) if math.isfinite(greater) and greater != value else "0.0"
    return f"not {value}"


def _change(tree: Tree, *, index: int, name: str, text: str) -> None:
    tree.nodes[index].attributes[name] = text


def _leave_out(tree: Tree, *, index: int, name: str) -> None:
    del tree.nodes[index].attributes[name]


OPERATOR = Operator(_NAME, _mutations)
