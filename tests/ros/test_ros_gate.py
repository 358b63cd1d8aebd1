"""``gpsfsm ros gate`` between clients and fake Fabric servers, all in processes of their own."""

from __future__ import annotations

import json
import os
import signal
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.ros.support import PATIENCE
from tests.ros.test_dispatch import GO, PLAN, REJECTED, V2, waypoint

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Iterator

    from tests.ros.support import Domain, Program

PRIVATE = "/gpsfsm_private/fabric"
SUBMIT = {
    "2": ("/fabric/set_plan", "fabric_msgs/srv/SetFabricPlan"),
    "3": ("/fabric/plan/submit", "fabric_msgs/srv/SubmitFabricPlan"),
}
STATUS = {"2": "/fabric/get_plan_status", "3": "/fabric/plan/get_status"}
CANCEL = {"2": "/fabric/cancel_plan", "3": "/fabric/plan/cancel"}
COMPLETE = {"2": "/fabric/set_completion", "3": "/fabric/plan/set_completion"}
GENERATE = ("/fabric/plan/generate", "fabric_msgs/action/GeneratePlan")
CRITIQUE = {
    "2": ("/gpsfsm_gate/critique", "fabric_msgs/srv/SetFabricPlan"),
    "3": ("/gpsfsm_gate/critique", "fabric_msgs/srv/ParsePlan"),
}
HOSTILE = {
    "2 MB": "<Plan>" + waypoint("1.0") * 20_000 + "</Plan>",
    "12 MB": "<Plan>" + " " * 12_000_000 + "</Plan>",
    "deep": "<Plan>" + '<Control type="sequential">' * 50_000,
    "entities": '<!DOCTYPE p [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><Plan>&b;</Plan>',
    "external": '<!DOCTYPE p SYSTEM "file:///etc/passwd"><Plan/>',
    "control": "<Plan>\x1b[31m\x01</Plan>",
    "no plan": "Sure! Here is your plan.",
    "empty": "",
    "another root": "<Foo/>",
    "machine": '{"name": "m", "states": []}',
}
both = pytest.mark.parametrize(
    ("ros", "version"), [(V2, "2"), ({}, "3")], indirect=["ros"], ids=["V2", "V3"]
)


def private_server(ros: Domain, version: str, *arguments: str) -> Program:
    return ros.server("fabric", "--version", version, "--prefix", PRIVATE, *arguments)


@contextmanager
def gate(ros: Domain, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """The gate, when it is ready."""
    with ros.running("ros", "gate", *arguments) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("ready: /fabric is gated"), line + process.communicate()[1]
        yield process
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=PATIENCE)
            assert process.returncode == 0, err


class Client:
    """A client of the public names, which knows nothing of a gate."""

    def __init__(self, ros: Domain, version: str) -> None:
        self.client, self.version = ros.client(), version

    def submit(self, plan: str, seconds: float = 30) -> dict[str, Any] | None:
        return self.client.call(*SUBMIT[self.version], timeout=seconds, plan=plan)

    def critique(self, plan: str) -> dict[str, Any]:
        answer = self.client.call(*CRITIQUE[self.version], timeout=PATIENCE, plan=plan)
        assert answer is not None
        return answer

    def plan(self, name: str, short: str, plan_id: str) -> dict[str, Any]:
        answer = self.client.call(
            name, f"fabric_msgs/srv/{short}", timeout=PATIENCE, plan_id=plan_id
        )
        assert answer is not None
        return answer


@both
def test_what_is_accepted_is_passed_on_and_nothing_else(ros: Domain, version: str) -> None:
    server = private_server(ros, version)
    server.command("next", outcome="HANG")
    with gate(ros, "--receipts", "decisions.jsonl"):
        client = Client(ros, version)
        rejected = client.submit(REJECTED)
        assert rejected is not None
        assert rejected["plan_id"] == ""
        assert rejected["error"].startswith("rejected by the gate: 3 findings of level error")
        assert "GP107 at line 2: " in rejected["error"]
        accepted = client.submit(PLAN)
        assert accepted is not None
        submitted = server.wait_for("submitted")
        assert (submitted["plan_id"], submitted["plan"]) == (accepted["plan_id"], PLAN)
        assert len(server.journal("submitted")) == 1
        plan_id = accepted["plan_id"]
        server.wait_for("status", status="RUNNING")
        assert client.plan(STATUS[version], "GetPlanStatus", plan_id)["status"]["code"] == 12
        client.plan(COMPLETE[version], "CompleteFabric", plan_id)
        server.wait_for("status", status="COMPLETED")
        assert client.plan(CANCEL[version], "CancelFabricPlan", plan_id)["success"]
        assert server.wait_for("cancel")["plan_id"] == plan_id
    lines = (ros.folder / "decisions.jsonl").read_text().splitlines()
    decisions = [json.loads(line) for line in lines]
    assert [each["decision"] for each in decisions] == ["rejected", "accepted"]
    assert [each["verdict"] for each in decisions] == ["rejected", "accepted"]


