"""``gpsfsm dispatch`` against fake Fabric servers of both releases, in processes of their own."""

from __future__ import annotations

import json
import signal
import sqlite3
import subprocess
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.ros.support import PATIENCE, PYTHON

if TYPE_CHECKING:
    from tests.ros.support import Domain, Program

GO = "nav2_capabilities/WaypointRunner"
DONE = "fabric_capabilities/FabricCompletionRunner"
MUX = "capabilities2_runner/InputMultiplexRunner"


def waypoint(x: str) -> str:
    return f'<Runner interface="{GO}" provider="{GO}" x="{x}" y="2.0"/>'


PLAN = f"<Plan>\n  {waypoint('1.0')}\n  {waypoint('2.0')}\n</Plan>\n"
RECOVERING = (
    f'<Plan>\n  {waypoint("1.0")}\n  <Control type="recovery">\n    {waypoint("2.0")}\n'
    f"  </Control>\n  {waypoint('3.0')}\n</Plan>\n"
)
REJECTED = f'<Plan>\n  <Runner interface="{GO}"/>\n</Plan>\n'
V2: dict[str, Any] = {"variants": ("fabric-v2",)}
both = pytest.mark.parametrize(
    ("ros", "version"), [(V2, "2"), ({}, "3")], indirect=["ros"], ids=["V2", "V3"]
)


def written(ros: Domain, text: str) -> Path:
    file = ros.folder / "plan.xml"
    file.write_text(text)
    return file


def server_of(ros: Domain, version: str, *arguments: str) -> Program:
    return ros.server("fabric", "--version", version, *arguments)


def rows(ros: Domain) -> list[dict[str, Any]]:
    done = ros.gpsfsm("events", "run.db", "--format", "jsonl", "--verify")
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@both
def test_an_accepted_plan_is_submitted_followed_and_journaled(ros: Domain, version: str) -> None:
    server = server_of(ros, version)
    written(ros, PLAN)
    done = ros.gpsfsm("dispatch", "plan.xml", "--journal", "run.db")
    assert done.returncode == 0, done.stdout + done.stderr
    submitted = server.wait_for("submitted")
    assert submitted["plan"] == PLAN
    assert f"plan {submitted['plan_id']} on Fabric V{version}: COMPLETED after" in done.stdout
    header, *events = rows(ros)
    assert (header["mode"], header["options"]["engine"]) == ("fabric", f"fabric-v{version}")
    notes = [row["data"] for row in events if row["kind"] == "NOTE"]
    assert notes[0] == {"fabric_plan": submitted["plan_id"]}
    assert [row["kind"] for row in events][-1] == "ENDED"
    assert events[-1]["data"] == {"status": "COMPLETED"}
    replayed = ros.gpsfsm("replay", "run.db")
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    resumed = ros.gpsfsm("resume", "run.db")
    assert (resumed.returncode, "driven by a Fabric server" in resumed.stderr) == (2, True)


@both
def test_a_rejected_plan_never_reaches_the_server(ros: Domain, version: str) -> None:
    server = server_of(ros, version)
    written(ros, REJECTED)
    done = ros.gpsfsm("dispatch", "plan.xml", "--journal", "run.db")
    assert done.returncode == 1
    assert "GP107" in done.stderr
    assert "rejected: findings, so it is not submitted" in done.stderr
    assert not server.journal("submitted")


