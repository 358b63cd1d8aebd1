"""Prompts, plans and generic actions in a world."""

from __future__ import annotations

import pytest

from gpsfsm.execution.records import Status
from gpsfsm.simulation.world import Answer, Settings, Window
from tests.simulation.support import LIBRARY, field_of, plan, run, runner

NAME = Answer("PromptSpeechRunner", ("greet", "Ada"), "Hello Ada.")
PLAN = Answer("PromptPlanRunner", ("go home",), "<Plan/>")


class Queue:
    def __init__(self, findings=()):
        self.plans = []
        self._findings = findings

    def submit(self, text, name=""):
        self.plans.append(text)
        return len(self.plans)

    def status(self, plan):
        return "REFUSED" if self._findings else "QUEUED"

    def findings(self, plan):
        return self._findings


def test_the_answer_is_about_all_that_is_in_the_buffer():
    text = plan(
        runner("PromptText", text="This is Ada.", uuid="a"),
        runner("PromptText", text="This is Ben.", uuid="b"),
        runner("PromptSpeech", task="greet them", uuid="a", flush="true"),
    )
    ran = run(text, field_of(answers=(NAME,)))
    assert ran.outputs[0] == {"response": "", "buffered": True, "success": False}
    assert ran.outputs[2] == {"text": "Hello Ada."}


def test_buffers_are_apart_and_are_not_emptied():
    text = plan(
        runner("PromptText", text="one", uuid="a"),
        runner("PromptText", text="other", uuid="b"),
        runner("PromptSpeech", task="t", uuid="a", flush="true"),
        runner("Wait", seconds="1.0"),  # else the answer would be the text of the next step
        runner("PromptText", text="two", uuid="a"),
        runner("PromptSpeech", task="t", uuid="a", flush="true"),
    )
    ran = run(text, field_of())
    assert ran.outputs[2] == {"text": "one"}
    assert ran.outputs[5] == {"text": "one two"}


def test_without_a_uuid_nothing_is_kept_for_anybody():
    text = plan(
        runner("PromptText", text="lost"),
        runner("PromptSpeech", task="just this", flush="true"),
    )
    assert run(text, field_of()).outputs[1] == {"text": "just this"}


def test_filling_never_fails_and_asking_may():
    world = field_of(settings={"PromptTextRunner": Settings(fails=1.0)})
    assert run(plan(runner("PromptText", text="a", uuid="u")), world).status is Status.COMPLETED
    ran = run(plan(runner("PromptText", text="a", uuid="u", flush="true")), world)
    assert ran.status is Status.GAVE_UP


def test_a_flush_that_fails_by_the_file():
    refused = Answer("prompt_capabilities/PromptTextRunner", fails="the model is away")
    ran = run(plan(runner("PromptText", text="a", flush="true")), field_of(answers=(refused,)))
    assert ran.messages[0] == "the model is away"


def test_pose_map_and_capabilities_go_into_the_buffer():
    text = plan(
        runner("RobotPose"),
        runner("PromptPose", uuid="u"),
        runner("OccupancyGrid"),
        runner("PromptOccupancy", uuid="u"),
        runner("GetCapabilitySpecs"),
        runner("PromptCapability", uuid="u"),
    )
    ran = run(text, field_of())
    pose, grid, specs = ran.world.prompts.kept("u")
    assert "x 0.0, y 0.0" in pose
    assert "width=34 height=34 resolution=0.3" in grid
    assert "nav2_capabilities/WaypointRunner" in specs
    assert len(ran.outputs[4]["CapabilitySpecs"]) == len(LIBRARY.interface_names)


def test_a_plan_is_written_checked_and_queued():
    queue = Queue()
    text = plan(runner("PromptPlan", task="go home", flush="true"), runner("FabricSetPlan"))
    ran = run(text, field_of(answers=(PLAN,)), plans=queue)
    assert ran.status is Status.COMPLETED
    assert queue.plans == ["<Plan/>"]


def test_a_plan_that_is_refused_is_a_failure():
    queue = Queue(findings=("line 1: a mistake",))
    text = plan(runner("PromptPlan", task="go home", flush="true"), runner("FabricSetPlan"))
    ran = run(text, field_of(answers=(PLAN,)), plans=queue)
    assert ran.messages[1] == "the plan was refused: line 1: a mistake"


@pytest.mark.parametrize(
    ("flush", "services", "message"),
    [
        ("true", {}, "no plan queue"),
        ("false", {"plans": Queue()}, "no plan was handed over"),
    ],
)
def test_plans_that_cannot_be_queued(flush, services, message):
    text = plan(
        runner("PromptPlan", task="go home", flush=flush, uuid="u"), runner("FabricSetPlan")
    )
    ran = run(text, field_of(answers=(PLAN,)), **services)
    assert ran.status is Status.GAVE_UP
    assert message in ran.messages[1]


