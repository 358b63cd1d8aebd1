"""Swap an element with the one behind it."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.fuzzing.operators.base import Mutation, Operator

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.operators.base import Tree
    from gpsfsm.model.plan import Plan

_NAME = "swap"


def _mutations(plan: Plan) -> Iterator[Mutation]:
    for parent in plan.elements:
        for one, other in pairwise(plan.children(parent)):
            summary = f"swaps {place(one)} and {place(other)}"
            yield Mutation(_NAME, one.index, summary, partial(_swap, index=one.index))


def _swap(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    siblings[at], siblings[at + 1] = siblings[at + 1], siblings[at]


OPERATOR = Operator(_NAME, _mutations)
