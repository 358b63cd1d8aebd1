"""Give a control another type."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.fuzzing.operators.base import Mutation, Operator
from gpsfsm.model.plan import ControlType, Kind

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.operators.base import Tree
    from gpsfsm.model.plan import Plan

_NAME = "control-type"


def _mutations(plan: Plan) -> Iterator[Mutation]:
    for element in plan.elements[1:]:
        if element.kind is not Kind.CONTROL:
            continue
        for kind in ControlType:
            if kind is not element.control_type:
                change = partial(_retype, index=element.index, kind=kind.value)
                summary = f"makes {place(element)} a {kind.value}"
                yield Mutation(_NAME, element.index, summary, change)


def _retype(tree: Tree, *, index: int, kind: str) -> None:
    tree.nodes[index].attributes["type"] = kind


OPERATOR = Operator(_NAME, _mutations)
