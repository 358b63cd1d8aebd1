"""Worlds of the service: how clients want plans to begin, and how each world goes on."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.queue_rows import QueueKind
from gpsfsm.running.drivers import MAPPED, Shared
from gpsfsm.running.history import FOLLOWS, Notify, begun_run, check_versions, simulated_world
from gpsfsm.running.prepare import DRAWN, WORLD

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.queue_rows import QueueRow
    from gpsfsm.execution.records import RunValue
    from gpsfsm.generation.service import ModelService
    from gpsfsm.running.history import StoredQueue

NAME = "world_name"
"""The option of a run that says which of the worlds it runs in."""

_DRAWN, _FIELD = "drawn", "field"
_MOST_BYTES = 1 << 26
_DIGITS = 4
_PREFIX = "start_"


@dataclass(frozen=True, slots=True)
class Start:
    """The beginning that a client wishes; what is left out is as the service has it.

    ``world``: the plan begins in a fresh world of this name; "" stands for the world of the
    service, which goes on from plan to plan. ``speed``: so many seconds of the run pass in a
    second, 0 for no waiting. ``paused``: it stands still before anything but its beginning.
    """

    world: str = ""
    speed: float | None = None
    paused: bool = False
    seed: int | None = None

    @classmethod
    def of(cls, data: Mapping[str, Any], prefix: str = _PREFIX) -> Start | None:
        """The beginning in the data of a row; None without one."""
        names = [each.name for each in fields(cls)]
        values = {name: data[prefix + name] for name in names if prefix + name in data}
        return cls(**values) if values else None

    def data(self) -> dict[str, RunValue]:
        """As a row keeps it."""
        every = {_PREFIX + each.name: getattr(self, each.name) for each in fields(self)}
        return {name: value for name, value in every.items() if value is not None}


class Starts:
    """The beginnings of the plans of a queue, by its rows.

    A plan that a client has not submitted begins as the one that submitted it, or that it goes on
    for, and in its world; but a pause is nothing that it inherits.
    """

    def __init__(self) -> None:
        self._own: dict[int, Start] = {}
        self._by: dict[int, int] = {}

    def take(self, row: QueueRow) -> None:
        """Take in a row of the queue."""
        if row.kind is not QueueKind.SUBMITTED:
            return
        self._by[row.plan] = row.by
        start = Start.of(row.data or {})
        if start is not None:
            self._own[row.plan] = start

    def of(self, plan: int) -> Start:
        """The beginning of a plan."""
        source = self._above(plan, lambda _: True)
        if not source:
            return Start()
        own = self._own[source]
        return own if source == plan else replace(own, paused=False)

    def root(self, plan: int) -> int:
        """The plan with which the world began in which a plan runs; 0 for that of the service."""
        return self._above(plan, lambda own: own.world != "")

    def seed(self, plan: int, base: int) -> int:
        """The seed of a plan, where those of the service begin with ``base``."""
        source = self._above(plan, lambda own: own.seed is not None)
        seed = self._own[source].seed if source else None
        return base + plan - 1 if seed is None else seed + plan - source

    def _above(self, plan: int, wanted: Any) -> int:
        """The plan itself, or that above it, which says what is wanted; 0 if none does."""
        while plan:
            own = self._own.get(plan)
            if own is not None and wanted(own):
                return plan
            plan = self._by.get(plan, 0)
        return 0


@dataclass(frozen=True, slots=True)
class Choice:
    """A world in which a plan can begin. ``mode`` is how runners are made."""

    name: str
    title: str
    mode: str
    content: bytes = b""

    def to_json(self) -> dict[str, Any]:
        """As clients see it."""
        return {"world": self.name, "title": self.title, "simulated": self.mode == WORLD}


def choices(files: list[list[str]], library: Library) -> dict[str, Choice]:
    """The worlds of these files, by name, and those that are always there.

    The first one is the world of the service. Raises GpsfsmError for a file that is wrong.
    """
    from gpsfsm.files import read_whole
    from gpsfsm.simulation.load import read_world

    offered = {}
    for name, file in files:
        try:
            content = read_whole(file, _MOST_BYTES)
        except InputError as error:
            raise InputError(f"{file}: {error}") from error
        title = read_world(content, file=file, library=library).name or name
        offered[name] = Choice(name, title, WORLD, content)
    always = (
        Choice(_DRAWN, "no world: outcomes are drawn", DRAWN),
        Choice(_FIELD, "open field", WORLD, b"world: open field\n"),
    )
    return {**offered, **{each.name: each for each in always if each.name not in offered}}


class Worlds:
    """The state that goes on from plan to plan. A world begins with its first plan, its ``root``.

    ``take_up`` tells of the runs of an earlier process. What they leave behind is simulated only
    when another plan needs it.
    """

    def __init__(
        self, offered: dict[str, Choice], starts: Starts, notify: Notify = lambda _: None
    ) -> None:
        self.offered = offered
        self._notify = notify
        self.model: ModelService | None = None
        self._starts = starts
        self._shared: dict[int, Shared] = {}
        self._last: dict[int, str] = {}  # the last run in each world
        self._past: dict[int, list[int]] = {}  # plans of an earlier process by their worlds
        self._queue: StoredQueue | None = None
        self._journal = ""

    @property
    def own(self) -> Choice:
        """The world of the service."""
        return next(iter(self.offered.values()))

    def choice(self, plan: int) -> Choice:
        """The world of a plan. Raises InputError if there is none of this name any more."""
        name = self._starts.of(plan).world
        if not name:
            return self.own
        if name not in self.offered:
            raise InputError(f"there is no world '{name:.60}' any more")
        return self.offered[name]

    def take_up(self, journal: str, queue: StoredQueue, over: Mapping[int, str]) -> None:
        """Plans have run to their ends in an earlier process; ``over`` has the ids of the runs."""
        self._journal, self._queue = journal, queue
        for plan, run in over.items():
            root = self._starts.root(plan)
            self._last[root] = run
            self._past.setdefault(root, []).append(plan)

    def shared(self, plan: int) -> Shared:
        """The state that the plans in the world of this one share. Raises ReplayDivergence."""
        root = self._starts.root(plan)
        if root not in self._shared:
            self._shared[root] = self._restored(self._past.pop(root, []))
        self._shared[root].model = self.model
        return self._shared[root]

    def _restored(self, plans: list[int]) -> Shared:
        if not plans or self._queue is None:
            return Shared(notify=self._notify)
        runs, past = self._queue.runs(), []
        with JournalReader(self._journal) as reader:
            for plan in plans:
                run = reader.run(runs[plan])
                if run.mode != WORLD:
                    continue
                check_versions(reader.path, run, self._notify)
                past.append(begun_run(reader, run, self._queue))
        return simulated_world(past, self._notify)

    def options(self, plan: int) -> dict[str, RunValue]:
        """The world in the heading of a run: which, since when, and where the robot is.

        Raises InputError and ReplayDivergence.
        """
        choice, root, shared = self.choice(plan), self._starts.root(plan), self.shared(plan)
        heading: dict[str, RunValue] = {NAME: choice.name}
        if choice.mode != WORLD:
            return heading
        heading[MAPPED] = True
        if root in self._last:
            heading[FOLLOWS] = self._last[root]
        if shared.state is not None:
            pose = shared.state.pose(shared.past_us / 1_000_000)
            heading["begun_us"] = shared.past_us
            heading["pose"] = [round(each, _DIGITS) for each in (pose.x, pose.y, pose.yaw)]
            heading["closed_zones"] = [*shared.state.zones.closed(shared.past_us / 1_000_000)]
        return heading

    def root(self, plan: int) -> int:
        """The plan with which the world of this one began; 0 for that of the service."""
        return self._starts.root(plan)

    def heading(self, plan: int, base: Heading) -> Heading:
        """The heading of the run of a plan, with its world. Raises InputError."""
        choice = self.choice(plan)
        return replace(
            base,
            mode=choice.mode,
            world=choice.content,
            seed=self._starts.seed(plan, base.seed),
            options={**base.options, **self.options(plan)},
        )

    def began(self, plan: int, run: str) -> None:
        """A plan runs; ``run`` is the id of its run."""
        self._last[self._starts.root(plan)] = run
