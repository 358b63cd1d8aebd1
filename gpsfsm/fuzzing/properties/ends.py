"""Every run ends: the plan completes or gives up, and nothing waits for ever."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.words import listed, place
from gpsfsm.execution.records import Status
from gpsfsm.fuzzing.properties.base import Breach, Property

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.runs import Run


def _check(run: Run) -> Iterator[Breach]:
    if run.status in (Status.COMPLETED, Status.GAVE_UP):
        return
    waiting = run.active_at_end
    if waiting:
        who = listed([place(run.runner(number)) for number in waiting])
        message = f"the plan waits for ever for {who}"
    else:
        message = "the plan is stuck: nothing acts any more, and it neither completes nor gives up"
    yield Breach(message, waiting, (str(run.status), "waiting" if waiting else "idle"))


PROPERTY = Property("ends", "every run completes or gives up", _check, by_default=True)
