"""Put another action of the plan in the place of a runner's."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import action, place
from gpsfsm.fuzzing.operators.base import Mutation, Operator

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.operators.base import Tree
    from gpsfsm.model.plan import Plan

_NAME = "replace"


def _mutations(plan: Plan) -> Iterator[Mutation]:
    """The next action behind it that is another one; for the last ones the first of the plan."""
    runners = plan.runners
    following: dict[int, int] = {}  # the next runner with another action
    later = -1
    for number in range(len(runners) - 1, -1, -1):
        behind = number + 1
        if behind < len(runners):
            same = runners[behind].action == runners[number].action
            later = following.get(behind, -1) if same else behind
        following[number] = later
    for number, runner in enumerate(runners):
        other = runners[following[number] if following[number] >= 0 else 0]
        if other.action == runner.action:
            continue
        summary = f"replaces {place(runner)} by {action(other)}"
        change = partial(_replace, index=runner.index, other=other.index)
        yield Mutation(_NAME, runner.index, summary, change)


def _replace(tree: Tree, *, index: int, other: int) -> None:
    tree.nodes[index].attributes = dict(tree.nodes[other].attributes)


OPERATOR = Operator(_NAME, _mutations)
