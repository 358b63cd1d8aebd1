"""What is told about the plans of a queue."""

from __future__ import annotations

import pytest

from gpsfsm.execution.queue import QueueKind, QueueRow
from gpsfsm.watch.tables import decision_lines, fates

NAMED = {"name": "a.xml", "sha256": "0"}


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (QueueRow(QueueKind.SUBMITTED, 2, 1, NAMED), "a.xml is queued by plan 1"),
        (QueueRow(QueueKind.SUBMITTED, 1), "it is queued"),
        (
            QueueRow(QueueKind.REFUSED, 2, 1, {**NAMED, "findings": ["bad", "worse"]}),
            "a.xml, submitted by plan 1, is refused: bad; worse",
        ),
        (QueueRow(QueueKind.REFUSED, 2, 0, NAMED), "a.xml is refused: no reason"),
        (
            QueueRow(QueueKind.REFUSED, 2, 0, {"findings": "x", "name": 3}),
            "3 is refused: no reason",
        ),
        (QueueRow(QueueKind.BEGUN, 1), "it is its turn"),
        (QueueRow(QueueKind.RUN, 1, data={"run": 7}), "it is run 7 of this journal"),
        (
            QueueRow(QueueKind.CANCEL, 1, 3, message="too late"),
            "it is to be cancelled by plan 3: too late",
        ),
        (QueueRow(QueueKind.ENDED, 1, data={"status": "STUCK"}), "it has ended: STUCK"),
        (
            QueueRow(QueueKind.ENDED, 1, data={"status": "REFUSED"}, message="not now"),
            "it has ended: REFUSED: not now",
        ),
        (QueueRow(QueueKind.ENDED, 1), "it has ended: ?"),
        (
            QueueRow(QueueKind.BOND_LOST, message="the bond is lost"),
            "the bond is lost, nothing begins: the bond is lost",
        ),
        (QueueRow(QueueKind.BOND_RENEWED), "the bond is back"),
        (
            QueueRow(QueueKind.CANCEL, 1, message="\x1b[31m red"),
            r"it is to be cancelled: \x1b[31m red",
        ),
    ],
)
def test_every_decision_has_words(row: QueueRow, message: str) -> None:
    _, line = decision_lines([(1_500_000, row)])
    plan = str(row.plan) if row.plan else ""
    assert line == f"       1       1.500 s  {plan:>5}  {row.kind.value:<12}  {message}"


def test_every_kind_can_be_shown() -> None:
    rows = [(0, QueueRow(kind, 1)) for kind in QueueKind]
    assert len(list(decision_lines(rows))) == len(rows) + 1


def test_fates() -> None:
    rows = [
        QueueRow(QueueKind.SUBMITTED, 1),
        QueueRow(QueueKind.SUBMITTED, 2),
        QueueRow(QueueKind.REFUSED, 3),
        QueueRow(QueueKind.BEGUN, 1),
    ]
    assert fates([(0, row) for row in rows]) == "3 plans: 1 RUNNING, 1 QUEUED, 1 REFUSED"
    rows += [QueueRow(QueueKind.ENDED, 1, data={"status": "GAVE_UP"})]
    assert fates([(0, row) for row in rows]) == "3 plans: 1 GAVE_UP, 1 QUEUED, 1 REFUSED"
    assert fates([]) == "0 plans"
