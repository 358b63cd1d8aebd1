"""Prompt runners that really ask a model."""

from __future__ import annotations

import asyncio
import threading
import time
from dataclasses import replace

import pytest

from gpsfsm.execution.conformance import check_runner
from gpsfsm.execution.prompts import PromptBuffers
from gpsfsm.execution.records import Kind, Status
from gpsfsm.generation.language_model import Answer, Finish, ModelError
from gpsfsm.generation.loop import Judgement
from gpsfsm.runners import prompting, system
from gpsfsm.runners.prompting import MAX_CELLS, shortened_map
from tests.generation.scripted import Scripted
from tests.runners.acting import act, fails
from tests.runners.prompting import messages, run_real, service
from tests.simulation.support import control, plan, runner

PLAN = "<Plan><Runner/></Plan>"


def test_fragments_and_the_own_text_make_one_prompt() -> None:
    model = Scripted(["Hello Ada and Ben."])
    text = plan(
        runner("PromptText", text="This is Ada.", uuid="a"),
        runner("PromptText", text="Nobody asks for this.", uuid="b"),
        runner("PromptText", text="This is Ben.", uuid="a"),
        runner("PromptText", text="Greet them.", uuid="a", flush="true"),
    )
    ran = run_real(text, model)
    assert ran.kernel.status is Status.COMPLETED
    assert ran.outputs[0] == {"response": "", "buffered": True, "success": False}
    assert ran.outputs[3] == {"response": "Hello Ada and Ben.", "buffered": False, "success": True}
    assert [messages(each) for each in model.requests] == [
        "This is Ada.\nThis is Ben.\nGreet them."
    ]
    assert (model.requests[0].task, model.requests[0].number) == ("Greet them.", 0)
    assert ran.prompts.kept("a") == ("This is Ada.", "This is Ben.")  # it is not emptied
    assert ran.lines == ["asked scripted:test: 0.0 s"]


def test_requests_about_the_same_task_are_numbered() -> None:
    model = Scripted(["one", "two"])
    ask = runner("PromptText", text="Say something.", flush="true")
    ran = run_real(plan(ask, runner("Wait", seconds="0.01"), ask), model)
    assert [each.number for each in model.requests] == [0, 1]
    assert (ran.outputs[0]["response"], ran.outputs[2]["response"]) == ("one", "two")


def test_words_to_say() -> None:
    model = Scripted(['"Good morning!"\x1b[2J\x00\r\n'])
    ran = run_real(plan(runner("PromptSpeech", task="greet them", flush="true")), model)
    assert ran.outputs[0] == {"text": '"Good morning!"[2J'}
    assert "says aloud for this: greet them\n" in messages(model.requests[0])


def test_a_pose_and_the_capabilities_in_words() -> None:
    model, services = Scripted(["I see."]), {"prompts": PromptBuffers()}
    services["model"] = service(model)
    pose = dict.fromkeys(("y", "z", "qx", "qy", "qz"), 0.0) | {"x": 1.5, "qw": 1.0}
    act(prompting.PromptPoseRunner(), services, flush=True, **pose)
    act(prompting.PromptCapabilityRunner(), services, flush="true", CapabilitySpecs=["a", "b"])
    requests = [messages(each) for each in model.requests]
    assert requests[0].startswith("The robot is at this pose: x 1.5, y 0.0, ")
    assert requests[1] == "The robot can do this:\na\nb"


def test_an_arm_and_its_gripper_in_words() -> None:
    model, services = Scripted(["I see."]), {"prompts": PromptBuffers()}
    services["model"] = service(model)
    joints = {"joint_names": ["base", "elbow"], "joint_positions": [0.5, -1.25]}
    hand = {"x": 0.5, "y": 0.0, "z": 1.0, "qw": 1.0, "yaw": 0.25}
    names = {"pose_names": ["home", "up", "odd"], "descriptions": ["folded", "as high as it gets"]}
    act(prompting.PromptNamedPosesRunner(), services, flush=True, **names)
    act(prompting.PromptCurrentJointPoseRunner(), services, flush=True, **joints)
    act(prompting.PromptGripperStateRunner(), services, flush=True, **joints)
    act(prompting.PromptCurrentCartesianPoseRunner(), services, flush=True, **hand)
    assert [messages(each) for each in model.requests] == [
        "The arm has these named poses:\nhome: folded\nup: as high as it gets\nodd",
        "The joints of the arm are at: base 0.5, elbow -1.25.",
        "The joints of the gripper are at: base 0.5, elbow -1.25.",
        "The arm is at this pose: x 0.5, y 0.0, z 1.0, qx , qy , qz , qw 1.0, roll , pitch , "
        "yaw 0.25.",
    ]


