"""Runs whose process was killed go on: with the robot of before, and with what became of goals."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.ros.support import reserved_domain
from tests.ros.test_navigation import killed_in_a_drive, plan, waypoint

if TYPE_CHECKING:
    from tests.ros.support import Domain


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
