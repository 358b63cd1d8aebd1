"""What the tests of the engine share: plans, sinks, runners, and drivers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Record, Status
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.model.automaton import Automaton
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext
    from tests.oracle import P

__all__ = ["Listing", "Luck", "compiled_of", "drive", "kinds", "records_of", "without_ends"]

BEGIN = Input(Kind.BEGIN)


def compiled_of(whole: P | str, faults: Collection[str] = ()) -> Compiled:
    """A compiled plan; nothing is known of its runners."""
    return compile_plan(plan_of(whole), start_chain="no-start" in faults)


def without_ends(compiled: Compiled) -> Compiled:
    """The same plan, but nothing completes it or gives it up: its runs are maximal."""
    automaton = compiled.automaton
    ends = (automaton.complete, automaton.give_up)
    edges = tuple(edge for edge in automaton.edges if edge.target not in ends)
    changed = Automaton.of(automaton.plan, automaton.nodes, edges, blocks=automaton.blocks)
    return replace(compiled, automaton=changed)


class Listing:
    """A sink that keeps everything in a list."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, Input, tuple[Record, ...]]] = []

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        self.rows.append((at_us, happened, tuple(records)))

    @property
    def records(self) -> list[Record]:
        return [record for _, _, records in self.rows for record in records]


class Luck(Runner):
    """A runner that takes its time and then fails or not, as luck has it."""

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        await context.sleep(context.random.uniform(0.1, 5))
        context.log("decides")
        if context.random.random() < 0.4:
            raise RunnerError("no luck")
        return {"luck": context.random.randrange(100)}


def drive(
    compiled: Compiled,
    make: Callable[[str, str], Runner] = lambda interface, provider: Luck(),
    before: Callable[[VirtualDriver], None] | None = None,
    **options: Any,
) -> tuple[Listing, VirtualDriver]:
    """A run in virtual time, to its end."""
    sink = Listing()
    driver = VirtualDriver(Kernel(compiled), sink, make, **options)
    if before is not None:
        before(driver)
    driver.run()
    kernel = driver.kernel
    assert kernel.status.ended
    assert not kernel.active
    assert not kernel.loaded
    return sink, driver


def records_of(kernel: Kernel, *inputs: Input) -> list[Record]:
    """What follows from inputs."""
    return [record for happened in inputs for record in kernel.step(happened)[0]]


def kinds(records: Sequence[Record]) -> list[str]:
    """The records in short: kind, and the number of the instance or runner or the join's node."""
    return [_short(record) for record in records]


def _short(record: Record) -> str:
    kind = str(record.kind)
    if record.kind is Kind.ENDED:
        assert record.data is not None
        return f"{kind} {record.data['status']}"
    if record.kind is Kind.JOINED:
        return kind
    if record.node >= 0:
        return f"{kind} {record.node - 1}"
    return f"{kind} r{record.runner}" if record.runner >= 0 else kind


ENDED: tuple[Status, ...] = (Status.COMPLETED, Status.GAVE_UP, Status.STUCK)
