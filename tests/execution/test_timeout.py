"""An action whose time is over is stopped first; only then has it failed, and the plan goes on."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import RowMaker, line
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Kind, Status
from gpsfsm.execution.replay import Comparing, replay, resume_into, simulate_again
from gpsfsm.execution.runner import Runner, RunnerError, StopRequested
from gpsfsm.execution.virtual import VirtualDriver
from tests.cases import many
from tests.execution.journaling import compiled, cut, ends_of_writes, exported
from tests.execution.misbehaving import GUARDED, makes, sleeping
from tests.execution.realtiming import WAIT_S, guarded, messages
from tests.execution.support import Listing, compiled_of, drive, kinds
from tests.oracle import P, par_all, par_any, plan, rec, to_xml
from tests.strategies import plans

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext

TIMES = {"timeout_s": 3.0, "grace_s": 2.0}
ENDS = (Kind.SUCCEEDED, Kind.FAILED, Kind.STOPPED)


def cleaning_up(seconds: float) -> Callable[..., Any]:
    async def act(parameters: object, context: RunContext) -> None:
        try:
            await context.sleep(float("inf"))
        finally:
            await context.sleep(seconds)

    return act


class Slow(Runner):
    """Often takes longer than it may, and then cleans up, perhaps for longer than it may."""

    def __init__(self, acting: set[int]) -> None:
        self.acting = acting

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        self.acting.add(context.number)
        try:
            await context.sleep(context.random.uniform(0.1, 6))
            if context.random.random() < 0.2:
                raise RunnerError("no luck")
        except StopRequested:
            context.log("cleans up")
            await context.sleep(context.random.uniform(0.1, 3))
        finally:
            self.acting.discard(context.number)
        return {"value": context.random.random()}


def slow(
    text: str, sink: Sink, *, seed: int, acting: set[int], kernel: Kernel | None = None
) -> VirtualDriver:
    kernel = kernel or Kernel(compiled(text))
    return VirtualDriver(kernel, sink, lambda *_: Slow(acting), seed=seed, **TIMES)


# -- in virtual time --------------------------------------------------------------------------


@given(whole=plans(max_runners=8), seed=st.integers(0, 1000))
def test_nothing_acts_any_more_when_its_end_is_recorded(whole: P, seed: int) -> None:
    acting: set[int] = set()
    sink = Listing()
    driver = slow(to_xml(whole), sink, seed=seed, acting=acting)

    def look(_at_us: int, _happened: object, records: Any) -> None:
        ended = {record.node - 1 for record in records if record.kind in ENDS}
        assert not ended & acting

    driver.watchers.append(look)
    driver.run()
    over: dict[int, list[str]] = {}
    for record in sink.records:
        if record.kind is Kind.TIMEOUT:
            over[record.node] = []
        if record.node in over:
            over[record.node].append(str(record.kind))
    assert all(value[:4] == ["TIMEOUT", "STOPPING", "STOPPED", "FAILED"] for value in over.values())
    started = sum(record.kind is Kind.STARTED for record in sink.records)
    assert driver.kernel.status.ended
    assert started >= len(over)
    assert not driver.kernel.overdue


@settings(max_examples=many(30))
@given(whole=plans(min_runners=1, max_runners=6), seed=st.integers(0, 10**6), data=st.data())
def test_a_cut_anywhere_changes_nothing(whole: P, seed: int, data: st.DataObject) -> None:
    text = to_xml(whole)
    with tempfile.TemporaryDirectory() as name:
        path, broken = Path(name, "whole.db"), Path(name, "cut.db")
        kernel = Kernel(compiled(text))
        with Journal(str(path), "none") as journal:
            writer = journal.begin(kernel, Heading(plan=text.encode(), seed=seed, mode="test"))
            slow(text, writer, seed=seed, acting=set(), kernel=kernel).run()
        expected = exported(path)
        cut(path, broken, data.draw(st.sampled_from(ends_of_writes(path)), "cut"))
        again = Kernel(compiled(text))
        with Journal(str(broken), "none") as journal, JournalReader(str(broken)) as reader:
            sink = Comparing(again, reader.events(1), journal.go_on(again, 1))
            simulate_again(slow(text, sink, seed=seed, acting=set(), kernel=again), sink)
        assert again.status is kernel.status
        assert exported(broken) == expected


@pytest.mark.parametrize(
    ("cleanup_s", "ends_s", "message"),
    [(0.5, 5.5, "stopped"), (1.9, 6.9, "stopped"), (60.0, 7.0, "did not stop and was cut off")],
)
def test_it_may_clean_up_within_the_grace_time(
    cleanup_s: float, ends_s: float, message: str
) -> None:
    options = {"timeout_s": 5, "grace_s": 2}
    sink, driver = drive(compiled_of(GUARDED), makes(cleaning_up(cleanup_s)), **options)
    assert driver.kernel.status is Status.COMPLETED
    (at_us,) = [at for at, happened, _ in sink.rows if happened.kind is Kind.STOPPED]
    assert at_us == round(ends_s * 1e6)
    assert messages(sink, Kind.STOPPED) == [message]
    assert messages(sink, Kind.FAILED) == ["its time is over"]
    started = [at for at, _, each in sink.rows if "STARTED 1" in kinds(each)]
    assert started == [at_us]


def test_the_run_may_end_meanwhile() -> None:
    make = makes(cleaning_up(1.5))
    sink, driver = drive(compiled_of(plan(par_any("A", "B"))), make, timeout_s=0.5, grace_s=2)
    assert driver.kernel.status is Status.GAVE_UP  # B has used up its time too, and stops at once
    sink, driver = drive(
        compiled_of(plan(par_any("A", "B"))),
        lambda interface, _: (
            make(interface, "") if interface == "A" else makes(sleeping(1))("A", "")
        ),
        before=lambda driver: driver.at(600_000, driver.cancel, "enough"),
        timeout_s=0.5,
        grace_s=2,
    )
    assert driver.kernel.status is Status.CANCELLED
    ends = [text for text in kinds(sink.records) if text.endswith(" 0")]
    assert ends[2:] == ["TIMEOUT 0", "STOPPING 0", "STOPPED 0", "FAILED 0"]
    assert driver.now_us() == 2_000_000


def test_a_runner_is_not_unloaded_while_it_cleans_up() -> None:
    sink, _ = drive(
        compiled_of(plan(par_all("A", "B"), rec("C"))),
        makes(cleaning_up(1)),
        timeout_s=5,
        grace_s=2,
    )
    order = kinds(sink.records)
    assert order.index("FAILED 0") < order.index("UNLOADED r0")
    assert order.index("FAILED 0") < order.index("TRIGGERED 2")


def test_a_grace_time_at_the_end_of_all_time_ends() -> None:
    sink = Listing()
    driver = VirtualDriver(
        Kernel(compiled_of(GUARDED)),
        sink,
        makes(cleaning_up(1e12)),
        timeout_s=8_999_999_999_998.0,
        grace_s=5,
    )
    with pytest.raises(GpsfsmError, match="the longest time that gpsfsm counts"):
        driver.run()  # behind that there is no time for B
    assert messages(sink, Kind.STOPPED)[0] == "did not stop and was cut off"


# -- in real time -----------------------------------------------------------------------------


class Deaf(Runner):
    """Is slow to stop; may be asked twice."""

    idempotent = True

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        try:
            await context.sleep(WAIT_S)
        except StopRequested:
            await context.sleep(WAIT_S)


class Fine(Runner):
    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        await context.sleep(0.01)


def make(interface: str, _provider: str) -> Runner:
    return Deaf() if interface == "demo/A" else Fine()


async def left_behind() -> list[Row]:
    """What a process leaves that ends while an action stops whose time is over."""
    sink, kernel = Listing(), Kernel(compiled_of(guarded("A", "B")))
    driver = RealtimeDriver(kernel, sink, make, timeout_s=0.05, grace_s=0.5)
    task = asyncio.create_task(driver.run())
    while not kernel.overdue:
        await asyncio.sleep(0.01)
    maker = RowMaker(kernel)
    rows = [row for written in sink.rows for row in maker.make(*written)]
    async with asyncio.timeout(WAIT_S):
        await task
    return rows


async def resumed(rows: list[Row], *, cancelled: bool) -> tuple[Listing, RealtimeDriver]:
    sink = Listing()
    driver = RealtimeDriver(Kernel(compiled_of(guarded("A", "B"))), sink, make)
    resume_into(driver, rows)
    if cancelled:
        driver.cancel("no more")
    async with asyncio.timeout(WAIT_S):
        await driver.run()
    return sink, driver


@pytest.mark.parametrize("cancelled", [False, True])
def test_its_process_has_ended_while_it_stopped(cancelled: bool) -> None:
    rows = asyncio.run(left_behind())
    assert [row.kind for row in rows][-2:] == ["TIMEOUT", "STOPPING"]
    left = replay(Kernel(compiled_of(guarded("A", "B"))), rows)
    assert [start.number for start in left.active] == [0]
    sink, driver = asyncio.run(resumed(rows, cancelled=cancelled))
    assert kinds(sink.records)[:2] == ["STOPPED 0", "FAILED 0"]
    assert messages(sink, Kind.STOPPED)[0] == "its process has ended"
    assert not messages(sink, Kind.RESTARTED)  # its outcome is known, though it may be done twice
    assert driver.kernel.status is (Status.CANCELLED if cancelled else Status.COMPLETED)
    maker = RowMaker(driver.kernel, len(rows))
    again = [row for written in sink.rows for row in maker.make(*written)]
    whole = [*rows, *again]
    assert replay(Kernel(compiled_of(guarded("A", "B"))), whole).active == ()
    assert len({line(row) for row in whole}) == len(whole)
