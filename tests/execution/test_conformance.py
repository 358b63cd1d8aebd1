"""The test kit for runners: good ones pass, and each breach of the contract is found."""

from __future__ import annotations

import asyncio
import itertools
import random
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.capabilities.load import load_directories
from gpsfsm.execution.conformance import ConformanceError, check_runner
from gpsfsm.execution.runner import Runner, RunnerError, StopRequested
from gpsfsm.model.capability import Outcomes, Output, Parameter, Provider, Span, ValueType
from gpsfsm.model.event import Event
from gpsfsm.runners.generic import HttpRunner, LogRunner, ProcessRunner, PythonRunner, WaitRunner

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import LoadContext, RunContext


REPO = Path(__file__).parents[2]
EMPTY = 6  # a seed for which the gripper of the example is empty


def runner(act: Callable[[Mapping[str, Any], RunContext], Any]) -> Callable[[], Runner]:
    """A class of runners from a function."""

    class Made(Runner):
        async def run(
            self, parameters: Mapping[str, RunValue], context: RunContext
        ) -> Mapping[str, RunValue] | None:
            outputs: Mapping[str, RunValue] | None = await act(parameters, context)
            return outputs

    return Made


async def good(parameters: Mapping[str, Any], context: RunContext) -> dict[str, Any]:
    seconds = parameters.get("seconds")
    if seconds is None:
        raise RunnerError("'seconds' is missing")
    context.log("begins")
    await context.sleep(seconds)
    return {"width": context.random.random()}


async def bad(parameters: Mapping[str, Any], context: RunContext) -> None:
    await context.sleep(1)
    raise RunnerError("no grip", code=3)


def provider(**more: Any) -> Provider:
    described = {"outputs": (Output("width", ValueType.DOUBLE),), **more}
    return Provider("demo/Grasp", "demo/Grasp", described=True, **described)


GOOD = provider(
    configuration=(Parameter("seconds", ValueType.DOUBLE),),
    duration=Span(0.5, "seconds"),
)


def test_a_good_runner_passes_and_is_described() -> None:
    observed = check_runner(runner(good), {"seconds": 2.0}, provider=GOOD)
    assert observed.succeeded
    assert list(observed.outputs) == ["width"]
    assert 2.0 <= observed.duration_s < 2.001
    assert observed.logs == ("begins",)
    assert check_runner(runner(good), {"seconds": 2.0}, seed=1).outputs != observed.outputs


def test_a_runner_may_be_meant_to_fail() -> None:
    declared = provider(outputs=(Output("code", ValueType.INT, Event.FAILED),))
    observed = check_runner(runner(bad), {}, expect="fails", provider=declared)
    assert not observed.succeeded
    assert (observed.message, observed.outputs) == ("no grip", {"code": 3})


def breach(
    make: Callable[[], Any], parameters: Mapping[str, Any] | None = None, **more: Any
) -> str:
    with pytest.raises(ConformanceError) as caught:
        check_runner(make, {"seconds": 2.0} if parameters is None else parameters, **more)
    return str(caught.value)


@pytest.mark.parametrize(
    ("act", "declared", "expect", "message"),
    [
        (bad, None, "succeeds", "Made should succeed with {'seconds': 2.0}, but it fails: no grip"),
        (good, None, "fails", "Made should fail with {'seconds': 2.0}, but it succeeds"),
        (good, provider(outputs=()), "succeeds", "Made returns 'width', which is not declared"),
        (
            good,
            provider(outputs=(Output("width", ValueType.STRING),)),
            "succeeds",
            "Made returns float as 'width', declared is string",
        ),
        (
            good,
            provider(outputs=(Output("width"), Output("height"))),
            "succeeds",
            "Made does not return 'height', which is declared",
        ),
        (
            good,
            provider(outcomes=Outcomes(never_succeeds=True)),
            "succeeds",
            "Made is declared never to succeed",
        ),
        (
            bad,
            provider(outcomes=Outcomes(never_fails=True)),
            "fails",
            "Made is declared never to fail: no grip",
        ),
        (
            good,
            provider(duration=Span(0.0, 1.0)),
            "succeeds",
            "Made takes 2 s, declared are from 0 to 1",
        ),
        (
            good,
            provider(duration=Span(3.0)),
            "succeeds",
            "Made takes 2 s, declared are from 3 to any",
        ),
    ],
)
def test_what_is_declared_has_to_hold(
    act: Any, declared: Provider | None, expect: Any, message: str
) -> None:
    assert breach(runner(act), provider=declared, expect=expect).startswith(message)


