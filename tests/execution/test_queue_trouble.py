"""The plan queue when something goes wrong, and its bond."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.bond import Bond
from gpsfsm.execution.records import Input, Status
from tests.execution.queueing import (
    FAIL,
    HANG,
    SECOND,
    SLEEP,
    Bench,
    Nothing,
    text_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.queue import (
        PlanState,
        QueueRow,
    )
    from gpsfsm.execution.records import Record
    from gpsfsm.execution.virtual import VirtualDriver


# -- what goes wrong -----------------------------------------------------------------------------


def test_a_row_that_cannot_be_written_has_no_effect() -> None:
    bench = Bench()
    bench.queue.submit(SLEEP)

    def refuse(at_us: int, row: QueueRow) -> None:
        raise GpsfsmError("the disk is full")

    bench.log.write_queue = refuse  # type: ignore[method-assign]
    for action in (
        lambda: bench.queue.submit(SLEEP),
        lambda: bench.queue.submit("<Plan>"),
        lambda: bench.queue.cancel(1),
        bench.queue.run_all,
    ):
        with pytest.raises(GpsfsmError, match="disk is full"):
            action()
        assert [state.status for state in bench.queue.states()] == [Status.QUEUED]
    assert bench.drivers == []


def test_a_plan_that_cannot_begin_is_refused_and_the_next_one_runs() -> None:
    bench = Bench()
    begin = bench.queue._make

    def picky(state: PlanState, compiled: Compiled) -> VirtualDriver:
        if state.plan == 1:
            raise UsageError("there is no runner for t/Sleep")
        return begin(state, compiled)

    bench.queue._make = picky
    bench.queue.submit(SLEEP)
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    assert bench.statuses() == ["REFUSED", "COMPLETED"]
    assert bench.queue.state(1).findings == ("there is no runner for t/Sleep",)


def test_a_run_that_breaks_off_leaves_a_queue_that_can_be_read() -> None:
    class Full(Nothing):
        def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
            if at_us:
                raise GpsfsmError("the disk is full")

    bench = Bench()
    begin = bench.queue._make

    def failing(state: PlanState, compiled: Compiled) -> VirtualDriver:
        driver = begin(state, compiled)
        driver._sink = Full()
        return driver

    bench.queue._make = failing
    bench.queue.submit(SLEEP)
    bench.queue.submit(SLEEP)
    with pytest.raises(GpsfsmError, match="disk is full"):
        bench.queue.run_all()
    assert [str(state.status) for state in bench.queue.states()] == ["CANCELLED", "QUEUED"]


# -- the bond ------------------------------------------------------------------------------------


def test_a_lost_bond_stops_the_plan_and_lets_no_other_begin() -> None:
    bench = Bench(bond=Bond(1.5))
    bench.queue.submit(text_of("Sleep", "Sleep"))
    bench.queue.submit(SLEEP)
    bench.queue.run_all()
    assert bench.statuses() == ["CANCELLED", "QUEUED"]
    assert bench.queue.state(1).reason == "the bond is lost: no beat for 1.5 s"
    assert ("BOND_LOST", 0) in bench.log.events()
    bench.queue.run_all()
    assert bench.statuses() == ["CANCELLED", "QUEUED"]
    assert bench.queue.state(bench.queue.submit(SLEEP)).status is Status.QUEUED
    assert bench.queue.cancel(2)
    assert bench.statuses() == ["CANCELLED", "CANCELLED", "QUEUED"]


def test_a_renewed_bond_lets_them_begin() -> None:
    bond = Bond(1.5)
    bench = Bench(bond=bond)
    bench.queue.submit(text_of("Sleep", "Sleep"))
    bench.queue.submit(SLEEP)
    bench.queue.at(60 * SECOND, bond.renew)
    bench.queue.run_all()
    assert bench.statuses() == ["CANCELLED", "COMPLETED"]
    assert bench.queue.state(2).began_us == 60 * SECOND
    assert bench.log.events()[2:] == [
        ("BEGUN", 1),
        ("BOND_LOST", 0),
        ("ENDED", 1),
        ("BOND_RENEWED", 0),
        ("BEGUN", 2),
        ("ENDED", 2),
    ]


def test_one_bond_spans_all_plans() -> None:
    bond = Bond(2.0)
    bench = Bench(bond=bond)
    for _ in range(4):
        bench.queue.submit(SLEEP)
    bench.queue.at(SECOND * 3 // 2, lambda: bond.beat() and None)
    bench.queue.run_all()
    # one beat at 1.5 s: lost at 3.5 s, in the middle of the fourth plan
    assert bench.statuses() == ["COMPLETED"] * 3 + ["CANCELLED"]


def test_an_idle_queue_does_not_wait_for_its_bond_to_be_lost() -> None:
    bench = Bench(bond=Bond(10.0))
    for _ in range(3):
        bench.queue.submit(SLEEP)
        bench.queue.run_all()
    assert bench.statuses() == ["COMPLETED"] * 3


def test_the_bond_is_lost_at_every_instant_of_two_plans() -> None:
    for step in range(1, 45):
        bench = Bench(bond=Bond(step / 10))
        bench.queue.submit(text_of("Sleep", "Sleep"))
        bench.queue.submit(text_of("Sleep", "Sleep"))
        bench.queue.run_all()
        first, second = bench.statuses()
        if step < 20:
            assert (first, second) == ("CANCELLED", "QUEUED")
        elif step < 40:
            assert (first, second) == ("COMPLETED", "CANCELLED")
        else:
            assert (first, second) == ("COMPLETED", "COMPLETED")


def test_the_same_submissions_give_the_same_rows() -> None:
    def one() -> list[tuple[int, QueueRow]]:
        bench = Bench(bond=Bond(7.5))
        bench.does["Next"] = lambda plans: plans.submit(FAIL)
        for text in (text_of("Next", "Sleep"), "<", FAIL, HANG, SLEEP):
            bench.queue.submit(text)
        bench.queue.at(4 * SECOND, lambda: bench.queue.cancel(4) and None)
        bench.queue.run_all()
        return bench.log.rows

    first = one()
    assert len(first) > 12
    assert all(one() == first for _ in range(3))
