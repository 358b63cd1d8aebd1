"""The events of a run as text: the same run gives the same bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.journal_rows import canonical, line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.execution.journal_rows import Row

__all__ = ["jsonl"]


def jsonl(run: StoredRun, rows: Iterable[Row], *, wall_clock: bool = False) -> Iterator[str]:
    """One line of JSON for the run, then one for each event; with line ends.

    Without ``wall_clock`` nothing depends on when, where or as which run of a file it was run.
    """
    header = {"journal": 1, **run.header}
    if wall_clock:
        header["wall_us"] = run.wall_us
    yield canonical(header) + "\n"
    for row in rows:
        yield line(row, wall_clock=wall_clock) + "\n"
