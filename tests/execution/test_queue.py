"""The plan queue in virtual time: order, refusals, cancelling."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.execution.queue import (
    CLIENT,
    QueueFullError,
    Refusal,
)
from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import RunnerError
from tests.execution.queueing import (
    FAIL,
    HANG,
    SECOND,
    SLEEP,
    Bench,
    text_of,
)

if TYPE_CHECKING:
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.queue import PlanService


def test_plans_run_one_after_the_other_and_none_is_forgotten() -> None:
    bench = Bench()
    numbers = [bench.queue.submit(text) for text in (SLEEP, FAIL, "<Plan>", HANG, SLEEP)]
    assert numbers == [1, 2, 3, 4, 5]
    assert [str(state.status) for state in bench.queue.states()] == [
        "QUEUED",
        "QUEUED",
        "REFUSED",
        "QUEUED",
        "QUEUED",
    ]
    bench.queue.run_all()
    assert bench.statuses() == ["COMPLETED", "GAVE_UP", "REFUSED", "STUCK", "COMPLETED"]
    assert bench.queue.state(3).findings
    began = [state.began_us for state in bench.queue.states()]
    ended = [state.ended_us for state in bench.queue.states()]
    assert began[0] == 0
    assert began[1] == ended[0] == SECOND
    assert began[2] == -1
    assert began[3] == ended[1]
    assert began[4] == ended[3]
    assert bench.log.events() == [
        ("SUBMITTED", 1),
        ("SUBMITTED", 2),
        ("REFUSED", 3),
        ("SUBMITTED", 4),
        ("SUBMITTED", 5),
        ("BEGUN", 1),
        ("ENDED", 1),
        ("BEGUN", 2),
        ("ENDED", 2),
        ("BEGUN", 4),
        ("ENDED", 4),
        ("BEGUN", 5),
        ("ENDED", 5),
    ]
    assert [
        row.data["status"] for _, row in bench.log.rows if row.kind == "ENDED" and row.data
    ] == [
        "COMPLETED",
        "GAVE_UP",
        "STUCK",
        "COMPLETED",
    ]


def test_an_empty_queue_takes_more() -> None:
    bench = Bench()
    bench.queue.run_all()
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    assert bench.statuses() == ["COMPLETED", "COMPLETED"]


def test_a_submission_later_on_the_clock_runs_then() -> None:
    bench = Bench()
    bench.queue.at(30 * SECOND, lambda: bench.queue.submit(SLEEP) and None)
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    assert [state.began_us for state in bench.queue.states()] == [0, 30 * SECOND]
    assert [state.submitted_us for state in bench.queue.states()] == [0, 30 * SECOND]


def test_a_runner_submits_the_next_plan_while_its_own_runs() -> None:
    bench = Bench()
    seen: list[object] = []

    def next_plan(plans: PlanService) -> None:
        number = plans.submit(SLEEP, "the next")
        seen.append((number, plans.status(number), plans.status(1), plans.findings(number)))

    bench.does["Next"] = next_plan
    bench.queue.submit(text_of("Next", "Sleep"))
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    assert seen == [(3, "QUEUED", "RUNNING", ())]
    assert bench.statuses() == ["COMPLETED"] * 3
    state = bench.queue.state(3)
    assert (state.by, state.name) == (1, "plan 3 from the next")
    assert state.submitted_us < bench.queue.state(1).ended_us
    assert ("SUBMITTED", 3) in bench.log.events()
    assert next(row.by for _, row in bench.log.rows if row.plan == 3) == 1


def test_a_runner_learns_that_its_plan_was_refused() -> None:
    bench = Bench()

    def next_plan(plans: PlanService) -> None:
        number = plans.submit("no plan")
        if plans.status(number) == "REFUSED":
            raise RunnerError(plans.findings(number)[0])

    bench.does["Next"] = next_plan
    bench.queue.submit(text_of("Next"))
    bench.queue.run_all()
    assert bench.statuses() == ["GAVE_UP", "REFUSED"]


def test_plans_that_submit_themselves_come_to_an_end() -> None:
    bench = Bench(most_plans=20)
    text = text_of("Again")
    bench.does["Again"] = lambda plans: plans.submit(text)
    bench.queue.submit(text)
    bench.queue.run_all()
    assert bench.statuses() == ["COMPLETED"] * 19 + ["GAVE_UP"]
    with pytest.raises(QueueFullError, match="no more than 20"):
        bench.queue.submit(SLEEP)


def test_too_many_that_wait_are_refused() -> None:
    bench = Bench(most_waiting=2)
    for _ in range(4):
        bench.queue.submit(SLEEP)
    assert [state.status for state in bench.queue.states()][2:] == [Status.REFUSED] * 2
    assert bench.queue.state(3).findings == ("the queue is full: 2 plans wait",)
    bench.queue.run_all()
    assert bench.queue.state(bench.queue.submit(SLEEP)).status is Status.QUEUED


def test_a_gate_that_breaks_lets_nothing_through() -> None:
    def broken(text: str, name: str) -> Compiled | Refusal:
        raise RecursionError("too deep")

    bench = Bench(gate=broken)
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    assert bench.statuses() == ["REFUSED"]
    assert bench.queue.state(1).findings == ("the gate failed: RecursionError: too deep",)


# -- cancelling ----------------------------------------------------------------------------------


def test_a_plan_that_waits_is_cancelled_and_never_begins() -> None:
    bench = Bench()
    for _ in range(3):
        bench.queue.submit(SLEEP)
    assert bench.queue.cancel(2, "not needed")
    assert not bench.queue.cancel(2)
    bench.queue.run_all()
    assert bench.statuses() == ["COMPLETED", "CANCELLED", "COMPLETED"]
    assert bench.queue.state(2).reason == "not needed"
    assert bench.queue.state(2).began_us == -1
    assert not bench.queue.cancel(1)


def test_the_plan_that_runs_is_cancelled_and_the_next_one_begins() -> None:
    bench = Bench()
    bench.queue.submit(text_of("Sleep", "Sleep", "Sleep"))
    bench.queue.submit(SLEEP)
    bench.queue.at(3 * SECOND // 2, lambda: bench.queue.cancel(1, "enough", by=CLIENT) and None)
    bench.queue.run_all()
    assert bench.statuses() == ["CANCELLED", "COMPLETED"]
    assert bench.queue.state(1).ended_us == 3 * SECOND // 2
    assert bench.queue.state(1).reason == "enough"


def test_a_runner_may_cancel_its_own_plan_and_others() -> None:
    bench = Bench()
    bench.does["End"] = lambda plans: (plans.cancel(2), plans.cancel(1, "I give in"))
    bench.queue.submit(text_of("End", "Sleep"))
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    assert bench.statuses() == ["CANCELLED", "CANCELLED"]
    assert bench.queue.state(1).reason == "I give in"
    assert bench.queue.state(2).reason == "cancelled by a plan"
    assert [row.by for _, row in bench.log.rows if row.kind == "CANCEL"] == [1, 1]


def test_who_asks_for_a_plan_that_is_not_there_is_told() -> None:
    bench = Bench()
    for number in (0, -1, 1):
        with pytest.raises(UsageError, match=f"there is no plan {number}"):
            bench.queue.state(number)
        with pytest.raises(UsageError, match="there is no plan"):
            bench.queue.cancel(number)


def test_a_cancel_that_comes_too_late_leaves_no_reason() -> None:
    bench = Bench()
    bench.does["Last"] = lambda plans: plans.cancel(1, "too late")
    bench.queue.submit(text_of("Last"))
    bench.queue.run_all()
    assert bench.statuses() == ["COMPLETED"]
    assert bench.queue.state(1).reason == ""


def test_cancelled_at_any_time_the_next_plan_runs() -> None:
    for at_us in (0, 1, SECOND, SECOND + 1, SECOND + 2, 2 * SECOND, 2 * SECOND + 5, 9 * SECOND):
        bench = Bench()
        bench.queue.submit(text_of("Sleep", "Sleep"))
        bench.queue.submit(SLEEP)
        bench.queue.at(at_us, lambda bench=bench: bench.queue.cancel(1) and None)
        bench.queue.run_all()
        first = "CANCELLED" if at_us < 2 * SECOND + 2 else "COMPLETED"
        assert bench.statuses() == [first, "COMPLETED"], at_us
