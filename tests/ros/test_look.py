"""The look at a robot before the first goal: what is missing is said at once, and nothing moves."""

from __future__ import annotations

import json
import signal
import time
from typing import TYPE_CHECKING

import pytest

from tests.ros.test_lists import INTERFACE, MOVE, PROVIDER
from tests.ros.test_navigation import POSE, events, plan, provider_file, waypoint

if TYPE_CHECKING:
    from pathlib import Path

    from tests.ros.support import Domain

MINE = waypoint(3.0, provider="my_robot/Drive")
TYPO = ("    pose.pose.position.x: $x\n", "    pose.pose.positon.x: $x\n")
SECOND = ("action: navigate_to_pose", "action: dock\n  wait: 0.5")


def arm(ros: Domain, *changes: tuple[str, str]) -> Path:
    """The folder of the arm's files, changed, and a plan that moves it."""
    text = PROVIDER.lstrip()
    for change in changes:
        assert change[0] in text
        text = text.replace(*change, 1)
    for name, content in (("interfaces", INTERFACE), ("providers", text)):
        file = ros.folder / "caps" / "arm" / name / "Move.yaml"
        file.parent.mkdir(parents=True)
        file.write_text(content)
    return ros.folder / "caps"


@pytest.mark.parametrize(
    ("change", "missed"),
    [
        (TYPO, "request: Pose has no field positon (it has position, orientation)"),
        (
            ("  message: error_msg\n", "  message: error_msg\n  success: {eror_code: 0}\n"),
            "success",
        ),
        (SECOND, "the action /dock is not available (waited 0.5 s"),
    ],
    ids=["field", "success", "server"],
)
def test_nothing_drives_if_a_later_step_cannot(
    ros: Domain, change: tuple[str, str], missed: str
) -> None:
    server = ros.server("nav2")
    folder = provider_file(ros, "", change)
    file = plan(ros, waypoint(1.0), MINE)
    ended = ros.gpsfsm("run", "--real", file, "--capabilities", folder, "--journal", "run.db")
    assert ended.returncode == 2, ended.stdout + ended.stderr
    assert "the plan cannot be run for real:\n" in ended.stderr
    assert f"{file}:3: my_robot/Drive: {missed}" in ended.stderr
    assert server.journal("goal") == []
    assert not ended.stdout


def test_all_that_is_missing_comes_in_one_report_with_what_is_there_instead(ros: Domain) -> None:
    server = ros.server("nav2", "--ros-args", "-r", "__ns:=/r1")
    folder = provider_file(ros, "  wait: 0.5\n", TYPO)
    file = plan(ros, MINE)
    ended = ros.gpsfsm("ros", "check", file, "--capabilities", folder)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    first, second, tally = ended.stdout.splitlines()
    assert "the action /navigate_to_pose is not available (waited 0.5 s" in first
    assert "the robot has /r1/navigate_to_pose (nav2_msgs/action/NavigateToPose)" in first
    assert second.startswith(f"{file}:2: my_robot/Drive: request: Pose has no field positon (")
    assert tally == f"{file}: 1 of 1 steps act on ROS 2; 2 things are missing on the robot"
    there = ros.gpsfsm(*("ros", "check", plan(ros, waypoint(1.0)), "--ros-args", "-r", "__ns:=/r1"))
    assert there.returncode == 0, there.stdout + there.stderr
    assert "nothing is missing on the robot" in there.stdout
    assert server.journal("goal") == []


def test_without_a_robot_the_definitions_say_what_does_not_fit(ros: Domain) -> None:
    changes = (
        ("position: $joints", "positon: $joints"),
        ("limits: [2.5]", "limits: [far]"),
        ("reached_goal: true", "reached: true"),
        ("id\n    all", "name\n    all"),
    )
    folder = arm(ros, *changes)
    file = plan(ros, MOVE.format("0 0"))
    ended = ros.gpsfsm("ros", "check", "--offline", file, "--capabilities", folder)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    lines = [line.removeprefix(f"{file}:2: arm/Move: ") for line in ended.stdout.splitlines()]
    assert [line.split(" (")[0] for line in lines] == [
        "request: Joint has no field positon",
        'request: "far" does not fit the field limits, a double',
        "outputs: Sight has no field name",
        "success: Move Result has no field reached",
        f"{file}: 1 of 1 steps act on ROS 2; 4 things are missing in the definitions that are "
        "installed",
    ]