def test_events_drive_the_journal(ros: Domain) -> None:
    server_of(ros, "3", "--pace", "0.05").command("next", outcome="HANG")
    events = ros.server("events")
    written(ros, RECOVERING)
    with ros.running("dispatch", "plan.xml", "--journal", "run.db", "--format", "json") as run:
        events.command("listeners")
        wait_until_running(run)
        first = 40  # the server has numbered the instances of earlier plans
        events.command("event", code="FAILED", source=(GO, first), target=(GO, first + 1))
        events.command("event", code="SUCCEEDED", source=(GO, first + 1), target=(MUX, first + 2))
        events.command("event", code="SUCCEEDED", source=(GO, first + 1), target=(MUX, first + 2))
        events.command("event", code="SUCCEEDED", source=(MUX, first + 2), target=(GO, first + 3))
        events.command("event", code="SUCCEEDED", source=(GO, first + 3), target=(DONE, first + 4))
        out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 0, err
    last = json.loads(out.splitlines()[-1])["dispatch"]
    assert (last["status"], last["events"]) == ("COMPLETED", True)
    assert last["explanation"] == [
        "line 2: WaypointRunner (x=1.0, y=2.0) failed, and the plan continued"
    ]
    steps = [
        (row["kind"], row["element"])
        for row in rows(ros)
        if row.get("kind") in ("STARTED", "FAILED", "SUCCEEDED", "JOINED")
    ]
    assert [kind for kind, _ in steps] == [
        *("STARTED", "FAILED", "STARTED", "SUCCEEDED", "JOINED", "STARTED", "SUCCEEDED")
    ]


def test_a_failure_that_nothing_takes_is_explained(ros: Domain) -> None:
    server_of(ros, "3").command("next", outcome="HANG")
    events = ros.server("events")
    written(ros, PLAN)
    with ros.running("dispatch", "plan.xml", "--journal", "run.db", "--format", "json") as run:
        events.command("listeners")
        wait_until_running(run)
        events.command("raw")  # it changes nothing, and what comes after it does
        events.command("event", code="SUCCEEDED", source=(GO, 7), target=(GO, 8))
        events.command("event", code="FAILED", source=(GO, 8))
        out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 1, err
    last = json.loads(out.splitlines()[-1])["dispatch"]
    assert last["status"] == "HANG"
    assert last["explanation"] == [
        "the plan left its specified part at line 3: WaypointRunner (x=2.0, y=2.0): it failed, "
        "and nothing follows that; the server keeps waiting (HANG)"
    ]
    assert rows(ros)[-1]["data"] == {"status": "HANG"}


