"""A queue that is restored from its rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.execution.journal import Journal
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.queue import (
    QueueRow,
    Refusal,
)
from gpsfsm.execution.records import Status
from tests.execution.queueing import (
    FAIL,
    HANG,
    SECOND,
    SLEEP,
    Bench,
    text_of,
)

if TYPE_CHECKING:
    from pathlib import Path


# -- restoring -----------------------------------------------------------------------------------


def a_day(bench: Bench) -> None:
    bench.does["Next"] = lambda plans: plans.submit(FAIL)
    for text in (text_of("Next", "Sleep"), "<", FAIL, HANG, SLEEP, SLEEP):
        bench.queue.submit(text, name=f"{len(text)} characters")
    bench.queue.at(SECOND // 2, lambda: bench.queue.cancel(5, "not now") and None)
    bench.queue.at(5 * SECOND // 2, lambda: bench.queue.cancel(3, "no more") and None)


def test_a_queue_that_is_restored_after_any_row_ends_in_the_same_way() -> None:
    first = Bench()
    a_day(first)
    first.queue.run_all()
    rows, expected = first.log.rows, first.statuses()
    assert expected == [
        "COMPLETED",
        "REFUSED",
        "CANCELLED",
        "STUCK",
        "CANCELLED",
        "COMPLETED",
        "GAVE_UP",
    ]
    for count in range(len(rows) + 1):
        bench = Bench()
        running = bench.queue.restore(rows[:count])
        entries = [row.plan for _, row in rows[:count] if row.kind in ("SUBMITTED", "REFUSED")]
        assert [state.plan for state in bench.queue.states()] == entries
        begun = [row.plan for _, row in rows[:count] if row.kind == "BEGUN"]
        ended = [row.plan for _, row in rows[:count] if row.kind == "ENDED"]
        stopping = [row.plan for _, row in rows[:count] if row.kind == "CANCEL"]
        left = [plan for plan in begun if plan not in ended + stopping]
        assert [running] == (left or [0])
        bench.queue.run_all()
        cancelled = {row.plan for _, row in rows[:count] if row.kind == "CANCEL"}
        for state in bench.queue.states():
            wanted = expected[state.plan - 1]
            if wanted == "CANCELLED" and state.plan not in cancelled:
                assert state.status in (Status.GAVE_UP, Status.COMPLETED)  # nobody cancels it now
            else:
                assert state.status == wanted, (count, state)
            assert state.attempts <= 2
            assert state.ended_us >= state.began_us


def test_a_queue_that_has_ended_is_restored_as_it_was() -> None:
    first = Bench()
    a_day(first)
    first.queue.run_all()
    bench = Bench()
    assert bench.queue.restore(first.log.rows) == 0
    assert bench.queue.states() == first.queue.states()
    assert bench.queue.now_us() == first.log.rows[-1][0]
    assert bench.log.rows == []
    assert bench.queue.submit(SLEEP) == len(first.queue.states()) + 1


def test_a_journal_keeps_the_queue(tmp_path: Path) -> None:
    file = str(tmp_path / "run.db")
    first = Bench()
    with Journal(file) as journal:
        write, keep = first.log.write_queue, journal.write_queue

        def both(at_us: int, row: QueueRow) -> None:
            write(at_us, row)
            keep(at_us, row)

        first.log.write_queue = both  # type: ignore[method-assign]
        a_day(first)
        first.queue.run_all()
    with JournalReader(file) as reader:
        assert reader.verify_queue() == len(first.log.rows)
        rows = [(at_us, QueueRow.stored(*row)) for _, at_us, *row in reader.queue()]
    assert rows == first.log.rows
    bench = Bench()
    bench.queue.restore(rows)
    assert bench.queue.states() == first.queue.states()


def test_what_does_not_pass_the_gate_any_more_is_refused() -> None:
    first = Bench()
    first.queue.submit(SLEEP)
    bench = Bench(gate=lambda *_: Refusal(("a new rule", "another one")))
    assert bench.queue.restore(first.log.rows) == 0
    assert bench.statuses() == ["REFUSED"]
    assert bench.queue.state(1).findings == ("a new rule", "another one")
    assert bench.log.events() == [("ENDED", 1)]


def test_a_queue_in_use_cannot_be_restored() -> None:
    bench = Bench()
    bench.queue.submit(SLEEP)
    with pytest.raises(UsageError, match="before it is used"):
        bench.queue.restore(bench.log.rows)


def test_what_happens_once_more_happens_at_the_same_times() -> None:
    first = Bench()
    first.does["Next"] = lambda plans: plans.submit(SLEEP)
    first.queue.submit(text_of("Sleep", "Next", "Sleep"))
    first.queue.run_all()
    submitted = next(place for place, (_, row) in enumerate(first.log.rows) if row.plan == 2)
    bench = Bench()
    bench.queue.restore(first.log.rows[: submitted + 1])
    bench.queue.run_all()
    assert [state.ended_us for state in bench.queue.states()] == [
        state.ended_us for state in first.queue.states()
    ]
