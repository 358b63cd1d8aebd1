"""The plan queue in real time, and many plans on one clock."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.errors import InputError
from gpsfsm.execution.bond import Bond
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queue import (
    PlanState,
    QueueKind,
    Refusal,
)
from gpsfsm.execution.queues import LiveQueue, run_together
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.runner import RunContext, Runner
from tests.execution.queueing import (
    FAIL,
    HANG,
    SLEEP,
    Bench,
    Log,
    Nothing,
    gate,
    text_of,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.records import Record
    from gpsfsm.execution.runner import LoadContext
    from gpsfsm.execution.virtual import VirtualDriver


# -- real time -----------------------------------------------------------------------------------


class Live:
    """A driver in real time that runs a virtual one, a hundredth of a second for each event."""

    def __init__(self, inner: VirtualDriver) -> None:
        self.kernel = inner.kernel
        self.failure: BaseException | None = None
        self.inner = inner

    def cancel(self, reason: str) -> None:
        self.inner.cancel(reason)

    async def run(self) -> None:
        self.inner.deliver(Input(Kind.BEGIN))
        while not self.kernel.status.ended:
            await asyncio.sleep(0.01)
            if not self.inner.advance() and not self.kernel.status.ended:
                self.inner.deliver(Input(Kind.SILENCE))


def live(bench: Bench, **options: Any) -> LiveQueue:
    queue = LiveQueue(
        gate, bench.log, lambda state, comp: Live(bench.begin(state, comp)), **options
    )
    bench.queue = queue  # type: ignore[assignment]
    return queue


def test_in_real_time_a_later_plan_runs_too() -> None:
    async def client() -> list[str]:
        bench = Bench()
        queue = live(bench)
        serving = asyncio.create_task(queue.serve())
        queue.submit(SLEEP)
        while not queue.state(1).status.ended:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.05)  # the queue is empty for a while
        queue.submit(FAIL)
        queue.submit("<")
        queue.close()
        await serving
        assert [kind for kind, _ in bench.log.events()].count("BEGUN") == 2
        return bench.statuses()

    assert asyncio.run(client()) == ["COMPLETED", "GAVE_UP", "REFUSED"]


def test_in_real_time_plans_are_cancelled_and_the_bond_holds_them_back() -> None:
    async def client() -> list[str]:
        bench = Bench()
        bond = Bond(1e6)
        queue = live(bench, bond=bond)
        serving = asyncio.create_task(queue.serve())
        long = text_of(*["Sleep"] * 50)
        for _ in range(4):
            queue.submit(long)
        await asyncio.sleep(0.05)
        assert queue.cancel(1)
        assert queue.cancel(3)
        while queue.state(2).status is not Status.RUNNING:
            await asyncio.sleep(0.01)
        bond.release()
        while not queue.state(2).status.ended:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.05)
        assert queue.state(2).reason == "the client has left"
        assert queue.state(4).status is Status.QUEUED
        bond.renew()
        while queue.state(4).status is not Status.RUNNING:
            await asyncio.sleep(0.01)
        assert queue.cancel(4)
        queue.close()
        await serving
        assert (QueueKind.BOND_RENEWED, 0) in bench.log.events()
        return bench.statuses()

    assert asyncio.run(client()) == ["CANCELLED"] * 4


@pytest.mark.parametrize("meanwhile", ["cancel", "hold", ""])
def test_a_look_refuses_a_plan_and_ends_if_nobody_waits_for_it(meanwhile: str) -> None:
    ended: list[str] = []

    async def look(state: PlanState, _: Compiled) -> None:
        if state.plan == 1 and not meanwhile:
            raise InputError("there is no server")
        if state.plan == 1 and not ended:
            try:
                await asyncio.sleep(60.0)
            finally:
                ended.append("look")

    async def client() -> list[str]:
        bench = Bench()
        queue = live(bench, look=look)
        queue.submit(SLEEP)
        queue.submit(SLEEP)
        serving = asyncio.create_task(queue.serve())
        await asyncio.sleep(0.02)
        if meanwhile == "cancel":
            queue.cancel(1)
        elif meanwhile == "hold":
            queue.hold("stopped")
            await asyncio.sleep(0.1)
            assert queue.state(1).status is Status.QUEUED
            queue.release()
        queue.close()
        await serving
        assert ended == ["look"] * bool(meanwhile)
        assert queue.state(1).findings == (() if meanwhile else ("there is no server",))
        return bench.statuses()

    first = {"cancel": "CANCELLED", "hold": "COMPLETED", "": "REFUSED"}[meanwhile]
    assert asyncio.run(client()) == [first, "COMPLETED"]


class Thread(Runner):
    """Acts in real time, in a thread of its own, as drivers in real time let runners act."""

    def __init__(self, name: str, did: list[object]) -> None:
        self.name, self.did = name, did

    async def start(self, context: LoadContext) -> None:
        self.plans: PlanService = context.services["plans"]

    async def run(self, parameters: Mapping[str, Any], context: RunContext) -> None:
        if self.name == "Next":
            self.did.append(self.plans.status(self.plans.submit(text_of("Own"), "from a runner")))
            self.did.append(self.plans.status(self.plans.submit("<")))
        if self.name == "Own":
            self.did.append(self.plans.cancel(self.plans.plan, "I give in"))
            await context.sleep(60.0)
        if self.name == "Long":
            await context.sleep(60.0)


def test_runners_in_real_time_submit_and_cancel_and_lose_their_client() -> None:
    did: list[object] = []

    async def client() -> list[PlanState]:
        log, bond = Log(), Bond(1e6)

        def begin(state: PlanState, compiled: Compiled) -> RealtimeDriver:
            def make(interface: str, provider: str) -> Runner:
                return Thread(interface.rpartition("/")[2], did)

            services = {"plans": queue.service(state.plan)}
            return RealtimeDriver(Kernel(compiled), Nothing(), make, services=services)

        queue = LiveQueue(gate, log, begin, bond=bond)
        queue.submit(text_of("Next"))
        serving = asyncio.create_task(queue.serve())
        while len(queue.states()) < 3 or not queue.state(2).status.ended:
            await asyncio.sleep(0.01)
        queue.submit(text_of("Long"))
        while queue.state(4).status is not Status.RUNNING:
            await asyncio.sleep(0.01)
        bond.release()
        queue.close()
        await serving
        return list(queue.states())

    states = asyncio.run(asyncio.wait_for(client(), 30.0))
    assert [state.attempts for state in states] == [1, 1, 0, 1]
    assert [str(state.status) for state in states] == [
        "COMPLETED",
        "CANCELLED",
        "REFUSED",
        "CANCELLED",
    ]
    assert [state.by for state in states] == [0, 1, 1, 0]
    assert [state.reason for state in states] == ["", "I give in", "", "the client has left"]
    assert did == ["QUEUED", "REFUSED", True]


def test_who_stops_serving_stops_the_plan_in_good_order() -> None:
    async def client() -> tuple[list[str], list[tuple[str, int]]]:
        log = Log()

        def begin(state: PlanState, compiled: Compiled) -> RealtimeDriver:
            services = {"plans": queue.service(state.plan)}
            return RealtimeDriver(
                Kernel(compiled), Nothing(), lambda *_: Thread("Long", []), services=services
            )

        queue = LiveQueue(gate, log, begin)
        for _ in range(2):
            queue.submit(text_of("Long"))
        serving = asyncio.create_task(queue.serve())
        while queue.state(1).status is not Status.RUNNING:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.05)
        serving.cancel()
        with pytest.raises(asyncio.CancelledError):
            await serving
        return [str(state.status) for state in queue.states()], log.events()

    statuses, rows = asyncio.run(asyncio.wait_for(client(), 30.0))
    assert statuses == ["CANCELLED", "QUEUED"]
    assert rows[-2:] == [("BEGUN", 1), ("ENDED", 1)]


# -- many at once --------------------------------------------------------------------------------


def test_plans_that_run_together_run_as_they_do_alone() -> None:
    texts = [text_of("Sleep", "Fail"), HANG, SLEEP, text_of(*["Sleep"] * 5), FAIL] * 4

    class Keep:
        def __init__(self) -> None:
            self.rows: list[object] = []

        def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
            self.rows.append((at_us, happened, tuple(records)))

    def drivers() -> tuple[list[VirtualDriver], list[Keep]]:
        made, sinks = [], []
        for number, text in enumerate(texts):
            bench = Bench()
            bench.unit_s = 0.25 + number % 3
            compiled = gate(text)
            assert not isinstance(compiled, Refusal)
            driver = bench.begin(PlanState(number, Status.QUEUED, ""), compiled)
            driver._sink = Keep()
            made.append(driver)
            sinks.append(driver._sink)
        return made, sinks

    alone, expected = drivers()
    for driver in alone:
        driver.run()
    at_once, apart = drivers()
    run_together(at_once)
    assert [sink.rows for sink in apart] == [sink.rows for sink in expected]
    assert [driver.kernel.status for driver in at_once] == [
        driver.kernel.status for driver in alone
    ]
    assert {driver.kernel.status for driver in alone} == {
        Status.COMPLETED,
        Status.GAVE_UP,
        Status.STUCK,
    }


def test_what_runs_together_shares_one_clock() -> None:
    order: list[tuple[int, int]] = []

    class Note:
        def __init__(self, number: int) -> None:
            self.number = number

        def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
            order.append((at_us, self.number))

    made = []
    for number, unit_s in enumerate((3.0, 1.0, 2.0)):
        bench = Bench()
        bench.unit_s = unit_s
        compiled = gate(text_of("Sleep", "Sleep"))
        assert not isinstance(compiled, Refusal)
        driver = bench.begin(PlanState(number, Status.QUEUED, ""), compiled)
        driver._sink = Note(number)
        made.append(driver)
    run_together(made)
    assert order == sorted(order, key=lambda entry: entry[0])
    assert {number for _, number in order[:3]} == {0, 1, 2}


def test_nothing_runs_together() -> None:
    run_together([])
