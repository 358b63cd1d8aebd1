"""Runs the plans of a queue, one after the other, and tells how each one goes."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.cli._opened import Begun, LiveRun, News, Opened, from_signal
from gpsfsm.cli._past import Plans
from gpsfsm.cli._real import real, real_maker
from gpsfsm.cli._regenerate import policy_of
from gpsfsm.cli._runs import REAL, WORLD, Shared, exit_code, simulation
from gpsfsm.cli._streams import complain
from gpsfsm.cli._telling import TellingLog
from gpsfsm.cli._views import View, header
from gpsfsm.cli.run import MOST_PLANS
from gpsfsm.errors import GpsfsmError, InputError
from gpsfsm.execution.queues import LiveQueue, VirtualQueue
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.replay import Comparing
from gpsfsm.execution.resume import simulate_again
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.cli._drive import Interrupt, SimulationDriver
    from gpsfsm.cli._gate import PlanGate
    from gpsfsm.cli._keys import Keys
    from gpsfsm.cli._past import StoredQueue
    from gpsfsm.cli._runs import Prepared
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.bond import Bond
    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal import Heading, Journal
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import PlanQueue, PlanState, QueueLog, QueueRow
    from gpsfsm.execution.realtime import RealtimeDriver
    from gpsfsm.watch.steps import StepTaker

__all__ = ["PlanRuns", "Show", "worst"]

_ORDER = (0, 1, 2, 130)
_GO_ON = (WORLD, REAL)
_INTERRUPTED = "interrupted"


def worst(codes: Iterable[int]) -> int:
    """The exit code of several runs: 130 before 2 before 1 before 0. Without a run it is 2."""
    return max(codes, key=_ORDER.index, default=2)


@dataclass(frozen=True, slots=True)
class Show:
    """How runs are shown; ``titled``: a line above the first one as well."""

    output_format: str = "auto"
    verbose: bool = False
    speed: float | None = None
    titled: bool = False
    claim: str = ""  # how a scenario says that the plan ends
    keys: Keys | None = None


class _Nowhere:
    """The sink of a run, and of a queue, that nobody journals."""

    def write(self, *_: object) -> None:
        """Keep nothing."""

    def write_queue(self, *_: object) -> None:
        """Keep nothing."""


class PlanRuns:
    """The queue of one command. ``codes`` are the exit codes of its plans, 0 being no plan.

    ``base`` is the heading of all runs, ``past`` what an earlier process has written about the
    queue, ``begun`` the run that it did not end, ``ids`` those of its runs by their plans,
    ``done`` what they have done.
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
        done: Mapping[int, StepTaker] | None = None,
    ) -> None:
        self.codes: dict[int, int] = {}
        self._base, self._gate, self._show = base, gate, show
        self._interrupt, self._journal = interrupt, journal
        self._past, self._begun = past, begun or {}
        self._ids = ids or {}
        self._shared = shared or Shared()
        self._policy = policy_of(base.options)
        self._done = dict(done or {})
        self._queue: PlanQueue
        self._current: RealtimeDriver | None = None
        self._cancelled = False  # the current one knows that it is to stop

    def run(self, plans: Sequence[tuple[str, str]], *, bond: Bond | None = None) -> int:
        """Queue plans (names and texts), run what waits, and return the worst exit code."""
        most = self._base.options.get("max_plans")
        most_plans = most if isinstance(most, int) else MOST_PLANS
        kept = self._journal or _Nowhere()
        log = TellingLog(kept, self._show.output_format, self.codes, self._interrupt)
        if self._base.mode == REAL:
            import asyncio  # noqa: PLC0415  (slow to import)

            asyncio.run(self._serve(plans, log, most_plans, bond=bond))
        else:
            queue = VirtualQueue(self._gate, log, self._virtual, most_plans=most_plans)
            self._restore(queue)
            for name, text in plans:
                self._given(queue.submit(text, name=name))
            queue.run_all()
        self._left_behind()
        if not self.codes:
            complain("no plan has been run")
        return worst(self.codes.values())

    async def _serve(
        self,
        plans: Sequence[tuple[str, str]],
        log: QueueLog,
        most_plans: int,
        *,
        bond: Bond | None,
    ) -> None:
        import asyncio  # noqa: PLC0415

        from gpsfsm.parallel import CheckApart  # noqa: PLC0415

        loop = asyncio.get_running_loop()
        live = LiveQueue(self._gate, log, self._live, bond=bond, most_plans=most_plans)
        self._interrupt.action = from_signal(loop, self._stop_live)
        if bond is not None:
            from gpsfsm.cli._beats import beat  # noqa: PLC0415

            beat(bond, loop)
        self._restore(live)
        with CheckApart() as apart:  # z3 is used by one thread of a process only
            self._gate.check = apart.check
            for name, text in plans:
                if self._interrupt.asked:
                    self.codes[0] = 130
                    break
                self._given(await live.submitted(text, name=name))
            live.close()
            await live.serve()

    def _left_behind(self) -> None:
        """Tell of plans that have not begun: only a bond that is lost holds them back."""
        left = sum(not state.status.ended for state in self._queue.states())
        left += self._queue.continuing.due() is not None
        if not left:
            return
        self.codes[0] = worst((1, self.codes.get(0, 0)))
        plans = "1 plan has" if left == 1 else f"{left} plans have"
        kept = self._journal is not None and self._ids  # nothing is resumed where nothing began
        complain(
            f"the bond is lost, so {plans} not begun",
            hint="'gpsfsm resume' runs what is left in the journal" if kept else "",
        )

    def _restore(self, queue: PlanQueue) -> None:
        self._queue = queue
        if self._policy is not None and self._shared.model is not None:
            queue.continuing.by(self._regenerate, self._policy)
        if self._past is not None:
            # what really acts is checked, whatever the file says that has been checked before
            self._gate.trusting = self._base.mode != REAL
            queue.restore(self._past.rows)
            self._gate.trusting = False

    def _given(self, plan: int) -> None:
        """A plan of the command line has passed the gate, or not."""
        state, gate = self._queue.state(plan), self._gate
        if state.status is Status.REFUSED:
            if not gate.code:  # the gate has not even been asked
                complain(f"{state.name}: {'; '.join(state.findings)}")
            self.codes[plan] = gate.code or 2

    # -- one run ------------------------------------------------------------------------------

    def _open(self, state: PlanState, compiled: Compiled) -> Opened:
        """What it takes to run a plan; raises InputError if it cannot be run."""
        passed, begun = self._gate.take(compiled), self._begun.pop(state.plan, None)
        prepared = begun.prepared if begun else self._prepared(state, passed.prepared)
        if prepared.heading.mode == REAL:
            try:
                real_maker(prepared, self._shared.model)
            except GpsfsmError as error:
                self.codes[state.plan] = 2
                complain(str(error))
                raise InputError(str(error)) from error
        kernel = prepared.kernel()
        sink, news = self._sink(state.plan, prepared, kernel, begun)
        said: list[QueueRow] = []
        if self._past is not None and begun is not None and prepared.heading.mode != REAL:
            said = self._past.said_by(state.plan)
        return Opened(
            prepared=prepared,
            kernel=kernel,
            sink=sink,
            plans=Plans.of(self._queue, state.plan, said),
            view=lambda: self._view(state, prepared, kernel, news, fresh=begun is None),
            news=news,
            forced=passed.forced,
            begun=begun,
            told=lambda view: self._told(state.plan, view, kernel),
            steps=self._steps(state.plan, prepared, kernel, begun),
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
            keys=self._show.keys,
        )

    def _told(self, plan: int, view: View, kernel: Kernel) -> None:
        """The last lines about a run."""
        view.say(view.tally.told)
        if self._show.claim not in ("", kernel.status.value):
            view.say(f"The scenario says {self._show.claim}, which this run did not do.")
        could = self._base.mode in _GO_ON and "model" not in self._base.options
        if could and kernel.status is Status.GAVE_UP:
            view.say("No model is named (--model) that could write a plan which goes on from here.")
        self.codes[plan] = exit_code(kernel.status, self._interrupt)

    # -- a plan that gave up --------------------------------------------------------------------

    def _steps(
        self, plan: int, prepared: Prepared, kernel: Kernel, begun: Begun | None
    ) -> list[StepTaker]:
        """Who takes down what a plan does, if that will be asked for."""
        if self._policy is None:
            return []
        from gpsfsm.watch.steps import StepTaker  # noqa: PLC0415  (few runs ask a model)

        taker = self._done[plan] = StepTaker(kernel, prepared.words())
        if begun is not None and prepared.heading.mode == REAL:
            taker.take(begun.rows)
        return [taker]

    async def _regenerate(self, due: Due, write: Callable[[QueueRow], None], /) -> None:
        """Ask for a plan that goes on; the first Ctrl-C ends the request."""
        import asyncio  # noqa: PLC0415

        from gpsfsm.cli._regeneration import Regeneration, facts_of  # noqa: PLC0415

        assert self._shared.model is not None
        live, before = self._base.mode == REAL, self._interrupt.action
        if not live:
            loop = asyncio.get_running_loop()
            stop = self._queue.continuing.stop
            self._interrupt.action = from_signal(loop, lambda: stop(_INTERRUPTED))
        regeneration = Regeneration(
            self._shared.model,
            self._base,
            self._done,
            lambda: facts_of(self._shared, self._done.values()),
            apart=live,
        )
        try:
            if self._interrupt.asked:
                self._queue.continuing.stop(_INTERRUPTED)
            await regeneration(due, write)
        finally:
            self._interrupt.action = before
            if self._interrupt.asked:
                self._cancel_waiting()

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
            rows=() if run.begun is None else run.begun.rows,
        )
        driver.interrupted = self._cancel_waiting

        def course() -> None:
            with run.view() as view:
                driver.tick = view.tick
                driver.watchers += [view, *run.steps]
                if run.forced:
                    driver.mark(Input(Kind.NOTE, message=run.forced))
                if (again := run.news.sink) is not None:
                    driver.in_past = lambda: again.next is not None
                    simulate_again(driver, again)
                else:
                    driver.heed()  # a pause outlasts the plan before
                    VirtualDriver.run(driver)
                run.told(view)
            self._shared.past_us += driver.now_us()

        driver.course = course
        return driver

    # -- in real time -------------------------------------------------------------------------

    def _live(self, state: PlanState, compiled: Compiled) -> LiveRun:
        run = self._open(state, compiled)
        action = self._interrupt.action
        driver = real(
            *(run.prepared, run.kernel, run.sink, self._interrupt),
            plans=run.plans,
            model=self._shared.model,
            rows=() if run.begun is None else run.begun.rows,
        )
        self._interrupt.action, self._current = action, driver
        self._cancelled = self._interrupt.asked
        if self._cancelled:
            driver.cancel(_INTERRUPTED)
        return LiveRun(run, driver, self._interrupt)

    def _stop_live(self) -> None:
        self._cancel_waiting()
        self._queue.continuing.stop(_INTERRUPTED)
        if self._current is not None and not self._cancelled:
            self._cancelled = True
            self._current.cancel(_INTERRUPTED)

    def _cancel_waiting(self) -> None:
        for state in self._queue.states():
            if state.status is Status.QUEUED:
                self._queue.cancel(state.plan, _INTERRUPTED)
