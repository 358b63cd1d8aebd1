"""``gpsfsm ros status``: the ledger of goals by a journal alone."""

from __future__ import annotations

import os
import signal
import time
from typing import TYPE_CHECKING

from tests.ros.test_navigation import events, killed_in_a_drive, plan, profile, recovery, waypoint

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.ros.support import Domain


def status(ros: Domain, code: int) -> list[str]:
    ended = ros.gpsfsm("ros", "status", "run.db")
    assert ended.returncode == code, (ended.returncode, ended.stdout, ended.stderr)
    return ended.stdout.splitlines()


def eventually(ros: Domain, word: str) -> Iterator[str]:
    end = time.monotonic() + 30
    while time.monotonic() < end:
        if word in (seen := ros.gpsfsm("ros", "status", "run.db").stdout):
            yield seen
            return
    raise AssertionError(f"{word} was not seen: {seen}")


def test_the_goals_of_a_run_are_in_its_journal(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.3")
    steps = plan(ros, waypoint(0.01), waypoint(3.0))
    words = ("run", "--real", steps, "--journal", "run.db")
    with ros.running(*words) as process:
        first = server.wait_for("goal")["id"]
        second = server.wait_for("goal", count=2)["id"]
        (seen,) = eventually(ros, "ACCEPTED")
        assert f"{first}  ENDED      run 1, line 2  WaypointRunner (x=0.01, y=0.0)" in seen
        assert f"{second}  ACCEPTED   run 1, line 3  WaypointRunner (x=3.0, y=0.0)" in seen
        assert "the action navigate_to_pose; uses base" in seen
        os.kill(process.pid, signal.SIGSTOP)  # silent
        (seen,) = eventually(ros, "UNKNOWN")
        assert "its process has given no sign of life for" in seen
        os.kill(process.pid, signal.SIGCONT)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    assert "its step has stopped" in "".join(status(ros, 0))
    accepted = [row["data"] for row in events(ros) if "ledger" in row.get("data", {})]
    assert [(row["ledger"], row["goal"]) for row in accepted] == [
        ("ACCEPTED", second),
    ], "the steps say the rest"


def test_the_goal_of_a_process_that_was_killed_is_unknown(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    goal = killed_in_a_drive(ros, server, plan(ros, waypoint(3.0)))
    seen = "\n".join(status(ros, 3))
    assert f"{goal}  UNKNOWN" in seen
    assert "no process writes to the journal any more" in seen


def test_a_run_that_ended_in_doubt_says_so_later(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    steps = plan(ros, waypoint(3.0), recovery(waypoint(1.0)))
    lab = profile(ros, "robot", "{doubt: 4}")
    with ros.running("run", "--real", steps, "--robot", lab, "--journal", "run.db") as process:
        goal = server.wait_for("goal")["id"]
        os.kill(server.process.pid, signal.SIGSTOP)
        assert process.wait(60) == 3
        os.kill(server.process.pid, signal.SIGCONT)
    seen = "\n".join(status(ros, 3))
    assert f"{goal}  UNKNOWN" in seen
    assert "its server does not answer" in seen
    server.command("drive", speed=9.0)
    server.wait_for("result")
