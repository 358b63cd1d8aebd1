"""The service drives a robot: its queue, its stop, its hold, the poses on its page."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import httpx

from tests.ros.support import PATIENCE
from tests.ros.test_stopper import answer, ended, stopper

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tests.ros.support import Domain

SECRET = "0123456789abcdef-robot"  # noqa: S105  (of the tests)
PLAN = (
    '<Plan>\n<Runner interface="nav2_capabilities/WaypointRunner" '
    'provider="nav2_capabilities/WaypointRunner" x="{0}" y="0.0"/>\n</Plan>\n'
)
PROFILE = "name: lab\nrunners: [nav2_capabilities/WaypointRunner]\nmap: {x: [-9, 9], y: [-9, 9]}\n"


class Service:
    """A client of a service that drives a robot."""

    def __init__(self, port: int) -> None:
        self.client = httpx.Client(
            base_url=f"http://127.0.0.1:{port}",
            headers={"Authorization": f"Bearer {SECRET}"},
            timeout=PATIENCE,
            trust_env=False,
        )

    def ask(self, method: str, path: str, body: dict[str, Any] | None = None) -> dict[str, Any]:
        answer = self.client.request(method, path, json=body)
        assert answer.is_success, answer.text
        read: dict[str, Any] = answer.json()
        return read

    def submit(self, x: float) -> None:
        self.ask("POST", "/v1/plans", {"plan": PLAN.format(x)})

    def held(self) -> str:
        return str(self.ask("GET", "/v1/queue")["held"])


@contextmanager
def service(ros: Domain) -> Iterator[Service]:
    (ros.folder / "token").write_text(SECRET)
    (ros.folder / "robot.yaml").write_text(PROFILE)
    words = ("serve", "--real", "--journal", "queue.db", "--token-file", "token", "--port", "0")
    with ros.running(*words, "--robot", "robot.yaml") as process:
        assert process.stderr is not None
        port = 0
        while not port:
            line = process.stderr.readline()
            assert line, "the service did not begin"
            match = re.search(r"http://127\.0\.0\.1:(\d+)", line)
            port = int(match[1]) if match else 0
        served = Service(port)
        with served.client:
            yield served
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE)


def queue_process(ros: Domain) -> int:
    """The process that runs the plans; whoever kills it leaves files in shared memory."""
    (line,) = [line for line in ros.processes() if "gpsfsm.running.real_serving" in line]
    pid = int(line.split()[0])
    ros.give_up(pid)
    return pid


def eventually(condition: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def rows(ros: Domain) -> list[dict[str, Any]]:
    ended = ros.gpsfsm("events", "queue.db", "--format", "jsonl")
    return [json.loads(line) for line in ended.stdout.splitlines()[1:]]


def test_the_queue_drives_and_is_stopped_and_held(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.5")
    with service(ros) as client:
        client.submit(0.3)
        goal = server.wait_for("goal")["id"]
        assert server.wait_for("result", id=goal)["status"] == "succeeded"
        client.submit(8.0)
        drive = server.wait_for("goal", count=2)["id"]
        stopped = client.ask("POST", "/v1/stop")
        assert server.wait_for("result", id=drive)["status"] == "canceled"
        assert stopped["goals"] in (0, 1), stopped  # the run itself cancels it as well
        assert not stopped["problems"], stopped
        client.submit(0.1)
        eventually(client.held)
        assert len(server.journal("goal")) == 2
        client.ask("POST", "/v1/queue/release")
        assert server.wait_for("goal", count=3)["poses"][0][0] == 0.1


def test_a_stop_needs_neither_the_queue_nor_its_process(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    with service(ros) as client:
        client.submit(8.0)
        drive = server.wait_for("goal")["id"]
        queue = queue_process(ros)
        os.kill(queue, signal.SIGSTOP)
        stopped = client.client.post("/v1/stop").json()
        assert server.wait_for("result", id=drive)["status"] == "canceled"
        assert stopped["goals"] == 1, stopped
        assert "it was killed with everything that ran in it" in stopped["detail"]
        eventually(lambda: _held(client))
        assert len(server.journal("goal")) == 1


def test_nothing_drives_by_itself_after_the_queue_was_killed(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    with service(ros) as client:
        client.submit(8.0)
        drive = server.wait_for("goal")["id"]
        os.kill(queue_process(ros), signal.SIGKILL)
        assert server.wait_for("result", id=drive)["status"] == "canceled"
        eventually(lambda: _held(client))
        assert len(server.journal("goal")) == 1


def _held(client: Service) -> str:
    try:
        return client.held()
    except AssertionError:  # the queue is being started again
        return ""


def test_poses_and_feedback_are_journaled_for_the_page(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "1")
    with service(ros) as client:
        client.submit(2.0)
        server.wait_for("result")
    data = [row.get("data", {}) for row in rows(ros)]
    assert any(each.get("world") == "pose" for each in data)
    assert any("distance_left_m" in each for each in data)


def test_a_stop_is_not_confirmed_before_its_goal_cannot_begin(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "0.1")
    server.command("think", seconds=6)
    with service(ros) as client:
        client.submit(8.0)
        server.wait_for("asked")
        stopped = client.client.post("/v1/stop")
        assert stopped.status_code == 503, stopped.text
        detail = stopped.json()["detail"]
        assert "to the action navigate_to_pose has no answer yet, and may still begin" in detail
        drive = server.wait_for("goal")["id"]  # it begins, and is cancelled at once
        assert server.wait_for("result", id=drive)["status"] == "canceled"
        eventually(lambda: client.client.post("/v1/stop").status_code == 200)
        assert len(server.journal("goal")) == 1


TRIGGER = ("/gpsfsm/stop", "std_srvs/srv/Trigger")


def test_a_call_of_ros_stops_what_the_page_stops(ros: Domain) -> None:
    server, caller = ros.server("nav2", "--speed", "0.1"), ros.client()
    with service(ros) as client:
        assert caller.call(*TRIGGER)["success"]
        client.ask("POST", "/v1/queue/release")
        server.command("think", seconds=6)
        client.submit(8.0)
        server.wait_for("asked")
        response = caller.call(*TRIGGER)
        assert not response["success"], "the goal may still begin"
        assert "it is not confirmed that everything has stopped: the goal" in response["message"]
        assert "to the action navigate_to_pose has no answer yet" in response["message"]
        drive = server.wait_for("goal")["id"]
        assert server.wait_for("result", id=drive)["status"] == "canceled"
        assert client.held() == "stopped by a call of gpsfsm/stop"
        eventually(lambda: caller.call(*TRIGGER)["success"])
        assert len(server.journal("goal")) == 1


def test_a_call_is_answered_if_nobody_stops_anything(ros: Domain) -> None:
    ros.server("nav2")
    caller = ros.client()
    process = stopper(ros, ["navigate_to_pose"])
    response = caller.call(*TRIGGER)
    assert not response["success"]
    assert response["message"] == "the service of gpsfsm does not answer"
    assert answer(process) == {"called": 1}
    caller.program.send("call", name=TRIGGER[0], of_type=TRIGGER[1], timeout=10.0, request={})
    assert answer(process) == {"called": 2}
    assert process.stdin is not None
    process.stdin.write('answer 2 {"success": true, "message": "all"}\n')
    process.stdin.flush()
    assert caller.answers(2) == {"success": True, "message": "all"}
    assert ended(process) == 0
