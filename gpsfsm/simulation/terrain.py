"""From the ``map`` of a world file to obstacles in metres."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.simulation.world import Map, Obstacle, Rectangle, Window

if TYPE_CHECKING:
    from gpsfsm.capabilities.defects import Notes
    from gpsfsm.simulation.schema import MapFile, ObstacleFile
    from gpsfsm.simulation.world import Robot

__all__ = ["MAX_CELLS", "MAX_OBSTACLES", "map_of"]

MAX_CELLS = 250_000
MAX_OBSTACLES = 2_000
_MAX_COORDINATE = 1e6
_WALL = "#"


def map_of(model: MapFile | None, robot: Robot, notes: Notes) -> Map:
    """The map; without one a field of 20 by 20 metres around the start of the robot."""
    if model is None:
        x, y = robot.x, robot.y
        return Map(Rectangle(x - 10.0, y - 10.0, x + 10.0, y + 10.0))
    walls: list[Obstacle] = []
    if model.rows is not None:
        area = _drawn_area(model, notes)
        if area is not None:
            walls = _drawn_walls(model.rows, area, model.resolution)
    else:
        area = _area(model, notes)
    if area is None:
        return Map(Rectangle(0.0, 0.0, 1.0, 1.0))
    if model.resolution > 2 * robot.radius:
        message = "'resolution' must not be more than the width of the robot"
        notes.error(model.at("resolution"), message, "thin walls could be missed")
    obstacles = (*walls, *(_obstacle(found, notes) for found in model.obstacles))
    if len(obstacles) > MAX_OBSTACLES:
        message = f"the map has {len(obstacles)} obstacles; at most {MAX_OBSTACLES} are allowed"
        notes.error(model.place, message, "draw larger ones")
    if not area.holds(robot.x, robot.y):
        notes.error(model.place, "the robot does not start on the map", "move the one or the other")
    return Map(area, model.resolution, obstacles)


def _area(model: MapFile, notes: Notes) -> Rectangle | None:
    if model.x is None or model.y is None:
        message = "the map has no area"
        notes.error(model.place, message, "write x: [west, east] and y: [south, north], or rows")
        return None
    if model.origin is not None:
        notes.error(model.at("origin"), "'origin' belongs to 'rows'", "remove it")
    west, east = model.x
    south, north = model.y
    if not (west < east and south < north):
        notes.error(model.at("x"), "the area of the map is empty", "write the smaller number first")
        return None
    return _bounded(Rectangle(west, south, east, north), model, notes)


def _drawn_area(model: MapFile, notes: Notes) -> Rectangle | None:
    rows = (model.rows or "").splitlines()
    if not rows or not max(map(len, rows)):
        notes.error(model.at("rows"), "the map has no rows", "draw it with '#' and '.'")
        return None
    for key in ("x", "y"):
        if getattr(model, key) is not None:
            notes.error(model.at(key), f"'{key}' and 'rows' exclude each other", "remove one")
    strange = sorted({letter for row in rows for letter in row} - set("#. "))
    if strange:
        message = f"the map may hold '#', '.' and blanks only, not {strange[0]!r}"
        notes.error(model.at("rows"), message)
        return None
    x, y = model.origin or (0.0, 0.0)
    edge = model.resolution
    width, height = max(map(len, rows)) * edge, len(rows) * edge
    return _bounded(Rectangle(x, y, x + width, y + height), model, notes)


def _bounded(area: Rectangle, model: MapFile, notes: Notes) -> Rectangle | None:
    if not 0.001 <= model.resolution <= 100:
        notes.error(model.at("resolution"), "'resolution' must be between 0.001 and 100 metres")
        return None
    corners = (area.x0, area.y0, area.x1, area.y1)
    if any(abs(corner) > _MAX_COORDINATE for corner in corners):
        notes.error(model.place, f"the map reaches further than {_MAX_COORDINATE:g} metres")
        return None
    cells = ((area.x1 - area.x0) / model.resolution) * ((area.y1 - area.y0) / model.resolution)
    if cells > MAX_CELLS:
        message = f"the map has {cells:.0f} cells; at most {MAX_CELLS} are allowed"
        notes.error(model.at("resolution"), message, "make 'resolution' larger")
        return None
    return area


def _drawn_walls(text: str, area: Rectangle, edge: float) -> list[Obstacle]:
    """The walls of a drawing: runs of ``#``; equal runs in rows that follow are one rectangle."""
    found: list[Obstacle] = []
    open_runs: dict[tuple[int, int], int] = {}  # columns of a run: the row in which it begins
    rows = text.splitlines()
    for number, row in enumerate([*rows, ""]):
        runs = _runs(row)
        for columns in [columns for columns in open_runs if columns not in runs]:
            first = open_runs.pop(columns)
            north, south = area.y1 - first * edge, area.y1 - number * edge
            west, east = area.x0 + columns[0] * edge, area.x0 + columns[1] * edge
            found.append(Obstacle(Rectangle(west, south, east, north)))
        for columns in runs:
            open_runs.setdefault(columns, number)
    return found


def _runs(row: str) -> list[tuple[int, int]]:
    runs = []
    begin: int | None = None
    for column, letter in enumerate(row + " "):
        if letter == _WALL and begin is None:
            begin = column
        elif letter != _WALL and begin is not None:
            runs.append((begin, column))
            begin = None
    return runs


def _obstacle(model: ObstacleFile, notes: Notes) -> Obstacle:
    area = Rectangle(min(model.x), min(model.y), max(model.x), max(model.y))
    if any(abs(edge) > _MAX_COORDINATE for edge in (area.x0, area.y0, area.x1, area.y1)):
        notes.error(model.place, f"an obstacle reaches further than {_MAX_COORDINATE:g} metres")
    end = math.inf if model.until is None else model.until
    if model.from_ < 0:
        notes.error(model.at("from"), "'from' must not be negative")
    elif end <= model.from_:
        notes.error(model.at("until"), "'until' must be later than 'from'", "swap them")
    return Obstacle(area, model.name, model.low, Window(model.from_, end))
