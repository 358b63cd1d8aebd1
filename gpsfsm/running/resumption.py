"""Resumption of runs: what another process has left to be done in a journal."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError, UsageError
from gpsfsm.execution.chain import Chains
from gpsfsm.execution.journal_errors import DamagedJournalError, EmptyJournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.queue import QueueKind
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import NETWORK, RosSettings
from gpsfsm.running.admission import Refused, as_text
from gpsfsm.running.bounds import policy_of
from gpsfsm.running.drivers import real_maker
from gpsfsm.running.history import (
    OF_ONE_RUN,
    begun_with_past,
    queue_of,
    queues,
    simulated_world,
    unfinished,
)
from gpsfsm.running.prepare import FABRIC, OF_A_JOURNAL, REAL, WORLD
from gpsfsm.running.session import OneWorld, Session
from gpsfsm.running.worlds import Starts

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.journal import Heading, Journal
    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.execution.runner import Runner
    from gpsfsm.generation.service import ModelService
    from gpsfsm.running.admission import Admission, Decision
    from gpsfsm.running.history import Begun, Notify, StoredQueue, Unfinished
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.one_run import Observer
    from gpsfsm.running.prepare import Prepared


class Resumption:
    """A run that has no end in its journal, or the queue to which it belongs.

    ``run`` is the run to go on with; one that has ended says how the runs of its queue are made.
    ``queue`` is None if no queue waits for it. Raises GpsfsmError if there is no such run.
    """

    this: Begun
    base: Heading

    def __init__(self, reader: JournalReader, number: int | None, notify: Notify) -> None:
        self.queue = _open_queue(reader, number)
        self.run = _run_of(reader, self.queue, number)
        if self.run.mode == FABRIC:
            raise UsageError(
                f"run {self.run.number} was driven by a Fabric server, and only that server could "
                "continue it; 'gpsfsm dispatch' submits the plan again"
            )
        if not self.ended:
            _refuse_served(reader, self.run)
        self._reader, self._notify = reader, notify
        self._earlier: list[Begun] = []
        self._decisions: dict[tuple[str, str], Decision] = {}
        self._unfinished: Unfinished | None = None

    @property
    def ended(self) -> bool:
        """True if nothing is left to be done."""
        return self.queue is None and self.run.status.ended

    def load(self, permitted: Callable[[Heading], Heading]) -> None:
        """Read what has happened; ``permitted`` is the heading with what is allowed now."""
        this, self._earlier = begun_with_past(self._reader, self.run, self._notify)
        heading = permitted(this.prepared.heading)
        self.this = replace(this, prepared=replace(this.prepared, heading=heading))
        self.base = heading
        if self.queue is not None:
            options = {
                name: each for name, each in heading.options.items() if name not in OF_ONE_RUN
            }
            seed = heading.seed - self.queue.plan_of(self.run) + 1
            self.base = replace(heading, seed=seed, options=options, parent="")

    def refused(self, admission: Admission, observer: Observer) -> list[Refused]:
        """The real plans that are left and may not run: then none does.

        They passed a gate when they were journaled, or so the file says.
        """
        heading = self.this.prepared.heading
        if heading.mode != REAL:
            return []
        plans = [(self.run.file, as_text(heading.plan))]
        if self.queue is not None:
            if plans[0][1] != self.queue.text(self.queue.plan_of(self.run)):
                raise DamagedJournalError(
                    f"run {self.run.number} is not that of the plan that was queued"
                )
            plans = self.queue.waiting()
        for name, text in plans:
            self._decisions[name, text] = admission.decide(text, name, OF_A_JOURNAL)
            observer.decided(self._decisions[name, text])
        return [each for each in self._decisions.values() if isinstance(each, Refused)]

    def session(
        self,
        admission: Admission,
        observer: Observer,
        model: ModelService | None,
        *,
        journal: Journal,
        interruption: Interruption,
        runners: Mapping[str, type[Runner]] | None = None,
    ) -> Session:
        """The session that goes on. Raises GpsfsmError if that is not possible."""
        if self.base.mode == REAL and not self.run.status.ended:
            _refuse_elsewhere(self.run.number, self.this.prepared)
            real_maker(self.this.prepared, model, runners, admission.advice)
        before = self._earlier
        if self.queue is not None:
            plan = self.queue.plan_of(self.run)
            _refuse_other_worlds(self._reader.path, self.queue, plan)
            goes_on = plan in self.queue.open()
            left = unfinished(
                self._reader, self.queue, self.base, {plan: self.this} if goes_on else {}
            )
            before = before if goes_on else [*before, self.this]
            self._unfinished = replace(left, gate=self._gate) if self._decisions else left
        shared = simulated_world(before if self.base.mode == WORLD else (), self._notify)
        shared.model = model
        ids = () if self._unfinished is None else self._unfinished.ids.values()
        return Session(
            *(self.base, admission, observer),
            journal=journal,
            setting=OneWorld(shared, ids),
            interruption=interruption,
            runners=runners,
        )

    def _gate(self, text: str, name: str) -> Decision:
        return self._decisions[name, text]

    def go_on(self, session: Session) -> None:
        """Take the run to its end, or the queue to that of its last plan."""
        if self._unfinished is None:
            session.go_on(self.this, self._forced)
        else:
            session.run(unfinished=self._unfinished)

    async def go_on_live(self, session: Session) -> None:
        """The same for real runners, on the event loop of the caller."""
        if self._unfinished is None:
            await session.go_on_live(self.this, self._forced)
        else:
            await session.serve(unfinished=self._unfinished)

    @property
    def _forced(self) -> str:
        """In spite of what a run goes on that no queue waits for."""
        return next((getattr(each, "forced", "") for each in self._decisions.values()), "")


def refuse_empty(path: str) -> None:
    """Raises InputError if no run is in the journal."""
    try:
        with JournalReader(path) as reader:
            if reader.has_runs():
                return
            reader.check()  # maybe there was one
    except EmptyJournalError:
        pass
    raise InputError(
        f"{path}: it contains no run. If it is a copy, copy {path}-wal and {path}-seen as well; "
        "otherwise nothing of the plan has been run: run it again"
    )


def _open_queue(reader: JournalReader, number: int | None) -> StoredQueue | None:
    """The last queue of the journal, if something is left to do in it and it is asked for."""
    every = queues(reader)
    if not every:
        return None
    queue, runs = every[-1], every[-1].runs()
    left = [*queue.open(), *_owed(reader, queue)]
    if not left:
        return None
    last = reader.runs()[-1:]
    if runs and last and last[0].number not in runs.values():
        return None
    if number is not None and number not in [runs.get(plan) for plan in left]:
        return None
    return queue


def _owed(reader: JournalReader, queue: StoredQueue) -> tuple[int, ...]:
    """The plan that gave up, if another one is owed to it."""
    last = [*queue.runs().values()][-1:]
    if not last or policy_of(reader.run(last[0]).options) is None:
        return ()
    chains = Chains()
    for _, row in queue.rows:
        chains.take(row)
    due = chains.due()
    return () if due is None else (due.gave_up,)


def _run_of(reader: JournalReader, queue: StoredQueue | None, number: int | None) -> StoredRun:
    """The run to go on with; else the last one of the queue, which says how its runs are made."""
    if queue is None:
        return reader.run(number)
    runs = queue.runs()
    if not runs:
        raise UsageError(
            f"{reader.path}: no plan of the last queue had begun; run the plans once more"
        )
    last = [*runs.values()][-1]
    return reader.run(next((runs[plan] for plan in queue.open() if plan in runs), last))


def _refuse_served(reader: JournalReader, run: StoredRun) -> None:
    """Raises UsageError for a run of a service with real runners, or before plans that wait there.

    Nothing moves there before somebody has released the queue.
    """
    every = queues(reader)
    place = queue_of(every, run.number)
    if place is None:
        return
    rows = [row for _, row in every[place[0] - 1].rows if row.kind is QueueKind.SUBMITTED]
    if any((row.data or {}).get(REAL) is True for row in rows):
        raise UsageError(
            f"{reader.path}: these plans were queued for a robot by clients of a service; start "
            "'gpsfsm serve --real' with this journal: it cancels the plan that was running, and "
            "starts nothing until the queue is released"
        )


def _refuse_elsewhere(number: int, prepared: Prepared) -> None:
    """Raises UsageError if the robot of a run is on another network than this process."""
    options = prepared.heading.options
    was: object = options.get(NETWORK)
    settings = RosSettings.of(options.get("ros"))
    described = [prepared.library.resolve(*each).provider for each in prepared.kernel().runners]
    acts = settings.via or any(each is not None and each.ros for each in described)
    if not acts or not isinstance(was, dict):  # of an earlier gpsfsm
        return
    now = settings.network(os.environ)
    for name in dict.fromkeys((*was, *now)):
        if (before := was.get(name)) != (here := now.get(name)):
            raise UsageError(
                f"the robot of run {number} is in another place: {name} was "
                f"{clip(str(before or 'not set'), 200)}, and here it is {here or 'not set'}. Set "
                "the environment as it was: the run can be resumed"
            )


def _refuse_other_worlds(path: str, queue: StoredQueue, plan: int) -> None:
    """Raises UsageError if plans wait that do not belong into the world of this one."""
    starts, runs = Starts(), queue.runs()
    for _, row in queue.rows:
        starts.take(row)
    waiting = [each for each in queue.open() if each not in runs]
    if any(starts.root(each) != starts.root(plan) for each in waiting):
        raise UsageError(
            f"{path}: waiting plans belong to several worlds, chosen by clients of the service; "
            "let 'gpsfsm serve' continue them"
        )
