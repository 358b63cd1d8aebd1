"""Units that end at the instant at which they begin, and what that makes inexpressible.

BehaviorTree.CPP ticks the children of a Parallel one after the other. Children that end in their
first tick can end the Parallel before the others have been started; an automaton starts them all.
A reactive control is an ordinary one only if what stands before its last child never changes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.compile.units import UnitKind, Units

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

__all__ = ["first_lost"]

_PARALLEL = (UnitKind.ALL, UnitKind.ANY, UnitKind.COUNT)


def first_lost(units: Units, reactive: Mapping[int, bool]) -> Iterator[tuple[int, str]]:
    """The units that cannot be expressed, with the reason.

    ``reactive`` are the units of reactive controls; True for a ReactiveSequence.
    """
    instant = _instants(units)
    for unit, kind in enumerate(units.kinds):
        ends = [instant[child] for child in units.children[unit]]
        if kind in _PARALLEL and len(ends) > 1 and _parallel(units, unit, ends) is not None:
            yield unit, "children that end at once end this Parallel before it has started all"
    for unit, sequence in reactive.items():
        ends = [instant[child] for child in units.children[unit][:-1]]
        if any(end is not sequence for end in ends):
            what = "ReactiveSequence" if sequence else "ReactiveFallback"
            yield (
                unit,
                f"this {what} ticks its first children again while the last one runs, so that "
                "what they say may change; the automaton asks once",
            )


def _instants(units: Units) -> list[bool | None]:
    """Per unit: it succeeds at once, it fails at once (False), or neither (None)."""
    found: list[bool | None] = [None] * len(units)
    for unit in reversed(range(len(units))):
        kind = units.kinds[unit]
        ends = [found[child] for child in units.children[unit]]
        if kind is UnitKind.EMPTY:
            found[unit] = True
        elif kind is UnitKind.SEQUENCE:
            found[unit] = next((end for end in ends if end is not True), True)
        elif kind is UnitKind.GUARD:
            found[unit] = next((end for end in ends if end is not False), False)
        elif kind is UnitKind.NOT and ends[0] is not None:
            found[unit] = not ends[0]
        elif kind is UnitKind.BRANCH and ends[0] is not None:
            found[unit] = ends[1] if ends[0] else (ends[2] if len(ends) > 2 else False)
        elif kind in _PARALLEL:
            found[unit] = _parallel(units, unit, ends)
        elif kind is UnitKind.WAIT and None not in ends:
            found[unit] = sum(end is True for end in ends) >= units.needs[unit]
    return found


def _parallel(units: Units, unit: int, ends: Sequence[bool | None]) -> bool | None:
    need = units.needs.get(unit, 1 if units.kinds[unit] is UnitKind.ANY else len(ends))
    if sum(end is True for end in ends) >= need:
        return True
    return False if sum(end is False for end in ends) > len(ends) - need else None
