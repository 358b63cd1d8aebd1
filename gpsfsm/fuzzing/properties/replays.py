"""The journal replays: the inputs of a run lead a fresh kernel to the same events."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.journal_errors import DamagedJournalError, ReplayDivergence
from gpsfsm.execution.journal_rows import RowMaker
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.replay import replay
from gpsfsm.fuzzing.properties.base import Breach, Property

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.fuzzing.runs import Run


def _check(run: Run) -> Iterator[Breach]:
    fresh = Kernel(run.compiled, apart=run.subject.apart)
    maker = RowMaker(fresh)
    rows: list[Row] = []
    for at_us, happened, records in run.moments:
        rows += maker.make(at_us, happened, records)
    try:
        replay(fresh, rows)
    except (ReplayDivergence, DamagedJournalError) as error:
        yield Breach(f"the run does not replay from its journal: {error}", (), ("diverges",))
        return
    if fresh.status is not run.status:
        yield Breach(f"the replay ends {fresh.status}, the run {run.status}", (), ("ends",))


PROPERTY = Property(
    "replays", "the journal of every run leads to the same events again", _check, by_default=True
)
