"""Reading world files (docs/worlds.md). Imports pydantic and a YAML parser."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.defects import Notes, quoted
from gpsfsm.capabilities.files import read_bytes
from gpsfsm.capabilities.reading import Items, Scalar, read_table
from gpsfsm.capabilities.validate import validate
from gpsfsm.errors import ConfigError
from gpsfsm.simulation.names import check_names
from gpsfsm.simulation.schema import (
    AnswerFile,
    ChangeFile,
    PersonFile,
    RobotFile,
    SettingsFile,
    SoundFile,
    SpanFile,
    WorldFile,
)
from gpsfsm.simulation.sense import check_sense
from gpsfsm.simulation.terrain import map_of
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
    Thing,
    Window,
    World,
)

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.capabilities.library import Library
    from gpsfsm.capabilities.shapes import FileModel
    from gpsfsm.execution.records import RunValue

__all__ = ["load_world", "read_world"]

_MAX_SHOWN = 20
_MAX_SECONDS = 1e9
_MAX_ARRIVALS = 1_000_000


def load_world(file: str | Path, *, library: Library | None = None) -> World:
    """The world that a file describes.

    With a library, what the file says about runners is compared with it. Raises ConfigError, with a
    line for each defect, if anything is wrong with the file.
    """
    notes = Notes(str(file), kind="world")
    content = read_bytes(str(file), notes)
    if content is None:
        raise ConfigError(_told(notes))
    return read_world(content, file=str(file), library=library)


def read_world(content: bytes, *, file: str = "<world>", library: Library | None = None) -> World:
    """The world that the content of a file describes. Raises ConfigError like ``load_world``."""
    notes = Notes(file, kind="world")
    table = read_table(content, notes)
    model = None if table is None else validate(WorldFile, table, notes)
    if model is None or notes.defects:
        raise ConfigError(_told(notes))
    world = _world(model, notes, content.decode("utf-8-sig"))
    check_sense(model, world, notes)
    if library is not None:
        check_names(model, library, notes)
    if notes.defects:
        raise ConfigError(_told(notes))
    return replace(world, digest=hashlib.sha256(content).hexdigest())


def _told(notes: Notes) -> str:
    shown = sorted(notes.defects, key=lambda defect: defect.order)
    lines = [f"{one.told}\n    {one.hint}" if one.hint else one.told for one in shown[:_MAX_SHOWN]]
    if len(shown) > _MAX_SHOWN:
        lines.append(f"and {len(shown) - _MAX_SHOWN} more")
    return "\n".join(line.replace(": warning: ", ": error: ", 1) for line in dict.fromkeys(lines))


def _world(model: WorldFile, notes: Notes, text: str) -> World:
    robot = _robot(model.robot, notes)
    return World(
        name=model.world,
        map=map_of(model.map, robot, notes, text=text),
        robot=robot,
        changes=tuple(one for found in model.changes for one in _changes(found, notes)),
        places=tuple(Place(found.name, found.x, found.y) for found in model.places),
        people=tuple(_person(found, notes) for found in model.people),
        things=tuple(
            Thing(found.name, found.x, found.y, window_of(found, notes)) for found in model.things
        ),
        sounds=tuple(_sound(found, robot, notes) for found in model.sounds),
        answers=tuple(_answer(found, notes) for found in model.answers),
        settings={name: _settings(name, found, notes) for name, found in model.runners.items()},
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
        notes.error(model.at("open"), f"the zone {quoted(both)} is closed and opened at once")
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
        replies=tuple(Reply(tuple(one.asked), one.says) for one in model.replies),
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
        asked=tuple(model.asked),
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
        found = [value for value in values if value is not None]
        return list(found) if len(found) == len(node) else None
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