@both
def test_a_plan_whose_time_is_up_is_cancelled(ros: Domain, version: str) -> None:
    server = server_of(ros, version)
    server.command("next", outcome="HANG")
    written(ros, PLAN)
    done = ros.gpsfsm("dispatch", "plan.xml", "--journal", "run.db", "--timeout", "2")
    assert done.returncode == 1
    plan_id = server.wait_for("submitted")["plan_id"]
    assert server.wait_for("cancel")["plan_id"] == plan_id
    assert "the plan was cancelled: its time is up" in done.stdout
    assert ("Fabric V2 reports that it has cancelled the plan, but does not" in done.stdout) == (
        version == "2"
    )
    assert rows(ros)[-1]["data"] == {"status": "CANCELLED"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_cancels(ros: Domain, number: signal.Signals) -> None:
    server = server_of(ros, "3")
    server.command("next", outcome="HANG")
    written(ros, PLAN)
    with ros.running("dispatch", "plan.xml", "--format", "plain") as run:
        server.wait_for("status", status="RUNNING")
        run.send_signal(number)
        out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 130, out + err
    assert "the plan was cancelled: interrupted" in out
    server.wait_for("status", status="CANCELLED")


@pytest.mark.parametrize(("command", "code"), [("dispatch", 130), ("ros", 0)])
def test_an_interruption_ends_the_wait_for_a_server(ros: Domain, command: str, code: int) -> None:
    written(ros, PLAN)
    words = ["ros", "gate"] if command == "ros" else ["dispatch", "plan.xml"]
    with ros.running(*words, "--wait", "600") as run:
        maps = Path(f"/proc/{run.pid}/maps")
        deadline = time.monotonic() + PATIENCE
        while "librcl" not in maps.read_text():  # by then it has its own handlers of signals
            assert time.monotonic() < deadline
            time.sleep(0.05)
        run.send_signal(signal.SIGTERM)
        out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == code, out + err


def test_an_answer_to_a_submission_may_take_as_long_as_a_gate_does(ros: Domain) -> None:
    server = server_of(ros, "3")
    server.command("answer_after", seconds=6)
    written(ros, PLAN)
    done = ros.gpsfsm("dispatch", "plan.xml", "--format", "plain")
    assert done.returncode == 0, done.stdout + done.stderr
    server.wait_for("submitted")


def test_who_does_not_wait_for_the_answer_to_a_submission_is_warned(ros: Domain) -> None:
    server = server_of(ros, "3")
    server.command("answer_after", seconds=3_600)
    written(ros, PLAN)
    with ros.running("dispatch", "plan.xml", "--format", "plain") as run:
        server.wait_for("asked")
        assert run.stderr is not None
        run.send_signal(signal.SIGINT)
        assert "Ctrl-C again aborts it" in run.stderr.readline()
        run.send_signal(signal.SIGINT)
        _, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 130
    assert "the server may have taken the plan, and it may run" in err


@both
def test_what_the_server_refuses_is_said(ros: Domain, version: str) -> None:
    server = server_of(ros, version)
    server.command("next", outcome="REFUSED", error="[server] not today")
    server.command("next", outcome="VALIDATION_FAILED", rejected=["a/B"])
    written(ros, PLAN)
    done = ros.gpsfsm("dispatch", "plan.xml", "--journal", "run.db")
    assert done.returncode == 2
    assert f"Fabric V{version} rejects the plan: [server] not today" in done.stderr
    assert rows(ros)[-1]["data"] == {"status": "REFUSED"}
    done = ros.gpsfsm("dispatch", "plan.xml")
    assert done.returncode == 1
    assert "the server does not run the plan: VALIDATION_FAILED: a/B" in done.stdout


@pytest.mark.parametrize("ros", [V2], indirect=True)
def test_a_queue_whose_thread_has_ended_is_told_of(ros: Domain) -> None:
    server = server_of(ros, "2", "--queue-ends")
    written(ros, PLAN)
    assert ros.gpsfsm("dispatch", "plan.xml").returncode == 0
    server.wait_for("queue_ended")
    done = ros.gpsfsm("dispatch", "plan.xml", "--timeout", "6")
    assert done.returncode == 1
    assert "the plan is still QUEUED: another plan runs, or the thread" in done.stderr


def test_a_server_that_does_not_tell_of_the_plan_that_it_runs(ros: Domain) -> None:
    server = server_of(ros, "3", "--forgets", "--pace", "0.2")
    written(ros, PLAN)
    server.command("next", outcome="HANG")
    events = ros.server("events")
    with ros.running("dispatch", "plan.xml", "--format", "plain") as run:
        events.command("listeners")
        server.wait_for("status", status="RUNNING")
        time.sleep(2.5)  # longer than UNKNOWN is taken for an end elsewhere
        events.command("event", code="SUCCEEDED", source=(GO, 0), target=(GO, 1))
        events.command("event", code="SUCCEEDED", source=(GO, 1), target=(DONE, 2))
        out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 0, out + err


def test_without_a_server_nothing_is_submitted(ros: Domain) -> None:
    written(ros, PLAN)
    done = ros.gpsfsm("dispatch", "plan.xml", "--wait", "0.5")
    assert done.returncode == 2
    assert (
        "no Fabric server offers /fabric/set_plan (V2) or /fabric/plan/submit (V3)" in done.stderr
    )


def test_a_release_whose_definitions_are_not_installed_is_named(ros: Domain) -> None:
    ros.server("fabric", "--version", "2", variants=("fabric-v2",))
    written(ros, PLAN)
    done = ros.gpsfsm("dispatch", "plan.xml")  # with the definitions of V3
    assert done.returncode == 2
    assert "the server at /fabric is a Fabric V2, but fabric_msgs has no srv" in done.stderr


def test_a_service_of_other_definitions_is_told_from_one_that_is_not_there(ros: Domain) -> None:
    """V2 and V3 have a GetPlanStatus each, which do not fit each other."""
    renamed = ("--ros-args", "-r", "/fabric/plan/get_status:=/elsewhere")
    server_of(ros, "3", *renamed)
    written(ros, PLAN)
    done = ros.gpsfsm("dispatch", "plan.xml", "--wait", "2")
    assert done.returncode == 2
    assert "the Fabric V3 server does not offer /fabric/plan/get_status" in done.stderr
    renamed = (
        *("--ros-args", "-r", "/fabric/get_plan_status:=/fabric/plan/get_status"),
        *("-r", "/fabric/set_plan:=/elsewhere"),
    )
    ros.server("fabric", "--version", "2", *renamed, variants=("fabric-v2",))
    done = ros.gpsfsm("dispatch", "plan.xml", "--wait", "2")
    assert done.returncode == 2
    assert "/fabric/plan/get_status is listed, but the types do not match" in done.stderr


def test_a_server_that_is_killed_ends_the_dispatch(ros: Domain) -> None:
    server = server_of(ros, "3")
    server.command("next", outcome="HANG")
    written(ros, PLAN)
    with ros.running("dispatch", "plan.xml", "--journal", "run.db", "--format", "plain") as run:
        server.wait_for("status", status="RUNNING")
        ros.kill(server.process)
        out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 1, out + err
    assert "the Fabric server is gone: /fabric/plan/get_status does not answer" in out
    assert rows(ros)[-1]["kind"] != "ENDED"  # how it ended, nobody knows


def test_a_plan_that_cannot_be_followed_any_more_is_cancelled(ros: Domain) -> None:
    server = server_of(ros, "3")
    server.command("next", outcome="HANG")
    written(ros, PLAN)
    with ros.running("dispatch", "plan.xml", "--format", "plain") as run:
        server.wait_for("status", status="RUNNING")
        server.command("status_after", seconds=3_600)
        out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 1, out + err
    assert "if it still runs, so may the plan" in out
    server.wait_for("status", status="CANCELLED")


def test_a_plan_that_cannot_be_journaled_any_more_is_cancelled(ros: Domain) -> None:
    server = server_of(ros, "3")
    server.command("next", outcome="HANG")
    written(ros, PLAN)
    with ros.running("dispatch", "plan.xml", "--journal", "run.db", "--format", "json") as run:
        wait_until_running(run)
        events = ros.server("events")
        damage = sqlite3.connect(ros.folder / "run.db")
        damage.execute("DROP TABLE event")
        damage.commit()
        damage.close()
        events.command("listeners")
        events.command("event", code="SUCCEEDED", source=(GO, 0), target=(GO, 1))
        _, err = run.communicate(timeout=PATIENCE)
    assert run.returncode == 2, err
    server.wait_for("status", status="CANCELLED")


def wait_until_running(run: Any) -> None:
    """Read the JSON of a dispatch until the plan begins."""
    deadline = time.monotonic() + PATIENCE
    for line in run.stdout:
        if json.loads(line).get("kind") == "BEGIN":
            return
        assert time.monotonic() < deadline
    raise AssertionError(run.stderr.read())


SPINNING = """
import sys, time
from gpsfsm.model.ros import RosSettings
from gpsfsm.ros.node import RosNode
from std_msgs.msg import String

errors = []
node = RosNode(RosSettings(), threads=int(sys.argv[1]), on_error=errors.append)

def fail(message):
    raise ValueError(message.data)

node.do(lambda: node.handle.create_subscription(String, "chatter", fail, 10))
publisher = node.do(lambda: node.handle.create_publisher(String, "chatter", 10))
for number in (1, 2):
    end = time.monotonic() + 30
    while len(errors) < number and time.monotonic() < end:
        node.do(lambda: publisher.publish(String(data="odd")))
        time.sleep(0.05)
assert [str(each) for each in errors[:2]] == ["odd", "odd"], errors
assert node.do(lambda: 42) == 42
node.close()
"""


@pytest.mark.parametrize("threads", ["1", "3"])
def test_a_node_outlives_what_fails_in_its_executor(ros: Domain, threads: str) -> None:
    (ros.folder / "spinning.py").write_text(SPINNING)
    done = subprocess.run(
        [str(PYTHON), "spinning.py", threads],
        env=ros.environment(),
        cwd=ros.folder,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
