"""Edges that end in one line: each is drawn up to where it meets one that is there already.

Drawn on top of each other, broken lines would fill each other's gaps.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    from gpsfsm.picture.routing import Point

__all__ = ["Merging"]


class Merging:
    """Remembers the lines of all edges by what they lead to; later ones flow into them."""

    def __init__(self) -> None:
        self.known: dict[Hashable, tuple[float, Sequence[Point]]] = {}

    def cut(self, key: Hashable, way: Sequence[Point]) -> tuple[Sequence[Point], bool]:
        """A way up to where it meets one with the same key, and whether it does."""
        for number, (start, end) in enumerate(pairwise(way)):
            axis = 0 if start[0] == end[0] else 1  # the coordinate that stays
            line = (key, axis, end, start[1 - axis] < end[1 - axis])
            found = self.known.get(line)
            if found is None:
                self.known[line] = (start[1 - axis], way[number + 1 :])
                continue
            begin, rest = found
            if rest != way[number + 1 :]:
                continue
            if abs(begin - end[1 - axis]) >= abs(start[1 - axis] - end[1 - axis]):
                return way[: number + 1], number > 0
            self.known[line] = (start[1 - axis], rest)
            meeting = (end[0], begin) if axis == 0 else (begin, end[1])
            return [*way[: number + 1], meeting], True
        return way, False
