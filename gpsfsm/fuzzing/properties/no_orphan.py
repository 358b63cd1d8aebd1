"""No orphan: when the plan completes, no runner is active any more (semantics, section 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.words import place
from gpsfsm.execution.records import Status
from gpsfsm.fuzzing.properties.base import Breach, Property
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.runs import Run


def _check(run: Run) -> Iterator[Breach]:
    if run.status is not Status.COMPLETED:
        return
    for number in run.active_at_end:
        runner = run.runner(number)
        message = f"{place(runner)} is still active when the plan completes"
        yield Breach(message, (number,), (run.plan.path(runner),))


PROPERTY = Property(
    "no-orphan",
    "when the plan completes, no runner is active any more",
    _check,
    Severity.WARNING,
    by_default=True,
)
