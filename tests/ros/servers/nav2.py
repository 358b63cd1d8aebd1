"""Nav2, as its clients see it: two actions, the robot's pose in TF, a map.

    python -m tests.ros.servers.nav2 [--tf map|chain|odom|none] [--map] [--forget 10]
        [--ros-args -r __ns:=/robot]

The robot moves straight to its goal. Results are kept for ``--forget`` seconds. Commands:

- ``next``: the next goal is rejected, is aborted after half of its distance, or hangs there;
- ``drive``: the speed in metres per second, and null for a robot that is there at once;
- ``place``: the robot's pose;
- ``miss``: the numbers of the waypoints that goals miss;
- ``cancels``: false if the server rejects them;
- ``think``: the seconds until a goal is accepted.

It is Nav2 of kilted, or of humble when the interfaces are those of humble.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import TYPE_CHECKING, Any

from geometry_msgs.msg import PoseStamped, TransformStamped
from nav2_msgs.action import FollowWaypoints, NavigateToPose
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from tests.ros.servers.base import FakeServer, arguments, of_choices, scripted, uuid_of

if TYPE_CHECKING:
    from collections.abc import Sequence

TREES = {
    "map": (("map", "base_link"),),
    "chain": (("map", "odom"), ("odom", "base_link")),
    "odom": (("odom", "base_link"),),
    "none": (),
}
"""The published transforms between the map and the robot; odom is where the map is."""
OUTCOMES = ("succeed", "reject", "abort", "hang")
TICK = 0.05
"""The seconds between two steps of the robot, and two messages of feedback."""
ABORTED = (9002, "no transform from base_link to map")
ABORTED_WAYPOINTS = (601, "the task executor failed")


class Navigation(FakeServer):
    """The servers of both actions, and one robot."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__("fake_nav2")
        self.speed: float | None = options.speed
        self.pose = (0.0, 0.0, 0.0)
        self.outcomes: list[dict[str, Any]] = []
        self.missed: list[int] = []
        self.cancels_are_accepted = True
        self.thinks = 0.0
        self._forgets = options.forget
        self._active: dict[str, Any] = {}
        self._of_goal: dict[str, dict[str, Any]] = {}
        self._tree = TREES[options.tf]
        self._transforms = self.node.create_publisher(TFMessage, "/tf", 100)
        self.node.create_timer(TICK, self._publish_pose, callback_group=self.group)
        if options.map:
            self._publish_map()
        for action_type, name, drive in (
            (NavigateToPose, "navigate_to_pose", self._navigate),
            (FollowWaypoints, "follow_waypoints", self._follow),
        ):
            self._offer(action_type, name, drive)

    def do_next(self, outcome: str, error_code: int = 0, error_msg: str = "") -> None:
        """The outcome of the next goal that has none yet."""
        of_choices(outcome, OUTCOMES)
        self.outcomes.append({"outcome": outcome, "error": (error_code, error_msg)})

    def do_drive(self, speed: float | None) -> None:
        self.speed = speed

    def do_place(self, x: float, y: float, yaw: float = 0.0) -> None:
        self.pose = (x, y, yaw)

    def do_miss(self, waypoints: list[int]) -> None:
        self.missed = waypoints

    def do_cancels(self, accept: bool) -> None:
        self.cancels_are_accepted = accept

    def do_think(self, seconds: float) -> None:
        self.thinks = seconds

    def _offer(self, action_type: Any, name: str, drive: Any) -> None:
        def requested(goal: Any) -> GoalResponse:
            self.journal("asked", action=name)
            time.sleep(self.thinks)
            script = scripted(self.outcomes, {"outcome": "succeed", "error": (0, "")})
            if script["outcome"] == "reject":
                self.journal("rejected", action=name, **_goal_fields(goal))
                return GoalResponse.REJECT
            scripts.append(script)
            return GoalResponse.ACCEPT

        def accepted(handle: Any) -> None:
            key = uuid_of(handle.goal_id)
            self._of_goal[key] = scripts.pop(0)
            before, self._active[name] = self._active.get(name), key
            self.journal(
                "goal", action=name, id=key, instead_of=before, **_goal_fields(handle.request)
            )
            handle.execute()

        def cancelled(handle: Any) -> CancelResponse:
            accept = self.cancels_are_accepted
            self.journal("cancel", action=name, id=uuid_of(handle.goal_id), accepted=accept)
            return CancelResponse.ACCEPT if accept else CancelResponse.REJECT

        def execute(handle: Any) -> Any:
            key = uuid_of(handle.goal_id)
            result = action_type.Result()
            status = drive(handle, self._of_goal.pop(key), result)
            if self._active.get(name) == key:
                del self._active[name]
            getattr(handle, {"succeeded": "succeed", "canceled": "canceled"}.get(status, "abort"))()
            self.journal("result", action=name, id=key, status=status)
            return result

        scripts: list[dict[str, Any]] = []
        server = ActionServer(
            self.node,
            action_type,
            name,
            execute,
            goal_callback=requested,
            handle_accepted_callback=accepted,
            cancel_callback=cancelled,
            callback_group=self.group,
            result_timeout=self._forgets,
        )
        self.keep(server)

    def _navigate(self, handle: Any, script: dict[str, Any], result: Any) -> str:
        started = time.monotonic()

        def report(left: float) -> None:
            feedback = NavigateToPose.Feedback()
            _set_pose(feedback.current_pose, self.pose, self.now())
            feedback.distance_remaining = left
            seconds = time.monotonic() - started
            feedback.navigation_time.sec = int(seconds)
            feedback.navigation_time.nanosec = int(seconds % 1 * 1e9)
            if self.speed:
                feedback.estimated_time_remaining.sec = math.ceil(left / self.speed)
            handle.publish_feedback(feedback)

        half = 0.5 if script["outcome"] in ("abort", "hang") else 1.0
        status = self._drive(handle, "navigate_to_pose", handle.request.pose, half, report)
        return self._finish(handle, status, script, result, ABORTED)

    def _follow(self, handle: Any, script: dict[str, Any], result: Any) -> str:
        poses = handle.request.poses
        stops_at = len(poses) // 2 if script["outcome"] in ("abort", "hang") else len(poses)
        status = "succeeded"
        for number, pose in enumerate(poses[:stops_at]):

            def report(_: float, number: int = number) -> None:
                handle.publish_feedback(FollowWaypoints.Feedback(current_waypoint=number))

            status = self._drive(handle, "follow_waypoints", pose, 1.0, report)
            if status != "succeeded":
                break
            if number in self.missed:
                self._miss(result, number, pose)
        return self._finish(handle, status, script, result, ABORTED_WAYPOINTS)

    def _miss(self, result: Any, number: int, pose: PoseStamped) -> None:
        if not hasattr(result, "error_code"):
            result.missed_waypoints = [*result.missed_waypoints, number]
            return
        from nav2_msgs.msg import WaypointStatus

        missed = WaypointStatus(
            waypoint_status=WaypointStatus.FAILED,
            waypoint_index=number,
            waypoint_pose=pose,
            error_code=ABORTED[0],
            error_msg=ABORTED[1],
        )
        result.missed_waypoints = [*result.missed_waypoints, missed]

    def _drive(self, handle: Any, name: str, goal: PoseStamped, part: float, report: Any) -> str:
        """Move a part of the distance: the goal's status is what ended the movement."""
        x, y, yaw = _values(goal)
        (x0, y0, yaw0), whole = self.pose, math.dist(self.pose[:2], (x, y))
        gone, end = 0.0, whole * part
        while True:
            if (ended := self._ended(handle, name)) is not None:
                return ended
            gone = end if self.speed is None else min(end, gone + self.speed * TICK)
            share = gone / whole if whole else 1.0
            arrived = gone >= whole
            self.pose = (x0 + (x - x0) * share, y0 + (y - y0) * share, yaw if arrived else yaw0)
            report(whole - gone)
            if gone >= end:
                return "succeeded"
            self.stopping.wait(TICK)

    def _ended(self, handle: Any, name: str) -> str | None:
        """The status of a goal that is to end before its robot is there."""
        if handle.is_cancel_requested:
            return "canceled"
        preempted = self._active.get(name) != uuid_of(handle.goal_id)
        return "aborted" if preempted or self.stopping.is_set() else None

    def _finish(
        self,
        handle: Any,
        status: str,
        script: dict[str, Any],
        result: Any,
        usual: tuple[int, str],
    ) -> str:
        """The status of a goal whose robot stands, by what is to become of it."""
        name = "navigate_to_pose" if hasattr(handle.request, "pose") else "follow_waypoints"
        if status == "succeeded" and script["outcome"] == "hang":
            self.journal("hangs", id=uuid_of(handle.goal_id))
            while (ended := self._ended(handle, name)) is None:
                self.stopping.wait(TICK)
            return ended
        if status == "succeeded" and script["outcome"] == "abort":
            if hasattr(result, "error_code"):
                code, text = script["error"]
                result.error_code, result.error_msg = (code, text) if code or text else usual
            return "aborted"
        return status

    def _publish_pose(self) -> None:
        transforms = []
        for parent, child in self._tree:
            transform = TransformStamped(child_frame_id=child)
            transform.header.frame_id = parent
            transform.header.stamp = self.now()
            if child == "base_link":
                x, y, yaw = self.pose
                transform.transform.translation.x, transform.transform.translation.y = x, y
                transform.transform.rotation.z = math.sin(yaw / 2)
                transform.transform.rotation.w = math.cos(yaw / 2)
            transforms.append(transform)
        if transforms:
            self._transforms.publish(TFMessage(transforms=transforms))

    def _publish_map(self) -> None:
        grid = OccupancyGrid()
        grid.header.frame_id = "map"
        grid.header.stamp = self.now()
        grid.info.resolution = 0.5
        grid.info.width, grid.info.height = 4, 3
        grid.info.origin.position.x = -1.0
        grid.data = [0] * 10 + [100, -1]
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._map = self.node.create_publisher(OccupancyGrid, "/map", kept)
        self._map.publish(grid)


