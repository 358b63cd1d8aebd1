"""Every run completes: to be asked for where no failure is an excuse."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.records import Status
from gpsfsm.fuzzing.properties.base import Breach, Property

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fuzzing.runs import Run


def _check(run: Run) -> Iterator[Breach]:
    if run.status is not Status.COMPLETED:
        how = "gives up" if run.status is Status.GAVE_UP else "is stuck"
        yield Breach(f"the plan {how}", _last_failure(run), (str(run.status),))


def _last_failure(run: Run) -> tuple[int, ...]:
    """The instance whose failure came last: most likely the one that nothing recovers from."""
    failed = [event.number for event in run.events if event.kind == "FAILED"]
    return tuple(failed[-1:])


PROPERTY = Property("completes", "every run completes", _check)
