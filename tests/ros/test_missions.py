"""Whole missions on a robot: navigation, perception and prompts of the stack, each a server."""

from __future__ import annotations

import json
import re
import time
from typing import TYPE_CHECKING, Any

import pytest

from tests.ros.support import PATIENCE, REPO

if TYPE_CHECKING:
    import subprocess

    from tests.ros.support import Domain

MISSIONS = REPO / "corpus" / "missions"
MODEL = ("--model", "prompt-tools")


def finish(ros: Domain, name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    ended = ros.gpsfsm("run", "--real", MISSIONS / f"{name}.xml", *arguments)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "COMPLETED" in ended.stdout
    return ended


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_navigation(ros: Domain, number: int) -> None:
    server = ros.server("nav2", "--speed", "50")
    finish(ros, f"navigation_{number}")
    assert server.journal("goal")
    assert {row["status"] for row in server.journal("result")} == {"succeeded"}


def test_navigation_takes_the_other_place_where_one_cannot_be_reached(ros: Domain) -> None:
    server = ros.server("nav2", "--speed", "50")
    server.command("next", outcome="abort")
    server.command("next", outcome="succeed")
    server.command("next", outcome="reject")
    finish(ros, "navigation_5")
    places = [tuple(row["poses"][0][:2]) for row in server.journal("goal")]
    assert places == [(2.0, -0.5), (0.0, 2.0), (0.0, 2.0), (-3.0, -1.0), (0.0, -2.0)]


def stack(ros: Domain, package: str = "fp_perception_msgs") -> tuple[Any, Any, Any]:
    navigation = ros.server("nav2", "--speed", "50")
    perception = ros.server("perception", "--package", package)
    return navigation, perception, ros.server("prompt")


def requests(perception: Any, service: str) -> list[dict[str, Any]]:
    return [row["request"] for row in perception.journal("request", service=service)]


@pytest.mark.parametrize("package", ["fp_perception_msgs", "perception_msgs"])
def test_describe_view(ros: Domain, package: str) -> None:
    _, perception, prompt = stack(ros, package)
    prompt.command("answer", response="I see a cup.", success=True)
    finish(ros, "describe_view", *MODEL)
    (request,) = requests(perception, "image_analysis")
    assert (request["prompt"], request["use_device_vision"]) == (
        "What is in front of the robot?",
        True,
    )
    (spoken,) = requests(perception, "speech")
    assert spoken["input"]["text"] == "I see a cup."
    (sent,) = prompt.journal("request")
    assert "a table with a cup" in sent["request"]["prompt"]["prompt"]


@pytest.mark.parametrize("package", ["fp_perception_msgs", "perception_msgs"])
def test_bring_back_name(ros: Domain, package: str) -> None:
    navigation, perception, prompt = stack(ros, package)
    perception.command("answer", service="transcription", transcription="I am Ada.", success=True)
    prompt.command("answer", response="It is Ada.", success=True)
    finish(ros, "bring_back_name", *MODEL)
    window = "audio_request_window" if package == "fp_perception_msgs" else "device_buffer_time"
    assert requests(perception, "transcription")[0][window] == 8
    assert "I am Ada." in prompt.journal("request")[0]["request"]["prompt"]["prompt"]
    assert [each["input"]["text"] for each in requests(perception, "speech")] == [
        "Hello! May I ask for your name?",
        "It is Ada.",
    ]
    assert [row["poses"][0][:2] for row in navigation.journal("goal")] == [[5.0, 2.0], [0.0, 0.0]]


@pytest.mark.parametrize(("answer", "place"), [("yes", [0.0, 0.0]), ("no", [-3.0, -2.0])])
def test_look_for_person(ros: Domain, answer: str, place: list[float]) -> None:
    navigation, perception, prompt = stack(ros)
    perception.command("answer", service="image_analysis", response="a room, perhaps a person")
    prompt.command("answer", response=answer, success=True)
    finish(ros, "look_for_person", *MODEL)
    assert requests(perception, "image_analysis")[0]["prompt"] == "Is there a person?"
    assert [row["poses"][0][:2] for row in navigation.journal("goal")] == [[5.0, 2.0], place]


@pytest.mark.parametrize("package", ["fp_perception_msgs", "perception_msgs"])
def test_a_mood_is_judged(ros: Domain, package: str) -> None:
    perception = ros.server("perception", "--package", package)
    name = "perception_capabilities/SentimentRunner"
    plan = ros.folder / "mood.xml"
    plan.write_text(
        f'<Plan>\n<Runner interface="{name}" provider="{name}" text="good"/>\n</Plan>\n'
    )
    ended = ros.gpsfsm("run", "--real", plan, "--format", "json")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    (request,) = requests(perception, "sentiment_analysis")
    assert (request["text"], request["use_device_audio"]) == ("good", True)
    rows = [json.loads(line) for line in ended.stdout.splitlines()]
    (outputs,) = [row["data"] for row in rows if row.get("kind") == "SUCCEEDED"]
    assert (outputs["text"], outputs["score"]) == ("POSITIVE", 0.75)
    assert ("analyzed_text" in outputs) is (package == "fp_perception_msgs")


def test_a_service_that_says_it_failed_has_failed(ros: Domain) -> None:
    _, perception, _ = stack(ros)
    perception.command("answer", service="speech", success=False)
    ended = ros.gpsfsm("run", "--real", MISSIONS / "bring_back_name.xml", *MODEL)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    assert "the service perception/speech answers success=False" in ended.stdout


def test_a_service_that_does_not_answer_has_failed_in_time(ros: Domain) -> None:
    _, perception, _ = stack(ros)
    perception.command("hang", service="speech")
    ended = ros.gpsfsm("run", "--real", MISSIONS / "bring_back_name.xml", *MODEL, "--timeout", "2")
    assert ended.returncode == 1, ended.stdout + ended.stderr
    assert "SpeechRunner" in ended.stdout
    assert "its time is over" in ended.stdout


@pytest.mark.parametrize("ros", [{"lease": 3}], indirect=True)
def test_a_service_whose_server_was_killed_has_failed(ros: Domain) -> None:
    _, perception, _ = stack(ros)
    perception.command("hang", service="speech")
    with ros.running("run", "--real", MISSIONS / "bring_back_name.xml", *MODEL) as process:
        perception.wait_for("request", service="speech")
        ros.kill(perception.process)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1, out + err
    assert "the server of /perception/speech has gone, and the answer with it" in out


@pytest.mark.parametrize(
    ("response", "why"),
    [
        ({"response": "", "success": True}, "the answer is empty"),
        ({"response": "no key", "success": False}, "the server says that it failed: no key"),
    ],
)
def test_a_prompt_server_that_has_no_answer(
    ros: Domain, response: dict[str, Any], why: str
) -> None:
    _, _, prompt = stack(ros)
    for _ in range(5):
        prompt.command("answer", **response)
    ended = ros.gpsfsm("run", "--real", MISSIONS / "describe_view.xml", *MODEL)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    assert why in ended.stdout


def test_a_plan_is_written_by_the_prompt_server(ros: Domain) -> None:
    prompt = ros.server("prompt")
    plan = (
        '<Plan><Runner interface="nav2_capabilities/WaypointRunner" '
        'provider="nav2_capabilities/WaypointRunner" x="1.0" y="2.0"/></Plan>'
    )
    prompt.command("answer", response=plan, success=True)
    written = ros.gpsfsm("generate", "go to (1, 2)", "--model", "prompt-tools:openai")
    assert written.returncode == 0, written.stdout + written.stderr
    assert 'x="1.0"' in written.stdout
    (sent,) = prompt.journal("request")
    assert sent["request"]["prompt"]["model_family"] == "openai"
    assert sent["request"]["prompt"]["use_cache"] is False


def test_the_state_of_a_run_is_published(ros: Domain) -> None:
    client = ros.client()
    server = ros.server("nav2", "--speed", "0.5")
    with ros.running("run", "--real", MISSIONS / "navigation_1.xml") as process:
        server.wait_for("goal")
        state = json.loads(client.message("/gpsfsm/state", "std_msgs/msg/String")["data"])
        status = client.message("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")["status"][0]
        process.terminate()
        process.wait(30)
    assert state["status"] == "RUNNING"
    (active,) = state["active"]
    assert active["interface"] == "nav2_capabilities/WaypointRunner"
    assert status["name"] == "gpsfsm: plan"
    assert status["message"].startswith("RUNNING")


def test_the_lines_of_a_run_are_on_rosout(ros: Domain) -> None:
    client, server = ros.client(), ros.server("nav2", "--speed", "50")
    server.command("next", outcome="abort")
    client.program.command("rosout")
    ended = finish(ros, "navigation_5")
    end = client.program.wait_for("line", text="the run has ended: COMPLETED")
    lines = [row for row in client.program.journal("line") if row["name"] == end["name"]]
    assert {row["file"] for row in lines} == {str(MISSIONS / "navigation_5.xml")}
    assert [row["text"] for row in lines if row["level"] != 20] == [
        each.partition(" s  ")[2] for each in ended.stdout.splitlines() if " failed" in each
    ][:1]
    assert lines[0]["text"] == "the run begins"
    assert sum(row["text"].endswith(" started") for row in lines) == len(server.journal("goal"))
    assert "the run" not in ended.stderr


def test_two_runs_are_two_nodes(ros: Domain) -> None:
    client, server = ros.client(), ros.server("nav2", "--speed", "0.5")
    mission = MISSIONS / "navigation_1.xml"
    named = ("--ros-args", "-r", "__node:=driver")
    with ros.running("run", "--real", mission), ros.running("run", "--real", mission, *named):
        server.wait_for("goal", count=2)
        end, wanted = time.monotonic() + PATIENCE, re.compile(r"driver .*gpsfsm_[0-9a-f]{6}\b")
        while not wanted.search(" ".join(sorted(client.nodes()))):
            assert time.monotonic() < end, client.nodes()
            time.sleep(0.2)
