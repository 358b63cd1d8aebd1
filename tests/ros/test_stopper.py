"""The process that stops a robot cancels all goals, whoever has sent them."""

from __future__ import annotations

import json
import subprocess
import time
from typing import TYPE_CHECKING

from gpsfsm.capabilities.table import builtin
from gpsfsm.model.ros import RosSettings
from gpsfsm.ros.stopper import stopper_command
from tests.ros.support import PYTHON

if TYPE_CHECKING:
    from typing import Any

    import pytest

    from tests.ros.support import Domain

NAVIGATE = ("/navigate_to_pose", "nav2_msgs/action/NavigateToPose")
FOLLOW = ("/follow_waypoints", "nav2_msgs/action/FollowWaypoints")


def pose(x: float) -> dict[str, Any]:
    return {"header": {"frame_id": "map"}, "pose": {"position": {"x": x}}}


def stopper(
    ros: Domain, actions: list[str], settings: RosSettings | None = None
) -> subprocess.Popen[str]:
    head = json.dumps({"ros": (settings or RosSettings()).data(), "actions": actions})
    process = subprocess.Popen(
        [str(PYTHON), "-m", "gpsfsm.ros.stopper", head],
        env=ros.environment(),
        cwd=ros.folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert answer(process) == {"ready": True}
    return process


def answer(process: subprocess.Popen[str], line: str = "") -> dict[str, Any]:
    assert process.stdin is not None
    assert process.stdout is not None
    if line:
        process.stdin.write(line + "\n")
        process.stdin.flush()
    read: dict[str, Any] = json.loads(process.stdout.readline())
    return read


def seen(process: subprocess.Popen[str], servers: int) -> None:
    """Wait until the stopper sees so many servers on the graph."""
    while answer(process, "stop")["servers"] < servers:
        time.sleep(0.05)


def ended(process: subprocess.Popen[str]) -> int:
    process.communicate(timeout=30)
    return process.returncode


def test_all_goals_of_all_actions_are_cancelled(ros: Domain) -> None:
    server, client = ros.server("nav2", "--speed", "0.1"), ros.client()
    process = stopper(ros, ["navigate_to_pose", "follow_waypoints"])
    assert answer(process, "ping") == {"alive": True}
    assert answer(process, "stop") == {"cancelled": 0, "servers": 2, "problems": []}
    drive = client.send_goal(*NAVIGATE, {"pose": pose(5.0)})
    rounds = client.send_goal(*FOLLOW, {"poses": [pose(5.0)]})
    assert answer(process, "stop") == {"cancelled": 2, "servers": 2, "problems": []}
    for goal in (drive, rounds):
        assert server.wait_for("result", id=goal)["status"] == "canceled"
    assert ended(process) == 0


def test_a_server_that_cannot_be_stopped_is_named(ros: Domain) -> None:
    server, client = ros.server("nav2", "--speed", "0.1"), ros.client()
    process = stopper(ros, ["navigate_to_pose"])
    server.command("cancels", accept=False)
    client.send_goal(*NAVIGATE, {"pose": pose(5.0)})
    stopped = answer(process, "stop")
    assert stopped["cancelled"] == 0
    assert stopped["problems"] == ["/navigate_to_pose refuses to cancel its goals"]
    ros.kill(server.process)
    stopped = answer(process, "stop")
    assert "/navigate_to_pose does not answer" in stopped["problems"]
    assert ended(process) == 0


def test_a_server_that_vanished_with_a_goal_is_no_server_without_goals(ros: Domain) -> None:
    ros.lease = 2
    server, client = ros.server("nav2", "--speed", "0.1"), ros.client()
    process = stopper(ros, ["navigate_to_pose"])
    client.send_goal(*NAVIGATE, {"pose": pose(5.0)})
    server.command("cancels", accept=False)
    assert answer(process, "stop")["problems"] == ["/navigate_to_pose refuses to cancel its goals"]
    ros.kill(server.process)
    while (stopped := answer(process, "stop"))["servers"]:
        assert stopped["problems"]
    (problem,) = stopped["problems"]
    assert problem == "/navigate_to_pose cannot be seen any more, and had active goals"
    assert ended(process) == 0


def test_only_the_robot_in_the_namespace_is_stopped(ros: Domain) -> None:
    client = ros.client()
    servers = {
        name: ros.server("nav2", "--speed", "0.1", "--ros-args", "-r", f"__ns:=/{name}")
        for name in ("one", "two")
    }
    process = stopper(ros, ["navigate_to_pose"], RosSettings(namespace="/two"))
    seen(process, 2)
    goals = {
        name: client.send_goal(f"/{name}/navigate_to_pose", NAVIGATE[1], {"pose": pose(5.0)})
        for name in servers
    }
    assert answer(process, "stop 7").items() >= {"stop": 7, "cancelled": 1}.items()
    assert servers["two"].wait_for("result", id=goals["two"])["status"] == "canceled"
    assert not servers["one"].journal("cancel", accepted=True)
    assert ended(process) == 0


def test_the_command_names_the_actions_of_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    assert stopper_command(builtin(), {}) == (), "there is no rclpy in this environment"
    monkeypatch.setattr("gpsfsm.ros.stopper.find_spec", lambda name: name)
    _, isolation, _, module, head = stopper_command(builtin(), {"domain": 3})
    assert isolation == "-P", "a file in the working folder must not be taken for a module"
    assert module == "gpsfsm.ros.stopper"
    assert json.loads(head) == {"ros": {"domain": 3}, "actions": ["navigate_to_pose"]}