async def says_nothing(parameters: Mapping[str, Any], context: RunContext) -> None:
    raise RunnerError("")


async def changes(parameters: dict[str, Any], context: RunContext) -> None:
    parameters["seconds"] = 3


async def waits_elsewhere(parameters: Mapping[str, Any], context: RunContext) -> None:
    await asyncio.sleep(0)


async def ignores_stop(parameters: Mapping[str, Any], context: RunContext) -> None:
    try:
        await context.sleep(1)
    except StopRequested:
        await context.sleep(60)


async def needs_parameters(parameters: Mapping[str, Any], context: RunContext) -> None:
    await context.sleep(parameters.get("seconds", 1e6))


async def rubbish(parameters: Mapping[str, Any], context: RunContext) -> dict[str, Any]:
    return {"found": object()}


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (changes, "Made changes the parameters that it is given"),
        (waits_elsewhere, "Made should succeed with {'seconds': 2.0}, but it fails: it awaits"),
        (ignores_stop, "Made does not stop within 5 s when it is asked to 1e-06 s"),
        (needs_parameters, "Made never ends if it is given no parameters: let it fail"),
        (rubbish, "Made should succeed with {'seconds': 2.0}, but it fails: its output 'found'"),
    ],
)
def test_breaches_are_found(act: Any, message: str) -> None:
    assert breach(runner(act)).startswith(message)


def test_a_failure_has_to_be_explained() -> None:
    assert breach(runner(says_nothing), expect="fails") == "Made fails and does not say why"


def test_one_that_never_ends() -> None:
    async def hangs(parameters: Mapping[str, Any], context: RunContext) -> None:
        await context.sleep(1e6)

    assert "it has not ended after 60 s" in breach(runner(hangs), timeout_s=60)


@pytest.mark.parametrize("draw", [random.random, itertools.count().__next__])
def test_chance_from_elsewhere_is_found(draw: Callable[[], float]) -> None:
    async def drawn(parameters: Mapping[str, Any], context: RunContext) -> dict[str, Any]:
        await context.sleep(1)
        return {"drawn": draw()}

    assert "does not do the same again" in breach(runner(drawn))


def test_two_at_once_must_not_wait_for_each_other() -> None:
    class Jams(Runner):
        free = True

        async def run(self, parameters: Any, context: RunContext) -> None:
            while not self.free:
                await context.sleep(1)
            self.free = False
            await context.sleep(1)

    assert "of two instances of Jams" in breach(Jams, timeout_s=100)


def test_loading_and_unloading_are_tried() -> None:
    class Start(Runner):
        async def start(self, context: LoadContext) -> None:
            raise RunnerError("no power")

        async def run(self, parameters: Any, context: RunContext) -> None:
            return None

    class Stop(Runner):
        async def stop(self) -> None:
            raise ValueError("stuck")

        async def run(self, parameters: Any, context: RunContext) -> None:
            return None

    assert breach(Start).startswith("Start is not loaded: ")
    assert breach(Stop) == "Stop is not unloaded properly: unloading: ValueError: stuck"
    assert "str is not a subclass of Runner" in breach(lambda: "text")


def test_a_runner_may_log_what_it_likes() -> None:
    class Truck(Runner):
        async def run(self, parameters: Any, context: RunContext) -> None:
            context.log("unloading the truck")

    assert check_runner(Truck, {}).logs == ("unloading the truck",)


