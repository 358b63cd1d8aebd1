"""Runners that will not stop, load or unload, that flood, or cancel: every run ends well."""

from __future__ import annotations

import asyncio
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.runner import Runner, RunnerError, StopRequested
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.model.event import Outcome
from tests.cases import many
from tests.execution.misbehaving import (
    GUARDED,
    Doing,
    Fine,
    Foreign,
    makes,
    sleeping,
)
from tests.execution.support import BEGIN, Listing, compiled_of, drive, kinds
from tests.oracle import par_all, par_any, plan
from tests.strategies import plans

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import LoadContext, RunContext
    from tests import oracle


def ignoring(seconds: float, times: int = 10**9) -> Callable[..., Any]:
    """Sleeps so many times after it was asked to stop."""

    async def act(parameters: object, context: RunContext) -> None:
        with suppress(StopRequested):
            await context.sleep(100)
        for _ in range(times):
            await context.sleep(seconds)

    return act


CUT_OFF = "did not stop and was cut off"


@pytest.mark.parametrize(
    ("act", "how", "end_us"),
    [
        (sleeping(0.9), "stopped", 1_000_000),
        (ignoring(0.5, 1), "stopped", 1_500_000),
        (ignoring(0.5, 3), "stopped", 2_500_000),
        (ignoring(0.5), CUT_OFF, 3_000_000),
        (ignoring(float("inf")), CUT_OFF, 3_000_000),
        (ignoring(0), CUT_OFF, 1_000_099),  # by the number of its sleeps
    ],
)
def test_who_does_not_stop_is_cut_off(act: Callable[..., Any], how: str, end_us: int) -> None:
    compiled = compiled_of(plan(par_any("A", "B")))  # B succeeds after a second
    sink, driver = drive(compiled, makes(act), grace_s=2, max_sleeps=100)
    (stopped,) = [record for record in sink.records if record.kind is Kind.STOPPED]
    assert (stopped.node, stopped.message) == (1, how)
    assert driver.kernel.status is Status.COMPLETED
    assert driver.now_us() == end_us


def test_it_may_clean_up_within_the_grace_time() -> None:
    done: list[float] = []

    async def act(parameters: object, context: RunContext) -> None:
        try:
            await context.sleep(100)
        except StopRequested:
            assert context.stop_requested
            await context.sleep(1.5)
            done.append(context.now_s)
            raise

    sink, driver = drive(compiled_of(plan(par_any("A", "B"))), makes(act), grace_s=2)
    assert done == [2.5]
    assert driver.now_us() == 2_500_000
    assert "STOPPED 0" in kinds(sink.records)


def test_one_that_has_used_up_its_time_cleans_up_before_the_plan_goes_on() -> None:
    stops: list[str] = []

    class Late(Doing):
        async def stop(self) -> None:
            stops.append("unloaded")

    async def act(parameters: object, context: RunContext) -> None:
        try:
            await context.sleep(100)
        finally:
            await context.sleep(0.5)
            stops.append("cleaned up")

    make = makes(act)
    sink, _ = drive(
        compiled_of(GUARDED),
        lambda interface, provider: Late(act) if interface == "A" else make(interface, provider),
        timeout_s=5,
    )
    assert [text for text in kinds(sink.records) if text.endswith(" 0")] == [
        *("TRIGGERED 0", "STARTED 0", "TIMEOUT 0", "STOPPING 0", "STOPPED 0", "FAILED 0")
    ]
    assert stops == ["cleaned up", "unloaded"]


def test_floods_of_lines_are_cut() -> None:
    async def act(parameters: object, context: RunContext) -> None:
        for number in range(5000):
            context.log("x" * 20_000 + str(number))

    sink, driver = drive(compiled_of(plan("A", "B")), makes(act))
    assert driver.kernel.status is Status.COMPLETED
    lines = [happened.message for _, happened, _ in sink.rows if happened.kind is Kind.LOG]
    assert len(lines) == len(driver.logs) == 1001
    assert max(map(len, lines)) == 10_000
    assert "too much" in lines[-1]


@pytest.mark.parametrize("line", [None, 7, b"x", "half \ud800"], ids=str)
def test_odd_lines_can_be_written(line: Any) -> None:
    async def act(parameters: object, context: RunContext) -> None:
        context.log(line)

    sink, driver = drive(compiled_of(plan("A")), makes(act))
    assert driver.kernel.status is Status.COMPLETED
    (text,) = [happened.message for _, happened, _ in sink.rows if happened.kind is Kind.LOG]
    assert text.encode()


class Starting(Fine):
    """Misbehaves when it is loaded or unloaded."""

    def __init__(self, start: Any = None, stop: Any = None) -> None:
        self._start, self._stop = start, stop

    def start(self, context: LoadContext) -> Any:
        return self._do(self._start)

    def stop(self) -> Any:
        return self._do(self._stop)

    def _do(self, what: Any) -> Any:
        if what == "sync":
            return None
        if what == "rubbish":
            return 7
        if what == "raise at once":
            raise ValueError("broken")
        return self._later(what)

    async def _later(self, what: Any) -> None:
        if isinstance(what, BaseException):
            raise what
        if what == "wait":
            await asyncio.sleep(0)


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (ValueError("broken"), "ValueError: broken"),
        (SystemExit(1), "SystemExit: 1"),
        ("raise at once", "ValueError: broken"),
        ("wait", "must not wait"),
        ("rubbish", "AttributeError"),
    ],
    ids=str,
)
def test_a_runner_that_cannot_be_loaded_or_unloaded(what: Any, message: str) -> None:
    compiled = compiled_of(GUARDED)

    def make(interface: str, provider: str) -> Runner:
        return Starting(start=what) if interface == "A" else Starting(stop=what)

    sink, driver = drive(compiled, make)
    assert driver.kernel.status is Status.COMPLETED
    (refused,) = [record for record in sink.records if record.kind is Kind.NOT_LOADED]
    assert message in refused.message
    assert [text for _, _, text in driver.logs if message in text]  # of B and C, when they go
    assert "FAILED 0" in kinds(sink.records)


