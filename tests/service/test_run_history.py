"""What the service tells of past runs when its journal is damaged: nothing that is not so."""

from __future__ import annotations

import asyncio
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.journal import Journal
from gpsfsm.execution.queue import QueueKind, QueueRow
from gpsfsm.service import run_history
from gpsfsm.service.shapes import Problem
from tests.execution.journaling import opened_up, run_journaled

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

REQUESTS: dict[str, Callable[..., Any]] = {
    "runs": partial(run_history.latest, before=99, most=9),
    "run": partial(run_history.details, number=1),
    "events": partial(run_history.records, run=1, after=0, most=10**6),
    "more events": partial(run_history.records, run=1, after=4, most=10**6),
    "decisions": partial(run_history.decisions, after=0, most=10**6),
    "regeneration": partial(run_history.regeneration, plan=1),
}


@pytest.fixture
def path(tmp_path: Path) -> str:
    path = str(tmp_path / "j.db")
    run_journaled(path)
    with Journal(path, "none") as journal:
        for plan in (1, 2, 3):
            journal.write_queue(0, QueueRow(QueueKind.SUBMITTED, plan, data={"text": "x"}))
    return path


def test_a_whole_journal_answers(path: str) -> None:
    for work in REQUESTS.values():
        asyncio.run(run_history.in_journal(path, work))
    assert asyncio.run(run_history.in_journal(path, run_history.last_decision)) == 3


@pytest.mark.parametrize(
    ("statement", "names"),
    [
        ("DELETE FROM event WHERE seq = 8", ("events", "more events")),
        ("DELETE FROM event WHERE seq > 8", ("runs", "run", "events", "more events")),
        ("DELETE FROM event WHERE seq = 4", ("events", "more events")),
        ("UPDATE event SET wall_us = 7 WHERE seq = 9", ("events", "more events")),
        ("UPDATE run SET file = 'b.xml'", ("runs", "run", "events", "more events")),
        ("UPDATE run SET wall_us = -1", ("runs", "run")),
        ("DELETE FROM queue WHERE seq = 3", ("decisions", "regeneration")),
        ("UPDATE queue SET data = '{' WHERE seq = 2", ("decisions", "regeneration")),
    ],
)
def test_a_damaged_journal_is_a_problem(path: str, statement: str, names: tuple[str, ...]) -> None:
    with closing(opened_up(path)) as connection:
        connection.execute(statement)
    for name in names:
        with pytest.raises(Problem, match=r"the journal cannot be read: .*j\.db: ") as raised:
            asyncio.run(run_history.in_journal(path, REQUESTS[name]))
        assert raised.value.status == 503
