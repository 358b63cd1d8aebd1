"""Runners that go on after their end get no further turn, and leave no traces on a terminal."""

from __future__ import annotations

import asyncio
import gc
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Kind, Status
from gpsfsm.execution.runner import StopRequested
from gpsfsm.execution.virtual import VirtualDriver
from tests.execution.misbehaving import GUARDED, Fine, makes
from tests.execution.support import BEGIN, Listing, compiled_of, drive
from tests.oracle import par_any, plan

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.execution.runner import LoadContext, RunContext

CUT_OFF = "did not stop and was cut off"


def swallowing(awaits: int = 1) -> Callable[..., Any]:
    """Goes on whatever is raised where it waits, also when it is closed."""

    async def inner(context: RunContext) -> None:
        while True:
            with suppress(BaseException):
                await context.sleep(1)

    async def act(parameters: object, context: RunContext) -> None:
        await (inner(context) if awaits == 1 else act_deeper(context))

    async def act_deeper(context: RunContext) -> None:
        await inner(context)

    return act


class Stubborn(Fine):
    """Cannot be loaded, and does not let that happen either."""

    async def start(self, context: LoadContext) -> None:
        while True:
            with suppress(BaseException):
                await asyncio.sleep(0)


@pytest.mark.parametrize("awaits", [1, 2])
@pytest.mark.parametrize("max_sleeps", [10, 1_000_000])
def test_who_goes_on_after_the_end_is_left_alone_in_silence(
    awaits: int, max_sleeps: int, capfd: pytest.CaptureFixture[str]
) -> None:
    """No trace when it is freed, which Python would write to standard error; a line instead."""
    compiled = compiled_of(plan(par_any("A", "B")))
    sink, driver = drive(compiled, makes(swallowing(awaits)), grace_s=100, max_sleeps=max_sleeps)
    assert driver.kernel.status is Status.COMPLETED
    (said,) = [happened.message for _, happened, _ in sink.rows if happened.kind is Kind.LOG]
    assert said.startswith("it goes on after its end")
    assert f"STOPPED 0 {CUT_OFF}" in [
        f"{record.kind} {record.node - 1} {record.message}" for record in sink.records
    ]
    del sink, driver
    gc.collect()
    assert capfd.readouterr() == ("", "")


def test_who_goes_on_when_it_is_abandoned_or_loaded(capfd: pytest.CaptureFixture[str]) -> None:
    kernel = Kernel(compiled_of(plan(par_any("A", "B"))))
    driver = VirtualDriver(kernel, Listing(), makes(swallowing()))
    driver.deliver(BEGIN)
    while (driver.next_us() or 0) < 500_000:
        driver.advance()
    driver.abandon()
    assert any("it goes on after its end" in text for _, _, text in driver.logs)
    drive(compiled_of(GUARDED), lambda a, _: Stubborn() if a == "A" else Fine())
    del driver, kernel
    gc.collect()
    assert capfd.readouterr() == ("", "")


def test_who_fails_when_it_is_ended_has_ended() -> None:
    async def act(parameters: object, context: RunContext) -> None:
        with suppress(StopRequested):
            await context.sleep(100)
        try:
            await context.sleep(100)
        finally:
            raise ValueError("while it cleans up")

    sink, driver = drive(compiled_of(plan(par_any("A", "B"))), makes(act), grace_s=2)
    assert [record.message for record in sink.records if record.kind is Kind.STOPPED] == [CUT_OFF]
    assert driver.logs == []
