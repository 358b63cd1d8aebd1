"""What arrives where, what is missing, overwritten and lost (semantics, section 8.2)."""

from __future__ import annotations

import re
from itertools import combinations
from typing import TYPE_CHECKING

from .capabilities import ALWAYS, CONFIGURATION, EXTERNAL, NEVER, SOMETIMES, UPSTREAM
from .runs import FAILED, SUCCEEDED

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from .capabilities import Described, Input, Instance, Output, World

_PLACEHOLDER = re.compile(r"\$\w+|\{\w+\}|\$\{[\w.]+\}")


def source(world: World, instance: Instance) -> tuple[Instance, str] | None:
    """The instance and event whose connection triggers this one; None: start, STARTED or a join."""
    for other in world.instances:
        for event, signal in ((SUCCEEDED, other.node.succeeded), (FAILED, other.node.failed)):
            if instance.node.trigger == signal:
                return other, event
    return None


def missing(world: World) -> dict[tuple[str, str], str]:
    """The needs that are not met in some run: always or sometimes, by path and name."""
    results = {}
    for instance in world.reachable:
        arrives = instance.arrives
        for name, need in _needs(instance.described).items():
            if _met_by_the_plan(instance, name, need):
                continue
            if need is not None and need.sources and UPSTREAM not in need.sources:
                how = NEVER  # what arrives does not count
            elif arrives is None:
                continue
            else:
                how = arrives.get(name, NEVER)
            if how != ALWAYS:
                results[instance.path, name] = SOMETIMES if how == SOMETIMES else ALWAYS
    return results


def _needs(described: Described | None) -> dict[str, Input | None]:
    """The needs by name: None for a parameter, else the input."""
    if described is None:
        return {}
    needs: dict[str, Input | None] = {
        parameter.name: None
        for parameter in described.parameters
        if parameter.required
        and parameter.default is None
        and described.input(parameter.name) is None
    }
    for entry in described.inputs:
        if entry.required and entry.default is None:
            needs[entry.name] = entry
    return needs


def _met_by_the_plan(instance: Instance, name: str, need: Input | None) -> bool:
    if need is None:
        return name in instance.written
    if name in instance.written and {EXTERNAL, CONFIGURATION} & set(need.sources):
        return True
    # Where the file names no fallback parameter it is the one of the same name, if any.
    return CONFIGURATION in need.sources and instance.configured(need.fallback or name) is not None


def overwritten(world: World) -> dict[tuple[str, str], str]:
    """The literals of the plan that something arriving replaces, by path and name.

    Only names that the instance knows: no other has a value that it works with.
    """
    results = {}
    for instance in world.reachable:
        arrives = instance.arrives or {}
        for name in instance.written:
            if (
                name in arrives
                and instance.described is not None
                and instance.described.knows(name)
            ):
                results[instance.path, name] = arrives[name]
    return results


def lost(world: World) -> set[tuple[str, str, str]]:
    """The outputs that are lost: path of the producer, name, path of the later instance.

    Later in document order; what "does not get it" gets nothing under this name, in no run.
    """
    wanting = _wanting(world)
    return {
        (producer.path, output.name, consumer.path)
        for producer, consumer in combinations(world.instances, 2)
        for output in (producer.described.outputs if producer.described else ())
        if (consumer.path, output.name) in wanting
        and any(
            run.fired & _signal(producer, output) and run.fired & consumer.node.trigger
            for run in world.runs
        )
    }


def _signal(producer: Instance, output: Output) -> int:
    return producer.node.succeeded if output.event == SUCCEEDED else producer.node.failed


def _wanting(world: World) -> set[tuple[str, str]]:
    """The instances and names that are known and wanted, and under which nothing arrives."""
    result = set(missing(world))
    for instance in world.reachable:
        for name, text in instance.written.items():
            if (
                _PLACEHOLDER.fullmatch(text)
                and instance.described
                and instance.described.knows(name)
            ):
                result.add((instance.path, name))
    arrives = {one.path: one.arrives for one in world.reachable}
    return {(path, name) for path, name in result if name not in _or_any(arrives[path], name)}


def _or_any(arrives: Mapping[str, str] | None, name: str) -> Collection[str]:
    """What arrives; where nobody knows what does, this name may."""
    return [name] if arrives is None else arrives
