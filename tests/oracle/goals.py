"""Swallowed failures (semantics, 5.8), by looking at every run.

A unit is a ``Unit``: an element and the recoveries behind it. What a unit is to achieve, whether it
is done, and which goals a run misses is asked of that tree, by plain recursion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .model import C, P, Placed, R, place

if TYPE_CHECKING:
    from collections.abc import Collection

    from .runs import Run


@dataclass(frozen=True, slots=True)
class Unit:
    """``parts`` are the units in the element, ``recoveries`` those of each recovery behind it."""

    element: Placed
    parts: tuple[Unit, ...]
    recoveries: tuple[tuple[Unit, ...], ...]

    def achieves(self, achieving: Collection[str]) -> bool:
        """Whether a unit is to achieve something: what is guarded decides, not its recoveries."""
        if isinstance(self.element.node, R):
            return self.element.path in achieving
        return any(part.achieves(achieving) for part in self.parts)


def units_of(children: tuple[Placed, ...]) -> tuple[Unit, ...]:
    """The units of a control; recoveries that guard nothing, or hold no unit, are left out."""
    units: list[Unit] = []
    for child in children:
        inside = units_of(child.children)
        if not (isinstance(child.node, C) and child.node.type == "recovery"):
            units.append(Unit(child, inside, ()))
        elif units and inside:
            last = units.pop()
            units.append(Unit(last.element, last.parts, (*last.recoveries, inside)))
    return tuple(units)


def missed_goals(whole: P, achieving: Collection[str], run: Run) -> frozenset[str]:
    """The smallest goals that this run misses, though the plan completes; by what is guarded."""
    if not run.completed:
        return frozenset()
    missed = _missed(Unit(place(whole), units_of(place(whole).children), ()), achieving, run)
    return frozenset(
        path
        for path, inside in missed.items()
        if not any(other.startswith(inside) for other in missed if other != path)
    )


def _missed(unit: Unit, achieving: Collection[str], run: Run) -> dict[str, tuple[str, ...]]:
    """The goals missed in a unit, each with the paths of the elements in which smaller ones are."""
    excused = unit.achieves(achieving) and _done(unit, achieving, run)
    element = unit.element.node
    missed: dict[str, tuple[str, ...]] = {}
    if excused and (unit.recoveries or (isinstance(element, C) and element.type == "parallel_any")):
        return missed
    for part in (*unit.parts, *(each for group in unit.recoveries for each in group)):
        missed |= _missed(part, achieving, run)
    if unit.recoveries and unit.achieves(achieving) and _triggered(unit, run):
        below = [f"{unit.element.path}/", *(f"{_parent(group)}/" for group in unit.recoveries)]
        missed[unit.element.path] = tuple(below)
    return missed


def _parent(group: tuple[Unit, ...]) -> str:
    return group[0].element.path.rpartition("/")[0]


def _triggered(unit: Unit, run: Run) -> bool:
    return bool(run.fired & run.system.graph.triggers[unit.element.path])


def _done(unit: Unit, achieving: Collection[str], run: Run) -> bool:
    """Whether a unit that is to achieve something is done."""
    element = unit.element.node
    if isinstance(element, R):
        runner = run.system.graph.runners[run.system.index[unit.element.path]]
        done = bool(run.fired & runner.succeeded)
    else:
        parts = [_done(each, achieving, run) for each in unit.parts if each.achieves(achieving)]
        either = isinstance(element, C) and element.type == "parallel_any"
        done = any(parts) if either else all(parts)
    others = [each for group in unit.recoveries for each in group if each.achieves(achieving)]
    return done or any(_done(each, achieving, run) for each in others)
