"""Plans drive a robot: the runners of navigation against Nav2's actions, TF and map."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.ros.support import REPO

if TYPE_CHECKING:
    import subprocess

    from tests.ros.support import Domain, Program

WAYPOINT = '<Runner interface="nav2_capabilities/WaypointRunner" provider="{0}" x="{1}" y="{2}"/>'
LOG = (
    '<Runner interface="generic_capabilities/LogRunner" '
    'provider="generic_capabilities/LogRunner" text="recovered"/>'
)
RECOVERED = "LogRunner (text=recovered) succeeded"
POSE = (
    '<Runner interface="nav2_capabilities/RobotPoseRunner" '
    'provider="nav2_capabilities/RobotPoseRunner"/>'
)

_MALFORMED = """
import json
import sys
from gpsfsm.errors import UsageError
from gpsfsm.ros.node import refuse_malformed

for words in json.loads(sys.argv[1]):
    try:
        refuse_malformed(words)
    except UsageError as error:
        print(error)
"""


def waypoint(x: float, y: float = 0.0, provider: str = "nav2_capabilities/WaypointRunner") -> str:
    return WAYPOINT.format(provider, x, y)


def plan(ros: Domain, *steps: str, name: str = "plan.xml") -> Path:
    file = ros.folder / name
    file.write_text(f"<Plan>\n{chr(10).join(steps)}\n</Plan>\n")
    return file


def recovery(*steps: str) -> str:
    return f'<Control type="recovery">\n{chr(10).join(steps)}\n</Control>'


def events(ros: Domain, journal: str = "run.db") -> list[dict[str, Any]]:
    output = ros.gpsfsm("events", journal, "--format", "jsonl")
    assert output.returncode == 0, output.stderr
    return [json.loads(line) for line in output.stdout.splitlines()[1:]]


def run(ros: Domain, *arguments: str | Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    ended = ros.gpsfsm("run", "--real", "--force", *arguments)
    assert ended.returncode == code, (ended.returncode, ended.stdout, ended.stderr)
    assert "Traceback" not in ended.stderr
    return ended


def provider_file(ros: Domain, extra: str, change: tuple[str, str] = ("", "")) -> Path:
    """A folder with a provider of the waypoint interface of its own: my_robot/Drive."""
    text = (REPO / "runners/navigation/nav2_capabilities/providers/WaypointRunner.yaml").read_text()
    text = text.replace("name: WaypointRunner", "name: my_robot/Drive", 1)
    text = text.replace("  message: error_msg\n", f"  message: error_msg\n{extra}", 1)
    text = text.replace(*change) if change[0] else text
    folder = ros.folder / "capabilities" / "my_robot" / "providers"
    folder.mkdir(parents=True)
    (folder / "Drive.yaml").write_text(text)
    return ros.folder / "capabilities"


MINE = "my_robot/Drive"


def test_a_plan_drives_and_its_journal_has_feedback_and_poses(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "1")
    run(ros, plan(ros, waypoint(1.5), waypoint(1.5, 1.0)), "--journal", "run.db")
    assert [row["poses"][0][:2] for row in server.journal("goal")] == [[1.5, 0.0], [1.5, 1.0]]
    assert all(row["frames"] == ["map"] for row in server.journal("goal"))
    data = [row["data"] for row in events(ros) if row["kind"] == "LOG"]
    left = [each["distance_left_m"] for each in data if "distance_left_m" in each]
    poses = [(each["x"], each["y"]) for each in data if each.get("world") == "pose"]
    assert len(left) >= 3
    assert all(0 <= each <= 1.5 for each in left)
    assert poses[-1][0] == 1.5


def test_a_yaw_is_a_quaternion_in_its_frame(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "50")
    drive = waypoint(1.0, 2.0).replace("WaypointRunner", "WaypointYawRunner")
    run(ros, plan(ros, drive, drive.replace("/>", ' yaw="1.5707963267948966" frame="odom"/>')))
    one, two = server.journal("goal")
    assert (one["poses"], one["frames"]) == ([[1.0, 2.0, 0.0]], ["map"])
    turned = [[1.0, 2.0, pytest.approx(1.5707963267948966)]]
    assert (two["poses"], two["frames"]) == (turned, ["odom"])


@pytest.mark.parametrize(
    ("outcome", "why"),
    [
        ({"outcome": "reject"}, "has rejected the goal"),
        (
            {"outcome": "abort"},
            "was aborted: no transform from base_link to map, error code 9002",
        ),
    ],
)
def test_a_goal_that_fails_is_recovered_from(
    ros: Domain, outcome: dict[str, str], why: str
) -> None:
    server = ros.server("nav2")
    server.command("next", **outcome)
    ended = run(ros, plan(ros, waypoint(1.0), recovery(waypoint(2.0))))
    assert f"failed: the action navigate_to_pose {why}" in ended.stdout
    assert server.journal("result")[-1]["status"] == "succeeded"


def test_the_end_of_a_run_cancels_its_goal(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    with ros.running("run", "--real", plan(ros, waypoint(5.0))) as process:
        goal = server.wait_for("goal")["id"]
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130
    assert server.wait_for("cancel")["id"] == goal
    assert server.wait_for("result", id=goal)["status"] == "canceled"


def test_a_goal_that_is_accepted_after_the_end_of_a_run_is_cancelled(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    server.command("think", seconds=0.7)
    with ros.running("run", "--real", plan(ros, waypoint(5.0))) as process:
        server.wait_for("asked")
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130
    assert server.wait_for("result")["status"] == "canceled"


def test_a_plan_that_is_refused_ends_well_while_its_node_is_being_made(ros: Domain) -> None:
    ros.server("nav2")
    file = plan(ros, recovery(waypoint(1.0)), waypoint(2.0))
    for _ in range(3):
        ended = ros.gpsfsm("run", "--real", file)
        assert ended.returncode == 1, (ended.returncode, ended.stderr)
        assert "GP307" in ended.stderr
        assert "terminate" not in ended.stderr


def test_a_goal_that_takes_too_long_is_cancelled_and_has_failed(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    steps = plan(ros, waypoint(5.0), recovery(LOG))
    ended = run(ros, steps, "--timeout", "1")
    assert RECOVERED in ended.stdout
    assert server.wait_for("result")["status"] == "canceled"


def test_a_server_that_says_nothing_any_more_has_failed(ros: Domain) -> None:
    folder = provider_file(ros, "  silence: 1.5\n")
    server = ros.server("nav2")
    server.command("next", outcome="hang")
    steps = plan(ros, waypoint(1.0, provider=MINE), recovery(LOG))
    ended = run(ros, steps, "--capabilities", folder)
    assert "no feedback for 1.5 s" in ended.stdout
    assert RECOVERED in ended.stdout


def test_a_server_that_is_silent_and_alive_is_waited_for(ros: Domain) -> None:
    server = ros.server("nav2")
    server.command("next", outcome="hang")
    folder = provider_file(ros, "  probe: 0.3\n")
    steps = plan(ros, waypoint(1.0, provider=MINE))
    with ros.running("run", "--real", steps, "--capabilities", folder) as process:
        server.wait_for("hangs")
        time.sleep(3)  # ten times as long as a sign of life may stay out
        assert process.poll() is None
        assert not server.journal("cancel", accepted=True)
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130


def test_a_server_that_was_killed_leaves_the_run_in_doubt(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    (ros.folder / "robot.yaml").write_text("name: lab\nros: {doubt: 8}\n")
    steps = plan(ros, waypoint(5.0), recovery(LOG))
    words = ("run", "--real", "--format", "plain", steps, "--robot", "robot.yaml")
    with ros.running(*words) as process:
        server.wait_for("goal")
        ros.kill(server.process)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 3, (out, err)
    assert "its server does not answer, so whether it acts is unknown" in err
    assert "recovered" not in out, "nobody has said that the goal has ended"


def test_a_server_that_was_restarted_has_lost_the_goal(ros: Domain) -> None:
    first = ros.server("nav2", "--speed", "0.1")
    steps = plan(ros, waypoint(5.0), recovery(LOG))
    with ros.running("run", "--real", steps) as process:
        first.wait_for("goal")
        ros.kill(first.process)
        second = ros.server("nav2")
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, (out, err)
    assert "was restarted and has lost the goal" in out or "no longer answers" in out
    assert not second.journal("goal")


def test_definitions_that_differ_are_said_to_differ(ros: Domain) -> None:
    ros.server("nav2", variants=("humble",))
    ended = run(ros, plan(ros, waypoint(1.0)), code=2)
    assert (
        "is listed as nav2_msgs/action/NavigateToPose, but the types do not match" in ended.stderr
    )


def test_a_robot_with_older_definitions_is_driven_with_them(ros: Domain) -> None:
    server = ros.server("nav2", variants=("humble",))
    file = plan(ros, waypoint(1.0))
    ended = ros.gpsfsm("run", "--real", file, variants=("humble",))
    assert ended.returncode == 0, ended.stdout + ended.stderr
    server.command("next", outcome="abort")
    ended = ros.gpsfsm("run", "--real", plan(ros, waypoint(2.0)), variants=("humble",))
    assert "the action navigate_to_pose was aborted" in ended.stdout


def test_no_server_is_a_failure_that_says_what_to_do(ros: Domain) -> None:
    folder = provider_file(ros, "  wait: 0.5\n")
    ended = run(ros, plan(ros, waypoint(1.0, provider=MINE)), "--capabilities", folder, code=2)
    assert f"is not available (waited 0.5 s in domain {ros.number}): start what offers it" in (
        ended.stderr
    )


def test_messages_that_are_not_installed_are_named_before_anything_starts(ros: Domain) -> None:
    file = plan(ros, LOG, waypoint(1.0))
    environment = ros.environment()
    environment["PYTHONPATH"] = str(ros.folder)
    ended = ros.gpsfsm("run", "--real", file, environment=environment)
    assert ended.returncode == 2
    assert "the messages of nav2_msgs are not installed: apt install ros-" in ended.stderr
    assert not ended.stdout


def killed_in_a_drive(ros: Domain, server: Program, *arguments: str | Path) -> str:
    """The id of the goal of a run that was killed while the robot drives."""
    with ros.running("run", "--real", *arguments, "--journal", "run.db") as process:
        goal = str(server.wait_for("goal")["id"])
        time.sleep(0.2)
        ros.kill(process)
    return goal


def test_a_resumed_run_awaits_the_goal_that_is_under_way(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.3")
    goal = killed_in_a_drive(ros, server, plan(ros, waypoint(2.0)))
    ended = ros.gpsfsm("resume", "--real", "run.db")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert [row["id"] for row in server.journal("goal")] == [goal]
    assert not server.journal("cancel", accepted=True)
    assert server.wait_for("result", id=goal)["status"] == "succeeded"


def test_a_resumed_run_cancels_what_is_not_to_go_on(ros: Domain) -> None:
    folder = provider_file(ros, "  on_resume: cancel\n")
    server = ros.server("nav2", "--speed", "0.1")
    steps = plan(ros, waypoint(3.0, provider=MINE), recovery(LOG))
    goal = killed_in_a_drive(ros, server, steps, "--capabilities", folder)
    words = ("resume", "--real", "run.db", "--capabilities", folder)
    refused = ros.gpsfsm(*words, "--goal", f"{goal[:8]}=ended")
    assert refused.returncode == 2
    assert "has no effect: its runner has on_resume: cancel" in refused.stderr
    ended = ros.gpsfsm(*words)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert RECOVERED in ended.stdout
    assert server.wait_for("result", id=goal)["status"] == "canceled"
    assert len(server.journal("goal")) == 1


def test_a_resumed_run_sends_a_goal_again_that_the_server_has_lost(ros: Domain) -> None:
    folder = provider_file(ros, "  on_resume: continue\n")
    server = ros.server("nav2", "--speed", "0.1")
    steps = plan(ros, waypoint(2.0, provider=MINE))
    goal = killed_in_a_drive(ros, server, steps, "--capabilities", folder)
    ros.kill(server.process)
    again = ros.server("nav2")
    ended = ros.gpsfsm("resume", "--real", "run.db", "--capabilities", folder)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert again.wait_for("result", id=goal)["status"] == "succeeded"


def profile(ros: Domain, name: str, network: str) -> Path:
    file = ros.folder / f"{name}.yaml"
    file.write_text(f"name: {name}\nros: {network}\n")
    return file


def test_two_robots_in_two_namespaces(ros: Domain) -> None:
    servers = {
        name: ros.server("nav2", "--ros-args", "-r", f"__ns:=/{name}") for name in ("one", "two")
    }
    for place, (name, server) in enumerate(servers.items(), 1):
        robot = profile(ros, name, f"{{namespace: /{name}}}")
        run(ros, plan(ros, waypoint(float(place))), "--robot", robot)
        assert [row["poses"][0][0] for row in server.journal("goal")] == [float(place)]


def test_arguments_that_no_node_takes_are_refused(ros: Domain) -> None:
    words = [["--nonsense"], ["-r", "a"], ["-r"], ["--params-file", "none.yaml"], ["-r", "a:=b"]]
    done = ros.python("-c", _MALFORMED, json.dumps(words))
    assert [line.removeprefix("after --ros-args: ") for line in done.stdout.splitlines()] == [
        "unknown arguments '--nonsense'",
        "Couldn't parse remap rule: '-r a'. Error: Expected lexeme type (19) not found, search "
        "ended at index 1",
        "Couldn't parse trailing -r flag. No remap rule found.",
        "Couldn't parse params file: '--params-file none.yaml'. Error: Error opening YAML file",
    ], done.stderr
    for command in (["run", "--real", "plan.xml", "--journal", "run.db"], ["capabilities", "pull"]):
        plan(ros, waypoint(1.0))
        done = ros.gpsfsm(*command, "--ros-args", "--nonsense")
        assert done.returncode == 2, (command, done.stdout, done.stderr)
        assert "gpsfsm: after --ros-args: unknown arguments '--nonsense'" in done.stderr
    assert not (ros.folder / "run.db").exists()


def test_names_are_remapped_by_the_command_line_and_by_semantic_interfaces(ros: Domain) -> None:
    server = ros.server("nav2", "--ros-args", "-r", "__ns:=/turtlebot4")
    remap = "navigate_to_pose:=/turtlebot4/navigate_to_pose"
    run(ros, plan(ros, waypoint(1.0)), "--ros-args", "-r", remap)
    folder = ros.folder / "capabilities" / "turtlebot" / "semantic_interfaces"
    folder.mkdir(parents=True)
    (folder / "Waypoint.yaml").write_text(
        "name: turtlebot/Waypoint\nspec_type: semantic_interface\nspec_version: 1.2\n"
        "redefines: nav2_capabilities/WaypointRunner\n"
        "remappings: {actions: {/navigate_to_pose: /turtlebot4/navigate_to_pose}}\n"
    )
    step = waypoint(2.0).replace("nav2_capabilities/WaypointRunner", "turtlebot/Waypoint", 1)
    run(ros, plan(ros, step), "--capabilities", ros.folder / "capabilities")
    assert [row["poses"][0][0] for row in server.journal("goal")] == [1.0, 2.0]


@pytest.mark.parametrize("tree", ["map", "chain", "odom"])
def test_the_pose_comes_from_tf(ros: Domain, tree: str) -> None:
    server = ros.server("nav2", "--tf", tree)
    server.command("place", x=1.25, y=-0.5, yaw=1.0)
    run(ros, plan(ros, POSE), "--journal", "run.db")
    outputs = next(row["data"] for row in events(ros) if row["kind"] == "SUCCEEDED")
    assert (outputs["x"], outputs["y"], outputs["z"]) == (1.25, -0.5, 0.0)
    assert outputs["qz"] == pytest.approx(0.479426, abs=1e-6)


def test_a_robot_without_tf_has_no_pose(ros: Domain) -> None:
    ros.server("nav2", "--tf", "none")
    ended = run(ros, plan(ros, POSE), code=2)
    missing = "there is no transform from map to base_link or from odom to base_link (waited 5 s)"
    assert missing in ended.stderr


def test_the_map_of_the_robot(ros: Domain) -> None:
    ros.server("nav2", "--map")
    name = "nav2_capabilities/OccupancyGridRunner"
    step = f'<Runner interface="{name}" provider="{name}"/>'
    run(ros, plan(ros, step), "--journal", "run.db")
    outputs = next(row["data"] for row in events(ros) if row["kind"] == "SUCCEEDED")
    assert outputs["OccupancyGrid"].split("\n") == [
        "width=4 height=3 resolution=0.5 origin=(-1, 0)",
        "....",
        "....",
        "..#?",
    ]
