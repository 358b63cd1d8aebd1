"""The gate of a queue in real time: it checks in a thread, in order, and nothing waits for it."""

from __future__ import annotations

import asyncio
import threading
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.execution.bond import Bond
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queue import PlanState, QueueFullError, Refusal
from gpsfsm.execution.queues import LiveQueue
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import RunContext, Runner, StopRequested
from tests.execution.queueing import SLEEP, Log, Nothing, gate, text_of

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Mapping

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.runner import LoadContext

PATIENCE_S = 30.0


class Slow:
    """A gate that stands open for nobody until it is told to; it notes whom it has checked."""

    def __init__(self) -> None:
        self.open = threading.Event()
        self.consulted = threading.Event()
        self.names: list[str] = []
        self.threads: set[int] = set()
        self.at_once = 0

    def __call__(self, text: str, name: str) -> Compiled | Refusal:
        self.at_once += 1
        assert self.at_once == 1
        self.names.append(name)
        self.threads.add(threading.get_ident())
        self.consulted.set()
        assert self.open.wait(PATIENCE_S)
        self.at_once -= 1
        return gate(text)


class Acts(Runner):
    """Does what the test has for a runner of its name."""

    def __init__(self, does: Callable[[PlanService, RunContext], Awaitable[object]]) -> None:
        self.does = does

    async def start(self, context: LoadContext) -> None:
        self.plans: PlanService = context.services["plans"]

    async def run(self, parameters: Mapping[str, Any], context: RunContext) -> None:
        await self.does(self.plans, context)


def served(
    client: Callable[[LiveQueue, Log], Awaitable[None]],
    compile_: Callable[[str, str], Compiled | Refusal],
    does: Mapping[str, Callable[[PlanService, RunContext], Awaitable[object]]] | None = None,
    *,
    grace_s: float = 5.0,
    **options: Any,
) -> None:
    """Serve a queue while a client acts; runners that nobody says anything about do nothing."""

    async def nothing(_plans: PlanService, _context: RunContext) -> None:
        """End at once."""

    async def whole() -> None:
        log = Log()

        def begin(state: PlanState, compiled: Compiled) -> RealtimeDriver:
            return RealtimeDriver(
                Kernel(compiled),
                Nothing(),
                lambda name, _: Acts((does or {}).get(name.rpartition("/")[2], nothing)),
                services={"plans": queue.service(state.plan)},
                grace_s=grace_s,
            )

        queue = LiveQueue(compile_, log, begin, **options)
        serving = asyncio.create_task(queue.serve())
        await client(queue, log)
        queue.close()
        await serving

    asyncio.run(asyncio.wait_for(whole(), PATIENCE_S))


async def until(condition: Callable[[], bool]) -> None:
    while not condition():
        await asyncio.sleep(0.005)


def test_everything_goes_on_while_the_gate_checks() -> None:
    slow = Slow()

    async def client(queue: LiveQueue, log: Log) -> None:
        queue._bond, bond = None, Bond(1e6)
        bond.watch(queue._clock, lost=lambda _: None)
        submitting = asyncio.create_task(queue.submitted(SLEEP, name="slow"))
        await until(slow.consulted.is_set)
        assert bond.beat()
        ticks = 0
        while ticks < 20:
            await asyncio.sleep(0)
            ticks += 1
        assert log.rows == []
        assert queue.states() == ()
        slow.open.set()
        assert await submitting == 1
        await until(lambda: queue.state(1).status.ended)

    served(client, slow)
    assert threading.get_ident() not in slow.threads


def test_who_submits_first_has_the_lower_number() -> None:
    slow = Slow()

    async def client(queue: LiveQueue, log: Log) -> None:
        names = [f"plan {letter}" for letter in "abcde"]
        tasks = [asyncio.create_task(queue.submitted(SLEEP, name=name)) for name in names]
        await until(slow.consulted.is_set)
        slow.open.set()
        assert await asyncio.gather(*tasks) == [1, 2, 3, 4, 5]
        assert [state.name for state in queue.states()] == slow.names == names

    served(client, slow)


def test_the_queue_stays_open_for_what_is_at_the_gate() -> None:
    slow = Slow()

    async def client(queue: LiveQueue, log: Log) -> None:
        submitting = asyncio.create_task(queue.submitted(SLEEP))
        await until(slow.consulted.is_set)
        queue.close()
        await asyncio.sleep(0.01)
        slow.open.set()
        await submitting
        await until(lambda: queue.state(1).status is Status.COMPLETED)

    served(client, slow)


