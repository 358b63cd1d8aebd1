"""The worlds of the service: which there are, and how each goes on from plan to plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.cli._past import FOLLOWS, Past, check_versions, world
from gpsfsm.cli._runs import DRAWN, TOLD, WORLD, Shared, stored
from gpsfsm.errors import InputError
from gpsfsm.execution.journal_read import JournalReader

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.cli._past import StoredQueue
    from gpsfsm.cli._served_start import Starts
    from gpsfsm.execution.records import RunValue
    from gpsfsm.generation.service import ModelService

__all__ = ["NAME", "Choice", "Worlds", "choices"]

NAME = "world_name"
"""The option of a run that says which of the worlds it runs in."""

_DRAWN, _FIELD = "drawn", "field"
_MOST_BYTES = 1 << 26
_DIGITS = 4


@dataclass(frozen=True, slots=True)
class Choice:
    """A world in which a plan can begin. ``mode`` is how runners are made."""

    name: str
    title: str
    mode: str
    content: bytes = b""

    def told(self) -> dict[str, Any]:
        """As clients see it."""
        return {"world": self.name, "title": self.title, "simulated": self.mode == WORLD}


def choices(files: list[list[str]], library: Library) -> dict[str, Choice]:
    """The worlds of these files, by name, and those that are always there.

    The first one is the world of the service. Raises GpsfsmError for a file that is wrong.
    """
    from gpsfsm.inputs import read_file  # noqa: PLC0415
    from gpsfsm.simulation.load import read_world  # noqa: PLC0415  (YAML and pydantic)

    found = {}
    for name, file in files:
        try:
            content = read_file(file, _MOST_BYTES)
        except InputError as error:
            raise InputError(f"{file}: {error}") from error
        title = read_world(content, file=file, library=library).name or name
        found[name] = Choice(name, title, WORLD, content)
    always = (
        Choice(_DRAWN, "no world: outcomes are drawn", DRAWN),
        Choice(_FIELD, "open field", WORLD, b"world: open field\n"),
    )
    return {**found, **{each.name: each for each in always if each.name not in found}}


class Worlds:
    """What goes on from plan to plan. A world begins with its first plan, its ``root``.

    ``take_up`` tells of the runs of an earlier process. What they leave behind is simulated only
    when another plan needs it.
    """

    def __init__(self, known: dict[str, Choice], starts: Starts) -> None:
        self.known = known
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
        return next(iter(self.known.values()))

    def choice(self, plan: int) -> Choice:
        """The world of a plan. Raises InputError if there is none of this name any more."""
        name = self._starts.of(plan).world
        if not name:
            return self.own
        if name not in self.known:
            raise InputError(f"there is no world '{name:.60}' any more")
        return self.known[name]

    def take_up(self, journal: str, queue: StoredQueue, over: Mapping[int, str]) -> None:
        """Plans have run to their ends in an earlier process; ``over`` has the ids of the runs."""
        self._journal, self._queue = journal, queue
        for plan, run in over.items():
            root = self._starts.root(plan)
            self._last[root] = run
            self._past.setdefault(root, []).append(plan)

    def shared(self, plan: int) -> Shared:
        """What the plans in the world of this one share. Raises ReplayDivergence."""
        root = self._starts.root(plan)
        if root not in self._shared:
            self._shared[root] = self._restored(self._past.pop(root, []))
        self._shared[root].model = self.model
        return self._shared[root]

    def _restored(self, plans: list[int]) -> Shared:
        if not plans or self._queue is None:
            return Shared()
        runs, past = self._queue.runs(), []
        with JournalReader(self._journal) as reader:
            for plan in plans:
                run = reader.run(runs[plan])
                if run.mode != WORLD:
                    continue
                check_versions(reader.path, run)
                rows, said = list(reader.events(run.number)), self._queue.said_by(plan)
                past.append(Past(stored(reader, run), rows, said))
        return world(past)

    def options(self, plan: int) -> dict[str, RunValue]:
        """What the heading of a run says of its world: which, since when, and where the robot is.

        Raises InputError and ReplayDivergence.
        """
        choice, root, shared = self.choice(plan), self._starts.root(plan), self.shared(plan)
        found: dict[str, RunValue] = {NAME: choice.name}
        if choice.mode != WORLD:
            return found
        found[TOLD] = True
        if root in self._last:
            found[FOLLOWS] = self._last[root]
        if shared.state is not None:
            pose = shared.state.pose(shared.past_us / 1_000_000)
            found["begun_us"] = shared.past_us
            found["pose"] = [round(each, _DIGITS) for each in (pose.x, pose.y, pose.yaw)]
            found["closed_zones"] = [*shared.state.zones.closed(shared.past_us / 1_000_000)]
        return found

    def began(self, plan: int, run: str) -> None:
        """A plan runs; ``run`` is the id of its run."""
        self._last[self._starts.root(plan)] = run
