"""A world: where walls, people and things are, what is heard, and what runners answer.

Frozen data, as world files describe it (docs/worlds.md). Lengths are in metres, times in seconds
since the run began, angles in radians, counter-clockwise from the x axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue


@dataclass(frozen=True, slots=True)
class Window:
    """The time from ``start_s`` to ``end_s``, the end not included."""

    start_s: float = 0.0
    end_s: float = math.inf

    def holds(self, now_s: float) -> bool:
        """True if an instant belongs to it."""
        return self.start_s <= now_s < self.end_s

    def overlaps(self, other: Window) -> bool:
        """True if the two have an instant in common."""
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
        """True if a point belongs to it."""
        return self.x0 <= x <= self.x1 and self.y0 <= y <= self.y1

    def encloses(self, x: float, y: float) -> bool:
        """True if a point is in it and not on its edge."""
        return self.x0 < x < self.x1 and self.y0 < y < self.y1

    def meets(self, other: Rectangle) -> bool:
        """True if the two have a point in common."""
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
    """An area where the robot cannot be during a time. ``low``: it can be seen over."""

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
    """The place of somebody during a time."""

    x: float
    y: float
    window: Window = ALWAYS


@dataclass(frozen=True, slots=True)
class Reply:
    """The words of somebody who hears all of the texts in ``words`` (none: whatever they hear)."""

    words: tuple[str, ...]
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
        """Their stay at a time; None if they are not there."""
        return next((stay for stay in self.stays if stay.window.holds(now_s)), None)


@dataclass(frozen=True, slots=True)
class WorldObject:
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
    """The behaviour of runners. ``duration_s``: least and greatest (None: as usual)."""

    fails: float = 0.0
    message: str = ""
    duration_s: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer of a runner, where and when this holds; the first answer that fits counts.

    ``to`` is an interface, with or without its package. All texts in ``words`` must occur in what
    the runner asks, whatever the case. With ``fails`` the runner fails with that message.
    """

    to: str
    words: tuple[str, ...] = ()
    text: str = ""
    outputs: Mapping[str, RunValue] = field(default_factory=dict)
    fails: str = ""
    area: Rectangle | None = None
    window: Window = ALWAYS


@dataclass(frozen=True, slots=True)
class World:
    """A simulated world. ``digest`` is the SHA-256 of its file, "" if there is none."""

    name: str = ""
    map: Map = field(default_factory=lambda: Map(Rectangle(-10.0, -10.0, 10.0, 10.0)))
    robot: Robot = field(default_factory=Robot)
    changes: tuple[Change, ...] = ()
    places: tuple[Place, ...] = ()
    people: tuple[Person, ...] = ()
    things: tuple[WorldObject, ...] = ()
    sounds: tuple[Sound, ...] = ()
    answers: tuple[Answer, ...] = ()
    settings: Mapping[str, Settings] = field(default_factory=dict)
    digest: str = ""

    def settings_of(self, interface: str) -> Settings:
        """The settings of an interface, by its full name or its name without the package."""
        short = interface.rpartition("/")[2]
        return self.settings.get(interface) or self.settings.get(short) or _USUAL

    def answer(
        self, interface: str, question: str, *, now_s: float, x: float, y: float
    ) -> Answer | None:
        """The first answer that fits the question of a runner at a time and place."""
        lowered = question.casefold()
        for answer in self.answers:
            if (
                answer.to in (interface, interface.rpartition("/")[2])
                and answer.window.holds(now_s)
                and (answer.area is None or answer.area.holds(x, y))
                and all(text.casefold() in lowered for text in answer.words)
            ):
                return answer
        return None


_USUAL = Settings()


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
