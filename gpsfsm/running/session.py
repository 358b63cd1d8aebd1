"""A session: the plans of one queue, driven to their ends in virtual time or for real.

``gpsfsm run``, ``gpsfsm resume``, the service and ``gpsfsm.run`` all drive plans with it. What they
do differently are objects that it takes: the setting says in which world a plan runs and how
its heading begins, the pace when the next event happens, the interruption who may stop it, the
observer who is told.
"""

from __future__ import annotations

import asyncio
import hashlib
import os
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from gpsfsm.errors import GpsfsmError, InputError
from gpsfsm.execution.queue import Ending
from gpsfsm.execution.queues import LiveQueue, VirtualQueue
from gpsfsm.execution.records import Status
from gpsfsm.execution.replay import Comparing
from gpsfsm.model.ros import NETWORK, RosSettings
from gpsfsm.running.bounds import max_plans_of, policy_of
from gpsfsm.running.drivers import (
    Shared,
    ending_maker,
    real_driver,
    real_maker,
    simulated_driver,
)
from gpsfsm.running.history import Plans
from gpsfsm.running.interruption import REASON, Interruption
from gpsfsm.running.one_run import LiveRun, Run, VirtualRun, pausing
from gpsfsm.running.pace import InterruptiblePace, Pace
from gpsfsm.running.prepare import REAL, WORLD

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.execution.bond import Bond
    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.journal import Heading, Journal
    from gpsfsm.execution.queue import PlanQueue, PlanState, QueueLog, QueueRow, Refusal
    from gpsfsm.execution.realtime import RealtimeDriver
    from gpsfsm.execution.registry import Maker
    from gpsfsm.execution.runner import Runner
    from gpsfsm.generation.service import ModelService
    from gpsfsm.running.admission import Admission, Admitted, Decision
    from gpsfsm.running.history import Begun, Unfinished
    from gpsfsm.running.one_run import Observer
    from gpsfsm.running.prepare import Prepared
    from gpsfsm.watch.record_text import StepTaker


class Setting(Protocol):
    """The worlds in which the plans of a session run, and the model that they ask."""

    @property
    def model(self) -> ModelService | None:
        """The model that runners may ask, and that goes on for plans that give up."""

    def shared(self, plan: int) -> Shared:
        """The state that the plans in the world of this one share."""

    def root(self, plan: int) -> int:
        """Plans with the same root run in the same world."""

    def heading(self, plan: int, base: Heading) -> Heading:
        """The heading of the run of a plan, as far as it is not about the plan itself."""

    def began(self, plan: int, run: str) -> None:
        """A plan runs; ``run`` is the id of its run."""


class OneWorld:
    """The setting of a command: all plans run in one world; ``ids`` are those of earlier runs."""

    def __init__(self, shared: Shared | None = None, ids: Iterable[str] = ()) -> None:
        self._shared = shared or Shared()
        self._ids = [*ids]

    @property
    def model(self) -> ModelService | None:
        """The model that all plans share."""
        return self._shared.model

    def shared(self, _plan: int) -> Shared:
        """The state that all plans share."""
        return self._shared

    def root(self, _plan: int) -> int:
        """There is but one."""
        return 0

    def heading(self, plan: int, base: Heading) -> Heading:
        """A seed for each plan, and a nonce for each real run but the first, which has one."""
        options: dict[str, Any] = dict(base.options)
        if self._ids and base.mode == REAL:
            options["nonce"] = os.urandom(8).hex()
        if base.mode == REAL:
            options[NETWORK] = RosSettings.of(options.get("ros")).network(os.environ)
        if self._ids and base.mode == WORLD:
            options["follows"] = self._ids[-1]
        return replace(base, seed=base.seed + plan - 1, options=options)

    def began(self, _plan: int, run: str) -> None:
        """A plan runs."""
        self._ids.append(run)


@dataclass(frozen=True, slots=True)
class Submission:
    """A plan for a session, and what the gate has decided about it, if it has."""

    name: str
    text: str
    decision: Decision | None = None


class _Nowhere:
    """The sink of a run, and of a queue, that nobody journals."""

    def write(self, *_: object) -> None:
        """Keep nothing."""

    def write_queue(self, *_: object) -> None:
        """Keep nothing."""


class _ObservedLog:
    """The log of a queue; who observes is told of each row when it is safe."""

    def __init__(self, log: QueueLog, observer: Observer) -> None:
        self._log, self._observer = log, observer

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        """Keep a row, then tell of it."""
        self._log.write_queue(at_us, row)
        self._observer.wrote(row)