def test_hostile_texts_are_rejected_and_the_gate_goes_on(ros: Domain) -> None:
    server = private_server(ros, "3")
    with gate(ros):
        client = Client(ros, "3")
        for name, text in HOSTILE.items():
            answer = client.submit(text)
            assert answer is not None, name
            assert answer["plan_id"] == "", name
            assert answer["error"].startswith("rejected by the gate: "), name
            assert len(answer["error"]) < 10_000, name
        parsed = client.client.call(
            "/fabric/plan/parse", "fabric_msgs/srv/ParsePlan", timeout=PATIENCE, plan="<Foo/>"
        )
        assert parsed is not None
        assert (parsed["success"], parsed["connections"]) == (False, [])
        assert not server.journal("submitted")
        assert not server.journal("parse")
        answer = client.submit(PLAN)
        assert answer is not None
        assert answer["plan_id"]


@both
def test_a_critic_answers_in_the_words_for_language_models(ros: Domain, version: str) -> None:
    server = private_server(ros, version)
    with gate(ros):
        client = Client(ros, version)
        answer = client.critique(REJECTED)
        assert answer["error"].startswith("Your plan was rejected: ")
        assert "GP107" in answer["error"]
        accepted = client.critique(PLAN)
        assert accepted["error"].startswith("The plan is accepted.")
        if version == "3":
            assert (answer["success"], accepted["success"]) == (False, True)
        else:
            assert accepted["plan_id"] == ""
    assert not server.journal("submitted")


def test_a_gate_that_is_killed_lets_nothing_through(ros: Domain) -> None:
    server = private_server(ros, "3")
    with gate(ros) as process:
        client = Client(ros, "3")
        assert client.submit(PLAN)
        ros.kill(process)
        assert client.submit(PLAN, 2) is None
    assert len(server.journal("submitted")) == 1


def test_a_server_that_is_killed_means_rejections(ros: Domain) -> None:
    server = private_server(ros, "3")
    with gate(ros):
        client = Client(ros, "3")
        ros.kill(server.process)
        answer = client.submit(PLAN)
        assert answer is not None
        assert answer["plan_id"] == ""
        assert "does not answer within" in answer["error"] or "no Fabric server" in answer["error"]
        assert client.plan(STATUS["3"], "GetPlanStatus", "1")["status"]["code"] == 0
        assert not client.plan(CANCEL["3"], "CancelFabricPlan", "1")["success"]


def test_a_checker_that_dies_means_a_rejection(ros: Domain) -> None:
    server = private_server(ros, "3")
    with gate(ros) as process:
        client = Client(ros, "3")
        children = [
            int(child)
            for file in Path(f"/proc/{process.pid}/task").glob("*/children")
            for child in file.read_text().split()
        ]
        assert children
        for child in children:
            os.kill(child, signal.SIGKILL)
        answer = client.submit(PLAN)
        assert answer is not None
        assert answer["plan_id"] == ""
        assert "the process that decided has ended" in answer["error"]
        assert not server.journal("submitted")
        answer = client.submit(PLAN)  # another process decides by now
        assert answer is not None
        assert answer["plan_id"]


def test_a_checker_that_is_too_slow_means_a_rejection(ros: Domain) -> None:
    server = private_server(ros, "3")
    with gate(ros, "--budget-ms", "1"):
        answer = Client(ros, "3").submit(PLAN)
    assert answer is not None
    assert answer["plan_id"] == ""
    assert "the plan is undecided after 1 ms" in answer["error"]
    assert not server.journal("submitted")


def test_receipts_that_cannot_be_written_mean_rejections(ros: Domain) -> None:
    server = private_server(ros, "3")
    with gate(ros, "--receipts", "/dev/full"):
        answer = Client(ros, "3").submit(PLAN)
    assert answer is not None
    assert answer["plan_id"] == ""
    assert "the gate could not decide: cannot write /dev/full: " in answer["error"]
    assert not server.journal("submitted")


def test_it_does_not_start_without_the_private_server(ros: Domain) -> None:
    done = ros.gpsfsm("ros", "gate", "--wait", "0.5")
    assert done.returncode == 2
    assert "no Fabric server offers /gpsfsm_private/fabric/set_plan (V2)" in done.stderr


def test_the_public_names_themselves_are_no_private_ones(ros: Domain) -> None:
    for name in ("", "/", "a b", "/1"):
        done = ros.gpsfsm("ros", "gate", "--private", name)
        assert done.returncode == 2
        assert f"{name!r} is not a valid ROS 2 name" in done.stderr


