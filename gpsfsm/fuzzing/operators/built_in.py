"""The built-in mutations of plans."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

from gpsfsm.analysis.words import action, place
from gpsfsm.fuzzing.operators import Mutation, Operator
from gpsfsm.model.plan import NOT_PARAMETERS, ControlType, Kind
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.operators import Tree
    from gpsfsm.model.plan import Plan, Value


def _retypings(plan: Plan) -> Iterator[Mutation]:
    """Give a control another type."""
    for element in plan.elements[1:]:
        if element.kind is not Kind.CONTROL:
            continue
        for kind in ControlType:
            if kind is not element.control_type:
                change = partial(_retype, index=element.index, kind=kind.value)
                summary = f"makes {place(element)} a {kind.value}"
                yield Mutation("control-type", element.index, summary, change)


def _retype(tree: Tree, *, index: int, kind: str) -> None:
    tree.nodes[index].attributes["type"] = kind


def _drops(plan: Plan) -> Iterator[Mutation]:
    """Drop an element, with all that is in it."""
    for element in plan.elements[1:]:
        change = partial(_drop, index=element.index)
        yield Mutation("drop", element.index, f"drops {place(element)}", change)


def _drop(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    del siblings[at]


def _parameter_changes(plan: Plan) -> Iterator[Mutation]:
    """Change the value of a parameter, or leave the parameter out."""
    for runner in plan.runners:
        index = runner.index
        for attribute in runner.attributes:
            if attribute.name in NOT_PARAMETERS:
                continue
            name, text = clip(attribute.name, 40), _other(attribute.value)
            change = partial(_change, index=index, name=attribute.name, text=text)
            summary = f"changes {name} of {place(runner)} to '{clip(text, 40)}'"
            yield Mutation("parameter", index, summary, change)
            left_out = partial(_leave_out, index=index, name=attribute.name)
            yield Mutation("parameter", index, f"leaves out {name} of {place(runner)}", left_out)


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


_SUFFIX = "Runner"


def _renamings(plan: Plan) -> Iterator[Mutation]:
    """Misspell the interface of a runner."""
    for runner in plan.runners:
        name = _misspelt(runner.interface)
        summary = f"calls the interface of {place(runner)} '{clip(name, 60)}'"
        change = partial(_rename, index=runner.index, name=name)
        yield Mutation("rename", runner.index, summary, change)


def _misspelt(name: str) -> str:
    """``nav/WaypointRunner`` becomes ``nav/Waypoint``, any other name gets longer."""
    short = name.removesuffix(_SUFFIX)
    return short if short != name and not short.endswith("/") and short else f"{name}{_SUFFIX}"


def _rename(tree: Tree, *, index: int, name: str) -> None:
    tree.nodes[index].attributes["interface"] = name


def _renestings(plan: Plan) -> Iterator[Mutation]:
    """Take a control away from around its children, or move a child over its edge."""
    for element in plan.elements[1:]:
        if element.kind is not Kind.CONTROL:
            continue
        what, index = place(element), element.index
        if element.children:
            last = place(plan.elements[element.children[-1]])
            unwrap, out = partial(_unwrap, index=index), partial(_move_out, index=index)
            yield Mutation("renest", index, f"takes {what} away from around its children", unwrap)
            yield Mutation("renest", index, f"moves {last} out of {what}, behind it", out)
        siblings = plan.elements[element.parent].children
        behind = siblings[siblings.index(index) + 1 :]
        if behind:
            summary = f"moves {place(plan.elements[behind[0]])} into {what}, to its end"
            yield Mutation("renest", behind[0], summary, partial(_move_in, index=index))


def _unwrap(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    siblings[at : at + 1] = tree.nodes[index].children


def _move_out(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    siblings.insert(at + 1, tree.nodes[index].children.pop())


def _move_in(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    tree.nodes[index].children.append(siblings.pop(at + 1))


def _replacements(plan: Plan) -> Iterator[Mutation]:
    """Put another action of the plan in the place of a runner's.

    It is the next one behind it that is another one; for the last ones the first of the plan.
    """
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
        yield Mutation("replace", runner.index, summary, change)


def _replace(tree: Tree, *, index: int, other: int) -> None:
    tree.nodes[index].attributes = dict(tree.nodes[other].attributes)


def _swaps(plan: Plan) -> Iterator[Mutation]:
    """Swap an element with the one behind it."""
    for parent in plan.elements:
        for one, other in pairwise(plan.children(parent)):
            summary = f"swaps {place(one)} and {place(other)}"
            yield Mutation("swap", one.index, summary, partial(_swap, index=one.index))


def _swap(tree: Tree, *, index: int) -> None:
    siblings, at = tree.place(index)
    siblings[at], siblings[at + 1] = siblings[at + 1], siblings[at]


OPERATORS = (
    Operator("control-type", _retypings),
    Operator("drop", _drops),
    Operator("parameter", _parameter_changes),
    Operator("rename", _renamings),
    Operator("renest", _renestings),
    Operator("replace", _replacements),
    Operator("swap", _swaps),
)
