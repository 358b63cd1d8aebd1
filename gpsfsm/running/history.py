"""History of runs: what earlier processes have written about them and their queues."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError
from gpsfsm.execution.chain import chain_of
from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.kernel import VERSION as KERNEL_VERSION
from gpsfsm.execution.queue import (
    PlanQueue,
    PlanService,
    PlanState,
    QueueFullError,
    QueueKind,
    QueueRow,
)
from gpsfsm.execution.queue_rows import in_order, recall
from gpsfsm.execution.records import Status
from gpsfsm.execution.replay import Comparing, simulate_again
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import GOALS
from gpsfsm.running.bounds import max_plans_of, policy_of
from gpsfsm.running.drivers import MAPPED, Shared, simulated_driver
from gpsfsm.running.pace import Pace
from gpsfsm.running.prepare import REAL, WORLD, stored
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.queue import Gate
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.virtual import VirtualDriver
    from gpsfsm.running.prepare import Prepared
    from gpsfsm.watch.record_text import StepTaker

FOLLOWS = "follows"
"""The option of a run that names the one before it in the same world."""

OF_ONE_RUN = frozenset((FOLLOWS, "begun_us", "pose", "closed_zones", GOALS))
"""Options that say how things stood when a run began: no other run has them."""

Notify = Callable[[str], object]
"""Gets notes for people."""

_FIRST = (QueueKind.SUBMITTED, QueueKind.REFUSED)


@dataclass(frozen=True)
class StoredQueue:
    """The notes of one command about its queue: rows with their times."""

    rows: tuple[tuple[int, QueueRow], ...]

    def runs(self) -> dict[int, int]:
        """The plans that have run, with the numbers of their runs in the journal, in order."""
        return {
            row.plan: number
            for _, row in self.rows
            if row.kind is QueueKind.RUN and isinstance(number := (row.data or {}).get("run"), int)
        }

    def plans(self) -> int:
        """The number of submitted plans."""
        return sum(row.kind in _FIRST for _, row in self.rows)

    def open(self) -> tuple[int, ...]:
        """The plans that have not ended."""
        states, _ = self._recalled
        return tuple(state.plan for state in states if not state.status.ended)

    def waiting(self) -> list[tuple[str, str]]:
        """The names and texts of the plans that a queue will run, in its order."""
        states, texts = self._recalled
        return [(state.name, texts[state.plan]) for state in in_order(states) if not state.reason]

    def text(self, plan: int) -> str:
        """The text of a plan."""
        return self._recalled[1][plan]

    @cached_property
    def _recalled(self) -> tuple[list[PlanState], dict[int, str]]:
        states: list[PlanState] = []
        texts: dict[int, str] = {}
        for at_us, row in self.rows:
            recall(states, texts, row, at_us)
        return states, texts

    def continues(self, plan: int) -> int:
        """The plan that gave up and for which a plan goes on; 0 if there is none."""
        for _, row in self.rows:
            if row.kind in _FIRST and row.plan == plan:
                continued = (row.data or {}).get("continues")
                return continued if isinstance(continued, int) else 0
        return 0

    def plan_of(self, run: StoredRun) -> int:
        """The plan that a run is about."""
        return next(plan for plan, number in self.runs().items() if number == run.number)

    def submissions(self, plan: int) -> list[QueueRow]:
        """The plans that the runners of a plan have submitted."""
        return [
            row
            for _, row in self.rows
            if row.kind in _FIRST and row.by == plan and not (row.data or {}).get("continues")
        ]


def queues(reader: JournalReader) -> list[StoredQueue]:
    """The queues of a journal: each command has one, whose plans are numbered from 1.

    Raises DamagedJournalError, also for rows that no queue writes in this order: what is checked
    before a queue goes on is read from them, and so is what it then runs.
    """
    groups: list[list[tuple[int, QueueRow]]] = []
    states: list[PlanState] = []
    runs: dict[int, object] = {}
    for seq, at_us, kind, plan, by, data, message in reader.queue():
        try:
            row = QueueRow.stored(kind, plan, by, data, message)
            if not isinstance(row.data or {}, dict):
                raise ValueError("no object")
            # a robot may have been stopped before there was any plan, and is held for that still
            goes_on = bool(groups) and not states and (row.data or {}).get(REAL) is True
            if not groups or (row.kind in _FIRST and plan == 1 and not goes_on):
                groups.append([])
                states, runs = [], {}
            recall(states, {}, row, at_us)
            if row.kind is QueueKind.RUN:
                _take_run(states, runs, row)
        except (ValueError, RecursionError):
            raise DamagedJournalError(
                f"{reader.path}: decision {seq} of the plan queue is damaged"
            ) from None
        groups[-1].append((at_us, row))
    return [StoredQueue(tuple(rows)) for rows in groups]


def _take_run(states: Sequence[PlanState], runs: dict[int, object], row: QueueRow) -> None:
    """Raises ValueError if the plan has not begun, or the run is that of another one."""
    if not 1 <= row.plan <= len(states) or not states[row.plan - 1].attempts:
        raise ValueError(f"plan {row.plan} has a run and has not begun")
    run = (row.data or {}).get("run")
    if row.plan in runs or run in runs.values():
        raise ValueError(f"plan {row.plan} has a run twice, or that of another plan")
    runs[row.plan] = run


def queue_of(stored: Sequence[StoredQueue], run: int) -> tuple[int, int] | None:
    """The number of the queue to which a run belongs, and that of its plan there, both from 1."""
    for place, queue in enumerate(stored, 1):
        for plan, number in queue.runs().items():
            if number == run:
                return place, plan
    return None


def chain(stored: Sequence[StoredQueue], run: int) -> tuple[int, ...]:
    """The runs of the chain of plans to which a run belongs, itself included, in order."""
    place = queue_of(stored, run)
    if place is None:
        return (run,)
    queue, runs = stored[place[0] - 1], stored[place[0] - 1].runs()
    plans = chain_of((row for _, row in queue.rows), place[1])
    return tuple(runs[plan] for plan in plans if plan in runs)


@dataclass(frozen=True, slots=True)
class Plans(PlanService):
    """The queue as the runners of one plan see it; ``past`` is what they submit once more.

    A run that is simulated again must not queue again what it has queued already.
    """

    past: list[QueueRow]
    rows: dict[int, QueueRow]

    @classmethod
    def of(cls, queue: PlanQueue[Any], plan: int, past: Iterable[QueueRow] = ()) -> Plans:
        """For the runners of a plan."""
        return cls(queue, plan, list(past), {})

    def submit(self, text: str, name: str = "") -> int:
        """Queue a plan behind the one that runs; its number."""
        if not self.past:
            return PlanService.submit(self, text, name)
        row = self.past.pop(0)
        self.rows[row.plan] = row
        return row.plan

    async def submitted(self, text: str, name: str = "") -> int:
        """The same for runners that act in real time."""
        if self.past:
            return self.submit(text, name)
        return await PlanService.submitted(self, text, name)

    def status(self, plan: int) -> str:
        """The status of a plan."""
        row = self.rows.get(plan)
        if row is None:
            return PlanService.status(self, plan)
        refused = row.kind is QueueKind.REFUSED
        return (Status.REFUSED if refused else Status.QUEUED).value

    def findings(self, plan: int) -> tuple[str, ...]:
        """The reasons why a plan was refused; none if it was not."""
        row = self.rows.get(plan)
        if row is None:
            return PlanService.findings(self, plan)
        findings = (row.data or {}).get("findings", [])
        return tuple(map(str, findings)) if isinstance(findings, list) else ()


class _Closed(PlanQueue[Any]):
    """The queue of a run that is only looked at: it takes no more."""

    def __init__(self, most_plans: int) -> None:
        self._most_plans = most_plans
        self._states = []

    def now_us(self) -> int:
        """Always 0: its time does not go on."""
        return 0

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        """Nothing will ever happen."""

    def _go_to(self, at_us: int) -> None:
        """Stands still."""

    def submit(self, *_: object, **__: object) -> int:
        """Raises QueueFullError, as it did when the run was run."""
        raise QueueFullError(f"the queue takes no more than {self._most_plans:,} plans")


@dataclass(frozen=True, slots=True)
class Begun:
    """A run that another process began, with all that it takes to simulate it again.

    ``submissions`` are the plans that its runners have submitted.
    """

    run: StoredRun
    prepared: Prepared
    rows: list[Row]
    submissions: list[QueueRow]

    def plans(self) -> Plans:
        """The queue as its runners saw it, where there is no queue any more."""
        most = max_plans_of(self.prepared.heading.options)
        return Plans.of(_Closed(most), 0, self.submissions)


def begun_run(reader: JournalReader, run: StoredRun, queue: StoredQueue | None) -> Begun:
    """A run in a journal, and its queue, if it has one. Raises GpsfsmError."""
    submissions: list[QueueRow] = []
    if queue is not None:
        submissions = queue.submissions(queue.plan_of(run))
    return Begun(run, stored(reader, run), list(reader.events(run.number)), submissions)


def begun_with_past(
    reader: JournalReader, run: StoredRun, notify: Notify
) -> tuple[Begun, list[Begun]]:
    """A run, and those before it in its queue if they have to do with it: in the same world."""
    stored_queues = queues(reader)
    place = queue_of(stored_queues, run.number)
    check_versions(reader.path, run, notify)
    queue = None if place is None else stored_queues[place[0] - 1]
    this = begun_run(reader, run, queue)
    if queue is None or this.prepared.heading.mode != WORLD:
        return this, []
    return this, _before(reader, queue, run, notify)


def _before(
    reader: JournalReader, queue: StoredQueue, run: StoredRun, notify: Notify
) -> list[Begun]:
    """The runs that a run follows in its world, the first one first."""
    plans = {reader.run(number).id: plan for plan, number in queue.runs().items()}
    before: list[Begun] = []
    follows = run.options.get(FOLLOWS)
    while (plan := plans.pop(str(follows), 0)) != 0:
        earlier = reader.run(queue.runs()[plan])
        check_versions(reader.path, earlier, notify)
        before.append(begun_run(reader, earlier, queue))
        follows = earlier.options.get(FOLLOWS)
    return before[::-1]


def check_versions(path: str, run: StoredRun, notify: Notify) -> None:
    """Raises InputError if a run cannot come out the same again; notes another version."""
    kernel, version = run.header.get("kernel"), clip(str(run.header.get("version")), 40)
    if type(kernel) is not int or kernel != KERNEL_VERSION:
        raise InputError(
            f"{path}: run {run.number} was run by gpsfsm {version} (kernel "
            f"{clip(str(kernel), 20)}), whose rules differ from those of this gpsfsm {VERSION} "
            f"(kernel {KERNEL_VERSION}): it would not come out the same. Use gpsfsm {version} for "
            "it; 'gpsfsm events' shows it in any case"
        )
    if version != VERSION:
        notify(
            f"{path}: run {run.number} was run by gpsfsm {version}, this is gpsfsm {VERSION}; the "
            "rules are the same, but simulated runners may act differently"
        )


Motion = tuple[int, "Mapping[str, RunValue]"]
"""When something has happened in a world, in microseconds of the run, and what."""


def motions(reader: JournalReader, run: StoredRun, notify: Notify) -> list[Motion]:
    """The pose with which a run in a world begins, and those motions that its journal lacks.

    For these it is simulated once more, with what it follows. Raises InputError if that is not
    possible.
    """
    if run.mode != WORLD:
        return []
    if run.options.get(MAPPED) is True:
        match run.options.get("pose"):
            case [int() | float() as x, int() | float() as y, int() | float() as yaw]:
                return [(0, {"world": "pose", "x": x, "y": y, "yaw": yaw})]
        return []
    if not run.status.ended:
        raise InputError("it has not ended, and its journal does not hold them")
    this, earlier = begun_with_past(reader, run, notify)
    moved: list[Motion] = []
    simulated_world([*earlier, this], notify, moved)
    return moved


def simulated_world(
    past: Sequence[Begun], notify: Notify, moved: list[Motion] | None = None
) -> Shared:
    """The world that those runs leave behind, by simulating them again. Raises ReplayDivergence.

    ``moved`` gets what happens in the last of them.
    """
    shared = Shared(notify=notify)
    for each in past:
        kernel = each.prepared.kernel()
        sink = Comparing(kernel, each.rows)
        driver = simulated_driver(
            *(each.prepared, kernel, sink, Pace()),
            shared=shared,
            plans=each.plans(),
            rows=each.rows,
        )
        if moved is not None and each is past[-1]:
            _record(driver, shared, moved)
        simulate_again(driver, sink)
        shared.past_us += driver.now_us()
    return shared


def _record(driver: VirtualDriver, shared: Shared, moved: list[Motion]) -> None:
    state = shared.state
    if state is None:
        return
    pose = state.pose(shared.past_us / 1_000_000)
    moved.append((0, {"world": "pose", "x": pose.x, "y": pose.y, "yaw": pose.yaw}))

    def tell(what: str, data: Mapping[str, RunValue], _: str, /) -> None:
        moved.append((driver.now_us(), {"world": what, **data}))

    state.tell = tell


# -- queues that go on ------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Unfinished:
    """A queue that another process left.

    ``begun`` are the runs that it did not end, ``ids`` those of all runs, ``steps`` what they have
    done, if a model may be asked to go on; all by their plans. ``gate`` is that of the plans that
    wait, if it has decided about them already.
    """

    queue: StoredQueue
    begun: dict[int, Begun]
    ids: dict[int, str]
    steps: dict[int, StepTaker]
    gate: Gate[Any] | None = None


def unfinished(
    reader: JournalReader, queue: StoredQueue, base: Heading, begun: dict[int, Begun]
) -> Unfinished:
    """A queue with what is in the journal about its runs; ``base`` is their heading."""
    ids = {each.number: each.id for each in reader.runs()}
    by_plan = {plan: ids[number] for plan, number in queue.runs().items()}
    steps = {} if policy_of(base.options) is None else _steps(reader, queue)
    return Unfinished(queue, begun, by_plan, steps)


def _steps(reader: JournalReader, queue: StoredQueue) -> dict[int, StepTaker]:
    """The steps of the plans of the queue: a model that goes on for them reads it."""
    from gpsfsm.watch.record_text import StepTaker

    takers = {}
    for plan, number in queue.runs().items():
        prepared = stored(reader, reader.run(number))
        takers[plan] = StepTaker(prepared.kernel(), prepared.words())
        takers[plan].take(reader.events(number))
    return takers
