"""A queue that is held until somebody releases it, and runs that are only brought to their ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.queue import Ending, QueueRow
from gpsfsm.watch.tables import decision_lines
from tests.execution.queueing import HANG, SECOND, SLEEP, Bench, gate

if TYPE_CHECKING:
    from collections.abc import Container

WHY = "the process was started again"


def ending(*runs: int) -> Ending[object]:
    held: Container[int] = runs
    return Ending(WHY, held, gate)


def test_nothing_begins_while_a_queue_is_held() -> None:
    bench = Bench()
    bench.queue.hold("stopped")
    bench.queue.hold("and once more")
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    assert bench.queue.held == "stopped"
    assert bench.statuses() == ["QUEUED"]
    assert bench.queue.release()
    assert not bench.queue.release()
    bench.queue.run_all()
    assert bench.statuses() == ["COMPLETED"]
    assert [kind for kind, _ in bench.log.events()] == [
        *("HELD", "SUBMITTED", "RELEASED", "BEGUN", "ENDED")
    ]


def test_the_plan_that_runs_goes_on_when_the_queue_is_held() -> None:
    bench = Bench()
    bench.queue.submit(SLEEP)
    bench.queue.submit(SLEEP)
    bench.queue.at(SECOND // 2, lambda: bench.queue.hold("wait"))
    bench.queue.run_all()
    assert bench.statuses() == ["COMPLETED", "QUEUED"]


def test_whether_it_is_held_outlives_the_process() -> None:
    rows: list[tuple[int, QueueRow]] = []
    for held in ("stopped", ""):
        first = Bench()
        first.queue.submit(SLEEP)
        first.queue.hold("stopped")
        if not held:
            first.queue.release()
        rows = first.log.rows
        second = Bench()
        second.queue.restore(rows)
        assert second.queue.held == held


def left_after(row: str) -> list[tuple[int, QueueRow]]:
    """What a process leaves behind that ends after its first row of this kind."""
    bench = Bench()
    bench.queue.submit(HANG)
    bench.queue.submit(SLEEP)
    bench.queue.at(SECOND // 2, lambda: bench.queue.cancel(1, "by a client") and None)
    bench.queue.run_all()
    kinds = [kind for kind, _ in bench.log.events()]
    return bench.log.rows[: kinds.index(row) + 1]


def test_what_ran_is_brought_to_its_end_and_the_rest_waits() -> None:
    bench = Bench()
    assert bench.queue.restore(left_after("BEGUN"), None, ending(1)) == 1
    assert bench.queue.ending == {1: WHY}
    assert bench.queue.held == WHY
    assert bench.queue.cancel(
        1, "too late"
    )  # it is being cancelled; its run has to end all the same
    bench.queue.run_all()
    assert len(bench.drivers) == 1  # whoever makes the driver knows that nothing may act in it
    assert bench.statuses()[1] == "QUEUED"
    assert bench.queue.state(1).reason in (WHY, "")
    records = bench.log.events()
    assert records[:3] == [("HELD", 0), ("CANCEL", 1), ("BEGUN", 1)]


def test_a_plan_that_was_being_cancelled_has_a_run_to_end_as_well() -> None:
    bench = Bench()
    assert bench.queue.restore(left_after("CANCEL"), None, ending(1)) == 1
    assert bench.queue.ending == {1: "by a client"}
    assert bench.log.events() == [("HELD", 0)]  # it is to be cancelled already


def test_a_plan_without_a_run_is_cancelled_at_once() -> None:
    bench = Bench()
    assert bench.queue.restore(left_after("BEGUN"), None, ending()) == 0
    assert bench.statuses() == ["CANCELLED", "QUEUED"]
    assert bench.queue.state(1).reason == WHY
    assert not bench.drivers


def test_rows_tell_people() -> None:
    bench = Bench()
    bench.queue.submit(SLEEP)
    bench.queue.hold("stopped by token 0")
    bench.queue.release()
    text = "\n".join(map(str, decision_lines(bench.log.rows)))
    assert "the queue is held, nothing begins: stopped by token 0" in text
    assert "the queue is released" in text
