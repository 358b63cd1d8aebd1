"""What gpsfsm adds to plain rclpy: the table of docs/ros.md.

A server of the tests answers each goal at once. Two kinds of processes take turns, one of plain
rclpy and ``gpsfsm run --real``; the time is that from the start of the process to the goal in the
server. Then a process of each kind sends goals, each measured from the call to the acceptance, and
at last a thousand goals go through the runner, whose memory is looked at.
"""

from __future__ import annotations

import asyncio
import json
import os
import random
import resource
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from benchmarks.common import ROOT, table

STARTS = 15
GOALS = 200
MANY = 1000
SETTLED = 200
"""After so many goals nothing is new any more."""

PLAN = (
    '<Plan><Runner interface="nav2_capabilities/WaypointRunner" '
    'provider="nav2_capabilities/WaypointRunner" x="0.1" y="0.0"/></Plan>'
)
PLAIN = """
import statistics
import sys
import time

import rclpy
from rclpy.action import ActionClient
from nav2_msgs.action import NavigateToPose

rclpy.init()
node = rclpy.create_node("plain")
client = ActionClient(node, NavigateToPose, "navigate_to_pose")
client.wait_for_server()
goal = NavigateToPose.Goal()
goal.pose.header.frame_id = "map"
goal.pose.pose.position.x = 0.1
sent = client.send_goal_async(goal)
rclpy.spin_until_future_complete(node, sent)
result = sent.result().get_result_async()
rclpy.spin_until_future_complete(node, result)
if len(sys.argv) > 1:
    seconds = []
    for _ in range(int(sys.argv[1])):
        began = time.perf_counter()
        sent = client.send_goal_async(goal)
        rclpy.spin_until_future_complete(node, sent)
        seconds.append(time.perf_counter() - began)
        result = sent.result().get_result_async()
        rclpy.spin_until_future_complete(node, result)
    print(1000 * statistics.median(seconds))
client.destroy()
node.destroy_node()
rclpy.try_shutdown()
"""


def main() -> None:
    from tests.ros.support import Domain, missing, reserved_domain

    class Usual(Domain):
        """A domain in which participants meet as they do by the defaults of Fast DDS."""

        def environment(self, *variants: str) -> dict[str, str]:
            environment = super().environment(*variants)
            del environment["FASTDDS_DEFAULT_PROFILES_FILE"]
            return environment

    if reason := missing():
        raise SystemExit(reason)
    starts, inside = {}, {}
    for kind in (Usual, Domain):
        with tempfile.TemporaryDirectory() as name, reserved_domain() as number:
            domain = kind(number=number, folder=Path(name))
            server = domain.server("nav2")
            server.command("drive", speed=None)
            try:
                starts[kind] = _starts(domain, server, Path(name))
                inside = inside or _inside(domain, Path(name))
            finally:
                domain.close()
    who = ("plain", "gpsfsm")
    rows = [
        [f"start to goal, ms; {discovery}", *(f"{1000 * starts[kind][each]:.0f}" for each in who)]
        for kind, discovery in ((Usual, "Fast DDS as it comes"), (Domain, "announcing every 50 ms"))
    ]
    rows.append(["goal to acceptance, ms", *(f"{inside[each]:.1f}" for each in who)])
    print(table(["median", "plain rclpy", "gpsfsm"], rows))
    print(
        f"\n{MANY:,} goals in a row: {inside['before']:.1f} MB after {SETTLED} of them and "
        f"{inside['after']:.1f} MB at the end, {inside['threads']} threads more than before."
    )


def _starts(domain: Any, server: Any, folder: Path) -> dict[str, float]:
    """The median seconds from the start of a process to its goal."""
    plan, plain = folder / "plan.xml", folder / "plain.py"
    plan.write_text(PLAN)
    plain.write_text(PLAIN)
    python = str(ROOT / ".venv-ros" / "bin" / "python")
    commands = {
        "plain": [python, str(plain)],
        "gpsfsm": [python, "-m", "gpsfsm", "run", "--real", str(plan)],
    }
    seconds: dict[str, list[float]] = {who: [] for who in commands}
    for _ in range(STARTS + 1):
        for who, command in commands.items():
            count = len(server.journal("goal")) + 1
            began = time.perf_counter()
            process = subprocess.Popen(
                command, env=domain.environment(), cwd=folder, stdout=subprocess.DEVNULL
            )
            server.wait_for("goal", count=count)
            seconds[who].append(time.perf_counter() - began)
            assert process.wait(60) == 0
    return {who: statistics.median(each[1:]) for who, each in seconds.items()}


def _inside(domain: Any, folder: Path) -> dict[str, float]:
    """What processes with a node measure of themselves."""
    python = str(ROOT / ".venv-ros" / "bin" / "python")
    outputs = [
        subprocess.run(
            [python, *words],
            env=domain.environment(),
            cwd=ROOT,
            stdout=subprocess.PIPE,
            check=True,
        ).stdout
        for words in ([str(folder / "plain.py"), str(GOALS)], ["-m", "benchmarks.ros", "--inside"])
    ]
    measured: dict[str, float] = json.loads(outputs[1])
    return {**measured, "plain": float(outputs[0])}


def _rss_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


async def _measure() -> dict[str, float]:
    from gpsfsm.capabilities.table import builtin
    from gpsfsm.execution.runner import LoadContext, RunContext
    from gpsfsm.model.ros import RosSettings
    from gpsfsm.ros.actions import Goal
    from gpsfsm.ros.messages import definition
    from gpsfsm.ros.node import close_node, process_node
    from gpsfsm.ros.runner import RosRunner, Services

    name = "nav2_capabilities/WaypointRunner"
    services = Services(RosSettings(), builtin())
    runner = RosRunner()
    await runner.start(LoadContext(name, name, {"ros": services}))
    node, kind = process_node(), definition("nav2_msgs/action/NavigateToPose")
    client = runner._client
    seconds = []
    for number in range(GOALS):
        message = kind.Goal()
        goal = Goal(
            node,
            client,
            kind,
            f"benchmark {number}",
            call=services.call(name, name),
            feedback=lambda _: None,
        )
        began = time.perf_counter()
        await goal.send(message)
        seconds.append(time.perf_counter() - began)
        await goal.result()
    threads, before = threading.active_count(), 0.0
    for number in range(MANY):
        context = RunContext(
            number=0,
            element="/Plan/Runner[1]",
            key=f"many {number}",
            random=random.SystemRandom(),
            sleeper=asyncio.sleep,
            clock=time.monotonic,
            logger=lambda *_: None,
        )
        await runner.run({"x": 0.1 * (number % 2), "y": 0.0}, context)
        if number + 1 == SETTLED:
            before = _rss_mb()
    after, more = _rss_mb(), threading.active_count() - threads
    await runner.stop()
    close_node()
    median = 1000 * statistics.median(seconds)
    return {"gpsfsm": median, "before": before, "after": after, "threads": more}


if __name__ == "__main__":
    if "--inside" in sys.argv:
        print(json.dumps(asyncio.run(_measure())))
    else:
        os.chdir(ROOT)
        main()
