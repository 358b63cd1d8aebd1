"""Runs the plans of a queue, one after the other, and tells how each one goes."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.cli._past import Plans
from gpsfsm.cli._runs import REAL, WORLD, Shared, exit_code, real, real_maker, simulation, ticking
from gpsfsm.cli._streams import complain
from gpsfsm.cli._views import View, header
from gpsfsm.cli.run import MOST_PLANS
from gpsfsm.errors import GpsfsmError, InputError
from gpsfsm.execution.queues import LiveQueue, VirtualQueue
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.replay import Comparing
from gpsfsm.execution.resume import resume_into, simulate_again
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from gpsfsm.cli._drive import Interrupt, SimulationDriver
    from gpsfsm.cli._gate import PlanGate
    from gpsfsm.cli._past import StoredQueue
    from gpsfsm.cli._runs import Prepared
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.bond import Bond
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal import Heading, Journal
    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import PlanQueue, PlanState, QueueRow
    from gpsfsm.execution.realtime import RealtimeDriver
    from gpsfsm.execution.records import Record

__all__ = ["Begun", "News", "PlanRuns", "Show", "show_past", "worst"]

_ORDER = (0, 1, 2, 130)


def worst(codes: Iterable[int]) -> int:
    """The exit code of several runs: 130 before 2 before 1 before 0."""
    return max(codes, key=_ORDER.index, default=0)


@dataclass(frozen=True, slots=True)
class Show:
    """How runs are shown; ``titled``: a line above the first one as well."""

    output_format: str = "auto"
    verbose: bool = False
    speed: float | None = None
    titled: bool = False
    claim: str = ""  # how a scenario says that the plan ends


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


class _Nowhere:
    """The sink of a run, and of a queue, that nobody journals."""

    def write(self, *_: object) -> None:
        """Keep nothing."""

    def write_queue(self, *_: object) -> None:
        """Keep nothing."""


@dataclass(slots=True)
class _Run:
    """A run that is about to begin, or to go on."""

    prepared: Prepared
    kernel: Kernel
    sink: Sink
    plans: Plans
    view: Callable[[], View]
    news: News
    forced: str
    begun: Begun | None


class PlanRuns:
    """The queue of one command. ``codes`` are the exit codes of its plans.

    ``base`` is the heading of all runs, ``past`` what an earlier process has written about the
    queue, ``begun`` the run that it did not end, ``ids`` those of its runs by their plans.
    """

    def __init__(
        self,
        base: Heading,
        gate: PlanGate,
        show: Show,
        interrupt: Interrupt,
        journal: Journal | None,
        *,
        past: StoredQueue | None = None,
        begun: dict[int, Begun] | None = None,
        ids: dict[int, str] | None = None,
        shared: Shared | None = None,
    ) -> None:
        self.codes: list[int] = []
        self._base, self._gate, self._show = base, gate, show
        self._interrupt, self._journal = interrupt, journal
        self._past, self._begun = past, begun or {}
        self._ids = ids or {}
        self._shared = shared or Shared()
        self._queue: PlanQueue
        self._current: RealtimeDriver | None = None

    def run(self, plans: Sequence[tuple[str, str]], *, bond: Bond | None = None) -> int:
        """Queue plans (names and texts), run what waits, and return the worst exit code."""
        most = self._base.options.get("max_plans")
        most_plans = most if isinstance(most, int) else MOST_PLANS
        log = self._journal or _Nowhere()
        if self._base.mode == REAL:
            import asyncio  # noqa: PLC0415  (slow to import)

            async def serve() -> None:
                live = LiveQueue(self._gate, log, self._live, bond=bond, most_plans=most_plans)
                self._interrupt.action = _from_signal(asyncio.get_running_loop(), self._stop_live)
                if bond is not None:
                    from gpsfsm.cli._beats import beat  # noqa: PLC0415

                    beat(bond, asyncio.get_running_loop())
                self._fill(live, plans)
                live.close()
                await live.serve()

            asyncio.run(serve())
        else:
            queue = VirtualQueue(self._gate, log, self._virtual, most_plans=most_plans)
            self._fill(queue, plans)
            queue.run_all()
        if any(not state.status.ended for state in self._queue.states()):
            self.codes.append(1)
        return worst(self.codes)

    def _fill(self, queue: PlanQueue, plans: Sequence[tuple[str, str]]) -> None:
        self._queue, gate = queue, self._gate
        if self._past is not None:
            gate.trusting = True
            queue.restore(self._past.rows)
            gate.trusting = False
        for name, text in plans:
            gate.name = name
            state = queue.state(queue.submit(text, name=name))
            if state.status is Status.REFUSED:
                if not gate.code:  # the gate has not even been asked
                    complain(f"{name}: {'; '.join(state.findings)}")
                self.codes.append(gate.code or 2)

    # -- one run ------------------------------------------------------------------------------

    def _open(self, state: PlanState, compiled: Compiled) -> _Run:
        """What it takes to run a plan; raises InputError if it cannot be run."""
        passed, begun = self._gate.take(compiled), self._begun.pop(state.plan, None)
        prepared = begun.prepared if begun else self._prepared(state, passed.prepared)
        if prepared.heading.mode == REAL:
            try:
                real_maker(prepared)
            except GpsfsmError as error:
                self.codes.append(2)
                complain(str(error))
                raise InputError(str(error)) from error
        kernel = prepared.kernel()
        sink, news = self._sink(state.plan, prepared, kernel, begun)
        said: list[QueueRow] = []
        if self._past is not None and begun is not None and prepared.heading.mode != REAL:
            said = self._past.said_by(state.plan)
        return _Run(
            prepared=prepared,
            kernel=kernel,
            sink=sink,
            plans=Plans.of(self._queue, state.plan, self._gate, said),
            view=lambda: self._view(state, prepared, kernel, news, fresh=begun is None),
            news=news,
            forced="" if begun else passed.forced,
            begun=begun,
        )

    def _prepared(self, state: PlanState, found: Prepared) -> Prepared:
        """With the heading that this run has in the journal."""
        options: dict[str, Any] = dict(self._base.options)
        if self._ids and self._base.mode == REAL:
            options["nonce"] = os.urandom(8).hex()
        if self._ids and self._base.mode == WORLD:
            options["follows"] = [*self._ids.values()][-1]
        heading = replace(
            found.heading,
            file=state.name,
            seed=self._base.seed + state.plan - 1,
            options=options,
            parent=self._ids.get(state.by, ""),
        )
        return replace(found, heading=heading)

    def _sink(
        self, plan: int, prepared: Prepared, kernel: Kernel, begun: Begun | None
    ) -> tuple[Sink, News]:
        if self._journal is None:
            text = f"{len(self._ids) + 1}\n{prepared.heading.text()}"
            self._ids[plan] = hashlib.sha256(text.encode()).hexdigest()[:32]
            return _Nowhere(), News(None)
        if begun is None:
            queued = (self._queue.now_us(), plan)
            writer = self._journal.begin(kernel, prepared.heading, queued=queued)
        else:
            writer = self._journal.go_on(kernel, begun.run.number)
        self._ids[plan] = writer.id
        if begun is None or prepared.heading.mode == REAL:
            return writer, News(None)
        news = News(Comparing(kernel, begun.rows, writer))
        return news, news

    def _view(
        self, state: PlanState, prepared: Prepared, kernel: Kernel, news: News, *, fresh: bool
    ) -> View:
        titled = fresh and (self._show.titled or state.plan > 1)
        name = clip(state.name, 200) if state.by else f"plan {state.plan}: {clip(state.name, 200)}"
        return View(
            self._show.output_format,
            kernel,
            header=header(prepared.heading) if fresh else "",
            title=f"== {name}" if titled else "",
            verbose=self._show.verbose,
            at_once=prepared.heading.mode == REAL or self._show.speed is not None,
            is_new=lambda: news.is_new,
        )

    def _told(self, view: View, kernel: Kernel) -> None:
        """The last lines about a run."""
        view.say(view.tally.told)
        if self._show.claim not in ("", kernel.status.value):
            view.say(f"The scenario says {self._show.claim}, which this run did not do.")
        self.codes.append(exit_code(kernel.status, self._interrupt))

    # -- in virtual time ----------------------------------------------------------------------

    def _virtual(self, state: PlanState, compiled: Compiled) -> SimulationDriver:
        run = self._open(state, compiled)
        driver = simulation(
            run.prepared,
            run.kernel,
            run.sink,
            self._interrupt,
            speed=self._show.speed,
            shared=self._shared,
            plans=run.plans,
        )
        driver.interrupted = self._cancel_waiting

        def course() -> None:
            with run.view() as view:
                driver.tick = view.tick
                driver.watchers.append(view)
                if run.forced:
                    driver.mark(Input(Kind.NOTE, message=run.forced))
                if run.news.sink is not None:
                    simulate_again(driver, run.news.sink)
                else:
                    VirtualDriver.run(driver)
                self._told(view, run.kernel)
            self._shared.past_us += driver.now_us()

        driver.course = course
        return driver

    # -- in real time -------------------------------------------------------------------------

    def _live(self, state: PlanState, compiled: Compiled) -> _Live:
        run = self._open(state, compiled)
        action = self._interrupt.action
        driver = real(run.prepared, run.kernel, run.sink, self._interrupt, plans=run.plans)
        self._interrupt.action, self._current = action, driver
        if self._interrupt.asked:
            driver.cancel("interrupted")
        return _Live(run, driver, self._told)

    def _stop_live(self) -> None:
        self._cancel_waiting()
        if self._current is not None:
            self._current.cancel("interrupted")

    def _cancel_waiting(self) -> None:
        for state in self._queue.states():
            if state.status is Status.QUEUED:
                self._queue.cancel(state.plan, "interrupted")


class _Live:
    """A run in real time as the queue sees it."""

    def __init__(
        self, run: _Run, driver: RealtimeDriver, told: Callable[[View, Kernel], None]
    ) -> None:
        self.kernel = run.kernel
        self._run, self._driver, self._told = run, driver, told

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
                show_past(view, run.news, run.begun.rows, run.kernel)
            driver.watchers.append(view)
            if run.begun is not None:
                resume_into(driver, run.begun.rows)
            if run.forced:
                driver.mark(Input(Kind.NOTE, message=run.forced))
            if not run.kernel.status.ended:
                await _with_ticks(driver, view.tick)
            self._told(view, run.kernel)


async def _with_ticks(driver: RealtimeDriver, tick: Callable[[int], object]) -> None:
    import asyncio  # noqa: PLC0415

    ticker = asyncio.create_task(ticking(driver, tick))
    try:
        await driver.run()
    finally:
        ticker.cancel()


def _from_signal(loop: Any, action: Callable[[], None]) -> Callable[[], None]:
    """A signal can come at any time: let the event loop do what it asks for."""
    return lambda: loop.call_soon_threadsafe(action)


def show_past(view: View, news: News, rows: list[Row], kernel: Kernel) -> None:
    """Let the view know what has happened already."""
    from gpsfsm.watch.stored import stored_moments  # noqa: PLC0415

    news.is_new = False
    nodes = len(kernel.automaton.nodes)
    for _, moment in stored_moments(rows, nodes, len(kernel.runners)):
        record = moment.record
        view(moment.at_us, Input(record.kind), [record])
    news.is_new = True
