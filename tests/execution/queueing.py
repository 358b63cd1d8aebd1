"""What the tests of the plan queue share: a gate, runners, and a bench to try them on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.queue import (
    PlanState,
    QueueRow,
    Refusal,
)
from gpsfsm.execution.queues import VirtualQueue
from gpsfsm.execution.runner import RunContext, Runner, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.syntax import parse

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.records import Input, Record

SECOND = 1_000_000


def text_of(*interfaces: str) -> str:
    runners = "".join(f'<Runner interface="t/{name}" provider="t/{name}"/>' for name in interfaces)
    return f'<Plan><Control type="sequential">{runners}</Control></Plan>'


SLEEP, FAIL, HANG = text_of("Sleep"), text_of("Fail"), text_of("Hang")


def gate(text: str, _name: str = "") -> Compiled | Refusal:
    parsed = parse(text)
    if parsed.plan is None:
        return Refusal(tuple(problem.message for problem in parsed.problems))
    return compile_plan(parsed.plan)


class Log:
    """Keeps the rows of a queue."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, QueueRow]] = []

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        self.rows.append((at_us, row))

    def events(self) -> list[tuple[str, int]]:
        return [(str(row.kind), row.plan) for _, row in self.rows]


class Nothing:
    """A sink of a run that keeps nothing."""

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        pass


class Fake(Runner):
    """One class for all: the name of the interface says what it does."""

    def __init__(self, bench: Bench, name: str, plans: PlanService) -> None:
        self.bench, self.name, self.plans = bench, name, plans

    async def start(self, context: object) -> None:
        self.bench.loaded += 1

    async def stop(self) -> None:
        self.bench.loaded -= 1

    async def run(
        self, parameters: Mapping[str, Any], context: RunContext
    ) -> Mapping[str, Any] | None:
        await context.sleep(self.bench.unit_s)
        if self.name == "Fail":
            raise RunnerError("no luck")
        if self.name == "Hang":
            await context.sleep(float("inf"))
        if self.name in self.bench.does:
            self.bench.does[self.name](self.plans)
        return {}


class Bench:
    """A queue with its log, and what its runners do."""

    def __init__(self, **options: Any) -> None:
        self.log = Log()
        self.loaded = 0
        self.unit_s = 1.0
        self.does: dict[str, Callable[[PlanService], object]] = {}
        self.drivers: list[VirtualDriver] = []
        self.queue = VirtualQueue(options.pop("gate", gate), self.log, self.begin, **options)

    def begin(self, state: PlanState, compiled: Compiled) -> VirtualDriver:
        plans = self.queue.service(state.plan)

        def make(interface: str, provider: str) -> Runner:
            return Fake(self, interface.rpartition("/")[2], plans)

        self.drivers.append(VirtualDriver(Kernel(compiled), Nothing(), make, seed=state.plan))
        return self.drivers[-1]

    def statuses(self) -> list[str]:
        assert self.loaded == 0
        return [str(state.status) for state in self.queue.states()]
