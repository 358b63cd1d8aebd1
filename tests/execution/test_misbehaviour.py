"""Runners that do what they must not: bounded, journaled, and the plan goes on as it says."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.records import Kind, Status
from gpsfsm.execution.runner import RunnerError, StopRequested
from tests.execution.misbehaving import (
    GUARDED,
    Doing,
    Foreign,
    Quick,
    guarded,
    makes,
    sleeping,
)
from tests.execution.support import compiled_of, drive, kinds
from tests.oracle import plan

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.execution.runner import RunContext


def raising(error: BaseException) -> Callable[..., Any]:
    async def act(parameters: object, context: RunContext) -> None:
        await context.sleep(1)
        raise error

    return act


def returning(outputs: object) -> Callable[..., Any]:
    async def act(parameters: object, context: RunContext) -> object:
        return outputs

    return act


class Silent(Exception):  # noqa: N818
    def __str__(self) -> str:
        raise ValueError("not today")


class OwnError(RunnerError):
    def __init__(self) -> None:  # does not call the other constructor
        self.args = ("mine",)


class OddError(RunnerError):
    def __init__(self) -> None:
        super().__init__("odd")
        self.outputs: Any = {"x": object()}


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (RunnerError("no way"), "no way"),
        (ValueError("x"), "ValueError: x"),
        (ValueError(), "ValueError"),
        (Silent(), "Silent"),
        (OwnError(), "mine"),
        (OddError(), "odd"),
        (SystemExit(3), "SystemExit: 3"),
        (GeneratorExit("g"), "GeneratorExit: g"),
        (asyncio.CancelledError(), "CancelledError"),
        (StopRequested("self-made"), "StopRequested: self-made"),
        (StopIteration(3), "RuntimeError: coroutine raised StopIteration"),
        (RecursionError("deep"), "RecursionError: deep"),
        (MemoryError("much"), "MemoryError: much"),
        (ValueError("half \ud800 a character"), r"ValueError: half \ud800 a character"),
        (ValueError("x" * 10_000), "ValueError: " + "x" * 988),
    ],
    ids=lambda actual: type(actual).__name__ if isinstance(actual, BaseException) else "",
)
def test_what_a_runner_raises_is_its_failure(error: BaseException, message: str) -> None:
    failed, _, _ = guarded(raising(error))
    assert failed.message == message


def test_an_interrupt_of_the_user_is_none() -> None:
    stopped = []

    class Loaded(Doing):
        async def stop(self) -> None:
            stopped.append(1)

    with pytest.raises(KeyboardInterrupt):
        drive(
            compiled_of(GUARDED), lambda interface, provider: Loaded(raising(KeyboardInterrupt()))
        )
    assert stopped == [1]


DEEP: list[Any] = []
for _ in range(10):
    DEEP = [DEEP]
ENDLESS: list[Any] = []
ENDLESS.append(ENDLESS)


@pytest.mark.parametrize(
    "outputs",
    [
        7,
        "text",
        ["x"],
        {1: 2},
        {"x": None},
        {"x": object()},
        {"x": {"y": 1}},
        {"x": (1, 2)},
        {"x": float("nan")},
        {"x": [float("inf")]},
        {"x": 2**63},
        {"x": DEEP},
        {"x": ENDLESS},
        {"x": "y" * 1_000_001},
        {"x": ["y" * 1000] * 1001},
        {"x": [1] * 1_000_001},
        {str(number): number for number in range(400_000)},
        {"x": "\ud800"},
        {"\ud800": 1},
    ],
    ids=lambda actual: f"{actual!r:.20}" if actual is not ENDLESS else "endless",
)
def test_rubbish_is_a_failure(outputs: object) -> None:
    failed, _, _ = guarded(returning(outputs))
    assert "output" in failed.message
    assert len(failed.message) < 200
    assert not failed.data


def test_what_a_runner_does_to_its_outputs_later_changes_nothing() -> None:
    mine: dict[str, Any] = {"x": [1]}

    async def act(parameters: object, context: RunContext) -> object:
        return mine

    sink, _ = drive(compiled_of(plan("A")), makes(act))
    mine["x"].append(2)
    mine["y"] = 3
    (done,) = [record for record in sink.records if record.kind is Kind.SUCCEEDED]
    assert done.data == {"x": [1]}


def test_what_a_runner_does_to_its_parameters_changes_nothing() -> None:
    async def act(parameters: dict[str, Any], context: RunContext) -> None:
        parameters.clear()

    sink, _ = drive(
        compiled_of('<Plan><Runner interface="A" provider="P" x="1"/></Plan>'), makes(act)
    )
    (begun,) = [record for record in sink.records if record.kind is Kind.TRIGGERED]
    assert begun.data == {"x": 1}


def sync(parameters: object, context: RunContext) -> dict[str, int]:
    return {"x": 1}


def sync_raising(parameters: object, context: RunContext) -> None:
    raise ValueError("at once")


async def yielding(parameters: object, context: RunContext) -> Any:
    yield 1


def without_context(parameters: object) -> None: ...


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (sync, "TypeError"),
        (sync_raising, "ValueError: at once"),
        (yielding, "TypeError"),
        (without_context, "TypeError"),
    ],
)
def test_what_is_no_coroutine_is_a_failure(act: Callable[..., Any], message: str) -> None:
    failed, _, _ = guarded(act)
    assert failed.message.startswith(message)


async def nothing(parameters: object, context: RunContext) -> None:
    await asyncio.sleep(0)


async def event_loop(parameters: object, context: RunContext) -> None:
    await asyncio.sleep(1)


async def foreign(parameters: object, context: RunContext) -> None:
    await Foreign()


async def foreign_again(parameters: object, context: RunContext) -> None:
    while True:
        with suppress(BaseException):
            await Foreign()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    ("act", "message"),
    [
        (nothing, "not of its context"),
        (event_loop, "no running event loop"),
        (foreign, "not of its context"),
        (foreign_again, "not of its context"),
    ],
)
def test_it_can_wait_for_nothing_but_its_context(act: Callable[..., Any], message: str) -> None:
    failed, _, _ = guarded(act)
    assert message in failed.message


@pytest.mark.parametrize("seconds", [-1, -1e-9, float("nan"), float("-inf"), "1", None, []])
def test_a_sleep_that_makes_no_sense_is_a_failure(seconds: Any) -> None:
    async def act(parameters: object, context: RunContext) -> None:
        await context.sleep(seconds)

    failed, _, _ = guarded(act)
    assert failed.message.startswith(("ValueError", "TypeError"))


@pytest.mark.parametrize("seconds", [0, 1e-9, 0.5, 3600.0])
def test_a_runner_that_sleeps_for_ever_is_bounded_by_its_sleeps(seconds: float) -> None:
    failed, _, _ = guarded(sleeping(seconds), max_sleeps=1000)
    assert failed.message == "it has slept 1,000 times without an end"


@pytest.mark.parametrize("seconds", [0, 1e-3, 1e6, 1e12, float("inf")])
def test_and_by_its_time(seconds: float) -> None:
    make = makes(sleeping(seconds), Quick)
    sink, driver = drive(compiled_of(GUARDED), make, timeout_s=0.01)
    assert driver.kernel.status is Status.COMPLETED
    (at_us,) = [at for at, happened, _ in sink.rows if happened.kind is Kind.TIMEOUT]
    assert at_us == 10_000


def test_a_hang_is_stuck_without_a_timeout() -> None:
    sink, driver = drive(compiled_of(GUARDED), makes(sleeping(float("inf"))))
    assert driver.kernel.status is Status.STUCK
    assert kinds(sink.records)[-5:] == [
        *("SILENCE", "STOPPING 0", "STOPPED 0", "UNLOADED r0", "ENDED STUCK")
    ]