def test_a_gate_that_never_ends_refuses_and_is_not_asked_twice() -> None:
    slow = Slow()

    async def client(queue: LiveQueue, log: Log) -> None:
        first, second = await queue.submitted(SLEEP), await queue.submitted(SLEEP)
        assert queue.state(first).findings == ("the gate has not decided within 0.05 s",)
        assert queue.state(second).findings == ("the gate is still busy with an earlier plan",)
        assert len(slow.names) == 1
        slow.open.set()
        third = await queue.submitted(SLEEP)
        while queue.state(third).status is Status.REFUSED:  # the thread takes its time to end
            third = await queue.submitted(SLEEP)
        assert len(slow.names) == 2

    served(client, slow, gate_s=0.05)


@pytest.mark.parametrize("blocking", [True, False])
def test_a_runner_waits_for_the_verdict_and_others_act_meanwhile(blocking: bool) -> None:
    slow, did = Slow(), []

    def checking(text: str, name: str) -> Compiled | Refusal:
        return slow(text, name) if name else gate(text)

    async def submits(plans: PlanService, _context: RunContext) -> None:
        for text in (SLEEP, "<"):
            plan = plans.submit(text, "me") if blocking else await plans.submitted(text, "me")
            did.append((plan, plans.status(plan), bool(plans.findings(plan))))

    async def other(_plans: PlanService, context: RunContext) -> None:
        for _ in range(5):
            await context.sleep(0.001)
        did.append("other")
        slow.open.set()

    async def client(queue: LiveQueue, log: Log) -> None:
        both = text_of("Submits", "Other").replace("sequential", "parallel_all")
        await queue.submitted(both)
        await until(lambda: len(queue.states()) == 3 and queue.state(2).status.ended)
        assert slow.names == ["plan 2 from me", "plan 3 from me"]

    served(client, checking, {"Submits": submits, "Other": other})
    assert did == ["other", (2, "QUEUED", False), (3, "REFUSED", True)]


def test_who_is_stopped_at_the_gate_submits_nothing() -> None:
    slow, said = Slow(), []

    def checking(text: str, name: str) -> Compiled | Refusal:
        return slow(text, name) if name else gate(text)

    async def submits(plans: PlanService, _context: RunContext) -> None:
        try:
            await plans.submitted(SLEEP, "me")
        except StopRequested:
            said.append("stopped")
            raise

    async def client(queue: LiveQueue, log: Log) -> None:
        await queue.submitted(text_of("Submits"))
        await until(slow.consulted.is_set)
        assert queue.cancel(1, "enough")
        await until(lambda: queue.state(1).status is Status.CANCELLED)
        slow.open.set()
        assert await queue.submitted(SLEEP) == 2
        assert [state.by for state in queue.states()] == [0, 0]

    served(client, checking, {"Submits": submits})
    assert said == ["stopped"]


def test_a_plan_that_has_ended_at_the_gate_submits_nothing() -> None:
    slow, said = Slow(), []
    ended = threading.Event()

    def checking(text: str, name: str) -> Compiled | Refusal:
        return slow(text, name) if name else gate(text)

    async def submits(plans: PlanService, _context: RunContext) -> None:
        try:
            plans.submit(SLEEP, "me")  # this blocks its thread: it cannot be stopped
        except UsageError as error:
            said.append(str(error))
        ended.set()

    async def other(_plans: PlanService, _context: RunContext) -> None:
        while not slow.consulted.is_set():
            await asyncio.sleep(0.001)

    async def client(queue: LiveQueue, log: Log) -> None:
        any_of = text_of("Submits", "Other").replace("sequential", "parallel_any")
        await queue.submitted(any_of)
        await until(slow.consulted.is_set)
        queue.cancel(1)
        await until(lambda: queue.state(1).status.ended)
        slow.open.set()
        await until(ended.is_set)
        assert len(queue.states()) == 1

    served(client, checking, {"Submits": submits, "Other": other}, grace_s=0.1)
    assert said == ["plan 1, which submits a plan, has ended meanwhile"]


def test_the_bounds_hold_for_what_is_at_the_gate() -> None:
    async def client(queue: LiveQueue, log: Log) -> None:
        await queue.submitted(SLEEP)
        await queue.submitted("<")
        with pytest.raises(QueueFullError):
            await queue.submitted(SLEEP)

    served(client, gate, most_plans=2)
