"""A journaled run, read back as moments."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.records import MARKS, Kind, Record
from gpsfsm.watch.moments import Moment

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.execution.journal_rows import Row

__all__ = ["stored_moments"]


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
