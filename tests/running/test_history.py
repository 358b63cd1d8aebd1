"""What earlier processes have written about a plan queue."""

from __future__ import annotations

from gpsfsm.execution.queue_rows import QueueKind, QueueRow
from gpsfsm.running.history import StoredQueue


def test_what_continues_a_plan_was_not_submitted_by_its_runners() -> None:
    data = {"sha256": "", "name": "", "text": ""}
    own = QueueRow(QueueKind.SUBMITTED, 2, 1, data)
    refused = QueueRow(QueueKind.REFUSED, 3, 1, {**data, "findings": ["no"]})
    continued = QueueRow(QueueKind.SUBMITTED, 4, 1, {**data, "continues": 1})
    rows = [QueueRow(QueueKind.SUBMITTED, 1, 0, data), own, refused, continued]
    queue = StoredQueue(tuple((0, row) for row in rows))
    assert queue.submissions(1) == [own, refused]
    assert queue.open() == (1, 2, 4)
