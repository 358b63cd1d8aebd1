"""Navigation in a world."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.simulation.base import Pose, Simulated, number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue

_STEP_S = 0.5
_RETRY_S = 1.0
_TICK_S = 1e-6  # the clock cannot tell shorter times apart
_DIGITS = 6
_MAP = "map"
"""The frame of the places in a world."""


class WaypointRunner(Simulated):
    """Drives along the shortest way. A later goal replaces an earlier one, which then fails.

    A chance to fail breaks the drive off on the way. ``duration`` is the time before it begins.
    """

    idempotent = True
    takes_s = (0.05, 0.2)

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Drive there; where no way leads, look for one for a while."""
        x, y, yaw = _goal(parameters)
        least, greatest = self.settings.duration_s or self.takes_s
        await context.sleep(least + (greatest - least) * context.random.random())
        unlucky = context.random.random() < self.settings.fails
        part = context.random.random() if unlucky else 1.0
        token = self.world.driver = object()
        try:
            await self._drive(x, y, part, token, context)
            if unlucky:
                raise RunnerError(self.settings.message or "the drive was broken off on the way")
            await self._turn(Pose(x, y, yaw), token, context)
        finally:  # however it ends, also when it is stopped
            if self.world.driver is token:
                self.world.halt(self.now(context))
        self.world.arrive(self.now(context), x, y)
        self._tell_news(context)

    async def _drive(
        self, x: float, y: float, part: float, token: object, context: RunContext
    ) -> None:
        world = self.world
        tried_since: float | None = None
        while True:
            now = self.now(context)
            self._tell_news(context)
            route = world.route(now, x, y)
            if route is not None:
                tried_since = None
                seconds = world.drive(now, route) * part
                if await self._follow(now + seconds, token, context):
                    world.halt(self.now(context))
                    return
                continue
            world.halt(now)
            tried_since = now if tried_since is None else tried_since
            left = tried_since + world.world.robot.patience_s - now
            if left <= _TICK_S:
                why = world.hindrance(now, x, y)
                raise RunnerError(f"no way leads to ({x:g}, {y:g}){': ' if why else ''}{why}")
            await context.sleep(min(left, _RETRY_S))
            self._check(token)

    async def _follow(self, end_s: float, token: object, context: RunContext) -> bool:
        """Drive until the end of the way; False as soon as the map changes."""
        change = self.world.next_change(self.now(context))
        while self.now(context) < end_s - _TICK_S:
            if self.now(context) >= change:
                return False
            left = min(end_s, change) - self.now(context)
            await context.sleep(max(_TICK_S, min(_STEP_S, left)))
            self._check(token)
        return True

    async def _turn(self, goal: Pose, token: object, context: RunContext) -> None:
        world = self.world
        off = abs(math.remainder(goal.yaw - world.pose(self.now(context)).yaw, math.tau))
        await context.sleep(off / world.world.robot.turn_speed)
        self._check(token)
        world.put(goal)

    def _tell_news(self, context: RunContext) -> None:
        for line in self.world.zones.news(self.now(context)):
            context.log(line)

    def _check(self, token: object) -> None:
        if self.world.driver is not token:
            raise RunnerError("another goal has replaced this one")


class WaypointYawRunner(WaypointRunner):
    """The same for a direction in radians. A world has but one frame, its map."""

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Drive there."""
        if (frame := parameters.get("frame", _MAP)) != _MAP:
            raise RunnerError(f"the goal is in the frame {frame!r}: a world has {_MAP!r} only")
        yaw = number(parameters.get("yaw"), 0.0)
        turned = {"qz": math.sin(yaw / 2), "qw": math.cos(yaw / 2)}
        await super().run({**parameters, **turned}, context)


class RobotPoseRunner(Simulated):
    """Tells where the robot is."""

    idempotent = True
    takes_s = (0.1, 1.0)

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """The pose; the robot stays on the floor."""
        del parameters
        pose = self.world.pose(self.now(context))
        return {
            "x": round(pose.x, _DIGITS),
            "y": round(pose.y, _DIGITS),
            "z": 0.0,
            "qx": 0.0,
            "qy": 0.0,
            "qz": round(math.sin(pose.yaw / 2), _DIGITS),
            "qw": round(math.cos(pose.yaw / 2), _DIGITS),
        }


class OccupancyGridRunner(Simulated):
    """Hands over the map: size, resolution, origin, then the rows from south to north."""

    idempotent = True
    takes_s = (0.1, 1.0)

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """The map as text; ``#`` is a cell with something in it."""
        del parameters
        grid = self.world.grid
        area, edge = grid.map.area, grid.map.resolution
        mask = grid.blocked(self.world.present(self.now(context)), 0.0)
        rows = [
            "".join("#" if cell else "." for cell in mask[begin : begin + grid.width])
            for begin in range(0, len(mask), grid.width)
        ]
        head = f"width={grid.width} height={grid.height} resolution={edge:g}"
        return {"OccupancyGrid": "\n".join([f"{head} origin=({area.x0:g}, {area.y0:g})", *rows])}


def _goal(parameters: Mapping[str, RunValue]) -> tuple[float, float, float]:
    """The place, and the direction that the orientation means on the floor."""
    x, y = number(parameters.get("x"), math.nan), number(parameters.get("y"), math.nan)
    if not (math.isfinite(x) and math.isfinite(y)):
        raise RunnerError("the goal is no place: x and y must be numbers")
    qx, qy = number(parameters.get("qx"), 0.0), number(parameters.get("qy"), 0.0)
    qz, qw = number(parameters.get("qz"), 0.0), number(parameters.get("qw"), 1.0)
    length = math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    if not 1e-6 < length < math.inf:
        raise RunnerError("the goal has no direction: qx, qy, qz and qw are no orientation")
    qx, qy, qz, qw = qx / length, qy / length, qz / length, qw / length
    return x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