@pytest.mark.parametrize("public", ["2", "3"])
def test_it_does_not_start_beside_a_public_server(ros: Domain, public: str) -> None:
    private_server(ros, "3")
    ros.server("fabric", "--version", public, variants=("fabric-v2",) if public == "2" else ())
    done = ros.gpsfsm("ros", "gate")
    assert done.returncode == 2
    assert f"another server offers {SUBMIT[public][0]}: plans could get past" in done.stderr


def test_it_does_not_start_beside_a_public_action_that_queues_plans(ros: Domain) -> None:
    private_server(ros, "3", "--action-prefix", "/fabric")
    done = ros.gpsfsm("ros", "gate")
    assert done.returncode == 2
    assert f"another server offers {GENERATE[0]}/_action/send_goal" in done.stderr


def test_plans_that_wait_for_a_slow_server_are_answered(ros: Domain) -> None:
    """They must not take the threads in which the answers of the server arrive."""
    server = private_server(ros, "3")
    with gate(ros):
        client = Client(ros, "3")
        assert client.submit(PLAN)
        other = Client(ros, "3")
        other.plan(STATUS["3"], "GetPlanStatus", "1")
        server.command("answer_after", seconds=3)
        client.client.send_calls(*SUBMIT["3"], [{"plan": PLAN}] * 20)
        server.wait_for("asked", count=4)
        assert other.plan(CANCEL["3"], "CancelFabricPlan", "1") is not None
        assert server.wait_for("cancel")
        assert len(server.journal("submitted")) == 1  # the others still wait meanwhile
        answers = client.client.answers(2)
    assert all(answers)
    taken = [each["plan_id"] for each in answers if each["plan_id"]]
    submitted = [row["plan_id"] for row in server.journal("submitted")[1:]]
    assert taken
    assert sorted(taken) == sorted(submitted)
    assert {each["error"] for each in answers if not each["plan_id"]} == {
        "rejected by the gate: the gate is busy; try again later"
    }


def test_a_public_server_that_appears_later_closes_the_gate(ros: Domain) -> None:
    server = private_server(ros, "3")
    with gate(ros):
        client = ros.client()
        second = ros.server("fabric", "--version", "3")
        private = ("/gpsfsm_gate/critique", "fabric_msgs/srv/ParsePlan")
        assert client.call(*private, timeout=PATIENCE, plan=PLAN)  # the client sees the gate by now
        for _ in range(10):  # whoever of the two is asked
            answer = client.call(*SUBMIT["3"], timeout=PATIENCE, plan=PLAN)
            assert answer is not None
            if not answer["plan_id"]:
                assert "another server offers /fabric/plan/submit as well" in answer["error"]
    assert not server.journal("submitted")
    assert second.journal("ready")


def test_generated_plans_are_gated_before_they_are_queued(ros: Domain) -> None:
    server = private_server(ros, "3")
    server.command("generate", plan=PLAN, reasoning="because")
    server.command("generate", plan=REJECTED, reasoning="because")
    server.command("generate", plan=REJECTED, reasoning="because")
    with gate(ros):
        client = ros.client()
        results = []
        for auto_queue in (True, True, False):
            goal = client.send_goal(*GENERATE, {"task": "look around", "auto_queue": auto_queue})
            results.append(client.result(goal))
    queued, refused, unqueued = results
    assert queued["status"] == "STATUS_SUCCEEDED"
    assert queued["result"]["plan_id"] == server.wait_for("submitted")["plan_id"]
    assert refused["status"] == "STATUS_ABORTED"
    assert refused["result"]["plan_id"] == ""
    assert refused["result"]["reasoning"].startswith("rejected by the gate: ")
    assert unqueued["status"] == "STATUS_SUCCEEDED"  # who wants it to run has to submit it
    assert (unqueued["result"]["plan"], unqueued["result"]["plan_id"]) == (REJECTED, "")
    assert [row["auto_queue"] for row in server.journal("generate")] == [False] * 3
    assert len(server.journal("submitted")) == 1


@both
def test_a_plan_is_dispatched_through_the_gate(ros: Domain, version: str) -> None:
    server = private_server(ros, version)
    (ros.folder / "plan.xml").write_text(PLAN)
    with gate(ros):
        done = ros.gpsfsm("dispatch", "plan.xml")
    assert done.returncode == 0, done.stdout + done.stderr
    assert server.wait_for("submitted")["plan"] == PLAN


def test_runners_of_unknown_robots_are_rejected(ros: Domain) -> None:
    private_server(ros, "3")
    (ros.folder / "robot.yaml").write_text(
        "name: speaker\nrunners: [perception_capabilities/SpeechRunner]\n"
    )
    with gate(ros, "--robot", "robot.yaml"):
        answer = Client(ros, "3").submit(PLAN)
    assert answer is not None
    assert answer["plan_id"] == ""
    assert GO.rpartition("/")[2] in answer["error"]
