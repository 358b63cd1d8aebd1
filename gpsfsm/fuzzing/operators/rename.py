"""Misspell the interface of a runner."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.fuzzing.operators.base import Mutation, Operator
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.operators.base import Tree
    from gpsfsm.model.plan import Plan

_NAME = "rename"
_SUFFIX = "Runner"


def _mutations(plan: Plan) -> Iterator[Mutation]:
    for runner in plan.runners:
        name = _misspelt(runner.interface)
        summary = f"calls the interface of {place(runner)} '{clip(name, 60)}'"
        change = partial(_rename, index=runner.index, name=name)
        yield Mutation(_NAME, runner.index, summary, change)


def _misspelt(name: str) -> str:
    """``nav/WaypointRunner`` becomes ``nav/Waypoint``, any other name gets longer."""
    short = name.removesuffix(_SUFFIX)
    return short if short != name and not short.endswith("/") and short else f"{name}{_SUFFIX}"


def _rename(tree: Tree, *, index: int, name: str) -> None:
    tree.nodes[index].attributes["interface"] = name


OPERATOR = Operator(_NAME, _mutations)
