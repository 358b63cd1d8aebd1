"""What a robot can know of its world before it moves: where it is, and the places that have names.

People, things and closed doors are for the robot to find out, so no prompt tells them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.simulation.world import World

__all__ = ["known_of"]

_MAX_PLACES = 200
_MAX_NAME = 100


def known_of(world: World) -> tuple[str, ...]:
    """Facts about a world, one line each."""
    return tuple(_lines(world))


def _lines(world: World) -> Iterator[str]:
    robot = world.robot
    yield (
        f"- The robot is at x={robot.x:g}, y={robot.y:g} and looks in the direction of "
        f"{math.degrees(robot.yaw):g} degrees. Lengths are in metres."
    )
    for place in world.places[:_MAX_PLACES]:
        yield f"- {clip(place.name, _MAX_NAME)} is at x={place.x:g}, y={place.y:g}."
    if len(world.places) > _MAX_PLACES:
        yield f"- There are {len(world.places) - _MAX_PLACES} more places with a name."
