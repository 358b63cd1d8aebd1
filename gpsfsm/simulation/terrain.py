"""From the ``map`` of a world file to obstacles in metres."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import quoted
from gpsfsm.simulation.world import Map, Obstacle, Rectangle, Window, Zone

if TYPE_CHECKING:
    from gpsfsm.capabilities.defects import Notes, Place
    from gpsfsm.simulation.schema import MapFile, ObstacleFile, ZoneFile
    from gpsfsm.simulation.world import Robot

NOWHERE = Map(Rectangle(0.0, 0.0, 1.0, 1.0))
"""Stands for a map that is so wrong that nothing can be said about places on it."""

MAX_CELLS = 250_000
MAX_OBSTACLES = 2_000
_MAX_COORDINATE = 1e6
_MAX_SECONDS = 1e9
_WALL = "#"
_DRAWN = frozenset("#. ")


def map_of(model: MapFile | None, robot: Robot, notes: Notes, *, text: str = "") -> Map:
    """The map; without one a field of 20 by 20 metres around the start of the robot.

    ``text`` is that of the file, to tell where in a drawing something is wrong.
    """
    if model is None:
        x, y = robot.x, robot.y
        return Map(Rectangle(x - 10.0, y - 10.0, x + 10.0, y + 10.0))
    walls: list[Obstacle] = []
    if model.rows is not None:
        area = _drawn_area(model, notes, text)
        if area is not None:
            walls = _drawn_walls(model.rows, area, model.resolution)
    else:
        area = _area(model, notes)
    if area is None:
        return NOWHERE
    _check_sizes(model, area, robot, notes)
    count = len(walls) + len(model.obstacles) + len(model.zones)
    if count > MAX_OBSTACLES:
        message = f"the map has {count} obstacles and zones; at most {MAX_OBSTACLES} are allowed"
        notes.error(model.place, message, "draw larger ones")
        return NOWHERE
    obstacles = (*walls, *(_obstacle(entry, area, notes) for entry in model.obstacles))
    zones = tuple(
        Zone(entry.name, _rectangle(entry, area, "zone", notes), entry.closed)
        for entry in model.zones
    )
    return Map(area, model.resolution, obstacles, zones)


def _check_sizes(model: MapFile, area: Rectangle, robot: Robot, notes: Notes) -> None:
    wide = 2 * robot.radius
    if model.resolution > wide:
        message = "'resolution' must not be more than the width of the robot"
        notes.error(model.at("resolution"), message, "thin walls could be missed")
    if min(area.x1 - area.x0, area.y1 - area.y0) < wide:
        message = f"the map is narrower than the robot, which is {wide:g} metres wide"
        notes.error(model.place, message, "draw a larger map, or make 'radius' smaller")


def _area(model: MapFile, notes: Notes) -> Rectangle | None:
    if model.x is None or model.y is None:
        message = "the map has no area"
        notes.error(model.place, message, "write x: [west, east] and y: [south, north], or rows")
        return None
    if model.origin is not None:
        notes.error(model.at("origin"), "'origin' belongs to 'rows'", "remove it")
    west, east = model.x
    south, north = model.y
    for key, least, greatest in (("x", west, east), ("y", south, north)):
        if not least < greatest:
            hint = f"write {key}: [least, greatest], in metres"
            notes.error(model.at(key), "the area of the map is empty", hint)
            return None
    return _bounded(Rectangle(west, south, east, north), model, notes)


def _drawn_area(model: MapFile, notes: Notes, text: str) -> Rectangle | None:
    rows = (model.rows or "").splitlines()
    if not rows or not max(map(len, rows)):
        notes.error(model.at("rows"), "the map has no rows", "draw it with '#' and '.'")
        return None
    for key in ("x", "y"):
        if getattr(model, key) is not None:
            notes.error(model.at(key), f"'{key}' and 'rows' cannot be used together", "remove one")
    if not _well_drawn(rows, model, notes, text):
        return None
    x, y = model.origin or (0.0, 0.0)
    edge = model.resolution
    width, height = max(map(len, rows)) * edge, len(rows) * edge
    return _bounded(Rectangle(x, y, x + width, y + height), model, notes)


def _well_drawn(rows: list[str], model: MapFile, notes: Notes, text: str) -> bool:
    """True if all rows are equally long and hold nothing but walls and free cells."""
    lines, key = text.splitlines(), model.at("rows")

    def place_of(number: int, column: int) -> Place:
        """The place of a character of a row; that of the drawing if that cannot be told."""
        line = lines[key[0] + number] if key[0] + number < len(lines) else ""
        if not rows[number] or line.lstrip(" ").rstrip() != rows[number].lstrip(" ").rstrip():
            return key
        return key[0] + 1 + number, len(line.rstrip()) - len(rows[number].rstrip()) + column + 1

    before = len(notes.defects)
    for number, row in enumerate(rows):
        strange = next(
            (column for column, character in enumerate(row) if character not in _DRAWN), None
        )
        if strange is not None:
            message = f"the map may hold '#', '.' and blanks only, not {quoted(row[strange])}"
            notes.error(
                place_of(number, strange), message, "draw a wall as '#' and the rest as '.'"
            )
        if len(row) != len(rows[0]):
            message = (
                f"row {number + 1} of the map has {len(row)} characters, the first has "
                f"{len(rows[0])}"
            )
            hint = "make all rows equally long; spaces at the end count"
            notes.error(place_of(number, min(len(row), len(rows[0]))), message, hint)
    return len(notes.defects) == before


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
    drawn: list[Obstacle] = []
    open_runs: dict[tuple[int, int], int] = {}  # columns of a run: the row in which it begins
    rows = text.splitlines()
    for number, row in enumerate([*rows, ""]):
        runs = _runs(row)
        for columns in [columns for columns in open_runs if columns not in runs]:
            first = open_runs.pop(columns)
            north, south = area.y1 - first * edge, area.y1 - number * edge
            west, east = area.x0 + columns[0] * edge, area.x0 + columns[1] * edge
            drawn.append(Obstacle(Rectangle(west, south, east, north)))
        for columns in runs:
            open_runs.setdefault(columns, number)
    return drawn


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


def _obstacle(model: ObstacleFile, area: Rectangle, notes: Notes) -> Obstacle:
    end = math.inf if model.until is None else model.until
    if not 0 <= model.from_ <= _MAX_SECONDS:
        notes.error(model.at("from"), f"'from' must be between 0 and {_MAX_SECONDS:g} seconds")
    elif end <= model.from_:
        notes.error(model.at("until"), "'until' must be later than 'from'", "swap them")
    rectangle = _rectangle(model, area, "obstacle", notes)
    return Obstacle(rectangle, model.name, model.low, Window(model.from_, end))


def _rectangle(
    model: ObstacleFile | ZoneFile, area: Rectangle, what: str, notes: Notes
) -> Rectangle:
    """The rectangle of an obstacle or a zone, which must have a size and be on the map."""
    rectangle = Rectangle(min(model.x), min(model.y), max(model.x), max(model.y))
    named = f"the {what} {quoted(model.name)}" if model.name else f"this {what}"
    for key, least, greatest in (
        ("x", rectangle.x0, rectangle.x1),
        ("y", rectangle.y0, rectangle.y1),
    ):
        if max(abs(least), abs(greatest)) > _MAX_COORDINATE:
            message = f"{named} reaches further than {_MAX_COORDINATE:g} metres"
            notes.error(model.at(key), message)
            return rectangle
        if not least < greatest:
            hint = (
                f"write {key}: [{least:g}, {least + 0.1:g}], say; robots pass through a mere line"
            )
            notes.error(model.at(key), f"{named} has no width", hint)
            return rectangle
    if not rectangle.meets(area):
        shown = f"x: [{area.x0:g}, {area.x1:g}], y: [{area.y0:g}, {area.y1:g}]"
        notes.error(model.place, f"{named} is not on the map", f"the map is {shown}")
    return rectangle
