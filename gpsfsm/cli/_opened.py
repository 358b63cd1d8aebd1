"""A run of a queue that is about to begin or to go on, and how one goes in real time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.cli._runs import ticking
from gpsfsm.execution.records import Input, Kind
from gpsfsm.execution.resume import resume_into

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.cli._drive import Interrupt
    from gpsfsm.cli._past import Plans
    from gpsfsm.cli._runs import Prepared
    from gpsfsm.cli._views import View
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.realtime import RealtimeDriver
    from gpsfsm.execution.records import Record
    from gpsfsm.execution.replay import Comparing
    from gpsfsm.watch.steps import StepTaker

__all__ = ["Begun", "LiveRun", "News", "Opened", "from_signal"]


@dataclass(frozen=True, slots=True)
class Begun:
    """A run that another process began."""

    run: StoredRun
    prepared: Prepared
    rows: list[Row]


class News:
    """A sink that knows whether an event is news: in virtual time the past comes once more."""

    def __init__(self, sink: Comparing | None) -> None:
        self.sink = sink
        self.is_new = True

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Compare or keep an event."""
        assert self.sink is not None
        self.is_new = self.sink.next is None
        self.sink.write(at_us, happened, records)


@dataclass(slots=True)
class Opened:
    """A run that is about to begin, or to go on."""

    prepared: Prepared
    kernel: Kernel
    sink: Sink
    plans: Plans
    view: Callable[[], View]
    news: News
    forced: str
    begun: Begun | None
    told: Callable[[View], None]  # writes the last lines
    steps: list[StepTaker]


class LiveRun:
    """A run in real time as the queue sees it."""

    def __init__(self, run: Opened, driver: RealtimeDriver, interrupt: Interrupt) -> None:
        self.kernel = run.kernel
        self._interrupt = interrupt
        self._run, self._driver = run, driver

    @property
    def failure(self) -> BaseException | None:
        """Why the run cannot be journaled any more."""
        return self._driver.failure

    @failure.setter
    def failure(self, error: BaseException | None) -> None:
        self._driver.failure = error

    def cancel(self, reason: str) -> None:
        """Stop the run."""
        self._driver.cancel(reason)

    async def run(self) -> None:
        """Run, or go on, until the plan has ended."""
        run, driver = self._run, self._driver
        with run.view() as view:
            if run.begun is not None:
                view.recall(run.begun.rows, run.kernel)
            driver.watchers += [view, *run.steps]
            if run.begun is not None:
                resume_into(driver, run.begun.rows)
            if run.forced:
                driver.mark(Input(Kind.NOTE, message=run.forced))
            if run.begun is None and self._interrupt.paused:
                driver.deliver(Input(Kind.PAUSE))  # a pause outlasts the plan before
            if not run.kernel.status.ended:
                await _with_ticks(driver, view.tick)
            run.told(view)


async def _with_ticks(driver: RealtimeDriver, tick: Callable[[int], object]) -> None:
    import asyncio  # noqa: PLC0415

    ticker = asyncio.create_task(ticking(driver, tick))
    try:
        await driver.run()
    finally:
        ticker.cancel()


def from_signal(loop: Any, action: Callable[[], None]) -> Callable[[], None]:
    """A signal can come at any time: let the event loop do what it asks for."""
    return lambda: loop.call_soon_threadsafe(action)
