"""The plan queue of the service: how its plans are run, and how it goes on after a restart."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.choice import choose_capabilities
from gpsfsm.cli._drive import Interrupt
from gpsfsm.cli._gate import PlanGate, as_text
from gpsfsm.cli._opened import Begun
from gpsfsm.cli._past import OF_ONE_RUN, Plans, StoredQueue, check_versions, queues
from gpsfsm.cli._regenerate import policy_of
from gpsfsm.cli._runs import TOLD, simulation, stored
from gpsfsm.cli._served_pace import PacedDriver
from gpsfsm.cli._served_start import Start, Starts
from gpsfsm.cli._served_worlds import NAME, Worlds, choices
from gpsfsm.errors import UsageError
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.journal_errors import EmptyJournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.queue import CLIENT, QueueKind, QueueRow
from gpsfsm.execution.queues import VirtualQueue
from gpsfsm.execution.records import MARKS, Input, Record
from gpsfsm.execution.replay import Comparing
from gpsfsm.execution.resume import simulate_again
from gpsfsm.parallel import CheckApart
from gpsfsm.syntax import Limits
from gpsfsm.watch.steps import StepTaker

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import ExitStack

    from gpsfsm.cli._runs import Prepared
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.journal import Journal
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import PlanState

__all__ = ["Served", "Stopping"]

_MOST_ATTEMPTS = 3
_NOTE_S = 0.05
_OF_WORLDS = OF_ONE_RUN | {TOLD, NAME}


class Stopping(KeyboardInterrupt):
    """The service stops: what runs is left as it is, to go on when there is a service again.

    A kind of KeyboardInterrupt, because no driver takes that for the mistake of a runner.
    """


@dataclass(slots=True)
class _Keys:
    """The log of the queue: says with each plan for which request it was submitted, and how."""

    journal: Journal
    served: Served
    key: str = ""
    start: Start | None = None

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        """Keep a row, then let the service know."""
        if self.key and row.kind in (QueueKind.SUBMITTED, QueueKind.REFUSED):
            data = {} if self.start is None else self.start.data()
            row = row._replace(data={**(row.data or {}), "key": self.key, **data})
        self.journal.write_queue(at_us, row)
        self.served.starts.take(row)
        self.served.tell({"note": row.kind.value})


class Served:
    """The queue. ``keys`` are plans by the keys of requests, ``numbers`` are runs by plans."""

    def __init__(self, head: dict[str, Any], journal: Journal, stack: ExitStack) -> None:
        self.tell: Callable[[dict[str, Any]], None] = lambda _: None
        self.poll: Callable[[], None] = lambda: None
        self.keys: dict[str, int] = {}
        self.numbers: dict[int, int] = {}
        self._head, self._journal, self._stack = head, journal, stack
        self._ids: dict[int, str] = {}
        self._begun: dict[int, Begun] = {}
        self._said: dict[int, list[QueueRow]] = {}
        self._done: dict[int, StepTaker] = {}
        self.driver: tuple[int, PacedDriver] | None = None
        self.starts = Starts()
        capabilities = choose_capabilities(head["capabilities"], builtin=head["builtin"])
        self._capabilities = capabilities
        self.worlds = Worlds(choices(head.get("worlds", []), capabilities.library), self.starts)
        self._base = _heading(head, capabilities.library, self.worlds)
        self._policy = policy_of(self._base.options)
        self._gate = PlanGate(self._base, capabilities, Limits(**head["limits"]))
        self._gate.check = stack.enter_context(CheckApart(head["check_s"])).check
        self._log = _Keys(journal, self)
        self.queue = VirtualQueue(
            self._gate,
            self._log,
            self._virtual,
            most_waiting=head["most_waiting"],
            most_plans=head["most_plans"],
        )

    # -- what the service asks for --------------------------------------------------------------

    def full(self) -> str:
        """Why no plan can be taken now, though later one may; "" if one can."""
        waiting = self.queue.waiting
        most: int = self._head["most_waiting"]
        return "" if waiting < most else f"the queue is full: {waiting} plans wait"

    def submit(self, text: bytes, name: str, key: str, start: Start | None = None) -> int:
        """Queue a plan that has passed the gate of the service; when this returns it is safe."""
        self._gate.trusting, self._log.key, self._log.start = True, key, start
        try:
            plan = self.queue.submit(as_text(text), name=name)
        finally:
            self._gate.trusting, self._log.key, self._log.start = False, "", None
        self.keys[key] = plan
        return plan

    def cancel(self, plan: int, reason: str) -> bool:
        """Cancel a plan; False if it has ended already. Raises UsageError if there is none."""
        ended = self.queue.state(plan).status.ended
        if not ended and self.driver is not None and self.driver[0] == plan:
            self.driver[1].release()
        return self.queue.cancel(plan, reason)

    def speed(self, plan: int) -> float:
        """How fast a plan begins, 0 for as fast as possible."""
        found = self.starts.of(plan).speed
        return (self._head.get("speed") or 0.0) if found is None else found

    # -- a restart ------------------------------------------------------------------------------

    def restore(self) -> None:
        """Take up what an earlier service has left. Raises GpsfsmError if that is not possible."""
        past = None
        if Path(self._head["journal"]).exists():
            try:
                with JournalReader(self._head["journal"]) as reader:
                    past = self._read(reader)
            except EmptyJournalError:
                past = None
        self._ask_models(past)
        if past is None:
            return
        for _, row in past.rows:
            if isinstance(key := (row.data or {}).get("key"), str):
                self.keys[key] = row.plan
        self._gate.trusting = True
        self.queue.restore(past.rows)
        self._gate.trusting = False
        for state in self.queue.states():
            if not state.status.ended and state.attempts >= _MOST_ATTEMPTS:
                times = f"{state.attempts} times the process that ran it has ended"
                self.queue.cancel(state.plan, f"{times}; its memory may have run out")
                self._begun.pop(state.plan, None)

    def _read(self, reader: JournalReader) -> StoredQueue | None:
        found = queues(reader)
        if not found:
            return None
        queue, runs, left = found[-1], found[-1].runs(), found[-1].open()
        for _, row in queue.rows:
            self.starts.take(row)
        self.numbers = dict(runs)
        if not runs:
            return queue
        known = {each.number: each for each in reader.runs()}
        self._ids = {plan: known[number].id for plan, number in runs.items()}
        begun = next((plan for plan in left if plan in runs), 0)
        own = [plan for plan in runs if not self.starts.root(plan)]
        for plan in {begun or [*runs][-1], *own[-1:]}:
            run = reader.run(runs[plan])
            check_versions(reader.path, run)
            prepared = stored(reader, run)
            self._refuse_others(reader.path, prepared, plan)
            if plan == begun:
                self._begun[plan] = Begun(run, prepared, list(reader.events(run.number)))
                self._said[plan] = queue.said_by(plan)
        over = {
            plan: known[number].id for plan, number in runs.items() if known[number].status.ended
        }
        self.worlds.take_up(reader.path, queue, over)
        if self._policy is not None:
            self._take_steps(reader, queue)
        return queue

    def _refuse_others(self, path: str, past: Prepared, plan: int) -> None:
        """Raises UsageError if runs were made otherwise: then they cannot go on as they began."""
        heading, base = past.heading, self._base
        options = {name: each for name, each in heading.options.items() if name not in _OF_WORLDS}
        own = not self.starts.root(plan)
        differs = [
            name
            for name, before, now in (
                ("world", own and (heading.mode, heading.world), own and (base.mode, base.world)),
                ("capabilities", heading.capabilities, base.capabilities),
                ("seed", heading.seed, self.starts.seed(plan, base.seed)),
                ("options", options, dict(base.options)),
            )
            if before != now
        ]
        if differs:
            raise UsageError(
                f"{path}: the plans of this journal were run with other settings "
                f"({', '.join(differs)}); use those, or another journal"
            )

    def _take_steps(self, reader: JournalReader, queue: StoredQueue) -> None:
        """What the plans have done: told to a model that is asked for a plan that goes on."""
        for plan, number in queue.runs().items():
            prepared = stored(reader, reader.run(number))
            taker = self._done[plan] = StepTaker(prepared.kernel(), prepared.words())
            taker.take(reader.events(number))

    # -- a model --------------------------------------------------------------------------------

    def _ask_models(self, past: StoredQueue | None) -> None:
        if not self._head.get("model"):
            return
        from gpsfsm.cli._served_model import served_model  # noqa: PLC0415  (few ask one)

        self.worlds.model = served_model(
            (self._base, self._capabilities, self._stack),
            self._head,
            self._poll_now,
            (self._head["journal"], past),
        )
        if self._policy is not None:
            self.queue.continuing.by(self._regenerate, self._policy)

    def _poll_now(self) -> None:
        """What ``poll`` is by now."""
        self.poll()

    async def _regenerate(self, due: Due, write: Callable[[QueueRow], None], /) -> None:
        from gpsfsm.cli._regeneration import Regeneration, facts_of  # noqa: PLC0415

        assert self.worlds.model is not None
        shared, root = self.worlds.shared(due.gave_up), self.starts.root(due.gave_up)
        done = [taker for plan, taker in self._done.items() if self.starts.root(plan) == root]
        regeneration = Regeneration(
            self.worlds.model, self._base, self._done, lambda: facts_of(shared, done)
        )
        await regeneration(due, write)

    # -- one run --------------------------------------------------------------------------------

    def _virtual(self, state: PlanState, compiled: Compiled) -> PacedDriver:
        """Run a plan, or go on with it."""
        passed, begun = self._gate.take(compiled), self._begun.pop(state.plan, None)
        shared = self.worlds.shared(state.plan)
        prepared = begun.prepared if begun else self._prepared(state, passed.prepared)
        kernel = prepared.kernel()
        if begun is None:
            queued = (self.queue.now_us(), state.plan)
            writer = self._journal.begin(kernel, prepared.heading, queued=queued)
        else:
            writer = self._journal.go_on(kernel, begun.run.number)
        self._ids[state.plan], self.numbers[state.plan] = writer.id, writer.number
        self.worlds.began(state.plan, writer.id)
        rows = begun.rows if begun else []
        again = Comparing(kernel, rows, writer)
        driver = simulation(
            *(prepared, kernel, again, Interrupt()),
            shared=shared,
            plans=Plans.of(self.queue, state.plan, self._said.pop(state.plan, [])),
            rows=rows,
            kind=PacedDriver,
        )
        assert isinstance(driver, PacedDriver)
        driver.pace.speed = self.speed(state.plan)
        driver.pace.paused = self.starts.of(state.plan).paused
        watch = _Watch(self, state, driver)
        driver.tick = lambda _: watch.look()
        driver.in_past = lambda: again.next is not None
        driver.watchers += [*self._steps(state.plan, prepared, kernel), watch]

        def course() -> None:
            self.driver = (state.plan, driver)
            try:
                simulate_again(driver, again)
            finally:
                self.driver = None
            driver.refuse_all()
            shared.past_us += driver.now_us()

        driver.course = course
        return driver

    def _prepared(self, state: PlanState, found: Prepared) -> Prepared:
        """With the heading that this run has in the journal. Raises InputError."""
        choice = self.worlds.choice(state.plan)
        heading = replace(
            found.heading,
            file=state.name,
            mode=choice.mode,
            world=choice.content,
            seed=self.starts.seed(state.plan, self._base.seed),
            options={**self._base.options, **self.worlds.options(state.plan)},
            parent="" if state.by == CLIENT else self._ids.get(state.by, ""),
        )
        return replace(found, heading=heading)

    def _steps(self, plan: int, prepared: Prepared, kernel: Kernel) -> list[StepTaker]:
        if self._policy is None:
            return []
        taker = self._done[plan] = StepTaker(kernel, prepared.words())
        return [taker]

    @property
    def run_s(self) -> float:
        """What a run may take, in seconds of a clock on the wall."""
        found: float = self._head["run_s"]
        return found


class _Watch:
    """Told of each event of a run: sees to the service, and to the time."""

    def __init__(self, served: Served, state: PlanState, driver: PacedDriver) -> None:
        self._served, self._plan, self._driver = served, state.plan, driver
        self._until_s = time.monotonic() + served.run_s
        self._told_s = 0.0
        self._untold = False  # something has happened since
        self._over = False

    def __call__(self, _at_us: int, happened: Input, _records: Sequence[Record], /) -> None:
        """Something has happened in the run."""
        if self._driver.in_past():
            return  # nothing may intervene there
        self._untold = True
        self._tell()
        if happened.kind not in MARKS:  # inside of a runner nothing may intervene, either
            self.look()

    def look(self) -> None:
        """See what the service has asked for, and what time it is."""
        self._tell()
        ended = self._driver.kernel.status.ended
        if time.monotonic() > self._until_s and not self._over and not ended:
            self._over = True
            self._served.cancel(self._plan, f"it took more than {self._served.run_s:g} s")
        self._served.poll()

    def _tell(self) -> None:
        now_s = time.monotonic()
        soon = now_s - self._told_s <= _NOTE_S and not self._driver.kernel.status.ended
        if self._untold and not soon:
            self._told_s, self._untold = now_s, False
            self._served.tell({"note": "EVENT"})


def _heading(head: dict[str, Any], library: Any, worlds: Worlds) -> Heading:
    """What the headings of all runs have in common."""
    from gpsfsm.capabilities.table import dump  # noqa: PLC0415

    return Heading(
        plan=b"",
        capabilities=dump(library),
        world=worlds.own.content,
        seed=head.get("seed", 0),
        mode=worlds.own.mode,
        options=head.get("options", {}),
    )
