"""Nest differently: take a control away from around its children, or move a child over its edge."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.fuzzing.operators.base import Mutation, Operator
from gpsfsm.model.plan import Kind

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.operators.base import Tree
    from gpsfsm.model.plan import Plan

_NAME = "renest"


def _mutations(plan: Plan) -> Iterator[Mutation]:
    for element in plan.elements[1:]:
        if element.kind is not Kind.CONTROL:
            continue
        what, index = place(element), element.index
        if element.children:
            last = place(plan.elements[element.children[-1]])
            unwrap, out = partial(_unwrap, index=index), partial(_move_out, index=index)
            yield Mutation(_NAME, index, f"takes {what} away from around its children", unwrap)
            yield Mutation(_NAME, index, f"moves {last} out of {what}, behind it", out)
        siblings = plan.elements[element.parent].children
        behind = siblings[siblings.index(index) + 1 :]
        if behind:
            summary = f"moves {place(plan.elements[behind[0]])} into {what}, to its end"
            yield Mutation(_NAME, behind[0], summary, partial(_move_in, index=index))


def _unwrap(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    siblings[at : at + 1] = tree.nodes[index].children


def _move_out(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    siblings.insert(at + 1, tree.nodes[index].children.pop())


def _move_in(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    tree.nodes[index].children.append(siblings.pop(at + 1))


OPERATOR = Operator(_NAME, _mutations)
