"""The events of a run as text: the same run gives the same bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.journal_rows import canonical, line, quoted

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.queue import QueueRow

__all__ = ["journal_jsonl", "jsonl", "queue_jsonl"]


def jsonl(run: StoredRun, rows: Iterable[Row], *, wall_clock: bool = False) -> Iterator[str]:
    """One line of JSON for the run, then one for each event; with line ends.

    Without ``wall_clock`` nothing depends on when, where or as which run of a file it was run.
    """
    yield _header(run, wall_clock=wall_clock)
    for row in rows:
        yield line(row, wall_clock=wall_clock) + "\n"


def journal_jsonl(
    reader: JournalReader, run: StoredRun, *, wall_clock: bool = False
) -> Iterator[str]:
    """The same for all events of a run in a journal, whose lines the reader has made already."""
    yield _header(run, wall_clock=wall_clock)
    for row, text in reader.events_written(run.number):
        yield (line(row, wall_clock=True) if wall_clock else text) + "\n"


def _header(run: StoredRun, *, wall_clock: bool) -> str:
    header = {"journal": 1, **run.header}
    if wall_clock:
        header["wall_us"] = run.wall_us
    return canonical(header) + "\n"


def queue_jsonl(
    rows: Iterable[tuple[int, QueueRow]], wall_us: Sequence[int] | None = None
) -> Iterator[str]:
    """One line of JSON for each decision of a plan queue, with line ends.

    ``wall_us``: when each was written, in microseconds since 1970, if that is to be told.
    """
    for place, (at_us, row) in enumerate(rows):
        parts = [f'{{"seq":{place + 1},"at_us":{at_us},"kind":{quoted(row.kind.value)}']
        if row.plan:
            parts.append(f'"plan":{row.plan},"by":{row.by}')
        if row.data:
            parts.append(f'"data":{canonical(row.data)}')
        if row.message:
            parts.append(f'"message":{quoted(row.message)}')
        if wall_us is not None:
            parts.append(f'"wall_us":{wall_us[place]}')
        yield ",".join(parts) + "}\n"