def test_no_plan_is_made_up():
    ran = run(plan(runner("PromptPlan", task="dance", flush="true")), field_of(answers=(PLAN,)))
    assert "no answer" in ran.messages[0]


def test_generating_a_plan_asks_and_queues_in_one_step():
    queue = Queue()
    answers = (Answer("FabricGeneratePlanRunner", ("go home", "be quick"), "<Plan/>"),)
    text = plan(
        runner("PromptText", text="be quick", uuid="u"),
        runner("FabricGeneratePlan", task="go home", uuid="u", flush="true"),
    )
    assert run(text, field_of(answers=answers), plans=queue).status is Status.COMPLETED
    assert queue.plans == ["<Plan/>"]
    filling = plan(runner("FabricGeneratePlan", task="go home", uuid="u"))
    assert run(filling, field_of(), plans=queue).status is Status.COMPLETED
    assert queue.plans == ["<Plan/>"]


GENERIC = (
    Answer("HttpRunner", ("GET http://a/",), "hello"),
    Answer("HttpRunner", ("POST http://a/", "x=1"), "made", outputs={"status_code": 201}),
    Answer("HttpRunner", ("http://b/",), outputs={"status_code": 500}),
    Answer("ProcessRunner", ("uptime",), "3 days"),
    Answer("ProcessRunner", ("false",), outputs={"exit_code": 1, "stderr": "no"}),
    Answer("PythonRunner", ("robot:double 4",), "8"),
    Answer("PythonRunner", ("robot:early",), "yes", window=Window(0.0, 0.001)),
)


@pytest.mark.parametrize(
    ("step", "outputs"),
    [
        (runner("Http", url="http://a/"), {"response_body": "hello", "status_code": 200}),
        (
            runner("Http", url="http://a/", method="POST", body="x=1", expect_status=201),
            {"response_body": "made", "status_code": 201},
        ),
        (
            runner("Process", command="uptime -p"),
            {"stdout": "3 days", "stderr": "", "exit_code": 0},
        ),
        (runner("Python", function="robot:double", argument="4"), {"result": "8"}),
    ],
)
def test_generic_runners_answer_as_the_file_says(step, outputs):
    ran = run(plan(step), field_of(answers=GENERIC))
    assert ran.status is Status.COMPLETED
    assert ran.outputs[0] == outputs


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (runner("Http", url="http://c/"), "nothing answers at http://c/"),
        (runner("Http", url="http://b/"), "the status is 500"),
        (runner("Http", url="http://a/", expect_status=404), "the status is 200"),
        (runner("Process", command="false"), "the exit code is 1"),
        (runner("Process", command="rm"), "no program"),
        (runner("Python", function="a:b"), "no function"),
        (runner("Python", function="robot:early"), "no function"),
    ],
)
def test_generic_runners_fail_as_the_file_says(step, message):
    ran = run(plan(step), field_of(answers=GENERIC))
    assert ran.status is Status.GAVE_UP
    assert message in ran.messages[0]


def test_an_answer_that_fails_can_hand_outputs_over():
    gone = Answer("HttpRunner", outputs={"status_code": 410}, fails="gone")
    ran = run(plan(runner("Http", url="http://a/")), field_of(answers=(gone,)))
    assert (ran.messages[0], ran.outputs[0]) == ("gone", {"status_code": 410})


def test_failure_outputs_are_handed_over():
    ran = run(plan(runner("Process", command="false")), field_of(answers=GENERIC))
    assert ran.outputs[0] == {"stderr": "no", "exit_code": 1}


def test_a_timeout_ends_an_action():
    world = field_of(answers=GENERIC, settings={"HttpRunner": Settings(duration_s=(60.0, 60.0))})
    ran = run(plan(runner("Http", url="http://a/", timeout_s="2.5")), world)
    assert ran.messages[0] == "it was not done after 2.5 seconds"
    assert ran.seconds == pytest.approx(2.5, abs=0.01)


def test_waiting_logging_and_completing():
    text = plan(
        runner("Wait", seconds="36000.0"),
        runner("Log", text="ten hours", level="warning"),
        runner("FabricCompletion", plan_id="7"),
        runner("Wait", seconds="0.0"),
    )
    ran = run(text, field_of())
    assert ran.status is Status.COMPLETED
    assert [text for _, _, text in ran.driver.logs] == [
        "warning: ten hours",
        "the plan 7 is complete",
    ]
    assert ran.seconds == pytest.approx(36000, abs=0.01)
