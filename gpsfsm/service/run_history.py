"""The history of runs in the journal of the service, read while the queue writes to it."""

from __future__ import annotations

import asyncio
import json
from datetime import UTC, datetime
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.journal_errors import EmptyJournalError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import decoded, line
from gpsfsm.execution.queue_rows import QueueKind
from gpsfsm.service.shapes import Problem

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import TypeVar

    from gpsfsm.execution.journal_read import StoredRun

    _Read = TypeVar("_Read")


_FIRST = (QueueKind.SUBMITTED, QueueKind.REFUSED)
_OF_MODELS = (QueueKind.ASKED, QueueKind.ATTEMPT, QueueKind.GENERATED)
_LONG = frozenset(("asked", "answer", "raw"))  # of an attempt; the plan in it stands besides
_WORLD = "world"


async def in_journal(path: str, work: Callable[[JournalReader], _Read]) -> _Read | None:
    """The result of ``work`` on the journal, None while there is nothing in it. Raises Problem."""

    def read() -> _Read | None:
        try:
            with JournalReader(path) as reader:
                return work(reader)
        except EmptyJournalError:
            return None

    try:
        return await asyncio.to_thread(read)
    except GpsfsmError as error:
        raise Problem(503, f"the journal cannot be read: {error}") from None


def latest(reader: JournalReader, before: int, most: int) -> list[StoredRun]:
    """The last runs with numbers below ``before``, the last one first."""
    if not reader.has_runs():
        return []
    last = min(reader.run().number, before - 1)
    return [reader.run(number) for number in range(last, max(0, last - most), -1)]


def about(run: StoredRun) -> dict[str, Any]:
    """The data in the heading of a run and in its end."""
    began = datetime.fromtimestamp(run.wall_us / 1_000_000, UTC)
    pose, begun_us = run.options.get("pose"), run.options.get("begun_us")
    closed = run.options.get("closed_zones")
    simulated = run.mode == _WORLD
    return {
        "run": run.number,
        "name": run.file,
        "status": run.status.value,
        "began": began.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        "length_us": run.at_us,
        "events": run.events,
        "mode": run.mode,
        "world": str(run.options.get("world_name", _WORLD if simulated else run.mode)),
        "seed": run.seed,
        "begun_s": begun_us / 1_000_000 if isinstance(begun_us, int) else 0.0,
        "pose": pose if isinstance(pose, list) else None,
        "closed_zones": closed if isinstance(closed, list) else None,
    }


def details(reader: JournalReader, number: int) -> tuple[StoredRun, bytes, bytes] | None:
    """A run with its plan and its world; None if there is no such run."""
    last = reader.run().number if reader.has_runs() else 0
    if not 1 <= number <= last:
        return None
    run = reader.run(number)
    return run, reader.content(run, "plan"), reader.content(run, "world")


def records(reader: JournalReader, run: int, after: int, most: int) -> list[str]:
    """The events of a run behind one of them, as lines of JSON."""
    return [line(row, wall_clock=True) for row in islice(reader.events(run, after=after), most)]


def regeneration(reader: JournalReader, plan: int) -> dict[str, Any] | None:
    """The request to a model when a plan of the last queue gave up; None if there was none."""
    summary: dict[str, Any] | None = None
    for _, _, kind, of, _, text, message in reader.queue():
        if kind in _FIRST and of == 1:
            summary = None  # another queue begins
        if of != plan or kind not in _OF_MODELS:
            continue
        data: dict[str, Any] = decoded(text) if text else {}
        if kind == QueueKind.ASKED or summary is None:
            summary = {
                "why": str(data.get("why", "")),
                "model": str(data.get("model", "")),
                "accepted": None,
                "message": "",
                "attempts": [],
            }
        if kind == QueueKind.ATTEMPT:
            summary["attempts"].append(_short(data))
        elif kind == QueueKind.GENERATED:
            summary |= {"accepted": data.get("accepted") is True, "message": message}
    return summary


def _short(attempt: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in attempt.items() if name not in _LONG}


def last_decision(reader: JournalReader) -> int:
    """The number of the last decision of the queue."""
    return reader.last_decision()


def decisions(reader: JournalReader, after: int, most: int) -> list[tuple[int, str]]:
    """The next decisions of the queue, with their numbers."""
    numbered = []
    for seq, at_us, kind, plan, by, text, message in islice(reader.queue(after=after), most):
        data: dict[str, Any] = decoded(text) if text else {}
        heading = {"seq": seq, "at_us": at_us, "kind": kind, "plan": plan, "by": by}
        shown = _short(data) if kind == QueueKind.ATTEMPT else data
        numbered.append((seq, json.dumps({**heading, "message": message, "data": shown})))
    return numbered


@lru_cache(maxsize=8)
def outline_of(content: bytes) -> dict[str, Any]:
    """The map of the world of a run. Raises GpsfsmError."""
    from gpsfsm.simulation.load import read_world
    from gpsfsm.simulation.world import outline

    return outline(read_world(content))
