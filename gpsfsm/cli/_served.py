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
from gpsfsm.cli._past import Past, Plans, StoredQueue, past_of, queues, world
from gpsfsm.cli._regenerate import policy_of
from gpsfsm.cli._runs import DRAWN, WORLD, Shared, simulation, stored
from gpsfsm.errors import InputError, UsageError
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

    from gpsfsm.cli._drive import SimulationDriver
    from gpsfsm.cli._runs import Prepared
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.journal import Journal
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import PlanState

__all__ = ["Served", "Stopping"]

_MOST_ATTEMPTS = 3
_FOLLOWS = "follows"
_NOTE_S = 0.05


class Stopping(KeyboardInterrupt):
    """The service stops: what runs is left as it is, to go on when there is a service again.

    A kind of KeyboardInterrupt, because no driver takes that for the mistake of a runner.
    """


@dataclass(slots=True)
class _Keys:
    """The log of the queue: says with each plan for which request it was submitted."""

    journal: Journal
    served: Served
    key: str = ""

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        """Keep a row, then let the service know."""
        if self.key and row.kind in (QueueKind.SUBMITTED, QueueKind.REFUSED):
            row = row._replace(data={**(row.data or {}), "key": self.key})
        self.journal.write_queue(at_us, row)
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
        self._shared = Shared()
        capabilities = choose_capabilities(head["capabilities"], builtin=head["builtin"])
        self._capabilities = capabilities
        self._base = _heading(head, capabilities.library)
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

    def submit(self, text: bytes, name: str, key: str) -> int:
        """Queue a plan that has passed the gate of the service; when this returns it is safe."""
        self._gate.trusting, self._log.key = True, key
        try:
            plan = self.queue.submit(as_text(text), name=name)
        finally:
            self._gate.trusting, self._log.key = False, ""
        self.keys[key] = plan
        return plan

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
        reader.verify_queue()
        found = queues(reader)
        if not found:
            return None
        queue, runs, left = found[-1], found[-1].runs(), found[-1].open()
        self.numbers = dict(runs)
        if not runs:
            return queue
        ids = {each.number: each.id for each in reader.runs()}
        self._ids = {plan: ids[number] for plan, number in runs.items()}
        plan = next((plan for plan in left if plan in runs), [*runs][-1])
        run = reader.run(runs[plan])
        reader.verify(run.number)
        this, earlier = past_of(reader, run)
        self._refuse_others(reader.path, this, plan)
        if plan in left:
            self._begun[plan] = Begun(run, this.prepared, this.rows)
            self._said[plan] = queue.said_by(plan)
        elif self._base.mode == WORLD:
            earlier = [*earlier, this]
        if self._base.mode == WORLD:
            self._shared = world(earlier)
        if self._policy is not None:
            self._take_steps(reader, queue)
        return queue

    def _refuse_others(self, path: str, past: Past, plan: int) -> None:
        """Raises UsageError if runs were made otherwise: then they cannot go on as they began."""
        heading, base = past.prepared.heading, self._base
        options = {name: each for name, each in heading.options.items() if name != _FOLLOWS}
        differs = [
            name
            for name, before, now in (
                ("world", (heading.mode, heading.world), (base.mode, base.world)),
                ("capabilities", heading.capabilities, base.capabilities),
                ("seed", heading.seed - plan + 1, base.seed),
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

        self._shared.model = served_model(
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

        assert self._shared.model is not None
        regeneration = Regeneration(
            self._shared.model,
            self._base,
            self._done,
            lambda: facts_of(self._shared, self._done.values()),
        )
        await regeneration(due, write)

    # -- one run --------------------------------------------------------------------------------

    def _virtual(self, state: PlanState, compiled: Compiled) -> SimulationDriver:
        """Run a plan, or go on with it."""
        passed, begun = self._gate.take(compiled), self._begun.pop(state.plan, None)
        prepared = begun.prepared if begun else self._prepared(state, passed.prepared)
        kernel = prepared.kernel()
        if begun is None:
            queued = (self.queue.now_us(), state.plan)
            writer = self._journal.begin(kernel, prepared.heading, queued=queued)
        else:
            writer = self._journal.go_on(kernel, begun.run.number)
        self._ids[state.plan], self.numbers[state.plan] = writer.id, writer.number
        rows = begun.rows if begun else []
        again = Comparing(kernel, rows, writer)
        driver = simulation(
            *(prepared, kernel, again, Interrupt()),
            speed=self._head.get("speed"),
            shared=self._shared,
            plans=Plans.of(self.queue, state.plan, self._said.pop(state.plan, [])),
            rows=rows,
        )
        driver.tick = lambda _: self.poll()
        driver.in_past = lambda: again.next is not None
        driver.watchers += [*self._steps(state.plan, prepared, kernel), _Watch(self, state, driver)]

        def course() -> None:
            simulate_again(driver, again)
            self._shared.past_us += driver.now_us()

        driver.course = course
        return driver

    def _prepared(self, state: PlanState, found: Prepared) -> Prepared:
        """With the heading that this run has in the journal."""
        options: dict[str, Any] = dict(self._base.options)
        if self._ids and self._base.mode == WORLD:
            options[_FOLLOWS] = [*self._ids.values()][-1]
        heading = replace(
            found.heading,
            file=state.name,
            seed=self._base.seed + state.plan - 1,
            options=options,
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

    def __init__(self, served: Served, state: PlanState, driver: SimulationDriver) -> None:
        self._served, self._plan, self._driver = served, state.plan, driver
        self._until_s = time.monotonic() + served.run_s
        self._told_s = 0.0
        self._over = False

    def __call__(self, _at_us: int, happened: Input, _records: Sequence[Record], /) -> None:
        """Something has happened in the run."""
        if happened.kind in MARKS or self._driver.in_past():
            return  # inside of a runner, or in the past: nothing may intervene there
        now_s = time.monotonic()
        if now_s - self._told_s > _NOTE_S or self._driver.kernel.status.ended:
            self._told_s = now_s
            self._served.tell({"note": "EVENT"})
        if now_s > self._until_s and not self._over and not self._driver.kernel.status.ended:
            self._over = True
            self._served.queue.cancel(self._plan, f"it took more than {self._served.run_s:g} s")
        self._served.poll()


def _heading(head: dict[str, Any], library: Any) -> Heading:
    """What the headings of all runs have in common. Raises GpsfsmError for a wrong world."""
    from gpsfsm.capabilities.table import dump  # noqa: PLC0415

    mode, content = DRAWN, b""
    if head.get("world"):
        from gpsfsm.inputs import read_file  # noqa: PLC0415
        from gpsfsm.simulation.load import read_world  # noqa: PLC0415  (YAML and pydantic)

        try:
            mode, content = WORLD, read_file(head["world"], 1 << 26)
        except InputError as error:
            raise InputError(f"{head['world']}: {error}") from error
        read_world(content, file=head["world"], library=library)
    return Heading(
        plan=b"",
        capabilities=dump(library),
        world=content,
        seed=head.get("seed", 0),
        mode=mode,
        options=head.get("options", {}),
    )