def test_a_plan_is_asked_for_until_one_is_good() -> None:
    model = Scripted(["I would rather not.", f"Here it is: {PLAN}"])
    text = plan(
        runner("PromptText", text="The door is closed.", uuid="u"),
        runner("PromptPlan", task="Go home.", uuid="u", flush="true"),
    )
    ran = run_real(text, model)
    assert ran.outputs[1] == {"ReceivedPlan": PLAN}
    first = messages(model.requests[0])
    assert "nav2_capabilities/WaypointRunner" in first  # it is told what there is
    assert "The door is closed.\n\nWrite a plan for this task: Go home." in first
    assert [each.number for each in model.requests] == [0, 1]
    assert ran.lines[1:3] == [
        "attempt 1 was rejected: GP1: no plan",
        "asked scripted:test: 0.0 s",
    ]
    assert ran.lines[3] == "accepted the plan of attempt 2"


def test_what_was_wrong_with_the_last_plan_is_told() -> None:
    model = Scripted([PLAN])
    services = {"model": service(model)}
    values = {"task": "t", "replan": True, "FailedElements": "no way", "flush": True}
    assert act(prompting.PromptPlanRunner(), services, **values) == {"ReceivedPlan": PLAN}
    assert "The last plan was not good. no way" in messages(model.requests[0])


def test_no_good_plan_within_the_bound_is_a_failure() -> None:
    model = Scripted(["no"])
    error = fails(prompting.PromptPlanRunner(), {"model": service(model)}, task="t", flush=True)
    assert str(error) == "no plan was accepted in 3 attempts; the best one: GP1: no plan"
    assert len(model.requests) == 3


def test_only_what_rejects_a_plan_is_named() -> None:
    findings = (("GP2", "the error"), ("GP1", "a warning"))
    made = replace(
        service(Scripted([PLAN])),
        judge=lambda _: Judgement(False, PLAN, "no", errors=1, warnings=1, findings=findings),
    )
    error = fails(prompting.PromptPlanRunner(), {"model": made}, task="t", flush=True)
    assert str(error).endswith("; the best one: GP2: the error")


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (ModelError("the server is away"), "the server is away"),
        (Answer("half", "m", Finish.LENGTH), "the answer was cut off"),
        ("x" * 10_000_000, "the answer has more than 200,000 characters"),
    ],
)
@pytest.mark.parametrize("name", ["PromptTextRunner", "PromptPlanRunner"])
def test_what_is_no_answer(answer: str | Answer | ModelError, message: str, name: str) -> None:
    made = getattr(prompting, name)()
    error = fails(made, {"model": service(Scripted([answer]))}, text="t", task="t", flush=True)
    assert message in str(error)


def test_prompts_have_an_end() -> None:
    small = service(Scripted(["no"], context_tokens=5000))
    long = "word " * 2_000
    error = fails(prompting.PromptTextRunner(), {"model": small}, text=long, flush=True)
    assert "that is more than the 5,000 that scripted:test can read" in str(error)
    endless = {"model": service(Scripted(["no"]))}
    error = fails(prompting.PromptTextRunner(), endless, text="x" * 400_001, flush=True)
    assert "more than 400,000 characters" in str(error)
    small = service(Scripted(["no"], context_tokens=4500))
    error = fails(prompting.PromptPlanRunner(), {"model": small}, task="go", flush=True)
    assert "the shortest prompt takes about" in str(error)


def test_full_buffers_take_nothing() -> None:
    buffers = PromptBuffers()
    buffers.fill("u", "x" * 10_000_000)
    services = {"model": service(Scripted(["no"])), "prompts": buffers}
    assert "full" in str(fails(prompting.PromptTextRunner(), services, text="a", uuid="u"))


