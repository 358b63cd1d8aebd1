"""No goal counts as ended because nobody has answered: runs, stops and the next goals wait."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

from tests.ros.test_navigation import plan, recovery, waypoint

if TYPE_CHECKING:
    from tests.ros.support import Domain

PROFILE = "name: lab\nros: {doubt: 4}\n"


def profile(ros: Domain) -> str:
    (ros.folder / "robot.yaml").write_text(PROFILE)
    return "robot.yaml"


def test_a_run_does_not_end_before_its_goal_cannot_begin(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    server.command("think", seconds=8)
    with ros.running("run", "--real", "--format", "plain", plan(ros, waypoint(5.0))) as process:
        server.wait_for("asked")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, (out, err)
    assert "has no answer yet, and may still begin" in out
    assert server.wait_for("result")["status"] == "canceled"


def test_a_frozen_server_ends_the_run_in_doubt(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    steps = plan(ros, waypoint(5.0), recovery(waypoint(1.0)))
    words = ("run", "--real", "--format", "plain", steps, "--robot", profile(ros))
    with ros.running(*words) as process:
        server.wait_for("goal")
        os.kill(server.process.pid, signal.SIGSTOP)
        out, err = process.communicate(timeout=60)
        os.kill(server.process.pid, signal.SIGCONT)
        server.command("drive", speed=9.0)  # it is awake again, and can be asked to end
        server.wait_for("result")
    assert process.returncode == 3, (out, err)
    assert "its server does not answer, so whether it acts is unknown" in err
    assert len(server.journal("goal")) == 1


def test_no_next_goal_goes_to_a_resource_in_doubt(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    steps = plan(ros, waypoint(5.0), recovery(waypoint(1.0)))
    words = ("run", "--real", "--format", "plain", steps, "--timeout", "5")
    with ros.running(*words) as process:
        server.wait_for("goal")
        os.kill(server.process.pid, signal.SIGSTOP)
        lines = []
        assert process.stdout is not None
        for line in process.stdout:
            lines.append(line)
            if "it is waited for" in line:
                os.kill(server.process.pid, signal.SIGCONT)
                server.command("drive", speed=9.0)
                break
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, (lines, out, err)
    first, second = server.journal("goal")
    assert first["id"] != second["id"]
    assert second["instead_of"] is None, "the first had ended"


def test_a_goal_that_its_server_lost_goes_to_the_next_server(ros: Domain) -> None:
    first = ros.server("nav2")
    first.command("think", seconds=30)
    with ros.running("run", "--real", "--format", "plain", plan(ros, waypoint(1.0))) as process:
        first.wait_for("asked")
        ros.kill(first.process)
        second = ros.server("nav2")
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, (out, err)
    assert len(second.journal("goal")) == 1
    assert second.wait_for("result")["status"] == "succeeded"
