"""Going on in real time with what another process began, and services of other threads."""

from __future__ import annotations

import asyncio
import threading
from typing import TYPE_CHECKING

import pytest

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.journal_rows import RowMaker
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.lane import OnLoop, on_loop
from gpsfsm.execution.queue import PlanService
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Kind, Status
from gpsfsm.execution.replay import resume_into
from gpsfsm.execution.runner import InDoubtError, Runner, RunnerError
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
    again = [value.number for _, value, _ in sink.rows if value.kind is Kind.RESTARTED]
    assert again == [1]
    assert sink.rows[0][1].kind is Kind.CONTINUED
    assert all(at_us >= last_us for at_us, _, _ in sink.rows)


def test_a_run_whose_runners_cannot_be_loaded_again_can_be_resumed_later() -> None:
    rows = asyncio.run(interrupted([]))

    def make(interface: str, provider: str) -> Runner:
        raise RunnerError("no power")

    with pytest.raises(GpsfsmError, match=r"can be resumed: what it still does .*: no power"):
        asyncio.run(resumed(rows, make))


class Asks(Acts):
    """Nobody but a person can say what became of it."""

    async def may_repeat(self, key: str) -> bool:
        raise InDoubtError(f"what became of {key}?")

    async def left(self, key: str) -> str:
        raise AssertionError("nothing is stopped of what is asked about")


def test_a_run_waits_for_a_person_about_each_action_that_only_one_can_judge() -> None:
    rows = asyncio.run(interrupted([]))
    keys: list[str] = []
    both = r"(?s)can be resumed: what became of r:\S*Runner\[.\]\?\n  what became of r:\S*\?$"
    with pytest.raises(GpsfsmError, match=both):
        asyncio.run(resumed(rows, lambda name, _: Asks(name, keys, 0.01)))
    assert not keys, "nothing acts"


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
    actual: list[object] = []

    class Submits(Runner):
        async def start(self, context: LoadContext) -> None:
            self.plans = context.services["plans"]

        async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
            actual.append(self.plans.submit("<Plan/>"))
            actual.append(self.plans.plan)
            with pytest.raises(ValueError, match="no plan"):
                self.plans.submit("")
            actual.append(threading.current_thread().name)

    async def main() -> Status:
        service = PlanService(Queue(), 3)  # type: ignore[arg-type]
        kernel = Kernel(compiled_of(f"<Plan>{runner('A')}</Plan>"))
        services = {"plans": service, "other": actual}
        driver = RealtimeDriver(kernel, Listing(), lambda *_: Submits(), services=services)
        assert on_loop(actual, asyncio.get_running_loop()) is actual
        assert isinstance(on_loop(service, asyncio.get_running_loop()), OnLoop)
        async with asyncio.timeout(WAIT_S):
            await driver.run()
        return driver.kernel.status

    assert asyncio.run(main()) is Status.COMPLETED
    assert actual == [7, 3, "runner demo/A"]


# -- what an action still does outside ------------------------------------------------------


class Outside(Acts):
    """Notes for which actions it was asked to stop what they still do outside."""

    async def left(self, key: str) -> str:
        self.keys.append(f"left {key}")
        return "its goal is cancelled"


def left_lines(sink: Listing) -> list[tuple[str, object]]:
    """The lines about what was left, in the order in which they were journaled."""
    marks = [value for _, value, _ in sink.rows if value.kind is Kind.LOG]
    return [(mark.message, mark.outputs["left"]) for mark in marks if "left" in mark.outputs]


def test_what_has_failed_is_stopped_outside_before_anything_follows() -> None:
    keys: list[str] = []
    rows = asyncio.run(interrupted(keys))
    keys.clear()
    sink, driver = asyncio.run(resumed(rows, lambda name, _: Outside(name, keys, 0.01)))
    assert driver.kernel.status is Status.COMPLETED
    once = "r:/Plan/Control[1]/Runner[1]"
    assert keys[0] == f"left {once}"
    assert [key for key in keys if key.startswith("left")] == [f"left {once}"]
    assert left_lines(sink) == [("its goal is cancelled", "seen to")]
    order = [str(value.kind) for _, value, _ in sink.rows]
    assert order.index("CONTINUED") < order.index("LOG") < order.index("FAILED")


