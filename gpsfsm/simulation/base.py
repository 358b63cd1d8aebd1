"""The base of runners that live in a world, and the state of that world during a run.

The state is where the robot is, what was said, which zones are closed. Runners reach it as
``services["world"]``. It does not wait: runners wait, in the time of the run, and pass the time in.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

from gpsfsm.execution.prompts import PromptBuffers
from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.model.printable import clip
from gpsfsm.simulation.grid import Grid, Point, passes, sees
from gpsfsm.simulation.world import Sound

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.simulation.world import Answer, Change, Person, Settings, Stay, World

_DIGITS = 4
_NEAR = 1e-3
_MAX_TEXT = 2_000
_MAX_NAMED = 3


@dataclass(frozen=True, slots=True)
class Pose:
    """The place of the robot, in metres, and its direction, in radians."""

    x: float
    y: float
    yaw: float


@dataclass(frozen=True, slots=True)
class Said:
    """Something that the robot has said, and where it was then; ``at_s`` is the end of it."""

    at_s: float
    text: str
    x: float
    y: float


class Teller(Protocol):
    """The listener to what happens in a world."""

    def __call__(self, what: str, data: Mapping[str, RunValue], words: str, /) -> None:
        """Something has happened now."""


def _nobody(_what: str, _data: Mapping[str, RunValue], _words: str, /) -> None:
    """Nobody wants to know."""


def _rounded(*values: float) -> list[RunValue]:
    return [round(value, _DIGITS) + 0.0 for value in values]  # no -0


@dataclass(slots=True)
class _Drive:
    """A way that is being driven: the points, and how far along the way each one is."""

    points: Sequence[Point]
    along: Sequence[float]
    start_s: float


@dataclass(slots=True, eq=False)
class WorldState:
    """A world in one run. ``specs`` describes the capabilities of the robot, one text for each.

    ``begun_s`` is the time in the world at which the run began: more than 0 for a plan that follows
    another one in the same world. ``arrivals`` are the times and places at which the robot has
    reached a goal, ``said`` is what it has said. ``tell`` is told what a map of the run would show:
    what has happened, its values, and the same in words.
    """

    world: World
    specs: tuple[str, ...] = ()
    begun_s: float = 0.0
    arrivals: list[tuple[float, float, float]] = field(default_factory=list)
    said: list[Said] = field(default_factory=list)
    prompts: PromptBuffers = field(default_factory=PromptBuffers)
    grid: Grid = field(init=False)
    driver: object = None  # whose goal the robot drives to
    _rest: Pose = field(init=False)
    _drive: _Drive | None = None
    _replies: list[Sound] = field(default_factory=list)
    _times: list[float] = field(init=False)  # when obstacles appear and disappear
    zones: Zones = field(init=False)
    tell: Teller = field(default=_nobody)

    def __post_init__(self) -> None:
        robot = self.world.robot
        self.grid = Grid(self.world.map, robot.radius)
        self.zones = Zones(self.world)
        self._rest = Pose(robot.x, robot.y, robot.yaw)
        windows = [each.window for each in self.world.map.obstacles]
        times = {time for each in windows for time in (each.start_s, each.end_s)}
        self._times = sorted(times)

    def next_plan(self, begun_s: float) -> None:
        """A further plan begins in this world, at a time of the world: prompt buffers are empty."""
        self.begun_s = begun_s
        self.prompts = PromptBuffers()

    # -- the base ---------------------------------------------------------------------------

    def pose(self, now_s: float) -> Pose:
        """The pose of the robot."""
        drive = self._drive
        if drive is None:
            return self._rest
        gone = max(0.0, (now_s - drive.start_s) * self.world.robot.speed)
        if gone >= drive.along[-1]:
            (ax, ay), (bx, by) = drive.points[-2], drive.points[-1]
            return Pose(bx, by, math.atan2(by - ay, bx - ax))
        leg = bisect.bisect_right(drive.along, gone)
        assert drive.along[leg - 1] <= gone < drive.along[leg]  # the leg on which the robot is
        (ax, ay), (bx, by) = drive.points[leg - 1], drive.points[leg]
        part = (gone - drive.along[leg - 1]) / (drive.along[leg] - drive.along[leg - 1])
        return Pose(ax + (bx - ax) * part, ay + (by - ay) * part, math.atan2(by - ay, bx - ax))

    def present(self, now_s: float) -> tuple[int, ...]:
        """The obstacles at a time, as the grid counts it: obstacles, then closed zones."""
        first = len(self.world.map.obstacles)
        closed = (first + number for number in self.zones.closed(now_s))
        return (*self.grid.present(now_s), *closed)

    def route(self, now_s: float, x: float, y: float) -> list[Point] | None:
        """The shortest way to a place, as far as the robot knows now; None if there is none.

        A zone that was closed while the robot was in it does not keep it there.
        """
        pose, present = self.pose(now_s), self.present(now_s)
        first = len(self.world.map.obstacles)
        open_now = tuple(
            number
            for number in present
            if number < first or not self.grid.areas[number].holds(pose.x, pose.y)
        )
        if open_now != present and self._shut(x, y, present):
            return None
        return self.grid.route((pose.x, pose.y), (x, y), open_now)

    def _shut(self, x: float, y: float, present: tuple[int, ...]) -> bool:
        cell = self.grid.cell(x, y)
        return cell is None or bool(self.grid.blocked(present)[cell])

    def hindrance(self, now_s: float, x: float, y: float) -> str:
        """The closed zones but for which there would be a way, in words; "" if it is not they."""
        pose, first = self.pose(now_s), len(self.world.map.obstacles)
        closed = self.zones.closed(now_s)
        route = (
            self.grid.route((pose.x, pose.y), (x, y), self.grid.present(now_s)) if closed else None
        )
        if route is None:
            return ""
        crossed = []
        for number in closed:
            area = self.grid.areas[first + number]
            leaves = area.holds(pose.x, pose.y) and not area.holds(x, y)
            if not leaves and not passes(route, area.grown(self.world.robot.radius)):
                crossed.append(number)
        return self.zones.message(crossed or closed)

    def arrive(self, now_s: float, x: float, y: float) -> None:
        """The robot has reached a goal; a zone may be closed or opened by that."""
        self.arrivals.append((now_s, x, y))
        self.zones.arrived(now_s, len(self.arrivals))
        data: dict[str, RunValue] = {"x": x, "y": y, "count": len(self.arrivals)}
        self.tell("arrive", data, f"the robot has reached ({x:g}, {y:g})")

    def drive(self, now_s: float, points: Sequence[Point]) -> float:
        """Begin to drive along a way. Returns how many seconds it takes."""
        along = [0.0]
        for (ax, ay), (bx, by) in pairwise(points):
            along.append(along[-1] + math.sqrt((bx - ax) ** 2 + (by - ay) ** 2))
        if len(points) < 2 or along[-1] <= 0:
            self.halt(now_s)
            return 0.0
        assert len(along) == len(points)
        self._drive = _Drive(points, along, now_s)
        speed = self.world.robot.speed
        route: list[RunValue] = [_rounded(*point) for point in points]
        x, y = points[-1]
        self.tell("drive", {"way": route, "speed": speed}, f"the robot drives to ({x:g}, {y:g})")
        return along[-1] / speed

    def halt(self, now_s: float) -> None:
        """Stay where the robot is now."""
        drive, self._rest = self._drive, self.pose(now_s)
        self._drive = None
        assert self.pose(now_s) == self._rest  # halting moves nothing
        if drive is not None and math.dist((self._rest.x, self._rest.y), drive.points[-1]) > _NEAR:
            self._tell_pose()  # else the end of the way says it

    def put(self, pose: Pose) -> None:
        """Stay at a pose."""
        self._rest, self._drive = pose, None
        self._tell_pose()

    def _tell_pose(self) -> None:
        x, y, yaw = _rounded(self._rest.x, self._rest.y, self._rest.yaw)
        self.tell("pose", {"x": x, "y": y, "yaw": yaw}, f"the robot stands at ({x}, {y})")

    def next_change(self, now_s: float) -> float:
        """When the map changes the next time by itself; infinity if it does not."""
        place = bisect.bisect_right(self._times, now_s)
        change = self._times[place] if place < len(self._times) else math.inf
        change = min(change, self.zones.next_change(now_s))
        assert change > now_s  # else whoever waits for it would wait for ever
        return change

    # -- eyes, ears and mouth ---------------------------------------------------------------

    def people_in_view(self, now_s: float) -> list[Person]:
        """The people whom the camera sees, in the order of the file."""
        visible = []
        for person in self.world.people:
            stay = person.stay(now_s)
            if stay is not None and self.in_view(now_s, stay.x, stay.y):
                visible.append(person)
        return visible

    def in_view(self, now_s: float, x: float, y: float) -> bool:
        """True if the camera sees a place: near enough, in front, and with nothing between."""
        robot, pose = self.world.robot, self.pose(now_s)
        dx, dy = x - pose.x, y - pose.y
        if math.sqrt(dx * dx + dy * dy) > robot.sees_within:
            return False
        off = abs(math.remainder(math.atan2(dy, dx) - pose.yaw, math.tau)) if dx or dy else 0.0
        if off > robot.view / 2 + 1e-9:
            return False
        areas = [
            obstacle.area
            for obstacle in self.world.map.obstacles
            if not obstacle.low and obstacle.window.holds(now_s)
        ]
        return sees((pose.x, pose.y), (x, y), areas)

    def talk_s(self, text: str) -> float:
        """The seconds that it takes to say a text."""
        return max(1, len(text.split())) / self.world.robot.words_per_s

    def say(self, now_s: float, text: str) -> None:
        """The robot has said something; the people who hear it reply."""
        pose = self.pose(now_s)
        self.said.append(Said(now_s, text, pose.x, pose.y))
        x, y = _rounded(pose.x, pose.y)
        seconds = self.talk_s(text)
        data: dict[str, RunValue] = {
            "text": text[:_MAX_TEXT],
            "x": x,
            "y": y,
            "seconds": seconds,
        }
        self.tell("say", data, f"the robot has said: {clip(text, _MAX_TEXT)}")
        heard = text.casefold()
        for person in self.world.people:
            stay = person.stay(now_s)
            if stay is None or not self._near(now_s, stay.x, stay.y):
                continue
            for reply in person.replies:
                if all(word.casefold() in heard for word in reply.words):
                    start = now_s + person.replies_after_s
                    end = start + self.talk_s(reply.text)
                    self._replies.append(Sound(reply.text, start, end, stay.x, stay.y))
                    self._tell_reply(person, reply.text, stay)
                    break

    def _tell_reply(self, person: Person, text: str, stay: Stay) -> None:
        data: dict[str, RunValue] = {
            "who": person.name,
            "text": text[:_MAX_TEXT],
            "x": stay.x,
            "y": stay.y,
            "after_s": person.replies_after_s,
            "seconds": self.talk_s(text),
        }
        self.tell("reply", data, f"{clip(person.name, 60)} replies: {clip(text, _MAX_TEXT)}")

    def heard(self, start_s: float, end_s: float) -> str:
        """The words that the robot hears during a time, where it is at the end of it.

        The words of a sound are spread evenly over its time; a word is heard if its middle is.
        """
        parts: list[tuple[float, str]] = []
        for sound in (*self.world.sounds, *self._replies):
            if not self._hears(end_s, sound):
                continue
            words = sound.text.split()
            length = (sound.end_s - sound.start_s) / max(1, len(words))
            middles = [sound.start_s + (n + 0.5) * length for n in range(len(words))]
            caught = [
                word
                for word, middle in zip(words, middles, strict=True)
                if start_s <= middle < end_s
            ]
            if caught:
                parts.append((max(start_s, sound.start_s), " ".join(caught)))
        parts.sort(key=lambda part: part[0])
        text = " ".join(text for _, text in parts)
        if text:
            shown = clip(text, _MAX_TEXT)
            self.tell("hear", {"text": text[:_MAX_TEXT]}, f"the robot has heard: {shown}")
        return text

    def _hears(self, now_s: float, sound: Sound) -> bool:
        return sound.x is None or sound.y is None or self._near(now_s, sound.x, sound.y)

    def _near(self, now_s: float, x: float, y: float) -> bool:
        pose = self.pose(now_s)
        dx, dy = x - pose.x, y - pose.y
        return math.sqrt(dx * dx + dy * dy) <= self.world.robot.hears_within


class Zones:
    """The zones of a world, by number. Changes at one instant count in the order of the file."""

    def __init__(self, world: World) -> None:
        self._zones = world.map.zones
        self._numbers = {zone.name: number for number, zone in enumerate(self._zones)}
        self._changes = world.changes
        # what is known of the future: when, which of the changes
        self._planned = sorted(
            (change.at_s, place)
            for place, change in enumerate(world.changes)
            if change.at_s is not None
        )
        self._reported = 0  # how many of these are in the news already

    def closed(self, now_s: float) -> tuple[int, ...]:
        """The zones that are closed at a time, in the order of the file."""
        if not self._zones:
            return ()
        shut = [zone.closed for zone in self._zones]
        for at_s, place in self._planned:
            if at_s > now_s:
                break
            change = self._changes[place]
            shut[self._numbers[change.zone]] = change.closed
        return tuple(number for number, closed in enumerate(shut) if closed)

    def next_change(self, now_s: float) -> float:
        """When the next zone is closed or opened by the time alone; infinity if none is."""
        place = bisect.bisect_right(self._planned, (now_s, len(self._changes)))
        return self._planned[place][0] if place < len(self._planned) else math.inf

    def arrived(self, now_s: float, arrivals: int) -> None:
        """The robot has reached a goal, and that many in all."""
        for place, change in enumerate(self._changes):
            if change.after_arrivals == arrivals:
                bisect.insort(self._planned, (now_s, place), lo=self._reported)

    def news(self, now_s: float) -> list[str]:
        """A line for each change until now that was not told before."""
        news = []
        while self._reported < len(self._planned) and self._planned[self._reported][0] <= now_s:
            news.append(self._line(self._changes[self._planned[self._reported][1]]))
            self._reported += 1
        return news

    def message(self, numbers: Sequence[int]) -> str:
        """The message that these zones are closed."""
        names = [f"'{clip(self._zones[number].name, 60)}'" for number in numbers[:_MAX_NAMED]]
        if len(numbers) == 1:
            return f"the zone {names[0]} is closed"
        more = f" and {len(numbers) - _MAX_NAMED} more" if len(numbers) > _MAX_NAMED else ""
        return f"the zones {', '.join(names)}{more} are closed"

    def _line(self, change: Change) -> str:
        said = "closed" if change.closed else "open"
        return f"the zone '{clip(change.zone, 60)}' is {said} now"


class Simulated(Runner):
    """A runner that lets some time pass, may fail as the world file says, and then acts.

    ``takes_s`` is the least and the greatest usual duration in seconds; the world file can set
    another one.
    """

    takes_s: tuple[float, float] = (0.5, 1.5)

    world: WorldState
    interface: str
    settings: Settings

    async def start(self, context: LoadContext) -> None:
        """Find the world. Raises RunnerError if there is none."""
        world = context.services.get("world")
        if not isinstance(world, WorldState):
            raise RunnerError("this runner is simulated and needs a world")
        self.world = world
        self.interface = context.interface
        self.settings = world.world.settings_of(context.interface)
        self.services = context.services

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Wait, perhaps fail, then act."""
        await self.pass_time(context)
        return self.act(parameters, context)

    async def pass_time(self, context: RunContext) -> None:
        """Let the usual time pass. Raises RunnerError if the action fails by chance."""
        least, greatest = self.settings.duration_s or self.takes_s
        seconds = least + (greatest - least) * context.random.random()
        chance = context.random.random()
        await context.sleep(seconds)
        if chance < self.settings.fails:
            raise RunnerError(self.settings.message or "it failed by chance, as the world has it")

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Act, at the end of the duration. Override this method; by default it does nothing."""
        del parameters, context
        return None

    def now(self, context: RunContext) -> float:
        """The time in the world, in seconds."""
        return self.world.begun_s + context.now_s

    def answer(self, question: str, context: RunContext, *, interface: str = "") -> Answer | None:
        """The answer of the world file to a question at the current time and place.

        ``interface``: as if another runner asked. Raises RunnerError if it says that this fails.
        """
        now = self.now(context)
        pose = self.world.pose(now)
        asking = interface or self.interface
        answer = self.world.world.answer(asking, question, now_s=now, x=pose.x, y=pose.y)
        if answer is not None and answer.fails:
            error = RunnerError(answer.fails)
            error.outputs = answer.outputs  # not as arguments: an output may be called message
            raise error
        return answer


def said_true(value: RunValue | None) -> bool:
    """True if a parameter is true; a step before may hand it over as text."""
    return value is True or (isinstance(value, str) and value.strip().lower() == "true")


def text_of(value: RunValue | None) -> str:
    """A parameter as text; "" if it is not there."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return "\n".join(text_of(item) for item in value)
    return str(value)


def number(value: RunValue | None, default: float) -> float:
    """A parameter as a number; the default if it is not there or none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return default
    try:
        return float(value)
    except OverflowError:  # a whole number of hundreds of digits
        return default
