"""Fabric runners that really hand plans to a queue."""

from __future__ import annotations

import asyncio

import pytest

from gpsfsm.execution.queue import Refusal
from gpsfsm.execution.queues import LiveQueue
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Status
from gpsfsm.execution.registry import Maker
from gpsfsm.runners import fabric
from tests.generation.scripted import Scripted
from tests.runners.acting import act, fails
from tests.runners.prompting import LIBRARY, WAIT_S, Ran, kernel_of, service
from tests.simulation.support import plan, runner

NEXT = plan(runner("Wait", seconds="0.01"))
GENERATE = runner("FabricGeneratePlan", task="wait", flush="true")
TWO_STEPS = plan(runner("PromptPlan", task="wait", flush="true"), runner("FabricSetPlan"))


class Nowhere:
    def write_queue(self, *_: object) -> None:
        """Keep nothing."""


def serve(first: str, model: Scripted, *, refused: str = "") -> tuple[LiveQueue, list[Ran]]:
    """Run a plan, and those that it submits, through a queue in real time."""
    runs: list[Ran] = []

    def gate(text: str, name: str):
        if refused and refused in text:
            return Refusal(("line 1: a mistake",))
        return kernel_of(text).compiled

    def begin(state, compiled):
        ran = Ran()
        runs.append(ran)
        ran.kernel = type(kernel_of(NEXT))(compiled)
        services = {"model": service(model), "plans": queue.service(state.plan)}
        return RealtimeDriver(ran.kernel, ran, Maker(LIBRARY), services=services)

    async def go() -> LiveQueue:
        nonlocal queue
        queue = LiveQueue(gate, Nowhere(), begin)
        queue.submit(first)
        queue.close()
        async with asyncio.timeout(WAIT_S):
            await queue.serve()
        return queue

    queue: LiveQueue = None  # type: ignore[assignment]
    return asyncio.run(go()), runs


@pytest.mark.parametrize("first", [plan(GENERATE), TWO_STEPS])
def test_a_plan_that_a_model_has_written_runs_next(first: str) -> None:
    queue, runs = serve(first, Scripted([f"Here: {NEXT}"]))
    assert [state.status for state in queue.states()] == [Status.COMPLETED, Status.COMPLETED]
    assert queue.state(2).by == 1
    assert "queued as plan 2" in runs[0].lines


@pytest.mark.parametrize("first", [plan(GENERATE), TWO_STEPS])
def test_a_plan_that_the_gate_refuses_is_a_failure(first: str) -> None:
    queue, runs = serve(first, Scripted([NEXT]), refused="seconds")
    assert [state.status for state in queue.states()] == [Status.GAVE_UP, Status.REFUSED]
    assert "the plan was refused: line 1: a mistake" in runs[0].messages.values()


def test_what_cannot_be_queued() -> None:
    services = {"model": service(Scripted([NEXT]))}
    made = fabric.FabricSetPlanRunner()
    assert "no plan queue" in str(fails(made, services, ReceivedPlan=NEXT))
    assert "no plan queue" in str(
        fails(fabric.FabricGeneratePlanRunner(), services, task="t", flush=True)
    )
    queued = {**services, "plans": object()}
    assert "no plan was handed over" in str(fails(made, queued, ReceivedPlan=" \n"))


def test_filling_queues_nothing() -> None:
    model = Scripted([NEXT])
    services = {"model": service(model)}
    assert act(fabric.FabricGeneratePlanRunner(), services, task="t", uuid="u") == {}
    assert model.requests == []


def test_plans_must_not_be_queued_twice() -> None:
    assert not fabric.FabricSetPlanRunner.idempotent
    assert not fabric.FabricGeneratePlanRunner.idempotent


def test_the_end_of_a_plan_is_reported() -> None:
    assert act(fabric.FabricCompletionRunner(), {}, plan_id="7") is None
