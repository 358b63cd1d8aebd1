"""Whether what a world file says makes sense together: places, names and zones."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import quoted
from gpsfsm.simulation.terrain import NOWHERE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from gpsfsm.capabilities.defects import Notes, Place
    from gpsfsm.simulation.grid import Point
    from gpsfsm.simulation.schema import PersonFile, ThingFile, WorldFile
    from gpsfsm.simulation.world import Obstacle, Person, Thing, World

__all__ = ["check_sense"]


def check_sense(model: WorldFile, world: World, notes: Notes) -> None:
    """Note what is in a place where it cannot be, and names that are there twice or not at all."""
    if world.map is not NOWHERE:
        _check_places(model, world, notes)
    _no_name_twice("place", ((found.name, found.at("name")) for found in model.places), notes)
    _no_name_twice("person", ((found.name, found.at("name")) for found in model.people), notes)
    _check_zones(model, notes)


def _check_places(model: WorldFile, world: World, notes: Notes) -> None:
    _check_robot(model, world, notes)
    for person, found in zip(model.people, world.people, strict=True):
        _check_person(person, found, world, notes)
    drawn = len(world.map.obstacles) - (0 if model.map is None else len(model.map.obstacles))
    for thing, seen in zip(model.things, world.things, strict=True):
        _check_thing(thing, seen, world, notes, walls=world.map.obstacles[:drawn])
    for place in model.places:
        _on_map(f"the place {quoted(place.name)}", (place.x, place.y), place.place, world, notes)


def _check_robot(model: WorldFile, world: World, notes: Notes) -> None:
    robot = world.robot
    place: Place = (1, 1)
    if model.robot is not None:
        place = model.robot.at("x")
    elif model.map is not None:
        place = model.map.place
    at = f"({robot.x:g}, {robot.y:g})"
    hint = "write another 'x' and 'y' for the robot, or change the map"
    if not world.map.area.holds(robot.x, robot.y):
        notes.error(place, f"the robot does not start on the map: it starts at {at}", hint)
        return
    for found in world.map.obstacles:
        if found.window.holds(0.0) and found.area.encloses(robot.x, robot.y):
            notes.error(place, f"the robot starts in {_called(found)}, at {at}", hint)
            return
    for zone in world.map.zones:
        if zone.closed and zone.area.encloses(robot.x, robot.y):
            message = f"the robot starts in the zone {quoted(zone.name)}, which is closed"
            notes.error(place, message, hint)


def _check_person(model: PersonFile, person: Person, world: World, notes: Notes) -> None:
    """People do not stand in walls; they may sit on what is low."""
    name = quoted(model.name)
    for place, stay in zip(
        [one.place for one in model.stays] or [model.place], person.stays, strict=False
    ):
        if not _on_map(name, (stay.x, stay.y), place, world, notes):
            continue
        for found in world.map.obstacles:
            hit = found.area.encloses(stay.x, stay.y) and found.window.overlaps(stay.window)
            if hit and not found.low:
                hint = "write another 'x' and 'y', or 'low: true' for what one can stand on"
                notes.error(place, f"{name} stands in {_called(found)}", hint)
                break


def _check_thing(
    model: ThingFile, thing: Thing, world: World, notes: Notes, *, walls: tuple[Obstacle, ...]
) -> None:
    """Things are in walls no more than people, but may be on tables and in shelves."""
    name = quoted(model.name)
    if not _on_map(name, (thing.x, thing.y), model.place, world, notes):
        return
    if any(found.area.encloses(thing.x, thing.y) for found in walls):
        notes.error(model.place, f"{name} is in a wall of the drawing", "write another 'x' and 'y'")


def _on_map(name: str, point: Point, place: Place, world: World, notes: Notes) -> bool:
    area, (x, y) = world.map.area, point
    if area.holds(x, y):
        return True
    shown = f"x: [{area.x0:g}, {area.x1:g}], y: [{area.y0:g}, {area.y1:g}]"
    notes.error(place, f"{name} is not on the map: ({x:g}, {y:g})", f"the map is {shown}")
    return False


def _called(found: Obstacle) -> str:
    return f"the obstacle {quoted(found.name)}" if found.name else "an obstacle"


def _no_name_twice(kind: str, named: Iterable[tuple[str, Place]], notes: Notes) -> None:
    first: dict[str, Place] = {}
    for name, place in named:
        if name in first:
            message = (
                f"a {kind} called {quoted(name)} is here twice, first in line {first[name][0]}"
            )
            notes.error(place, message, "give each a name of its own, or remove one")
        first.setdefault(name, place)


def _check_zones(model: WorldFile, notes: Notes) -> None:
    zones = [] if model.map is None else model.map.zones
    _no_name_twice("zone", ((found.name, found.at("name")) for found in zones), notes)
    known: Mapping[str, None] = dict.fromkeys(found.name for found in zones)
    for change in model.changes:
        for key in ("close", "open"):
            for name in getattr(change, key):
                if name not in known:
                    hint = notes.near(name, known) or "describe it under 'zones' of the 'map'"
                    notes.error(change.at(key), f"no zone is called {quoted(name)}", hint)
