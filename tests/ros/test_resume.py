"""Runs whose process was killed go on: with the robot of before, and with what became of goals."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from tests.ros.support import reserved_domain
from tests.ros.test_navigation import events, killed_in_a_drive, plan, recovery, waypoint

if TYPE_CHECKING:
    from tests.ros.support import Domain, Program


def test_a_run_is_not_resumed_in_another_domain(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.3")
    goal = killed_in_a_drive(ros, server, plan(ros, waypoint(3.0)))
    with reserved_domain() as other:
        environment = {**ros.environment(), "ROS_DOMAIN_ID": str(other)}
        ended = ros.gpsfsm("resume", "--real", "run.db", environment=environment)
    assert ended.returncode == 2, ended.stdout + ended.stderr
    assert f"domain was {ros.number}, and here it is {other}" in ended.stderr
    ended = ros.gpsfsm("resume", "--real", "run.db")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert [row["id"] for row in server.journal("goal")] == [goal]


NAVIGATE = ("/navigate_to_pose", "nav2_msgs/action/NavigateToPose")


def forgotten(ros: Domain, *steps: str, also: bool = True) -> tuple[Program, str]:
    """A server that has ended a goal of a run whose process was killed, and has forgotten it.

    ``also``: its status topic does not have it any more either, since another goal came.
    """
    server = ros.server("nav2", "--speed", "2", "--forget", "1")
    goal = killed_in_a_drive(ros, server, plan(ros, *steps))
    assert server.wait_for("result", id=goal)["status"] == "succeeded"
    time.sleep(2.5)
    if also:
        client = ros.client()
        client.result(client.send_goal(*NAVIGATE, {"pose": {"pose": {"position": {"x": 9.0}}}}))
    return server, goal


def driven(server: Program) -> list[float]:
    """The places to which runs have sent the robot."""
    return [row["poses"][0][0] for row in server.journal("goal") if row["poses"][0][0] != 9.0]


def resume(ros: Domain, *words: str, code: int = 0) -> str:
    ended = ros.gpsfsm("resume", "--real", "run.db", *words)
    assert ended.returncode == code, (ended.returncode, ended.stdout, ended.stderr)
    return ended.stdout + ended.stderr


def test_a_goal_that_was_finished_and_forgotten_is_not_done_again(ros: Domain) -> None:
    server, goal = forgotten(ros, waypoint(2.0), waypoint(2.5))
    seen = resume(ros, code=2)
    assert f"nobody knows what became of {goal[:8]}" in seen
    assert f"add --goal {goal[:8]}=succeeded, ended or never" in seen
    assert driven(server) == [2.0], "it was not sent again"
    assert "the open goals of the run are" in resume(ros, "--goal", "0000=ended", code=2)
    assert "write ID=succeeded" in resume(ros, "--goal", f"{goal[:8]}=done", code=2)
    resume(ros, "--goal", f"{goal[:8]}=succeeded")
    assert driven(server) == [2.0, 2.5]
    said = [row["message"] for row in events(ros) if row["kind"] == "LOG"]
    assert any("a person says it has succeeded" in each for each in said)


def test_a_goal_that_has_ended_somehow_has_failed(ros: Domain) -> None:
    server, goal = forgotten(ros, waypoint(2.0), recovery(waypoint(1.0)))
    seen = resume(ros, "--goal", f"{goal[:8]}=ended")
    assert "a person says that it has ended" in seen
    assert driven(server) == [2.0, 1.0]


def test_a_goal_that_never_began_is_sent_again(ros: Domain) -> None:
    server, goal = forgotten(ros, waypoint(2.0))
    resume(ros, "--goal", f"{goal}=never")
    assert len(server.journal("goal", id=goal)) == 2


def test_the_status_topic_has_a_goal_that_its_server_has_forgotten(ros: Domain) -> None:
    server, _ = forgotten(ros, waypoint(2.0), also=False)
    resume(ros)
    assert driven(server) == [2.0]


def test_a_goal_that_its_server_remembers_needs_no_word(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "2", "--forget", "900")
    goal = killed_in_a_drive(ros, server, plan(ros, waypoint(2.0)))
    server.wait_for("result", id=goal)
    resume(ros, "--goal", f"{goal[:8]}=never")  # the server knows better
    assert [row["id"] for row in server.journal("goal")] == [goal]
