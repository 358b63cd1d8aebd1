"""The shape of world files: the border, in pydantic."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from gpsfsm.capabilities.reading import (
    FileModel,
    Flag,
    Items,
    ListOf,
    MappingOf,
    Number,
    Scalar,
    Some,
    Text,
    wrong,
)

Values = MappingOf[Any]


def _pair(node: object) -> object:
    """Two numbers; one number stands for both."""
    if isinstance(node, Scalar):
        return [node, node]
    if isinstance(node, Items) and len(node) == 2:
        return list(node)
    raise wrong("two numbers in brackets", node)


Pair = Annotated[list[Number], BeforeValidator(_pair)]


class SpanFile(FileModel):
    """``from`` and ``until``, in seconds since the run began."""

    from_: Number = Field(default=0.0, alias="from")
    until: Number | None = None


class ObstacleFile(SpanFile):
    """An entry of ``map: obstacles``."""

    name: Text = ""
    x: Pair
    y: Pair
    low: Flag = False


class ZoneFile(FileModel):
    """An entry of ``map: zones``."""

    name: Text
    x: Pair
    y: Pair
    closed: Flag = False


class MapFile(FileModel):
    """``map``: an area, or rows of characters of which ``#`` is a wall."""

    x: Pair | None = None
    y: Pair | None = None
    resolution: Number = 0.1
    rows: Text | None = None
    origin: Pair | None = None
    obstacles: ListOf[ObstacleFile] = Field(default_factory=list)
    zones: ListOf[ZoneFile] = Field(default_factory=list)


class RobotFile(FileModel):
    """``robot``; angles in degrees."""

    x: Number = 0.0
    y: Number = 0.0
    yaw: Number = 0.0
    radius: Number = 0.2
    speed: Number = 0.5
    turn_speed: Number = 60.0
    sees_within: Number = 5.0
    view: Number = 90.0
    hears_within: Number = 5.0
    words_per_s: Number = 2.5
    patience: Number = 5.0


class ChangeFile(FileModel):
    """An entry of ``changes``: when, and which zones."""

    at_: Number | None = Field(default=None, alias="at")
    after_arrivals: Number | None = None
    close: Some = Field(default_factory=list)
    open: Some = Field(default_factory=list)


class PlaceFile(FileModel):
    """An entry of ``places``."""

    name: Text
    x: Number
    y: Number


class StayFile(SpanFile):
    """An entry of ``stays``."""

    x: Number
    y: Number


class ReplyFile(FileModel):
    """An entry of ``replies``."""

    words: Some = Field(default_factory=list, alias="asked")
    says: Text


class PersonFile(FileModel):
    """An entry of ``people``."""

    name: Text
    looks: Text = "a person"
    x: Number | None = None
    y: Number | None = None
    stays: ListOf[StayFile] = Field(default_factory=list)
    replies: ListOf[ReplyFile] = Field(default_factory=list)
    replies_after: Number = 1.0


class ObjectFile(SpanFile):
    """An entry of ``things``."""

    name: Text
    x: Number
    y: Number


class SoundFile(FileModel):
    """An entry of ``sounds``."""

    text: Text
    from_: Number = Field(alias="from")
    until: Number | None = None
    x: Number | None = None
    y: Number | None = None


class AnswerFile(SpanFile):
    """An entry of ``answers``."""

    to: Text
    words: Some = Field(default_factory=list, alias="asked")
    text: Text = ""
    outputs: Values = Field(default_factory=dict)
    fails: Text = ""
    x: Pair | None = None
    y: Pair | None = None


class SettingsFile(FileModel):
    """An entry of ``runners``."""

    fails: Number = 0.0
    message: Text = ""
    duration: Pair | None = None


class WorldFile(FileModel):
    """A world file."""

    world: Text
    description: Text = ""
    map: MapFile | None = None
    robot: RobotFile | None = None
    changes: ListOf[ChangeFile] = Field(default_factory=list)
    places: ListOf[PlaceFile] = Field(default_factory=list)
    people: ListOf[PersonFile] = Field(default_factory=list)
    things: ListOf[ObjectFile] = Field(default_factory=list)
    sounds: ListOf[SoundFile] = Field(default_factory=list)
    answers: ListOf[AnswerFile] = Field(default_factory=list)
    runners: MappingOf[SettingsFile] = Field(default_factory=dict)
