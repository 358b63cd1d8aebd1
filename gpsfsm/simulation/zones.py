"""Zones of a map in one run: which of them are closed when."""

from __future__ import annotations

import bisect
import math
from typing import TYPE_CHECKING

from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.simulation.world import Change, World

__all__ = ["Zones"]

_MAX_TOLD = 3


class Zones:
    """The zones of a world, by number. Changes at one instant count in the order of the file."""

    def __init__(self, world: World) -> None:
        self._zones = world.map.zones
        self._numbers = {found.name: number for number, found in enumerate(self._zones)}
        self._changes = world.changes
        # what is known of the future: when, which of the changes
        self._planned = sorted(
            (change.at_s, place)
            for place, change in enumerate(world.changes)
            if change.at_s is not None
        )
        self._told = 0  # how many of these have been told

    def closed(self, now_s: float) -> tuple[int, ...]:
        """The zones that are closed at a time, in the order of the file."""
        if not self._zones:
            return ()
        shut = [found.closed for found in self._zones]
        for at_s, place in self._planned:
            if at_s > now_s:
                break
            change = self._changes[place]
            shut[self._numbers[change.zone]] = change.closed
        return tuple(number for number, closed in enumerate(shut) if closed)

    def next_change(self, now_s: float) -> float:
        """When the next zone is closed or opened by the time alone; infinity if none is."""
        place = bisect.bisect_right(self._planned, (now_s, len(self._changes)))
        return self._planned[place][0] if place < len(self._planned) else math.inf

    def arrived(self, now_s: float, arrivals: int) -> None:
        """The robot has reached a goal, and that many in all."""
        for place, change in enumerate(self._changes):
            if change.after_arrivals == arrivals:
                bisect.insort(self._planned, (now_s, place), lo=self._told)

    def news(self, now_s: float) -> list[str]:
        """A line for each change until now that was not told before."""
        found = []
        while self._told < len(self._planned) and self._planned[self._told][0] <= now_s:
            found.append(self._line(self._changes[self._planned[self._told][1]]))
            self._told += 1
        return found

    def told(self, numbers: Sequence[int]) -> str:
        """That these zones are closed, in words."""
        names = [f"'{clip(self._zones[number].name, 60)}'" for number in numbers[:_MAX_TOLD]]
        if len(numbers) == 1:
            return f"the zone {names[0]} is closed"
        more = f" and {len(numbers) - _MAX_TOLD} more" if len(numbers) > _MAX_TOLD else ""
        return f"the zones {', '.join(names)}{more} are closed"

    def _line(self, change: Change) -> str:
        said = "closed" if change.closed else "open"
        return f"the zone '{clip(change.zone, 60)}' is {said} now"