def _values(stamped: PoseStamped) -> tuple[float, float, float]:
    """The place and the direction of a pose."""
    turn, place = stamped.pose.orientation, stamped.pose.position
    yaw = math.atan2(
        2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y * turn.y + turn.z * turn.z)
    )
    return place.x, place.y, yaw


def _goal_fields(goal: Any) -> dict[str, Any]:
    """A goal of either action, for the journal."""
    poses = [goal.pose] if hasattr(goal, "pose") else goal.poses
    return {
        "poses": [_values(pose) for pose in poses],
        "frames": sorted({pose.header.frame_id for pose in poses}),
        "behavior_tree": getattr(goal, "behavior_tree", ""),
    }


def _set_pose(stamped: PoseStamped, pose: tuple[float, float, float], stamp: Any) -> None:
    stamped.header.frame_id = "map"
    stamped.header.stamp = stamp
    stamped.pose.position.x, stamped.pose.position.y, yaw = pose
    stamped.pose.orientation.z, stamped.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)


def options_of(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--tf", choices=TREES, default="map")
    parser.add_argument("--map", action="store_true")
    parser.add_argument("--speed", type=float, default=2.0)
    parser.add_argument("--forget", type=int, default=10)
    return parser.parse_args(words)


if __name__ == "__main__":
    Navigation(options_of(arguments())).run()