class Session:
    """The plans of one queue. ``base`` is what the headings of their runs have in common.

    ``journal`` keeps the runs, ``log`` the rows of the queue, if that is another one; without
    them nothing is kept. ``pace`` makes the pace of a simulated run, by its number in the queue.
    ``runners`` are real runners beside those that are installed. ``most_plans`` and
    ``most_waiting`` bound the queue. In real time a session is used for one ``run`` or ``serve``.
    """

    queue: PlanQueue[Admitted]

    def __init__(
        self,
        base: Heading,
        admission: Admission,
        observer: Observer,
        *,
        journal: Journal | None = None,
        log: QueueLog | None = None,
        setting: Setting | None = None,
        interruption: Interruption | None = None,
        pace: Callable[[int], Pace] | None = None,
        speed: float | None = None,
        runners: Mapping[str, type[Runner]] | None = None,
        most_plans: int | None = None,
        most_waiting: int = 100,
    ) -> None:
        self.base = base
        self._admission, self._observer, self._journal = admission, observer, journal
        self._log = _ObservedLog(log or journal or _Nowhere(), observer)
        self._setting: Setting = setting or OneWorld()
        self._interruption = interruption or Interruption()
        self._pace = pace or (lambda _: self._own_pace(speed))
        self._runners = runners
        self._most_plans = most_plans or max_plans_of(base.options)
        self._most_waiting = most_waiting
        self._policy = policy_of(base.options)
        self._ids: dict[int, str] = {}
        self._begun: dict[int, Begun] = {}
        self._steps: dict[int, StepTaker] = {}
        self._current: RealtimeDriver | None = None  # the run that is not yet to stop
        if base.mode != REAL:
            self.queue = VirtualQueue(
                *(self._decide, self._log, self._virtual),
                most_waiting=self._most_waiting,
                most_plans=self._most_plans,
            )

    def _own_pace(self, speed: float | None) -> Pace:
        return InterruptiblePace(self._interruption, speed, self._cancel_waiting)

    # -- all plans ------------------------------------------------------------------------------

    def run(
        self,
        plans: Iterable[Submission] = (),
        *,
        unfinished: Unfinished | None = None,
        bond: Bond | None = None,
    ) -> None:
        """Queue plans, behind those that another process left, and run what waits."""
        if self.base.mode == REAL:
            asyncio.run(self.serve(plans, unfinished=unfinished, bond=bond))
            return
        assert isinstance(self.queue, VirtualQueue)
        self.take_up(unfinished)
        for each in plans:
            decisions, gate = self._gate_of(each)
            self._report(self.queue.submit(each.text, name=each.name, gate=gate), decisions)
        self.queue.run_all()
        self._left_behind()

    async def serve(
        self,
        plans: Iterable[Submission] = (),
        *,
        unfinished: Unfinished | None = None,
        bond: Bond | None = None,
    ) -> None:
        """The same in real time, on the event loop of the caller."""
        from gpsfsm.checking.parallel import CheckApart

        loop = asyncio.get_running_loop()
        live = self.live_queue(bond)
        self._interruption.on_request = _from_signal(loop, self._stop_live)
        if bond is not None:
            from gpsfsm.execution.bond import beat_on_input

            beat_on_input(bond, loop)
        self.take_up(unfinished)
        try:
            with CheckApart() as apart:  # z3 is used by one thread of a process only
                self._admission.check = apart.check
                left = deque(plans)
                while left and not self._interruption.requested:
                    each = left.popleft()
                    decisions, gate = self._gate_of(each)
                    plan = await live.submitted(each.text, name=each.name, gate=gate)
                    self._report(plan, decisions)
                live.close()
                if left:
                    self._observer.not_submitted([each.name for each in left])
                await live.serve()
        finally:
            self._interruption.let_go()
        self._left_behind()

    def live_queue(self, bond: Bond | None = None) -> LiveQueue[Admitted]:
        """The queue of the session in real time, made on the event loop of the caller."""
        live = LiveQueue(
            *(self._decide, self._log, self._live),
            bond=bond,
            most_waiting=self._most_waiting,
            most_plans=self._most_plans,
            look=self._look,
        )
        self.queue = live
        return live

    def take_up(self, unfinished: Unfinished | None, ending: str = "") -> None:
        """Go on with the queue of another process, and ask a model from now on.

        ``ending``: why real runs are brought to their ends, not gone on with, and the queue held.
        """
        if self._policy is not None and self._setting.model is not None:
            self.queue.continuing.by(self._regenerate, self._policy)
        if unfinished is None:
            return
        self._ids |= unfinished.ids
        self._begun |= unfinished.begun
        self._steps |= unfinished.steps
        # what really acts is checked, whatever the file says that has been checked before
        gate = self._decide if self.base.mode == REAL else self._admission.trust
        self.queue.restore(
            unfinished.queue.rows,
            unfinished.gate or gate,
            Ending(ending, self._begun, self._admission.trust) if ending else None,
        )

    def _decide(self, text: str, name: str) -> Admitted | Refusal:
        decision = self._admission.decide(text, name)
        self._observer.decided(decision)
        return decision

    def _gate_of(self, plan: Submission) -> tuple[list[Decision], Callable[..., Any]]:
        """The gate of one plan, and a list in which its decision will be, if it is asked."""
        decisions: list[Decision] = []

        def gate(text: str, name: str) -> Admitted | Refusal:
            if plan.decision is None:
                decision = self._admission.decide(text, name)
                self._observer.decided(decision)
            else:
                decision = plan.decision
            decisions.append(decision)
            return decision

        return decisions, gate

    def _report(self, plan: int, decisions: list[Decision]) -> None:
        """A plan has passed the gate, or not."""
        state = self.queue.state(plan)
        if state.status is Status.REFUSED:
            self._observer.refused(state, decisions[0] if decisions else None)

    def _left_behind(self) -> None:
        """Tell of plans that have not begun: only a bond that is lost holds them back."""
        left = sum(not state.status.ended for state in self.queue.states())
        left += self.queue.continuing.due() is not None
        if left:  # nothing is resumed where nothing began
            resumable = self._journal is not None and bool(self._ids)
            self._observer.not_begun(left, resumable=resumable)

    # -- one run ------------------------------------------------------------------------------

    def _open(self, state: PlanState, admitted: Admitted) -> Run:
        """A plan, opened to be run; raises InputError if it cannot be run."""
        begun = self._begun.pop(state.plan, None)
        prepared = begun.prepared if begun else self._prepared(state, admitted.prepared)
        submissions = begun.submissions if begun and prepared.heading.mode != REAL else ()
        run = self._opened(prepared, begun, state)
        run.plans = Plans.of(self.queue, state.plan, submissions)
        run.forced = admitted.forced
        if self._policy is not None:
            from gpsfsm.watch.record_text import StepTaker

            taker = self._steps[state.plan] = StepTaker(run.kernel, prepared.words())
            if begun is not None and prepared.heading.mode == REAL:
                taker.take(begun.rows)
            run.steps = [taker]
        return run

    def _prepared(self, state: PlanState, admitted: Prepared) -> Prepared:
        """With the heading that this run has in the journal."""
        heading = replace(
            self._setting.heading(state.plan, self.base),
            plan=admitted.heading.plan,
            file=state.name,
            parent=self._ids.get(state.by, ""),
        )
        return replace(admitted, heading=heading)

    def _opened(self, prepared: Prepared, begun: Begun | None, state: PlanState | None) -> Run:
        """A run in its journal, if there is one."""
        plan = 0 if state is None else state.plan
        kernel = prepared.kernel()
        run = Run(prepared, kernel, _Nowhere(), None, state, begun=begun)
        if self._journal is not None:
            run.beat = self._journal.beat
        if self._journal is None:
            text = f"{len(self._ids) + 1}\n{prepared.heading.text()}"
            run_id = hashlib.sha256(text.encode()).hexdigest()[:32]
        elif begun is None:
            writer = self._journal.begin(
                kernel, prepared.heading, queued=(self.queue.now_us(), plan)
            )
            run.sink, run.number, run_id = writer, writer.number, writer.id
        else:
            writer = self._journal.go_on(kernel, begun.run.number)
            run.sink, run.number, run_id = writer, writer.number, writer.id
            if prepared.heading.mode != REAL:
                run.sink = run.again = Comparing(kernel, begun.rows, writer)
        self._ids[plan] = run_id
        self._setting.began(plan, run_id)
        return run

    # -- in virtual time ----------------------------------------------------------------------

    def _virtual(self, state: PlanState, admitted: Admitted) -> VirtualRun:
        return self._simulated(self._open(state, admitted), state.plan)

    def _simulated(self, run: Run, plan: int) -> VirtualRun:
        shared, pace = self._setting.shared(plan), self._pace(plan)
        pace.past, shared.notify = run.again, self._observer.notice
        driver = simulated_driver(
            run.prepared,
            run.kernel,
            run.sink,
            pace,
            interruption=self._interruption,
            shared=shared,
            plans=run.plans,
            rows=run.rows(),
        )
        return VirtualRun(run, driver, pace, shared, self._observer)

    # -- in real time -------------------------------------------------------------------------

    async def _look(self, state: PlanState, admitted: Admitted) -> None:
        """Raises InputError with all that a plan needs on the robot and that is not there.

        A run that goes on has been looked at, and its goals may act: it is to take them up.
        """
        if state.plan in self._begun or state.plan in self.queue.ending:
            return
        from gpsfsm.running.looking import refuse_missing

        of_runners = self._setting.model, self._runners, self._admission.advice
        try:
            await refuse_missing(admitted.prepared, *of_runners)
        except GpsfsmError as error:
            self._observer.cannot_run(state.plan, str(error))
            raise InputError(str(error)) from error

    def _live(self, state: PlanState, admitted: Admitted) -> LiveRun:
        prepared = admitted.prepared
        if state.plan in self._begun:
            prepared = self._begun[state.plan].prepared
        try:
            maker = self._maker_of(prepared, state.plan)
        except GpsfsmError as error:
            self._observer.cannot_run(state.plan, str(error))
            raise InputError(str(error)) from error
        run = self._open(state, admitted)
        driver = real_driver(
            *(run.prepared, run.kernel, run.sink, maker),
            plans=run.plans,
            model=self._setting.model,
            rows=run.rows(),
        )
        self._interruption.on_pause = pausing(driver)
        self._current = None if self._interruption.requested else driver
        if self._interruption.requested:
            driver.cancel(REASON)
        ending = self.queue.ending.get(state.plan, "")
        return LiveRun(
            *(run, driver, self._interruption, self._observer),
            ending=ending,
            in_doubt=self._doubted,
        )

    def _doubted(self, doubts: Sequence[str]) -> None:
        """Something may still act on the robot: no other plan begins."""
        if hasattr(self, "queue"):  # who serves writes it down; a command ends, and is resumed
            self.queue.held = self.queue.held or f"in doubt: {doubts[0]}"
            self.queue.continuing.stop()
        self._observer.in_doubt(doubts)

    def _maker_of(self, prepared: Prepared, plan: int = 0) -> Maker:
        """The maker of the real runners of a plan. Raises GpsfsmError.

        For a run that is only brought to its end whatever there is of them has to do.
        """
        advice = self._admission.advice
        if plan and plan in self.queue.ending:
            return ending_maker(prepared, self._admission.library, self._runners, advice)
        return real_maker(prepared, self._setting.model, self._runners, advice)

    def _stop_live(self) -> None:
        self._cancel_waiting()
        self.queue.continuing.stop(REASON)
        if self._current is not None:
            self._current.cancel(REASON)
            self._current = None

    def _cancel_waiting(self) -> None:
        for state in self.queue.states():
            if state.status is Status.QUEUED:
                self.queue.cancel(state.plan, REASON)

    # -- without a queue ----------------------------------------------------------------------

    def go_on(self, begun: Begun, forced: str = "") -> None:
        """Take a run to its end that no queue waits for."""
        if self.base.mode == REAL:
            asyncio.run(self.go_on_live(begun, forced))
            return
        run = self._opened(begun.prepared, begun, None)
        run.plans, run.forced = begun.plans(), forced
        self._simulated(run, 0).run()

    async def go_on_live(self, begun: Begun, forced: str = "") -> None:
        """The same in real time, on the event loop of the caller."""
        run = self._opened(begun.prepared, begun, None)
        run.forced = forced
        driver = real_driver(
            *(run.prepared, run.kernel, run.sink, self._maker_of(run.prepared)),
            model=self._setting.model,
            rows=begun.rows,
        )
        loop = asyncio.get_running_loop()
        self._interruption.on_request = _from_signal(loop, lambda: driver.cancel(REASON))
        if self._interruption.requested:
            driver.cancel(REASON)
        self._interruption.on_pause = pausing(driver)
        try:
            await LiveRun(
                *(run, driver, self._interruption, self._observer), in_doubt=self._doubted
            ).run()
        finally:
            self._interruption.let_go()

    # -- a plan that gave up --------------------------------------------------------------------

    async def _regenerate(self, due: Due, write: Callable[[QueueRow], None], /) -> None:
        """Ask for a plan that goes on; an interruption ends the request."""
        from gpsfsm.running.continuation import Regeneration, facts_of

        live, before = self.base.mode == REAL, self._interruption.on_request
        shared, root = self._setting.shared(due.gave_up), self._setting.root(due.gave_up)
        steps = [each for plan, each in self._steps.items() if self._setting.root(plan) == root]
        assert shared.model is not None
        if not live:
            loop, stop = asyncio.get_running_loop(), self.queue.continuing.stop
            self._interruption.on_request = _from_signal(loop, lambda: stop(REASON))
        regeneration = Regeneration(
            *(shared.model, self.base, self._steps),
            lambda: facts_of(shared, steps),
            apart=live,
        )
        try:
            if self._interruption.requested:
                self.queue.continuing.stop(REASON)
            await regeneration(due, write)
        finally:
            self._interruption.on_request = before
            if self._interruption.requested:
                self._cancel_waiting()


def _from_signal(
    loop: asyncio.AbstractEventLoop, action: Callable[[], None]
) -> Callable[[], object]:
    """A signal can come at any time: let the event loop do what it asks for, while there is one."""

    def request() -> None:
        with suppress(RuntimeError):  # it is closed, so nothing runs
            loop.call_soon_threadsafe(action)

    return request
