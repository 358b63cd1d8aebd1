"""A world: where walls, people and things are, what is heard, and what runners answer.

Frozen data, as world files describe it (docs/worlds.md). Lengths are in metres, times in seconds
since the run began, angles in radians, counter-clockwise from the x axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

__all__ = [
    "ALWAYS",
    "Answer",
    "Change",
    "Map",
    "Obstacle",
    "Person",
    "Place",
    "Rectangle",
    "Reply",
    "Robot",
    "Settings",
    "Sound",
    "Stay",
    "Thing",
    "Window",
    "World",
    "Zone",
]


@dataclass(frozen=True, slots=True)
class Window:
    """The time from ``start_s`` to ``end_s``, the end not included."""

    start_s: float = 0.0
    end_s: float = math.inf

    def holds(self, now_s: float) -> bool:
        """Whether an instant belongs to it."""
        return self.start_s <= now_s < self.end_s

    def overlaps(self, other: Window) -> bool:
        """Whether the two have an instant in common."""
        return self.start_s < other.end_s and other.start_s < self.end_s


ALWAYS = Window()


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle along the axes; its edges belong to it."""

    x0: float
    y0: float
    x1: float
    y1: float

    def holds(self, x: float, y: float) -> bool:
        """Whether a point belongs to it."""
        return self.x0 <= x <= self.x1 and self.y0 <= y <= self.y1

    def encloses(self, x: float, y: float) -> bool:
        """Whether a point is in it and not on its edge."""
        return self.x0 < x < self.x1 and self.y0 < y < self.y1

    def meets(self, other: Rectangle) -> bool:
        """Whether the two have a point in common."""
        return (
            self.x0 <= other.x1
            and other.x0 <= self.x1
            and self.y0 <= other.y1
            and other.y0 <= self.y1
        )

    def grown(self, by: float) -> Rectangle:
        """The same, wider on every side."""
        return Rectangle(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Where the robot cannot be during a time. ``low``: it can be seen over."""

    area: Rectangle
    name: str = ""
    low: bool = False
    window: Window = ALWAYS


@dataclass(frozen=True, slots=True)
class Zone:
    """A part of the map that can be closed. ``closed``: it is, when the run begins."""

    name: str
    area: Rectangle
    closed: bool = False


@dataclass(frozen=True, slots=True)
class Change:
    """A zone is closed or opened, at a time or when the robot has reached so many goals.

    Exactly one of ``at_s`` and ``after_arrivals`` is not None.
    """

    zone: str
    closed: bool
    at_s: float | None = None
    after_arrivals: int | None = None


@dataclass(frozen=True, slots=True)
class Map:
    """The area that the robot can be in. ``resolution`` is the edge of a cell of the path search.

    The edge of the area is like a wall, and so is a zone while it is closed.
    """

    area: Rectangle
    resolution: float = 0.1
    obstacles: tuple[Obstacle, ...] = ()
    zones: tuple[Zone, ...] = ()


@dataclass(frozen=True, slots=True)
class Robot:
    """The robot: where it starts, what it can do. ``patience_s``: how long it looks for a way.

    ``view`` is the angle of the camera, ``turn_speed`` is in radians per second.
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    radius: float = 0.2
    speed: float = 0.5
    turn_speed: float = 1.0
    sees_within: float = 5.0
    view: float = math.pi / 2
    hears_within: float = 5.0
    words_per_s: float = 2.5
    patience_s: float = 5.0


@dataclass(frozen=True, slots=True)
class Place:
    """A place with a name."""

    name: str
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class Stay:
    """Where somebody is during a time."""

    x: float
    y: float
    window: Window = ALWAYS


@dataclass(frozen=True, slots=True)
class Reply:
    """What somebody says who hears all of the texts in ``asked`` (none: whatever they hear)."""

    asked: tuple[str, ...]
    text: str


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody: what a camera makes of them, where they are, what they reply.

    ``replies_after_s`` is how long they think.
    """

    name: str
    looks: str = "a person"
    stays: tuple[Stay, ...] = ()
    replies: tuple[Reply, ...] = ()
    replies_after_s: float = 1.0

    def stay(self, now_s: float) -> Stay | None:
        """Where they are; None if they are not there."""
        return next((stay for stay in self.stays if stay.window.holds(now_s)), None)


@dataclass(frozen=True, slots=True)
class Thing:
    """Something that a camera can see."""

    name: str
    x: float
    y: float
    window: Window = ALWAYS


@dataclass(frozen=True, slots=True)
class Sound:
    """Words or a noise, ``start_s`` to ``end_s``; ``x`` and ``y`` None: it is heard everywhere."""

    text: str
    start_s: float
    end_s: float
    x: float | None = None
    y: float | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """How runners of an interface behave. ``duration_s``: least and greatest (None: as usual)."""

    fails: float = 0.0
    message: str = ""
    duration_s: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """What a runner answers, where and when this holds; the first answer that fits counts.

    ``to`` is an interface, with or without its package. All texts in ``asked`` must occur in what
    the runner asks, whatever the case. With ``fails`` the runner fails with that message.
    """

    to: str
    asked: tuple[str, ...] = ()
    text: str = ""
    outputs: Mapping[str, RunValue] = field(default_factory=dict)
    fails: str = ""
    area: Rectangle | None = None
    window: Window = ALWAYS


@dataclass(frozen=True, slots=True)
class World:
    """A world. ``digest`` is the SHA-256 of the file, "" if there is none."""

    name: str = ""
    map: Map = field(default_factory=lambda: Map(Rectangle(-10.0, -10.0, 10.0, 10.0)))
    robot: Robot = field(default_factory=Robot)
    changes: tuple[Change, ...] = ()
    places: tuple[Place, ...] = ()
    people: tuple[Person, ...] = ()
    things: tuple[Thing, ...] = ()
    sounds: tuple[Sound, ...] = ()
    answers: tuple[Answer, ...] = ()
    settings: Mapping[str, Settings] = field(default_factory=dict)
    digest: str = ""

    def settings_of(self, interface: str) -> Settings:
        """The settings of an interface, under its name or under that without package."""
        short = interface.rpartition("/")[2]
        return self.settings.get(interface) or self.settings.get(short) or _USUAL

    def answer(
        self, interface: str, question: str, *, now_s: float, x: float, y: float
    ) -> Answer | None:
        """The first answer that fits what a runner asks at a time and a place."""
        lowered = question.casefold()
        for found in self.answers:
            if (
                found.to in (interface, interface.rpartition("/")[2])
                and found.window.holds(now_s)
                and (found.area is None or found.area.holds(x, y))
                and all(text.casefold() in lowered for text in found.asked)
            ):
                return found
        return None


_USUAL = Settings()
