"""Drop an element, with all that is in it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.fuzzing.operators.base import Mutation, Operator

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.operators.base import Tree
    from gpsfsm.model.plan import Plan

_NAME = "drop"


def _mutations(plan: Plan) -> Iterator[Mutation]:
    for element in plan.elements[1:]:
        change = partial(_drop, index=element.index)
        yield Mutation(_NAME, element.index, f"drops {place(element)}", change)


def _drop(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    del siblings[at]


OPERATOR = Operator(_NAME, _mutations)
