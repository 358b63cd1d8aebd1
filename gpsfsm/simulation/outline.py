"""What a map of a world shows, as plain values: lengths in metres, angles in radians."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gpsfsm.simulation.world import Rectangle, Window, World

__all__ = ["outline"]


def outline(world: World) -> dict[str, Any]:
    """The map, and who and what is on it when. ``until_s`` is None for what never ends."""
    robot, ground = world.robot, world.map
    numbers = {zone.name: number for number, zone in enumerate(ground.zones)}
    return {
        "title": world.name,
        "area": _box(ground.area),
        "resolution": ground.resolution,
        "robot": {
            "x": robot.x,
            "y": robot.y,
            "yaw": robot.yaw,
            "radius": robot.radius,
            "speed": robot.speed,
            "turn_speed": robot.turn_speed,
            "sees_within": robot.sees_within,
            "view": robot.view,
            "hears_within": robot.hears_within,
        },
        "obstacles": [
            {"name": each.name, "box": _box(each.area), "low": each.low, **_span(each.window)}
            for each in ground.obstacles
        ],
        "zones": [
            {"name": each.name, "box": _box(each.area), "closed": each.closed}
            for each in ground.zones
        ],
        "changes": [
            {
                "zone": numbers[each.zone],
                "closed": each.closed,
                "at_s": each.at_s,
                "after_arrivals": each.after_arrivals,
            }
            for each in world.changes
        ],
        **_inhabitants(world),
    }


def _inhabitants(world: World) -> dict[str, Any]:
    return {
        "places": [{"name": each.name, "x": each.x, "y": each.y} for each in world.places],
        "people": [
            {
                "name": each.name,
                "looks": each.looks,
                "stays": [{"x": stay.x, "y": stay.y, **_span(stay.window)} for stay in each.stays],
            }
            for each in world.people
        ],
        "things": [
            {"name": each.name, "x": each.x, "y": each.y, **_span(each.window)}
            for each in world.things
        ],
        "sounds": [
            {
                "text": each.text,
                "from_s": each.start_s,
                "until_s": each.end_s if each.end_s < math.inf else None,
                "x": each.x,
                "y": each.y,
            }
            for each in world.sounds
        ],
    }


def _box(area: Rectangle) -> list[float]:
    return [area.x0, area.y0, area.x1, area.y1]


def _span(window: Window) -> dict[str, float | None]:
    end_s = window.end_s if window.end_s < math.inf else None
    return {"from_s": window.start_s, "until_s": end_s}
