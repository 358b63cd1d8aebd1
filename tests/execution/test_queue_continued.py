"""A plan that goes on where another one gave up: it is the next one, also after a crash."""

from __future__ import annotations

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.execution.queue import CLIENT, QueueFullError
from gpsfsm.execution.records import Status
from tests.execution.queueing import FAIL, SLEEP, Bench, text_of


def begun(bench: Bench) -> list[int]:
    return [plan for kind, plan in bench.log.events() if kind == "BEGUN"]


def gave_up() -> Bench:
    """A bench whose plan 1 has given up, and plan 2 waits."""
    bench = Bench()
    bench.queue.submit(FAIL)
    bench.queue.run_all()
    bench.queue.submit(SLEEP)
    return bench


def test_it_runs_before_all_that_wait() -> None:
    bench = gave_up()
    assert bench.queue.continue_with(1, text_of("Sleep", "Sleep")) == 3
    state = bench.queue.state(3)
    assert (state.by, state.continues) == (1, 1)
    assert state.name == "plan 3, which continues plan 1"
    bench.queue.run_all()
    assert begun(bench) == [1, 3, 2]
    assert bench.statuses() == ["GAVE_UP", "COMPLETED", "COMPLETED"]


def test_it_passes_the_gate_and_may_be_tried_again() -> None:
    bench = gave_up()
    assert bench.queue.state(bench.queue.continue_with(1, "<")).status is Status.REFUSED
    bench.queue.continue_with(1, FAIL)
    bench.queue.run_all()
    bench.queue.continue_with(4, SLEEP)
    bench.queue.run_all()
    assert begun(bench) == [1, 4, 2, 5]


def test_what_cannot_be_continued() -> None:
    bench = Bench(most_plans=3)
    bench.queue.submit(FAIL)
    with pytest.raises(UsageError, match="plan 1 has not given up"):
        bench.queue.continue_with(1, SLEEP)
    bench.queue.run_all()
    bench.queue.continue_with(1, SLEEP)
    with pytest.raises(UsageError, match="plan 1 is continued already"):
        bench.queue.continue_with(1, SLEEP)
    bench.queue.run_all()
    with pytest.raises(UsageError, match="plan 2 has not given up"):
        bench.queue.continue_with(2, SLEEP)
    bench.queue.run_all()
    bench.queue.submit(FAIL)
    bench.queue.run_all()
    with pytest.raises(QueueFullError):
        bench.queue.continue_with(3, SLEEP)


def test_nothing_comes_before_a_plan_that_runs() -> None:
    bench = gave_up()
    said: list[str] = []

    def submits(_plans: object) -> None:
        try:
            bench.queue.continue_with(1, SLEEP)
        except UsageError as error:
            said.append(str(error))

    bench.does["Submits"] = submits
    bench.queue.submit(text_of("Submits"))
    bench.queue.run_all()
    assert said == ["plan 3 runs: nothing can come before it"]


def test_after_a_crash_at_any_row_it_is_still_the_next_one() -> None:
    bench = gave_up()
    bench.queue.continue_with(1, FAIL)
    bench.queue.run_all()
    bench.queue.submit(SLEEP)
    whole = bench.log.rows
    submitted = next(place for place, (_, row) in enumerate(whole) if row.plan == 3)
    for length in range(submitted + 1, len(whole) + 1):
        other = Bench()
        running = other.queue.restore(whole[:length])
        assert other.queue.state(3).continues == 1
        assert other.queue.state(3).by != CLIENT
        last = [row for _, row in whole[:length]][-1]
        assert running == (last.plan if last.kind == "BEGUN" else 0)
        other.queue.run_all()
        ended = [row.plan for _, row in (*whole[:length], *other.log.rows) if row.kind == "ENDED"]
        assert ended[:3] == [1, 3, 2]