def test_a_runner_may_be_loaded_without_a_coroutine() -> None:
    sink, driver = drive(
        compiled_of(GUARDED), lambda interface, provider: Starting(start="sync", stop="sync")
    )
    assert driver.kernel.status is Status.COMPLETED
    assert "FAILED 0" not in kinds(sink.records)
    assert driver.logs == []


def test_a_runner_that_cannot_be_made() -> None:
    def make(interface: str, provider: str) -> Runner:
        if interface == "A":
            sys.exit("no")
        return Fine()

    sink, driver = drive(compiled_of(GUARDED), make)
    assert driver.kernel.status is Status.COMPLETED
    assert [text for text in kinds(sink.records) if "NOT_LOADED" in text] == ["NOT_LOADED r0"]


def test_a_runner_that_cancels_its_own_run() -> None:
    drivers: list[VirtualDriver] = []

    async def act(parameters: object, context: RunContext) -> None:
        drivers[0].cancel("it is enough")
        await context.sleep(100)

    sink, driver = drive(compiled_of(plan(par_all("A", "B"))), makes(act), drivers.append)
    assert driver.kernel.status is Status.CANCELLED
    assert driver.now_us() == 0
    assert kinds(sink.records)[-5:] == [
        *("STOPPED 1", "STOPPED 0", "UNLOADED r1", "UNLOADED r0", "ENDED CANCELLED")
    ]


@pytest.mark.parametrize("kind", [Kind.BEGIN, Kind.LOADED, Kind.SUCCEEDED], ids=str)
def test_a_watcher_that_cancels(kind: Kind) -> None:
    """What it does comes after what follows from the input that it watches."""

    def before(driver: VirtualDriver) -> None:
        def watch(at_us: int, happened: Input, records: object) -> None:
            if happened.kind is kind:
                driver.cancel("seen enough")

        driver.watchers.append(watch)

    sink, driver = drive(
        compiled_of(plan(par_all("A", "B"), "C")), lambda interface, provider: Fine(), before
    )
    assert driver.kernel.status is Status.CANCELLED
    assert kinds(sink.records)[-1] == "ENDED CANCELLED"
    assert sink.rows[0][1] == BEGIN


def test_a_sink_that_cannot_write_ends_it_all() -> None:
    class Full(Listing):
        def write(self, at_us: int, happened: Input, records: Any) -> None:
            if happened.kind is Kind.SUCCEEDED:
                raise OSError("disk full")
            super().write(at_us, happened, records)

    stopped: list[str] = []

    async def act(parameters: object, context: RunContext) -> None:
        try:
            await context.sleep(100)
        except StopRequested:
            stopped.append(context.element)
            raise

    driver = VirtualDriver(Kernel(compiled_of(plan(par_all("A", "B")))), Full(), makes(act))
    with pytest.raises(OSError, match="disk full"):
        driver.run()
    assert stopped == ["/Plan/Control[1]/Runner[1]"]
    assert not driver._runners
    with pytest.raises(OSError, match="disk full"):
        driver.cancel("again")


class Chaos(Runner):
    """Does one of many wrong things, as luck has it."""

    async def start(self, context: LoadContext) -> None:
        self.times = 0

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> Any:
        luck = context.random
        for _ in range(luck.randrange(4)):
            with suppress(*luck.choice([(), (StopRequested,), (Exception,), (BaseException,)])):
                await context.sleep(luck.choice([0, 0.1, 2, 20, 1e6]))
            context.log("goes on")
        what = luck.randrange(8)
        if what == 0:
            raise luck.choice([ValueError("x"), SystemExit(1), RunnerError("y", z=object())])  # type: ignore[arg-type]
        if what == 1:
            await Foreign()
        if what == 2:
            await context.sleep(-1)
        if what == 3:
            await context.sleep(float("inf"))
        return luck.choice([None, {}, {"x": 1}, 7, {"x": object()}])

    async def stop(self) -> None:
        raise RuntimeError("never")


@settings(max_examples=many(100))
@given(whole=plans(max_runners=8), seed=st.integers(0, 10_000), timed=st.booleans())
def test_whatever_runners_do_the_run_is_one_of_the_automaton(
    whole: oracle.P, seed: int, timed: bool
) -> None:
    compiled = compiled_of(whole)
    sink, driver = drive(
        compiled,
        lambda interface, provider: Chaos(),
        seed=seed,
        timeout_s=5 if timed else None,
        grace_s=1,
        max_sleeps=50,
    )
    came = {
        record.node - 1: Outcome(record.kind.value)
        for record in sink.records
        if record.kind in (Kind.SUCCEEDED, Kind.FAILED)
    }
    run = Evaluator(compiled.automaton).run(lambda number: came.get(number, Outcome.HANG))
    assert run.ends.value == driver.kernel.status.value
    if timed:
        assert driver.kernel.status is not Status.STUCK
    assert not driver._acting
    assert not driver._runners
    assert [text for text in kinds(sink.records) if text.startswith("ENDED")] == [
        f"ENDED {driver.kernel.status}"
    ]