def test_a_look_without_a_robot_has_no_use_for_where_it_is(ros: Domain) -> None:
    file = plan(ros, MOVE.format("1 2"))
    ended = ros.gpsfsm("ros", "check", file, "--offline", "--ros-args", "-r", "__ns:=/r1")
    assert ended.returncode == 2
    assert "--offline and --ros-args cannot be used together" in ended.stderr


def test_a_dry_run_fills_every_message_and_sends_none(ros: Domain) -> None:
    server = ros.server("arm")
    folder = arm(ros)
    file = plan(ros, MOVE.format("0.1 0.2"), MOVE.format("1 2 3"))
    words = ("run", "--real", "--force", "--dry-run", file, "--capabilities", folder)
    ended = ros.gpsfsm(*words, "--format", "json")
    assert ended.returncode == 2
    assert f"{file}:3: arm/Move: request: the lists for joints of Constraint differ" in ended.stderr
    first, _ = map(json.loads, ended.stdout.splitlines())
    assert (first["name"], first["type"]) == ("move_arm", "arm_msgs/action/Move")
    joints = first["message"]["constraints"][0]["joints"]
    assert [(each["name"], each["position"]) for each in joints] == [("base", 0.1), ("elbow", 0.2)]
    fitting = ros.gpsfsm(*words[:4], plan(ros, MOVE.format("0.1 0.2")), *words[5:])
    assert fitting.returncode == 0, fitting.stderr
    assert ": move_arm (arm_msgs/action/Move) {" in fitting.stdout
    assert server.journal("goal") == []


def test_a_plan_that_has_all_it_needs_runs_and_one_may_wait_for_a_late_server(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "5")
    changed = (SECOND[0], f"{SECOND[1]}\n  late: true")
    folder = provider_file(ros, "", changed)
    file = plan(ros, waypoint(1.0), MINE)
    words = ("run", "--real", file, "--capabilities", folder, "--journal", "run.db")
    ended = ros.gpsfsm(*words)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    assert len(server.journal("goal")) == 1
    assert any("the action /dock is not available" in row.get("message", "") for row in events(ros))


def test_an_interruption_ends_the_look(ros: Domain) -> None:
    folder = provider_file(ros, "  wait: 50\n")
    with ros.running("run", "--real", plan(ros, MINE), "--capabilities", folder) as process:
        time.sleep(4)
        process.send_signal(signal.SIGINT)
        before = time.monotonic()
        assert process.wait(20) == 130
        assert time.monotonic() - before < 5


def test_topics_and_frames_are_looked_for(ros: Domain) -> None:
    ros.server("nav2", "--map", "--tf", "odom")
    grid = "nav2_capabilities/OccupancyGridRunner"
    steps = (f'<Runner interface="{grid}" provider="{grid}"/>', POSE)
    file = plan(ros, *steps)
    ended = ros.gpsfsm("ros", "check", file, "--ros-args", "-r", "__ns:=/r1")
    assert ended.returncode == 1, ended.stdout + ended.stderr
    topic, frames, _ = ended.stdout.splitlines()
    assert topic.startswith(f"{file}:2: {grid}: the topic /r1/map is not available (waited 5 s")
    assert topic.endswith("; the robot has /map (nav_msgs/msg/OccupancyGrid)")
    assert frames.startswith(f"{file}:3: nav2_capabilities/RobotPoseRunner: there is no transform ")
    assert frames.endswith("; its frames: none")
    there = ros.gpsfsm("ros", "check", file)
    assert there.returncode == 0, there.stdout + there.stderr
