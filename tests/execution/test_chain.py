"""What is owed to plans that gave up, by the rows alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.chain import Chains
from gpsfsm.execution.queue import QueueKind, QueueRow
from tests.execution.queueing import FAIL, SECOND

if TYPE_CHECKING:
    from gpsfsm.execution.records import RunValue


@pytest.mark.parametrize(("cancelled", "owed"), [((), True), ((1,), False), ((2,), True)])
def test_a_plan_that_was_cancelled_when_it_gave_up_is_owed_nothing(
    cancelled: tuple[int, ...], owed: bool
) -> None:
    chains = Chains()
    chains.take(QueueRow(QueueKind.SUBMITTED, 1, data={"text": FAIL}))
    for plan in cancelled:
        chains.take(QueueRow(QueueKind.CANCEL, plan))
    chains.take(QueueRow(QueueKind.ENDED, 1, data={"status": "GAVE_UP"}))
    assert (chains.due() is not None) == owed


@pytest.mark.parametrize("latency_s", [-1e9, float("nan"), float("inf"), "long", None])
def test_a_time_that_makes_no_sense_does_not_undo_the_bound(latency_s: RunValue) -> None:
    def row(kind: QueueKind, number: int, **data: RunValue) -> QueueRow:
        return QueueRow(kind, number, data=data)

    chains, gave_up = Chains(), {"status": "GAVE_UP"}
    answer = {"round": 1, "candidate": 1, "accepted": True, "plan": SECOND}
    for each in (
        row(QueueKind.SUBMITTED, 1, text=FAIL),
        row(QueueKind.ENDED, 1, **gave_up),
        row(QueueKind.ATTEMPT, 1, latency_s=2.5),
        row(QueueKind.ATTEMPT, 1, **answer, latency_s=latency_s),
        row(QueueKind.GENERATED, 1, **answer),
        row(QueueKind.SUBMITTED, 2, text=SECOND, continues=1),
        row(QueueKind.ENDED, 2, **gave_up),
    ):
        chains.take(each)
    due = chains.due()
    assert due is not None
    assert (due.before, due.spent_s) == (2, 2.5)
