"""One run of a session, in virtual time or for real, and those who observe it."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.records import Input, Kind
from gpsfsm.execution.replay import resume_into, simulate_again
from gpsfsm.model.report import Report
from gpsfsm.running.admission import Refused
from gpsfsm.streams import complain, to_stderr

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from types import TracebackType
    from typing import Self

    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import PlanState
    from gpsfsm.execution.queue_rows import QueueRow
    from gpsfsm.execution.realtime import RealtimeDriver
    from gpsfsm.execution.records import Record
    from gpsfsm.execution.replay import Comparing
    from gpsfsm.execution.virtual import VirtualDriver
    from gpsfsm.running.admission import Decision
    from gpsfsm.running.drivers import Shared
    from gpsfsm.running.history import Begun, Plans
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.pace import Pace
    from gpsfsm.running.prepare import Prepared
    from gpsfsm.watch.record_text import StepTaker


class RunObserver:
    """A watcher of one run, entered while it runs; this one does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """The run is over, also by an exception."""

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Take in what has happened."""

    def tick(self, now_us: int) -> None:
        """Nothing happens at this time of the run."""

    def recall(self, rows: Sequence[Row], kernel: Kernel) -> None:
        """Take in what another process has journaled of the run."""

    def ended(self) -> None:
        """The plan has ended, and nothing has gone wrong."""


class Observer:
    """The listener of a session while it runs its plans; this one ignores all."""

    def notice(self, message: str, hint: str = "") -> None:
        """Something that people should read."""

    def decided(self, decision: Decision) -> None:
        """The gate has decided about a plan; may be called from a thread."""

    def wrote(self, row: QueueRow) -> None:
        """A row about the queue is in the journal."""

    def refused(self, state: PlanState, decision: Decision | None) -> None:
        """A submitted plan is not run; the queue has refused it if there is no decision."""

    def cannot_run(self, plan: int, message: str) -> None:
        """A plan that has passed the gate cannot be run."""

    def not_begun(self, plans: int, *, resumable: bool) -> None:
        """The bond is lost, so some plans have not begun."""

    def in_doubt(self, doubts: Sequence[str]) -> None:
        """A run has ended although something may still act on the robot."""

    def not_submitted(self, names: Sequence[str]) -> None:
        """An interruption came before the plans with these names were submitted."""

    def run_begins(self, _run: Run) -> RunObserver:
        """A run begins, or goes on."""
        return RunObserver()


class StderrObserver(Observer):
    """Writes notices, and what is wrong with plans, to standard error."""

    def notice(self, message: str, hint: str = "") -> None:
        """Something that people should read."""
        complain(message, hint=hint)

    def decided(self, decision: Decision) -> None:
        """Write the errors of a plan, and why it is not run."""
        if decision.errors is not None and decision.errors.findings:
            from gpsfsm.report import RenderOptions, render

            to_stderr(render(Report((decision.errors,)), options=RenderOptions(quiet=True)))
        if isinstance(decision, Refused):
            complain(decision.message)


_TICK_S = 0.2


@dataclass(slots=True)
class Run:
    """A run of a session. ``number`` is the one that it has in the journal, 0 without a journal.

    ``begun`` is what another process has done of it, ``again`` the sink that compares what comes
    once more, ``state`` what the queue knew as it began: None for a run that no queue waits for.
    """

    prepared: Prepared
    kernel: Kernel
    sink: Sink
    plans: Plans | None
    state: PlanState | None = None
    number: int = 0
    forced: str = ""
    begun: Begun | None = None
    again: Comparing | None = None
    steps: list[StepTaker] = field(default_factory=list)
    beat: Callable[[], object] = lambda: None  # gives a sign of life to who reads the journal

    @property
    def is_new(self) -> bool:
        """True if what happened last is news: in virtual time the past comes once more."""
        return self.again is None or self.again.is_new

    def rows(self) -> Iterable[Any]:
        """The rows that another process has journaled of it."""
        return () if self.begun is None else self.begun.rows


class VirtualRun:
    """A run in virtual time as the queue sees it."""

    def __init__(
        self, run: Run, driver: VirtualDriver, pace: Pace, shared: Shared, observer: Observer
    ) -> None:
        self.kernel = run.kernel
        self._run, self._driver, self._pace = run, driver, pace
        self._shared, self._observer = shared, observer

    @property
    def failure(self) -> BaseException | None:
        """The reason why the run cannot be journaled any more."""
        return self._driver.failure

    @failure.setter
    def failure(self, error: BaseException | None) -> None:
        self._driver.failure = error

    def now_us(self) -> int:
        """The virtual time since the run began."""
        return self._driver.now_us()

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Do something at a time of the run."""
        self._driver.at(at_us, action)

    def cancel(self, reason: str) -> None:
        """Stop the run."""
        self._driver.cancel(reason)

    def run(self) -> None:
        """Run, or go on, until the plan has ended."""
        run, driver = self._run, self._driver
        with self._observer.run_begins(run) as observer:
            self._pace.tick = observer.tick
            driver.watchers += [*run.steps, observer]
            if run.forced:
                driver.mark(Input(Kind.NOTE, message=run.forced))
            if run.again is not None:
                simulate_again(driver, run.again)
            else:
                self._pace.before_run(driver)
                driver.run()
            observer.ended()
        self._pace.over()
        self._shared.past_us += driver.now_us()


