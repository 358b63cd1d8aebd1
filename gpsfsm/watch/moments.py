"""Moments: the records of a run with their times, also of a journaled one, and their counts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.records import MARKS, Kind, Record, Status

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.records import Input


class Moment(NamedTuple):
    """A record and when it was made, in microseconds since the run began.

    ``cause`` is the node whose answer it follows from, -1 for none.
    """

    at_us: int
    record: Record
    cause: int = -1


def moments(at_us: int, happened: Input, records: Sequence[Record]) -> list[Moment]:
    """The news of a host to its watchers, as moments. A mark (a log line, say) becomes one, too."""
    node = happened.number + 1 if happened.number >= 0 else -1  # the start node is node 0
    if happened.kind in MARKS:
        data = happened.outputs or None if happened.kind is Kind.LOG else None
        return [Moment(at_us, Record(happened.kind, node, data=data, message=happened.message))]
    return [Moment(at_us, record, node) for record in records]


@dataclass(slots=True)
class Tally:
    """Counts the records of a run; ``status`` is how it stands."""

    started: int = 0
    succeeded: int = 0
    failed: int = 0
    stopped: int = 0
    end_us: int = 0
    status: Status = Status.QUEUED
    _open: dict[int, None] = field(default_factory=dict)

    def add(self, at_us: int, records: Iterable[Record]) -> None:
        """Count what has happened."""
        self.end_us = max(self.end_us, at_us)
        for record in records:
            kind = record.kind
            if kind is Kind.STARTED:
                self.started += 1
                self._open[record.node] = None
            elif kind is Kind.SUCCEEDED:
                self.succeeded += 1
                self._open.pop(record.node, None)
            elif kind is Kind.FAILED:
                self.failed += 1
                self._open.pop(record.node, None)
            elif kind is Kind.STOPPED and record.node in self._open:
                self.stopped += 1  # unless FAILED follows: its time was over
                self._open.pop(record.node)
            elif kind is Kind.TIMEOUT:
                self._open.pop(record.node, None)
            elif kind is Kind.BEGIN:
                self.status = Status.RUNNING
            elif kind is Kind.ENDED:
                self.status = status_of(record)

    @property
    def summary(self) -> str:
        """``COMPLETED after 12.300 s: 3 started, 2 succeeded, 1 failed``."""
        counts = [f"{self.started} started", f"{self.succeeded} succeeded", f"{self.failed} failed"]
        if self.stopped:
            counts.append(f"{self.stopped} stopped")
        how = self.status.value if self.status.ended else "not ended"
        return f"{how} after {seconds(self.end_us)} s: {', '.join(counts)}"


def status_of(record: Record) -> Status:
    """The status that an ENDED record tells."""
    return Status(str((record.data or {})["status"]))


def seconds(at_us: int) -> str:
    """Microseconds as seconds with three decimals, rounded half up.

    >>> seconds(12_300_000), seconds(1_500)
    ('12.300', '0.002')
    """
    milliseconds = (at_us + 500) // 1000
    return f"{milliseconds // 1000}.{milliseconds % 1000:03d}"


def stored_moments(rows: Iterable[Row], nodes: int, runners: int) -> Iterator[tuple[Row, Moment]]:
    """The rows that are events of the run, or marks, each with its moment.

    ``nodes`` and ``runners`` are how many the plan has. Raises DamagedJournalError for a row that
    is about others.
    """
    inputs: dict[int, int] = {}
    for row in rows:
        if row.input:
            inputs[row.seq] = row.node
        kind = _kind(row)
        if row.node >= nodes or row.runner >= runners or row.node < -1:
            raise DamagedJournalError(f"event {row.seq} is about what the plan does not have")
        if row.record or kind in MARKS:
            record = Record(kind, row.node, row.runner, row.values or None, row.message)
            cause = row.node if row.input else inputs.get(row.cause, -1)
            yield row, Moment(row.at_us, record, cause)


def _kind(row: Row) -> Kind:
    try:
        return Kind(row.kind)
    except ValueError:
        raise DamagedJournalError(f"event {row.seq} has the unknown kind {row.kind}") from None