@pytest.mark.parametrize(("cancel", "loads"), [("the service was restarted", True), ("x", False)])
def test_a_run_that_is_cancelled_lets_nothing_act_again(cancel: str, loads: bool) -> None:
    keys: list[str] = []
    rows = asyncio.run(interrupted(keys))
    keys.clear()

    def make(name: str, _: str) -> Runner:
        if not loads:
            raise RunnerError("no power")
        return Outside(name, keys, 0.01)

    async def main() -> tuple[Listing, RealtimeDriver]:
        sink = Listing()
        driver = RealtimeDriver(Kernel(compiled_of(TEXT)), sink, make, run_id="r")
        resume_into(driver, rows, cancel)
        async with asyncio.timeout(WAIT_S):
            await driver.run()
        return sink, driver

    sink, driver = asyncio.run(main())
    assert driver.kernel.status is Status.CANCELLED
    assert messages(sink, Kind.CANCEL) == [cancel]
    assert sink.rows[0][1].kind is Kind.CONTINUED
    assert messages(sink, Kind.STOPPED) == ["its process has ended"] * 2
    places = [f"left r:/Plan/Control[1]/Runner[{place}]" for place in (1, 2)]
    assert sorted(keys) == (places if loads else [])  # nothing acts, idempotent or not
    said = [text for text, how in left_lines(sink) if how == "unknown"]
    assert len(said) == (0 if loads else 2)


@pytest.mark.parametrize("hangs", [False, True])
def test_what_cannot_be_stopped_outside_is_told_and_holds_nothing_up_for_ever(hangs: bool) -> None:
    rows = asyncio.run(interrupted([]))

    class Broken(Acts):
        async def left(self, key: str) -> str:
            if hangs:
                await asyncio.Event().wait()
            raise RunnerError("the robot does not answer")

    async def main() -> tuple[Listing, RealtimeDriver]:
        sink, kernel = Listing(), Kernel(compiled_of(TEXT))
        make = lambda name, _: Broken(name, [], 0.01)  # noqa: E731
        driver = RealtimeDriver(kernel, sink, make, run_id="r", grace_s=0.05)
        resume_into(driver, rows, "no more")
        async with asyncio.timeout(WAIT_S):
            await driver.run()
        return sink, driver

    sink, driver = asyncio.run(main())
    assert driver.kernel.status is Status.CANCELLED
    why = "took more than 0.1 s" if hangs else "the robot does not answer"
    assert [why in text for text, _ in left_lines(sink)] == [True, True]
    assert {how for _, how in left_lines(sink)} == {"unknown"}


@pytest.mark.parametrize("late", ["demo/Once", "demo/Again"])
def test_what_is_asked_again_no_more_is_stopped_outside_as_well(late: str) -> None:
    text = f'<Plan><Control type="parallel_all">{runner("Again")}{runner("Once")}</Control></Plan>'
    keys: list[str] = []

    class Begins(Acts):
        async def start(self, context: LoadContext) -> None:
            while context.interface == late and not keys:
                await asyncio.sleep(0.01)

    async def first() -> list[Row]:
        sink, kernel = Listing(), Kernel(compiled_of(text))
        make = lambda name, _: Begins(name, keys, WAIT_S)  # noqa: E731
        driver = RealtimeDriver(kernel, sink, make, run_id="r")
        task = asyncio.create_task(driver.run())
        while len(keys) < 2:
            await asyncio.sleep(0.01)
        rows = rows_of(kernel, sink)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return rows

    async def second(rows: list[Row]) -> tuple[Listing, RealtimeDriver]:
        sink, kernel = Listing(), Kernel(compiled_of(text))
        make = lambda name, _: Outside(name, keys, WAIT_S)  # noqa: E731
        driver = RealtimeDriver(kernel, sink, make, run_id="r")
        resume_into(driver, rows)
        async with asyncio.timeout(WAIT_S):
            await driver.run()
        return sink, driver

    rows = asyncio.run(first())
    keys.clear()
    sink, driver = asyncio.run(second(rows))
    assert driver.kernel.status is Status.GAVE_UP  # nothing recovers from the failure of Once
    assert keys == [f"left r:/Plan/Control[1]/Runner[{place}]" for place in (2, 1)]
    assert len(left_lines(sink)) == 2


def test_a_run_that_was_stopping_while_a_runner_was_loaded_comes_to_its_end() -> None:
    async def first() -> list[Row]:
        class Slow(Acts):
            async def start(self, context: LoadContext) -> None:
                await asyncio.sleep(WAIT_S)

        sink, kernel = Listing(), Kernel(compiled_of(TEXT))
        driver = RealtimeDriver(kernel, sink, lambda name, _: Slow(name, [], 0), load_s=0.3)
        task = asyncio.create_task(driver.run())
        await asyncio.sleep(0.05)
        driver.cancel("no more")
        while kernel.status is not Status.STOPPING:
            await asyncio.sleep(0.01)
        rows = rows_of(kernel, sink)
        await task
        return rows

    _, driver = asyncio.run(resumed(asyncio.run(first()), lambda name, _: Acts(name, [], 0)))
    assert driver.kernel.status is Status.CANCELLED