class LiveRun:
    """A run in real time as the queue sees it.

    ``ending``: why a run of another process is brought to its end, "" to go on with it.
    ``in_doubt`` is told what may still act once it has ended, before another plan can begin.
    """

    def __init__(
        self,
        run: Run,
        driver: RealtimeDriver,
        interruption: Interruption,
        observer: Observer,
        *,
        ending: str = "",
        in_doubt: Callable[[Sequence[str]], None] = lambda _: None,
    ) -> None:
        self.kernel = run.kernel
        self._run, self._driver, self._ending = run, driver, ending
        self._in_doubt = in_doubt
        self._interruption, self._observer = interruption, observer

    @property
    def failure(self) -> BaseException | None:
        """The reason why the run cannot be journaled any more."""
        return self._driver.failure

    @failure.setter
    def failure(self, error: BaseException | None) -> None:
        self._driver.failure = error

    def cancel(self, reason: str) -> None:
        """Stop the run."""
        self._driver.cancel(reason)

    def pause(self, *, on: bool) -> None:
        """Trigger nothing more, or go on."""
        pausing(self._driver)(on)

    def now_us(self) -> int:
        """The time of the run."""
        return self._driver.now_us()

    async def run(self) -> None:
        """Run, or go on, until the plan has ended."""
        run, driver, kernel = self._run, self._driver, self.kernel
        with self._observer.run_begins(run) as observer:
            if run.begun is not None:
                observer.recall(run.begun.rows, kernel)
            driver.watchers += [*run.steps, observer]
            if run.begun is not None:
                resume_into(driver, run.begun.rows, self._ending)
            if run.forced:
                driver.mark(Input(Kind.NOTE, message=run.forced))
            if run.begun is None and self._interruption.paused:
                driver.deliver(Input(Kind.PAUSE))  # a pause outlasts the plan before
            if not kernel.status.ended:
                ticker = asyncio.create_task(_ticking(driver, observer, run.beat))
                try:
                    await driver.run()
                finally:
                    ticker.cancel()
                    if doubts := dict.fromkeys((*driver.doubts, *_left())):
                        self._in_doubt([*doubts])
            observer.ended()


def _left() -> list[str]:
    """Words for the goals that may still act, whoever waits for them."""
    from gpsfsm.ros.ledger import OURS

    return [each.words for each in OURS.open() if not each.is_request]


async def _ticking(
    driver: RealtimeDriver, observer: RunObserver, beat: Callable[[], object]
) -> None:
    """Tell the time of the run now and then, for ever."""
    while True:
        beat()
        await asyncio.sleep(_TICK_S)
        observer.tick(driver.now_us())


def pausing(driver: RealtimeDriver) -> Callable[[bool], None]:
    """Let a driver pause, or go on."""
    return lambda paused: driver.pause() if paused else driver.resume()
