"""Waiting joins: which units are guilty, and what belongs to them.

Shared by the rules on dangling events, join deadlocks and stuck plans: one cause, one finding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.analysis.encode import conjunction, negation
from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.joins import Deadlock

__all__ = ["Waiting", "waiting_blocks"]


@dataclass(frozen=True, slots=True)
class Waiting:
    """A parallel_all whose join may wait for ever.

    ``guilty`` are the units for which it may wait, ``dangling`` the numbers of the runners whose
    dangling failures make them fail, ``outer`` the blocks that wait only because this one does.
    """

    deadlock: Deadlock
    unit: int
    guilty: tuple[int, ...]
    dangling: tuple[int, ...]
    outer: tuple[int, ...]


def waiting_blocks(context: Context) -> tuple[Waiting, ...]:
    """The join deadlocks to report, in document order. Raises Inconclusive at a limit.

    A block that waits only for a block that waits itself is listed under that one.
    """
    deadlocks = {
        context.unit_of_element[context.automaton.blocks[deadlock.block].element]: deadlock
        for deadlock in context.answers["joins"] or ()
    }
    guilty = _guilty(context, deadlocks)
    cause = {unit: _cause(context, guilty, unit) for unit in deadlocks}
    enclosing = _enclosing(context.units.parents, deadlocks)
    outer: dict[int, list[int]] = {}
    for unit, root in cause.items():
        if root != unit:
            outer.setdefault(root, []).append(unit)
    dangling: dict[int, list[int]] = {}
    for found in context.answers["dangling"] or ():
        block = enclosing[context.unit_of_runner[found.runner]]
        if block >= 0 and (found.effect == "give_up" or context.possible_event(found)):
            dangling.setdefault(cause[block], []).append(found.runner)
    return tuple(
        Waiting(
            deadlock,
            unit,
            guilty[unit],
            tuple(dangling.get(unit, ())),
            tuple(outer.get(unit, ())),
        )
        for unit, deadlock in deadlocks.items()
        if cause[unit] == unit
    )


def _guilty(context: Context, deadlocks: Mapping[int, Deadlock]) -> Mapping[int, tuple[int, ...]]:
    """The units of each block whose success may never come."""
    children = context.units.children
    structure = context.deciders.structure
    if structure is not None:
        return {
            unit: tuple(child for child in children[unit] if structure.can_fail[child])
            for unit in deadlocks
        }
    solver = context.deciders.solver
    pairs = [(unit, place) for unit in deadlocks for place in range(len(children[unit]))]
    terms = []
    for unit, place in pairs:
        block = context.automaton.blocks[deadlocks[unit].block]
        success, _ = block.units[place]
        triggered = solver.encoding.happens(block.trigger)
        terms.append(conjunction((triggered, negation(solver.encoding.happens(success)))))
    answers = solver.decide(terms)
    found: dict[int, list[int]] = {unit: [] for unit in deadlocks}
    for (unit, place), guilty in zip(pairs, answers, strict=True):
        if guilty:
            found[unit].append(children[unit][place])
    return {unit: tuple(units) for unit, units in found.items()}


def _cause(context: Context, guilty: Mapping[int, tuple[int, ...]], unit: int) -> int:
    """The innermost block because of which this one waits: itself, if it has other reasons."""
    while len(guilty[unit]) == 1:
        inner = guilty[unit][0]
        while context.units.kinds[inner] is UnitKind.SEQUENCE and (
            len(context.units.children[inner]) == 1
        ):
            inner = context.units.children[inner][0]
        if inner not in guilty:
            break
        unit = inner
    return unit


def _enclosing(parents: Sequence[int], blocks: Mapping[int, Deadlock]) -> list[int]:
    """For each unit the innermost of the blocks around it, or -1."""
    found = [-1] * len(parents)
    for unit, parent in enumerate(parents):
        if parent >= 0:
            found[unit] = parent if parent in blocks else found[parent]
    return found
