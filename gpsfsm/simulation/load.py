"""Reading world files (docs/worlds.md): from shapes to a world, and notes on what makes no sense.

Places, names and zones have to fit together, and the runners that a file speaks of have to exist in
the chosen capabilities. Imports pydantic and a YAML parser.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import Notes, errors_text, quoted
from gpsfsm.capabilities.files import read_bytes
from gpsfsm.capabilities.library import namespace
from gpsfsm.capabilities.reading import Items, Scalar, read_table, validate
from gpsfsm.errors import ConfigError
from gpsfsm.model.event import Event
from gpsfsm.simulation.schema import (
    AnswerFile,
    PersonFile,
    WorldFile,
)
from gpsfsm.simulation.terrain import NOWHERE, map_of
from gpsfsm.simulation.world import (
    Answer,
    Change,
    Person,
    Place,
    Rectangle,
    Reply,
    Robot,
    Settings,
    Sound,
    Stay,
    Window,
    World,
    WorldObject,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from gpsfsm.capabilities.defects import Place as Position
    from gpsfsm.capabilities.library import Library
    from gpsfsm.capabilities.reading import FileModel
    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.capability import Provider
    from gpsfsm.simulation.grid import Point
    from gpsfsm.simulation.schema import (
        AnswerFile,
        ChangeFile,
        ObjectFile,
        PersonFile,
        RobotFile,
        SettingsFile,
        SoundFile,
        SpanFile,
    )
    from gpsfsm.simulation.world import Obstacle

_MAX_SECONDS = 1e9
_MAX_ARRIVALS = 1_000_000


def load_world(file: str | Path, *, library: Library | None = None) -> World:
    """Load a world file.

    With ``library``, the file's statements about runners are checked against it. Raises
    ConfigError, with one line for each defect, if the file is invalid.
    """
    notes = Notes(str(file), kind="world")
    content = read_bytes(str(file), notes)
    if content is None:
        raise ConfigError(errors_text(notes))
    return read_world(content, file=str(file), library=library)


def read_world(content: bytes, *, file: str = "<world>", library: Library | None = None) -> World:
    """The world that the content of a file describes. Raises ConfigError like ``load_world``."""
    notes = Notes(file, kind="world")
    table = read_table(content, notes)
    model = None if table is None else validate(WorldFile, table, notes)
    if model is None or notes.defects:
        raise ConfigError(errors_text(notes))
    world = _world(model, notes, content.decode("utf-8-sig"))
    check_sense(model, world, notes)
    if library is not None:
        check_names(model, library, notes)
    if notes.defects:
        raise ConfigError(errors_text(notes))
    return replace(world, digest=hashlib.sha256(content).hexdigest())


def _world(model: WorldFile, notes: Notes, text: str) -> World:
    robot = _robot(model.robot, notes)
    return World(
        name=model.world,
        map=map_of(model.map, robot, notes, text=text),
        robot=robot,
        changes=tuple(one for each in model.changes for one in _changes(each, notes)),
        places=tuple(Place(each.name, each.x, each.y) for each in model.places),
        people=tuple(_person(each, notes) for each in model.people),
        things=tuple(
            WorldObject(each.name, each.x, each.y, window_of(each, notes)) for each in model.things
        ),
        sounds=tuple(_sound(each, robot, notes) for each in model.sounds),
        answers=tuple(_answer(each, notes) for each in model.answers),
        settings={name: _settings(name, each, notes) for name, each in model.runners.items()},
    )


def window_of(model: SpanFile, notes: Notes) -> Window:
    """The time of an entry."""
    end = math.inf if model.until is None else model.until
    if model.from_ < 0 or model.from_ > _MAX_SECONDS:
        notes.error(model.at("from"), f"'from' must be between 0 and {_MAX_SECONDS:g} seconds")
    elif end <= model.from_:
        notes.error(model.at("until"), "'until' must be later than 'from'", "swap them")
    return Window(model.from_, end)


def _between(model: FileModel, least: float, greatest: float, names: str, notes: Notes) -> None:
    """Note the numbers that are out of bounds."""
    for name in names.split():
        value = getattr(model, name)
        if not least <= value <= greatest:
            key = name.rstrip("_")  # as it is called in the file
            message = f"'{key}' must be between {least:g} and {greatest:g}, not {value:g}"
            notes.error(model.at(key), message)


def _robot(model: RobotFile | None, notes: Notes) -> Robot:
    if model is None:
        return Robot()
    _between(model, -1e6, 1e6, "x y yaw", notes)
    _between(model, 0.01, 100, "radius speed words_per_s", notes)
    _between(model, 1, 3600, "turn_speed", notes)
    _between(model, 0, 1e6, "sees_within hears_within", notes)
    _between(model, 0, 3600, "patience", notes)
    _between(model, 0, 360, "view", notes)
    return Robot(
        x=model.x,
        y=model.y,
        yaw=math.radians(model.yaw),
        radius=model.radius,
        speed=model.speed,
        turn_speed=math.radians(model.turn_speed),
        sees_within=model.sees_within,
        view=math.radians(model.view),
        hears_within=model.hears_within,
        words_per_s=model.words_per_s,
        patience_s=model.patience,
    )


def _changes(model: ChangeFile, notes: Notes) -> list[Change]:
    """One change for each zone of an entry of ``changes``."""
    arrivals = model.after_arrivals
    if (model.at_ is None) == (arrivals is None):
        hint = "write 'at: SECONDS' or 'after_arrivals: NUMBER'"
        notes.error(model.place, "a change needs one of 'at' and 'after_arrivals'", hint)
    if model.at_ is not None:
        _between(model, 0, _MAX_SECONDS, "at_", notes)
    if arrivals is not None and not (1 <= arrivals <= _MAX_ARRIVALS and arrivals == int(arrivals)):
        message = f"'after_arrivals' must be a whole number between 1 and {_MAX_ARRIVALS}"
        notes.error(model.at("after_arrivals"), message)
        arrivals = None
    if not (model.close or model.open):
        notes.error(model.place, "a change must close or open a zone", "write 'close: NAME'")
    both = next((name for name in model.open if name in model.close), None)
    if both is not None:
        notes.error(
            model.at("open"), f"the zone {quoted(both)} is closed and opened at the same time"
        )
    count = None if arrivals is None else int(arrivals)
    return [
        Change(name, closed, model.at_, count)
        for names, closed in ((model.close, True), (model.open, False))
        for name in names
    ]


def _person(model: PersonFile, notes: Notes) -> Person:
    _between(model, 0, 3600, "replies_after", notes)
    stays = [Stay(one.x, one.y, window_of(one, notes)) for one in model.stays]
    if (model.x is None) != (model.y is None):
        notes.error(model.place, f"{quoted(model.name)} has only one of 'x' and 'y'", "give both")
    elif model.x is not None and model.y is not None:
        if stays:
            hint = "write either where they always are, or their stays"
            notes.error(model.at("stays"), f"{quoted(model.name)} has 'x' and also 'stays'", hint)
        stays = [Stay(model.x, model.y)]
    elif not stays:
        notes.error(model.place, f"{quoted(model.name)} is nowhere", "give 'x' and 'y', or 'stays'")
    return Person(
        model.name,
        looks=model.looks,
        stays=tuple(stays),
        replies=tuple(Reply(tuple(one.words), one.says) for one in model.replies),
        replies_after_s=model.replies_after,
    )


def _sound(model: SoundFile, robot: Robot, notes: Notes) -> Sound:
    if (model.x is None) != (model.y is None):
        notes.error(model.place, "a sound has only one of 'x' and 'y'", "give both, or none")
    _between(model, 0, _MAX_SECONDS, "from_", notes)
    usual = max(1, len(model.text.split())) / robot.words_per_s
    end = model.from_ + usual if model.until is None else model.until
    if end <= model.from_:
        notes.error(model.at("until"), "'until' must be later than 'from'", "swap them")
    return Sound(model.text, model.from_, end, model.x, model.y)


def _answer(model: AnswerFile, notes: Notes) -> Answer:
    area = None
    if (model.x is None) != (model.y is None):
        notes.error(model.place, "an answer has only one of 'x' and 'y'", "give both, or none")
    elif model.x is not None and model.y is not None:
        area = Rectangle(min(model.x), min(model.y), max(model.x), max(model.y))
    if model.fails and model.text:
        hint = "remove one of them"
        notes.error(model.at("fails"), "an answer that fails has a text", hint)
    outputs: dict[str, RunValue] = {}
    for name, node in model.outputs.items():
        value = _value(node)
        if value is None:
            message = f"the output {quoted(name)} must be a text, a number, true or false"
            notes.error(model.below("outputs", name), message, "or a list of these")
        else:
            outputs[name] = value
    return Answer(
        model.to,
        words=tuple(model.words),
        text=model.text,
        outputs=outputs,
        fails=model.fails,
        area=area,
        window=window_of(model, notes),
    )


def _value(node: object) -> RunValue | None:
    if isinstance(node, Scalar):
        value = node.value
        if isinstance(value, float) and not math.isfinite(value):
            return None
        return None if isinstance(value, int) and abs(value) >= 2**63 else value
    if isinstance(node, Items):
        values = [_value(item) for item in node if isinstance(item, Scalar)]
        items = [value for value in values if value is not None]
        return list(items) if len(items) == len(node) else None
    return None


def _settings(name: str, model: SettingsFile, notes: Notes) -> Settings:
    if not 0 <= model.fails <= 1:
        message = f"'fails' of {quoted(name)} must be a probability, from 0 to 1"
        notes.error(model.at("fails"), message)
    duration = None
    if model.duration is not None:
        least, greatest = model.duration
        duration = (least, greatest)
        if not 0 <= least <= greatest <= _MAX_SECONDS:
            message = f"'duration' of {quoted(name)} must be [least, greatest], in seconds"
            notes.error(model.at("duration"), message)
    return Settings(model.fails, model.message, duration)


def check_sense(model: WorldFile, world: World, notes: Notes) -> None:
    """Note what is in a place where it cannot be, and names that are there twice or not at all."""
    if world.map is not NOWHERE:
        _check_places(model, world, notes)
    _no_name_twice("place", ((each.name, each.at("name")) for each in model.places), notes)
    _no_name_twice("person", ((each.name, each.at("name")) for each in model.people), notes)
    _check_zones(model, notes)


def _check_places(model: WorldFile, world: World, notes: Notes) -> None:
    _check_robot(model, world, notes)
    for person, seen_person in zip(model.people, world.people, strict=True):
        _check_person(person, seen_person, world, notes)
    drawn = len(world.map.obstacles) - (0 if model.map is None else len(model.map.obstacles))
    for entry, seen in zip(model.things, world.things, strict=True):
        _check_place_of(entry, seen, world, notes, walls=world.map.obstacles[:drawn])
    for place in model.places:
        _on_map(f"the place {quoted(place.name)}", (place.x, place.y), place.place, world, notes)


def _check_robot(model: WorldFile, world: World, notes: Notes) -> None:
    robot = world.robot
    place: Position = (1, 1)
    if model.robot is not None:
        place = model.robot.at("x")
    elif model.map is not None:
        place = model.map.place
    at = f"({robot.x:g}, {robot.y:g})"
    hint = "write another 'x' and 'y' for the robot, or change the map"
    if not world.map.area.holds(robot.x, robot.y):
        notes.error(place, f"the robot does not start on the map: it starts at {at}", hint)
        return
    for obstacle in world.map.obstacles:
        if obstacle.window.holds(0.0) and obstacle.area.encloses(robot.x, robot.y):
            notes.error(place, f"the robot starts in {_called(obstacle)}, at {at}", hint)
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
        for obstacle in world.map.obstacles:
            hit = obstacle.area.encloses(stay.x, stay.y) and obstacle.window.overlaps(stay.window)
            if hit and not obstacle.low:
                hint = "write another 'x' and 'y', or 'low: true' for what one can stand on"
                notes.error(place, f"{name} stands in {_called(obstacle)}", hint)
                break


def _check_place_of(
    model: ObjectFile,
    entry: WorldObject,
    world: World,
    notes: Notes,
    *,
    walls: tuple[Obstacle, ...],
) -> None:
    """Things are in walls no more than people, but may be on tables and in shelves."""
    name = quoted(model.name)
    if not _on_map(name, (entry.x, entry.y), model.place, world, notes):
        return
    if any(obstacle.area.encloses(entry.x, entry.y) for obstacle in walls):
        notes.error(model.place, f"{name} is in a wall of the drawing", "write another 'x' and 'y'")


def _on_map(name: str, point: Point, place: Position, world: World, notes: Notes) -> bool:
    area, (x, y) = world.map.area, point
    if area.holds(x, y):
        return True
    shown = f"x: [{area.x0:g}, {area.x1:g}], y: [{area.y0:g}, {area.y1:g}]"
    notes.error(place, f"{name} is not on the map: ({x:g}, {y:g})", f"the map is {shown}")
    return False


def _called(obstacle: Obstacle) -> str:
    return f"the obstacle {quoted(obstacle.name)}" if obstacle.name else "an obstacle"


def _no_name_twice(kind: str, named: Iterable[tuple[str, Position]], notes: Notes) -> None:
    first: dict[str, Position] = {}
    for name, place in named:
        if name in first:
            message = (
                f"a {kind} called {quoted(name)} is here twice, first in line {first[name][0]}"
            )
            notes.error(place, message, "give each a name of its own, or remove one")
        first.setdefault(name, place)


def _check_zones(model: WorldFile, notes: Notes) -> None:
    zones = [] if model.map is None else model.map.zones
    _no_name_twice(
        "zone", ((zone_entry.name, zone_entry.at("name")) for zone_entry in zones), notes
    )
    names: Mapping[str, None] = dict.fromkeys(zone_entry.name for zone_entry in zones)
    for change in model.changes:
        for key in ("close", "open"):
            for name in getattr(change, key):
                if name not in names:
                    hint = notes.near(name, names) or "describe it under 'zones' of the 'map'"
                    notes.error(change.at(key), f"no zone is called {quoted(name)}", hint)


def check_names(model: WorldFile, library: Library, notes: Notes) -> None:
    """Note the names of interfaces and outputs that no run with these capabilities ever looks up.

    Of packages of which the library describes nothing, only the full names are taken on trust.
    """
    by_name: dict[str, list[str]] = {}
    for interface in library.interfaces:
        by_name.setdefault(interface.name, []).append(interface.name)
        by_name.setdefault(_short(interface.name), []).append(interface.name)
    for name in model.runners:
        _check(name, model.below("runners", name), by_name, library, notes)
    for answer in model.answers:
        if _check(answer.to, answer.at("to"), by_name, library, notes):
            _check_outputs(answer, by_name.get(answer.to, []), library, notes)


def _check(
    name: str,
    place: Position,
    by_name: Mapping[str, list[str]],
    library: Library,
    notes: Notes,
) -> bool:
    if name in by_name:
        return True
    package, translated = namespace(name), library.translation(name)
    of_others = package and package not in library.namespaces and not library.complete
    if of_others and translated is None:
        return True
    if translated is not None and not any(
        provider.described for provider in library.providers_of(translated)
    ):
        return True  # runs ask by the name that the plan writes then
    notes.error(
        place, f"no interface is called {quoted(name)}", _hint(name, by_name, library, notes)
    )
    return False


def _hint(name: str, by_name: Mapping[str, list[str]], library: Library, notes: Notes) -> str:
    now = library.translation(name)
    if now is not None:
        return f"it is called {quoted(now)} here"
    meant = library.interface(name)
    provider = library.provider(name)
    if meant is not None:  # a semantic interface: runners are asked by what it redefines
        return f"write {quoted(meant.name)}, which it redefines"
    if provider is not None:
        return f"that is a provider; write its interface, {quoted(provider.implements)}"
    near = notes.near(name, by_name) or notes.near(_short(name), by_name)
    otherwise = "give the folder of its capability file with --capabilities"
    if not namespace(name) and not library.complete:
        otherwise += ", or write it with its package if there is none"
    return f"{near} Else {otherwise}" if near else otherwise


def _check_outputs(
    model: AnswerFile, interfaces: list[str], library: Library, notes: Notes
) -> None:
    providers = [provider for name in interfaces for provider in library.providers_of(name)]
    if not providers or not all(provider.described for provider in providers):
        return
    event = Event.FAILED if model.fails else Event.SUCCEEDED
    declared = _outputs(providers, event)
    for name in model.outputs:
        if name in declared:
            continue
        when = "when it fails" if model.fails else "when it succeeds"
        message = f"{quoted(model.to)} has no output {quoted(name)} {when}"
        listed = ", ".join(declared)
        hint = notes.near(name, declared) or (
            f"the outputs are {listed}" if listed else "remove it"
        )
        notes.error(model.below("outputs", name), message, hint)


def _outputs(providers: list[Provider], event: Event) -> list[str]:
    names = {
        output.name: None
        for provider in providers
        for output in provider.outputs
        if output.event is event
    }
    return list(names)


def _short(name: str) -> str:
    return name.rpartition("/")[2]
