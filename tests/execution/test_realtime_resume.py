"""Going on in real time with what another process began, and services of other threads."""

from __future__ import annotations

import asyncio
import threading
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal_rows import RowMaker
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.lane import OnLoop, on_loop
from gpsfsm.execution.queue import PlanService
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Kind, Status
from gpsfsm.execution.replay import resume_into
from gpsfsm.execution.runner import Runner, RunnerError
from tests.execution.realtiming import WAIT_S, messages, runner
from tests.execution.support import Listing, compiled_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import LoadContext, RunContext

TEXT = (
    f'<Plan><Control type="parallel_all">{runner("Once")}{runner("Again")}</Control>'
    f'<Control type="recovery">{runner("Once")}</Control></Plan>'
)


class Acts(Runner):
    """Notes its keys; the process ends while it acts for the first time."""

    def __init__(self, name: str, keys: list[str], seconds: float) -> None:
        self.idempotent = name == "demo/Again"
        self.keys = keys
        self.seconds = seconds

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        self.keys.append(context.key)
        await context.sleep(self.seconds)


def rows_of(kernel: Kernel, sink: Listing) -> list[Row]:
    maker = RowMaker(kernel)
    return [row for written in sink.rows for row in maker.make(*written)]


async def interrupted(keys: list[str]) -> list[Row]:
    """What a process leaves that ends while two instances act."""
    sink = Listing()
    kernel = Kernel(compiled_of(TEXT))
    driver = RealtimeDriver(kernel, sink, lambda name, _: Acts(name, keys, WAIT_S), run_id="r")
    task = asyncio.create_task(driver.run())
    while len(keys) < 2:
        await asyncio.sleep(0.01)
    rows = rows_of(kernel, sink)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    return rows


async def resumed(
    rows: list[Row], make: Callable[[str, str], Runner]
) -> tuple[Listing, RealtimeDriver]:
    sink = Listing()
    driver = RealtimeDriver(Kernel(compiled_of(TEXT)), sink, make, run_id="r")
    resume_into(driver, rows)
    async with asyncio.timeout(WAIT_S):
        await driver.run()
    return sink, driver


def test_what_may_be_done_twice_is_and_the_rest_has_failed() -> None:
    keys: list[str] = []
    rows = asyncio.run(interrupted(keys))
    before, last_us = sorted(keys), rows[-1].at_us
    keys.clear()
    sink, driver = asyncio.run(resumed(rows, lambda name, _: Acts(name, keys, 0.01)))
    assert driver.kernel.status is Status.COMPLETED
    assert messages(sink, Kind.FAILED) == ["the process ended while it was active"]
    element = "/Plan/Control[1]/Runner[2]"
    assert f"r:{element}" in before
    again = [given.number for _, given, _ in sink.rows if given.kind is Kind.RESTARTED]
    assert again == [1]
    assert sink.rows[0][1].kind is Kind.CONTINUED
    assert all(at_us >= last_us for at_us, _, _ in sink.rows)


def test_a_runner_that_cannot_be_loaded_again_fails_its_instances() -> None:
    rows = asyncio.run(interrupted([]))

    def make(interface: str, provider: str) -> Runner:
        raise RunnerError("no power")

    _, driver = asyncio.run(resumed(rows, make))
    assert driver.kernel.status is Status.GAVE_UP
    assert not driver.kernel.active
    lines = [line for _, _, line in driver.logs]
    assert sorted(line for line in lines if "not loaded again" in line) == [
        "demo/Again is not loaded again: no power",
        "demo/Once is not loaded again: no power",
    ]


def test_cancelling_while_it_is_taken_over() -> None:
    keys: list[str] = []
    rows = asyncio.run(interrupted(keys))

    async def main() -> tuple[Listing, RealtimeDriver]:
        sink = Listing()
        kernel = Kernel(compiled_of(TEXT))
        driver = RealtimeDriver(kernel, sink, lambda name, _: Acts(name, keys, WAIT_S))
        resume_into(driver, rows)
        driver.cancel("no more")
        async with asyncio.timeout(WAIT_S):
            await driver.run()
        return sink, driver

    _, driver = asyncio.run(main())
    assert driver.kernel.status is Status.CANCELLED


# -- services -------------------------------------------------------------------------------


class Queue:
    """What a plan queue does, as far as this test goes; only for one thread."""

    def __init__(self) -> None:
        self.thread = threading.current_thread()

    async def submitted(self, text: str, *, name: str = "", by: int = 0) -> int:
        assert threading.current_thread() is self.thread
        if not text:
            raise ValueError("no plan")
        return 7


def test_the_plan_queue_is_called_in_its_own_thread() -> None:
    found: list[object] = []

    class Submits(Runner):
        async def start(self, context: LoadContext) -> None:
            self.plans = context.services["plans"]

        async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
            found.append(self.plans.submit("<Plan/>"))
            found.append(self.plans.plan)
            with pytest.raises(ValueError, match="no plan"):
                self.plans.submit("")
            found.append(threading.current_thread().name)

    async def main() -> Status:
        service = PlanService(Queue(), 3)  # type: ignore[arg-type]
        kernel = Kernel(compiled_of(f"<Plan>{runner('A')}</Plan>"))
        services = {"plans": service, "other": found}
        driver = RealtimeDriver(kernel, Listing(), lambda *_: Submits(), services=services)
        assert on_loop(found, asyncio.get_running_loop()) is found
        assert isinstance(on_loop(service, asyncio.get_running_loop()), OnLoop)
        async with asyncio.timeout(WAIT_S):
            await driver.run()
        return driver.kernel.status

    assert asyncio.run(main()) is Status.COMPLETED
    assert found == [7, 3, "runner demo/A"]
