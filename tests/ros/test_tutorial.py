"""The commands of the tutorial, against servers that offer what a TurtleBot offers."""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING

from tests.ros.support import REPO

if TYPE_CHECKING:
    from tests.ros.support import Domain

PAGE = REPO / "docs" / "turtlebot.md"
SHOWN = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def commands() -> list[list[str]]:
    """The commands of the page that a robot is needed for, with the paths of this checkout."""
    lines = [line for block in SHOWN.findall(PAGE.read_text()) for line in block.splitlines()]
    words = [shlex.split(line) for line in lines if line.startswith("gpsfsm ")]
    return [
        [str(REPO / word) if word.startswith("docs/") else word for word in line[1:]]
        for line in words
    ]


def test_the_tutorial_drives_a_robot(ros: Domain) -> None:
    navigation, perception = ros.server("nav2", "--speed", "20"), ros.server("perception")
    prompt = ros.server("prompt")
    plan = (REPO / "docs/examples/turtlebot/hello.xml").read_text()
    prompt.command("answer", response=plan, success=True)
    drive, bounded, generate = commands()
    for command in (drive, bounded):
        ended = ros.gpsfsm(*command)
        assert ended.returncode == 0, ended.stdout + ended.stderr
    assert [row["poses"][0][:2] for row in navigation.journal("goal")] == [[1.0, 0.5]] * 2
    said = [row["request"]["input"]["text"] for row in perception.journal(service="speech")]
    assert said == ["a table with a cup"] * 2
    written = ros.gpsfsm(*generate)
    assert written.returncode == 0, written.stdout + written.stderr
    assert 'x="1.0"' in (ros.folder / "hello_again.xml").read_text()
    events = ros.gpsfsm("events", "drive.db")
    assert events.returncode == 0, events.stderr
    assert "WaypointRunner" in events.stdout
    words = ("--format", "mcap", "--output-file", "drive.mcap")
    recorded = ros.gpsfsm("events", "drive.db", *words)
    assert recorded.returncode == 0, recorded.stderr
    assert (ros.folder / "drive.mcap").read_bytes().startswith(b"\x89MCAP")


def test_what_leaves_the_map_is_refused(ros: Domain) -> None:
    far = ros.folder / "far.xml"
    far.write_text(
        '<Plan>\n<Runner interface="nav2_capabilities/WaypointRunner" '
        'provider="nav2_capabilities/WaypointRunner" x="50.0" y="0.5"/>\n</Plan>\n'
    )
    navigation = ros.server("nav2")
    robot = REPO / "docs/examples/turtlebot/robot.yaml"
    ended = ros.gpsfsm("run", "--real", far, "--robot", robot)
    assert ended.returncode == 1
    assert "GP206" in ended.stderr
    assert not navigation.journal("goal")


def test_waypoints_of_a_file_without_code(ros: Domain) -> None:
    folder = REPO / "docs" / "examples" / "waypoints"
    server = ros.server("nav2", "--speed", "20")
    name = "rounds/FollowWaypointsRunner"
    plan = ros.folder / "rounds.xml"
    plan.write_text(
        f'<Plan>\n<Runner interface="{name}" provider="{name}" xs="1 2.5 0" ys="0 1 -1"/>\n'
        "</Plan>\n"
    )
    ended = ros.gpsfsm("run", "--real", plan, "--capabilities", folder)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    (goal,) = server.journal("goal", action="follow_waypoints")
    assert [pose[:2] for pose in goal["poses"]] == [[1.0, 0.0], [2.5, 1.0], [0.0, -1.0]]
    server.command("miss", waypoints=[1])
    ended = ros.gpsfsm("run", "--real", plan, "--capabilities", folder)
    assert ended.returncode == 1
    assert "answers missed_waypoints[]=1" in ended.stdout
