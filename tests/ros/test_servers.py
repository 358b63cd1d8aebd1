"""The fake servers do what they say, seen by a client on a real ROS 2."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from tests.ros.support import Domain

NAVIGATE = ("/navigate_to_pose", "nav2_msgs/action/NavigateToPose")
FOLLOW = ("/follow_waypoints", "nav2_msgs/action/FollowWaypoints")
PLAN = '<Plan><Runner interface="a" provider="p"/><Runner interface="b" provider="q"/></Plan>'
WALK = [
    "PARSING",
    "VALIDATING",
    "BONDING",
    "CAPABILITY_STARTING",
    "CAPABILITY_CONNECTING",
    "RUNNING",
    "COMPLETED",
]
HUMBLE = pytest.mark.parametrize("ros", [{"variants": ("humble",)}], indirect=True)
FABRIC_V2 = pytest.mark.parametrize("ros", [{"variants": ("fabric-v2",)}], indirect=True)


def pose(x: float, y: float = 0.0) -> dict[str, Any]:
    return {
        "header": {"frame_id": "map"},
        "pose": {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}},
    }


def test_a_robot_drives_to_its_goal_and_says_where_it_is(ros: Domain) -> None:
    server, client = ros.server("nav2", "--tf", "chain", "--map"), ros.client()
    goal = client.send_goal(*NAVIGATE, {"pose": pose(0.4, 0.3)})
    assert client.result(goal) == {
        "event": "result",
        "goal": goal,
        "status": "STATUS_SUCCEEDED",
        "result": {"error_code": 0, "error_msg": ""},
    }
    assert server.wait_for("goal", id=goal) == {
        "event": "goal",
        "action": "navigate_to_pose",
        "id": goal,
        "instead_of": None,
        "poses": [[0.4, 0.3, 0.0]],
        "frames": ["map"],
        "behavior_tree": "",
    }
    # the first messages may be lost: they are sent before the server has seen the client
    client.program.wait_for("feedback", goal=goal)
    left = [each["distance_remaining"] for each in client.feedback(goal)]
    assert left == sorted(left, reverse=True)
    assert all(0 <= each <= 0.5 for each in left)
    transforms = client.message("/tf", "tf2_msgs/msg/TFMessage")["transforms"]
    assert [each["child_frame_id"] for each in transforms] == ["odom", "base_link"]
    place = transforms[1]["transform"]["translation"]
    assert (place["x"], place["y"]) == (0.4, 0.3)
    grid = client.message("/map", "nav_msgs/msg/OccupancyGrid")
    assert (grid["info"]["width"], grid["data"][-2:]) == (4, [100, -1])


def test_a_goal_is_rejected_aborted_and_preempted(ros: Domain) -> None:
    server, client = ros.server("nav2"), ros.client()
    server.command("next", outcome="reject")
    assert client.send_goal(*NAVIGATE, {"pose": pose(1.0)}) == ""
    assert server.wait_for("rejected")["poses"] == [[1.0, 0.0, 0.0]]

    server.command("drive", speed=None)
    server.command("next", outcome="abort", error_code=9003, error_msg="too late")
    aborted = client.result(client.send_goal(*NAVIGATE, {"pose": pose(1.0)}))
    assert aborted["status"] == "STATUS_ABORTED"
    assert aborted["result"] == {"error_code": 9003, "error_msg": "too late"}
    transforms = client.message("/tf", "tf2_msgs/msg/TFMessage")["transforms"]
    assert transforms[0]["transform"]["translation"]["x"] == 0.5

    server.command("next", outcome="hang")
    first = client.send_goal(*NAVIGATE, {"pose": pose(2.0)})
    server.wait_for("hangs", id=first)
    second = client.send_goal(*NAVIGATE, {"pose": pose(0.0)})
    assert client.result(first)["status"] == "STATUS_ABORTED"
    assert client.result(second)["status"] == "STATUS_SUCCEEDED"
    assert server.wait_for("goal", id=second)["instead_of"] == first


def test_a_goal_that_hangs_is_cancelled_if_the_server_accepts_that(ros: Domain) -> None:
    server, client = ros.server("nav2", "--ros-args", "-r", "__ns:=/robot"), ros.client()
    server.command("next", outcome="hang")
    server.command("drive", speed=None)
    server.command("cancels", accept=False)
    goal = client.send_goal("/robot" + NAVIGATE[0], NAVIGATE[1], {"pose": pose(1.0)})
    server.wait_for("hangs", id=goal)
    client.cancel(goal)
    assert server.wait_for("cancel", id=goal)["accepted"] is False
    assert not client.program.journal("result")
    server.command("cancels", accept=True)
    assert client.cancel(goal) == 0
    assert client.result(goal)["status"] == "STATUS_CANCELED"
    assert server.wait_for("result", id=goal)["status"] == "canceled"


def test_waypoints_are_followed_and_missed(ros: Domain) -> None:
    server, client = ros.server("nav2", "--tf", "odom"), ros.client()
    server.command("miss", waypoints=[1])
    goal = client.send_goal(*FOLLOW, {"poses": [pose(1.0), pose(2.0), pose(3.0)]})
    result = client.result(goal)["result"]
    assert [each["waypoint_index"] for each in result["missed_waypoints"]] == [1]
    assert result["missed_waypoints"][0]["error_code"] == 9002
    client.program.wait_for("feedback", goal=goal, feedback={"current_waypoint": 2})
    numbers = [each["current_waypoint"] for each in client.feedback(goal)]
    assert numbers == sorted(numbers)
    transforms = client.message("/tf", "tf2_msgs/msg/TFMessage")["transforms"]
    assert [each["header"]["frame_id"] for each in transforms] == ["odom"]


@HUMBLE
def test_nav2_of_humble_has_no_error_codes(ros: Domain) -> None:
    server, client = ros.server("nav2"), ros.client()
    server.command("drive", speed=None)
    server.command("miss", waypoints=[0])
    server.command("next", outcome="abort")
    aborted = client.result(client.send_goal(*NAVIGATE, {"pose": pose(1.0)}))
    assert (aborted["status"], aborted["result"]) == ("STATUS_ABORTED", {"result": {}})
    followed = client.result(client.send_goal(*FOLLOW, {"poses": [pose(1.0)]}))
    assert followed["result"] == {"missed_waypoints": [0]}


def test_a_killed_server_comes_back_and_leaves_no_files(ros: Domain) -> None:
    server, client = ros.server("nav2", "--speed", "0.1"), ros.client()
    first = client.send_goal(*NAVIGATE, {"pose": pose(5.0)})
    ros.kill(server.process)
    again = ros.server("nav2", "--speed", "100")
    # the client of before sends to the server of before as long as that has its lease
    second = ros.client().send_goal(*NAVIGATE, {"pose": pose(1.0)})
    again.wait_for("result", id=second, status="succeeded")
    assert not again.journal("goal", id=first)
    assert not client.program.journal("result")


@pytest.mark.parametrize("package", ["fp_perception_msgs", "perception_msgs"])
def test_perception_answers_fails_and_hangs(ros: Domain, package: str) -> None:
    server, client = ros.server("perception", "--package", package), ros.client()
    speech = ("/perception/speech", f"{package}/srv/PerceptionSpeech")
    assert client.call(*speech, input={"text": "hello"})["success"] is True
    server.command("answer", service="speech", success=False)
    assert client.call(*speech, input={"text": "hello"})["success"] is False
    text = server.wait_for("request", service="speech")["request"]["input"]["text"]
    assert text == "hello"

    transcription = ("/perception/transcription", f"{package}/srv/PerceptionTranscribe")
    server.command("answer", service="transcription", transcription="stop")
    assert client.call(*transcription)["transcription"] == "stop"
    sentiment = client.call(
        "/perception/sentiment_analysis", f"{package}/srv/PerceptionSentiment", text="well"
    )
    assert ("analyzed_text" in sentiment) is (package == "fp_perception_msgs")
    assert sentiment["score"] == 0.75

    server.command("hang", service="image_analysis")
    image = ("/perception/image_analysis", f"{package}/srv/PerceptionImageAnalysis")
    assert client.call(*image, timeout=0.2, prompt="cups?") is None
    assert client.call(*image, prompt="cups?")["response"] == "a table with a cup"


def test_prompts_are_kept_until_they_are_flushed(ros: Domain) -> None:
    server, client = ros.server("prompt"), ros.client()

    def prompt(text: str, uuid: str = "", **fields: Any) -> Any:
        request = {"prompt": text, **fields}
        return client.call("/prompt/prompt", "prompt_msgs/srv/Prompt", uuid=uuid, prompt=request)

    server.command("answer", response="four")
    assert prompt("2 + 2?")["response"]["response"] == "four"
    first = prompt("a", use_cache=True)
    assert first["uuid"]
    assert (first["response"]["buffered"], first["response"]["success"]) == (True, False)
    assert prompt("b", first["uuid"], use_cache=True)["uuid"] == first["uuid"]
    flushed = prompt("c", first["uuid"], use_cache=True, flush_cache=True)
    assert (flushed["uuid"], flushed["response"]["success"]) == ("", True)
    assert prompt("d", "unknown", use_cache=True, flush_cache=True)["uuid"] == ""
    server.wait_for("model", count=3)
    texts = [row["texts"] for row in server.journal("model")]
    assert texts == [["2 + 2?"], ["a b", "c"], ["d"]]


class FabricClient:
    """Requests to the Fabric server of a version."""

    def __init__(self, ros: Domain, version: int, *options: str) -> None:
        self.version = version
        self.server = ros.server("fabric", "--version", str(version), *options)
        self.client = ros.client()

    def call(self, old: str, new: str, short: str, **request: Any) -> Any:
        name = old if self.version == 2 else new
        return self.client.call(f"/fabric/{name}", f"fabric_msgs/srv/{short}", **request)

    def submit(self, plan: str = PLAN, **request: Any) -> str:
        short = "SetFabricPlan" if self.version == 2 else "SubmitFabricPlan"
        return self.call("set_plan", "plan/submit", short, plan=plan, **request)["plan_id"]

    def status(self, plan: str) -> tuple[int, list[str]]:
        response = self.call("get_plan_status", "plan/get_status", "GetPlanStatus", plan_id=plan)
        return response["status"]["code"], response["rejected_list"]

    def cancel(self, plan: str) -> bool:
        response = self.call("cancel_plan", "plan/cancel", "CancelFabricPlan", plan_id=plan)
        return bool(response["success"])

    def reach(self, plan: str, status: str) -> None:
        self.server.wait_for("status", plan_id=plan, status=status)


@FABRIC_V2
def test_fabric_v2_walks_forgets_and_ignores_cancels(ros: Domain) -> None:
    fabric = FabricClient(ros, 2, "--queue-ends")
    fabric.server.command("next", outcome="HANG")
    plan = fabric.submit()
    fabric.reach(plan, "RUNNING")
    assert fabric.cancel(plan) is fabric.cancel("another") is True
    assert fabric.status(plan) == (12, [])
    fabric.server.command("next", outcome="VALIDATION_FAILED", rejected=["a of p"])
    rejected = fabric.submit()
    assert fabric.status(rejected) == (1, [])
    fabric.call("set_completion", "", "CompleteFabric", plan_id=plan)
    fabric.server.wait_for("queue_ended")
    walk = [row["status"] for row in fabric.server.journal("status", plan_id=plan)]
    assert walk == WALK
    assert fabric.status(plan) == (0, [])
    assert fabric.status(rejected) == (5, ["a of p"])
    late = fabric.submit()
    assert fabric.status(late) == (1, [])


def test_fabric_v3_cancels_parses_and_generates(ros: Domain) -> None:
    fabric = FabricClient(ros, 3)
    fabric.server.command("pace", seconds=None)
    plan = fabric.submit(metadata={"graph_hash": "abc"})
    for status in WALK[:3]:
        fabric.server.command("step")
        fabric.reach(plan, status)
    assert fabric.status(plan) == (6, [])
    queued = fabric.submit()
    assert fabric.cancel(queued) is fabric.cancel(plan) is True
    fabric.reach(queued, "CANCELLED")
    fabric.reach(plan, "CANCELLED")
    assert fabric.status(plan) == (14, [])
    assert fabric.cancel("another") is False
    fabric.server.command("pace", seconds=0)

    broken = fabric.submit("<Plan>")
    fabric.reach(broken, "PARSE_FAILED")
    fabric.server.command("next", outcome="REFUSED", error="no room")
    refused = fabric.call("", "plan/submit", "SubmitFabricPlan", plan=PLAN)
    assert (refused["plan_id"], refused["error"]) == ("", "no room")

    parsed = fabric.call("", "plan/parse", "ParsePlan", plan=PLAN)
    assert [each["source"]["interface"] for each in parsed["connections"]] == ["a", "b"]
    assert parsed["connections"][0]["on_success"]["interface"] == "b"
    assert fabric.call("", "plan/parse", "ParsePlan", plan="<Plan/>")["success"] is False

    fabric.server.command("pace", seconds=0.3)
    fabric.server.command("generate", plan=PLAN, reasoning="both")
    goal = fabric.client.send_goal(
        "/fabric/plan/generate",
        "fabric_msgs/action/GeneratePlan",
        {"task": "do both", "auto_queue": True},
    )
    result = fabric.client.result(goal)["result"]
    assert (result["plan"], result["reasoning"]) == (PLAN, "both")
    fabric.client.program.wait_for("feedback", goal=goal)
    assert {each["status"]["code"] for each in fabric.client.feedback(goal)} <= {15, 16}
    fabric.reach(result["plan_id"], "COMPLETED")


def test_definitions_of_fabric_v2_do_not_match_a_server_of_v3(ros: Domain) -> None:
    ros.server("fabric", "--prefix", "/a/fabric")
    status = ("/a/fabric/plan/get_status", "fabric_msgs/srv/GetPlanStatus")
    assert ros.client().call(*status)["status"]["code"] == 0
    old = ros.client(variants=("fabric-v2",))
    assert old.call(*status, timeout=1.0) is None
    assert status in old.services().items()


def test_yaw_is_where_the_robot_looks(ros: Domain) -> None:
    server, client = ros.server("nav2"), ros.client()
    server.command("place", x=1.0, y=2.0, yaw=math.pi / 2)
    transform = client.message("/tf", "tf2_msgs/msg/TFMessage")["transforms"][0]["transform"]
    assert transform["rotation"]["z"] == pytest.approx(math.sqrt(0.5))


def test_a_process_that_is_killed_without_notice_is_noticed(ros: Domain) -> None:
    ros.kill(ros.server("prompt").process)
    noted, ros.abandoned = ros.abandoned, set()
    with pytest.raises(AssertionError, match="did not leave well"):
        ros.close()
    ros.abandoned = noted


def test_gpsfsm_runs_beside_the_wheels(ros: Domain) -> None:
    # one of the wheels wants another lark, by which assumptions would not be read
    plan = ros.folder / "plan.xml"
    plan.write_text(PLAN)
    done = ros.gpsfsm("check", plan, "--assume", "never fails: a", "--format", "json")
    assert done.stderr == ""
    assert done.returncode in (0, 1)