def test_without_a_model_no_prompt_is_loaded() -> None:
    ran = run_real(plan(runner("PromptText", text="a", flush="true")), None)
    assert ran.kernel.status is Status.GAVE_UP
    lines = [record.message for _, _, records in ran.rows for record in records if record.message]
    assert any("name one with --model" in message for message in lines)


def test_cancelling_the_run_ends_the_request_at_once() -> None:
    class Slow(Scripted):
        ended = ""

        async def answer(self, request):
            driver.cancel("enough")
            try:
                return await super().answer(request)
            except asyncio.CancelledError:
                self.ended = "cancelled"
                raise

    def before(made):
        nonlocal driver
        driver = made

    driver = None
    model = Slow(["late"], delays_s=(60.0,))
    began = time.monotonic()
    ran = run_real(plan(runner("PromptText", text="a", flush="true")), model, before=before)
    assert (ran.kernel.status, model.ended) == (Status.CANCELLED, "cancelled")
    assert time.monotonic() - began < 30


def test_models_are_asked_side_by_side_on_the_event_loop_of_the_engine() -> None:
    class Placed(Scripted):
        async def answer(self, request):
            assert threading.current_thread() is threading.main_thread()
            return await super().answer(request)

    model = Placed(["a"], delays_s=(0.2,))
    text = plan(
        control(
            "parallel_all",
            runner("PromptText", text="one", flush="true"),
            runner("PromptSpeech", task="two", flush="true"),
        )
    )
    ran = run_real(text, model)
    assert ran.kernel.status is Status.COMPLETED
    kinds = [happened.kind for _, happened, _ in ran.rows]
    assert sorted(each.task for each in model.requests) == ["one", "two"]
    assert kinds.count(Kind.SUCCEEDED) == 2


@pytest.mark.parametrize(
    ("made", "parameters"),
    [
        (prompting.PromptTextRunner, {"text": "a", "flush": True}),
        (prompting.PromptTextRunner, {"text": "a", "uuid": "u"}),
        (prompting.PromptSpeechRunner, {"task": "a", "flush": True}),
        (prompting.PromptPlanRunner, {"task": "a", "flush": True}),
        (system.GetCapabilitySpecsRunner, {}),
        (system.InputMultiplexRunner, {}),
    ],
)
def test_they_keep_to_the_contract(made, parameters) -> None:
    def services():
        return {"model": service(Scripted([PLAN], delays_s=(0.05,))), "specs": ("a",)}

    observed = check_runner(made, parameters, services=services, real=True)
    assert observed.succeeded


# -- maps -----------------------------------------------------------------------------------------


def grid(width: int, height: int, *occupied: tuple[int, int]) -> str:
    rows = [["."] * width for _ in range(height)]
    for x, y in occupied:
        rows[y][x] = "#"
    head = f"width={width} height={height} resolution=0.05 origin=(-1, 2)"
    return "\n".join([head, *("".join(row) for row in rows)])


def test_a_small_map_stays_as_it_is() -> None:
    assert shortened_map(grid(40, 40, (3, 4))) == grid(40, 40, (3, 4))


@pytest.mark.parametrize("size", [(41, 40), (100, 100), (1000, 17), (1, 5000), (999, 998)])
def test_a_large_map_loses_no_obstacle(size: tuple[int, int]) -> None:
    width, height = size
    head, *rows = shortened_map(grid(width, height, (0, 0), (width - 1, height - 1))).split("\n")
    assert len(rows) * len(rows[0]) <= MAX_CELLS
    assert head.startswith(f"width={len(rows[0])} height={len(rows)} resolution=")
    assert head.endswith(" origin=(-1, 2)")
    assert rows[0][0] == rows[-1][-1] == "#"
    assert sum(row.count("#") for row in rows) == 2


@pytest.mark.parametrize("text", ["", "x" * 100_000, "width=9 height=9 resolution=1\n..", "\n\n"])
def test_what_is_no_map_is_clipped(text: str) -> None:
    assert shortened_map(text)[:6_000] == text[:6_000]
    assert len(shortened_map(text)) <= 6_001