@pytest.mark.parametrize("real", [False, True])
def test_data_of_a_line_that_nobody_can_write_down_fails_the_runner_alone(real: bool) -> None:
    class Objects(Runner):
        async def run(self, parameters: Any, context: RunContext) -> None:
            context.log("half", {"whole": 1.5, "parts": ["a", 2]})
            context.log("odd", {"odd": object()})  # type: ignore[dict-item]

    observed = check_runner(Objects, {}, expect="fails", real=real, timeout_s=20)
    assert observed.logs == ("half",)
    assert "'odd' is no value" in observed.message


# -- in real time ---------------------------------------------------------------------------


def test_a_runner_that_acts_outside_is_tried_in_real_time() -> None:
    async def acts(parameters: Mapping[str, Any], context: RunContext) -> dict[str, Any]:
        await asyncio.sleep(parameters.get("seconds", 0))
        return {"width": 1}

    values = {"seconds": 0.2}
    observed = check_runner(runner(acts), values, provider=GOOD, real=True, timeout_s=20)
    assert observed.outputs == {"width": 1}


def test_a_stubborn_one_is_found_in_real_time() -> None:
    async def stubborn(parameters: Mapping[str, Any], context: RunContext) -> None:
        for _ in range(20):
            try:
                await asyncio.sleep(0.03)
            except BaseException:
                context.log("no")

    assert "does not stop within 0.1 s" in breach(
        runner(stubborn), real=True, timeout_s=20, grace_s=0.1
    )


GENERIC: list[tuple[type[Runner], dict[str, Any], dict[str, Any]]] = [
    (WaitRunner, {"seconds": 0.2}, {}),
    (LogRunner, {"text": "hello"}, {}),
    (ProcessRunner, {"command": "sleep 0.2"}, {"allow_programs": ["sleep"]}),
    (
        PythonRunner,
        {"function": "os.path:basename", "argument": "a/b"},
        {"allow_functions": ["os.path:basename"]},
    ),
]


@pytest.mark.parametrize(("make", "parameters", "services"), GENERIC)
def test_the_generic_runners_keep_to_the_contract(
    make: type[Runner], parameters: dict[str, Any], services: dict[str, Any]
) -> None:
    described = builtin_capabilities().library.provider(f"generic_capabilities/{make.__name__}")
    assert described is not None
    real = not getattr(make, "simulated", False)
    options: dict[str, Any] = {"real": True, "timeout_s": 20.0} if real else {}
    observed = check_runner(
        make, parameters, provider=described, services=lambda: services, **options
    )
    assert observed.succeeded


def test_a_request_that_is_not_allowed_fails_properly() -> None:
    observed = check_runner(
        HttpRunner, {"url": "http://127.0.0.1:1/"}, expect="fails", real=True, timeout_s=20
    )
    assert observed.message == "the host 127.0.0.1:1 is not allowed"


# -- the example of the documentation -------------------------------------------------------


def test_the_example_is_shown_as_it_is_and_keeps_to_the_contract() -> None:
    file = REPO / "docs" / "examples" / "my_robot" / "gripper.py"
    code = file.read_text()
    shown = (REPO / "docs" / "runners.md").read_text()
    assert code.partition('"""\n\n')[2] in shown
    made: dict[str, Any] = {}
    exec(compile(code, str(file), "exec"), made)  # noqa: S102
    library = load_directories([file.parent]).library
    described = library.provider("gripper_capabilities/GraspRunner")
    assert described is not None
    assert described.runner == f"my_robot.gripper:{made['GraspRunner'].__name__}"
    values = {"force": 12.0, "timeout_s": 5.0}
    observed = check_runner(made["GraspRunner"], values, provider=described)
    assert observed.logs == (f"holds {1000 * float(str(observed.outputs['width'])):.0f} mm",)
    empty = breach(made["GraspRunner"], values, provider=described, seed=EMPTY)
    assert empty.endswith("it fails: nothing is held with 12 N")
