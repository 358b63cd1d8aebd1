"""Replay: the inputs of a journaled run go into a fresh kernel, and every event must come again."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.errors import InternalError
from gpsfsm.execution.journal_errors import DamagedJournalError, ReplayDivergence
from gpsfsm.execution.journal_rows import RowMaker, input_of, line
from gpsfsm.execution.records import MARKS, Kind, Left, Start

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.execution.journal import RunWriter
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Input, Record

__all__ = ["Comparing", "replay"]


class Comparing:
    """A sink that compares what comes with what is journaled, and then appends.

    For runs in virtual time: they are simulated once more from their beginning. Without a
    ``writer`` nothing may come that is not in the journal.
    """

    def __init__(
        self, kernel: Kernel, rows: Iterable[Row], writer: RunWriter | None = None
    ) -> None:
        self._maker = RowMaker(kernel)
        self._rows = iter(rows)
        self._writer = writer
        self.next: Row | None = next(self._rows, None)

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Raises ReplayDivergence at the first event that differs."""
        if self.next is None and self._writer is not None:
            self._writer.write(at_us, happened, records)
            return
        for row in self._maker.make(at_us, happened, records):
            got, expected = line(row), "" if self.next is None else line(self.next)
            if got != expected:
                raise ReplayDivergence(row.seq, expected, got)
            self.next = next(self._rows, None)


def replay(kernel: Kernel, rows: Iterable[Row]) -> Left:
    """Take a fresh kernel through the events of a run, without acting.

    Returns what the run has left to do; for a run that has ended, nothing. Raises
    ReplayDivergence at the first event that differs, DamagedJournalError for impossible ones.
    """
    sink = Comparing(kernel, rows)
    starts: dict[int, Start] = {}
    loading: dict[int, None] = {}
    at_us = 0
    while (row := sink.next) is not None:
        if not row.input:
            raise ReplayDivergence(row.seq, line(row), "")
        at_us = row.at_us
        happened = input_of(row, len(kernel.runner_of), len(kernel.runners))
        sink.write(at_us, happened, _follow(kernel, happened, row, (starts, loading)))
    return Left(
        at_us=at_us,
        active=tuple(starts[number] for number in kernel.active),
        loaded=tuple(kernel.loaded),
        loading=() if kernel.status.ended else tuple(loading),
    )


def _follow(
    kernel: Kernel,
    happened: Input,
    row: Row,
    left: tuple[dict[int, Start], dict[int, None]],
) -> Sequence[Record]:
    """What the kernel makes of an input; starts and loads are noted in ``left``."""
    if happened.kind in MARKS:
        return ()
    starts, loading = left
    try:
        records, commands = kernel.step(happened)
    except InternalError as error:
        raise DamagedJournalError(f"event {row.seq} cannot have happened: {error}") from error
    loading.pop(happened.runner, None)
    for command in commands:
        if isinstance(command, Start):
            starts[command.number] = command
    for record in records:
        if record.kind is Kind.LOADING:
            loading[record.runner] = None
    return records
