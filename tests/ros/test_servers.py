"""The fake servers do what they say, seen by a client on a real ROS 2."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tests.ros.support import Domain

NAVIGATE = ("/navigate_to_pose", "nav2_msgs/action/NavigateToPose")


def pose(x: float, y: float = 0.0) -> dict[str, Any]:
    return {
        "header": {"frame_id": "map"},
        "pose": {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}},
    }


def test_a_robot_drives_to_its_goal(ros: Domain) -> None:
    server, client = ros.server("nav2"), ros.client()
    goal = client.send_goal(*NAVIGATE, {"pose": pose(0.4)})
    assert client.result(goal)["status"] == "STATUS_SUCCEEDED"
    assert server.wait_for("goal", id=goal)["poses"] == [[0.4, 0.0, 0.0]]
    left = [each["distance_remaining"] for each in client.feedback(goal)]
    assert left == sorted(left, reverse=True)
