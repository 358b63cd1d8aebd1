"""The replay of journaled runs: a run gets what came from outside once more, and is compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError
from gpsfsm.execution.chain import broken_link
from gpsfsm.execution.journal_errors import ReplayDivergence
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.replay import replay
from gpsfsm.running.history import begun_with_past, chain, queue_of, queues, simulated_world
from gpsfsm.running.prepare import FABRIC, REAL

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.execution.records import Status
    from gpsfsm.running.history import Notify


@dataclass(frozen=True, slots=True)
class ReplayedRun:
    """The replay of one run of a journal; it is true if all events are the same.

    - ``run``: the number of the run; 0 if a link between runs differs.
    - ``status``: how the run ended; ``events``: the number of events that were compared.
    - ``again``: the run was also simulated once more, from its beginning.
    - ``difference``: describes the first event that differs; "" if none does.
    """

    run: int
    status: Status | None
    events: int
    again: bool = False
    difference: str = ""

    def __bool__(self) -> bool:
        return not self.difference


@dataclass(frozen=True, slots=True)
class Replayed:
    """The replay of a journal; it is true if all events of all runs are the same."""

    runs: tuple[ReplayedRun, ...]
    notices: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.runs) and all(self.runs)

    @property
    def difference(self) -> str:
        """The first difference in words; "" if there is none."""
        return next((each.difference for each in self.runs if not each), "")

    def to_dict(self) -> dict[str, Any]:
        """The result as data."""
        return {
            "same": bool(self),
            "runs": [
                {
                    "run": each.run,
                    "status": None if each.status is None else each.status.value,
                    "events": each.events,
                    "again": each.again,
                    "difference": each.difference,
                }
                for each in self.runs
            ],
            "notices": list(self.notices),
        }


def replayed_runs(journal: str, number: int | None, notify: Notify) -> Iterator[ReplayedRun]:
    """Replay a run and those that it continues, up to the first that differs.

    ``number`` None: the last one. Raises GpsfsmError if that is not possible.
    """
    with JournalReader(journal) as reader:
        note = reader.check()
        last = reader.run(number).number
        stored = queues(reader)
        runs = chain(stored, last) if number is None else (last,)
        place = queue_of(stored, last)
        link = ""
        if place is not None:
            link = broken_link(row for _, row in stored[place[0] - 1].rows)
    if link:
        yield ReplayedRun(0, None, 0, difference=link)
        return
    for each in runs:
        done = _replayed(journal, each, notify)
        yield done
        if not done:
            return
    if note:
        notify(note)


def _replayed(journal: str, number: int, notify: Notify) -> ReplayedRun:
    with JournalReader(journal) as reader:
        run = reader.run(number)
        this, earlier = begun_with_past(reader, run, notify)
    if not this.rows:
        raise InputError(f"{journal}: run {run.number} has no event yet, so nothing is compared")
    again = run.status.ended and this.prepared.heading.mode not in (REAL, FABRIC)
    difference = ""
    try:
        replay(this.prepared.kernel(), this.rows)
        if again:
            simulated_world([*earlier, this], notify)
    except ReplayDivergence as error:
        difference = str(error)
    return ReplayedRun(run.number, run.status, len(this.rows), again, difference)
