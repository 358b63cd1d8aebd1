"""How plans of the service begin: as a client has said, or as the plan above them."""

from __future__ import annotations

from gpsfsm.execution.queue_rows import QueueKind, QueueRow
from gpsfsm.running.worlds import Start, Starts


def starts(*rows: tuple[int, int, Start | None]) -> Starts:
    """The starts of plans: number, the plan that has submitted it, what a client has said."""
    result = Starts()
    for plan, by, start in rows:
        data = {} if start is None else start.data()
        result.take(QueueRow(QueueKind.SUBMITTED, plan, by, {"name": "x", **data}))
    return result


def test_a_row_keeps_what_a_client_has_said() -> None:
    for start in (Start(), Start("home", 0.0, paused=True, seed=0), Start(speed=2.5)):
        assert Start.of(start.data()) == start
    assert Start.of({"name": "x", "sha256": ""}) is None
    assert Start.of({"speed": 0.0}, "") == Start(speed=0.0)


def test_a_plan_begins_as_the_one_that_it_goes_on_for() -> None:
    start = Start("arena", 2.0, paused=True, seed=40)
    start_times = starts((1, 0, None), (2, 0, start), (3, 1, None), (4, 2, None), (5, 4, None))
    assert [start_times.root(plan) for plan in range(6)] == [0, 0, 2, 0, 2, 2]
    assert start_times.of(2) == start
    assert start_times.of(5) == Start("arena", 2.0, paused=False, seed=40)
    assert start_times.of(3) == Start()
    assert [start_times.seed(plan, 7) for plan in (1, 2, 3, 4, 5)] == [7, 40, 9, 42, 43]


def test_who_chooses_no_world_stays_in_that_of_the_service() -> None:
    start_times = starts((1, 0, Start("home")), (2, 1, Start(speed=3.0)), (3, 0, Start(speed=4.0)))
    assert [start_times.root(plan) for plan in (1, 2, 3)] == [1, 1, 0]
    assert [start_times.of(plan).speed for plan in (1, 2, 3)] == [None, 3.0, 4.0]


def test_a_long_chain_is_no_trouble() -> None:
    rows = [(plan, plan - 1, Start("home") if plan == 1 else None) for plan in range(1, 5_001)]
    assert starts(*rows).root(5_000) == 1
