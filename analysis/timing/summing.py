"""What times and energies of a plan have in common: they are put together from its units."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from gpsfsm.compile import UnitKind

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.analysis.timing.amounts import Amounts, Range

__all__ = ["reached", "whole"]

T = TypeVar("T")


def whole(
    structure: Structure,
    amounts: Amounts,
    made: Callable[[Range, Range | None], T],
    combined: Mapping[UnitKind, Callable[[Sequence[T]], T]],
) -> T | None:
    """What the plan takes; None if no reachable instance declares any.

    ``made`` is given what an instance takes if it succeeds, and if it fails (None if it cannot).
    ``combined`` makes of what its children take what a unit of some kind takes.
    """
    if not any(structure.reached[structure.unit_of[number]] for number in amounts.declared):
        return None
    units = structure.units
    found: dict[int, T] = {}
    for unit in reversed(range(len(units))):  # children come after their parents
        kind = units.kinds[unit]
        if kind is UnitKind.RUNNER:
            amount = amounts.ranges[structure.number[unit]]
            found[unit] = made(amount, amount if structure.can_fail[unit] else None)
        else:
            found[unit] = combined[kind]([found[child] for child in units.children[unit]])
    return found[0]


def reached(solver: Solver, amounts: Amounts) -> Iterator[int]:
    """The numbers of the instances that declare something and that some run triggers."""
    for number in amounts.declared:
        node = solver.automaton.runner_node(number)
        if solver.decide([solver.encoding.triggered(node)])[0]:
            yield number
