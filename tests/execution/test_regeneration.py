"""What a queue does for a plan that gave up: it asks for another one, within bounds, and once."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import UsageError
from gpsfsm.execution.bond import Bond
from gpsfsm.execution.chain import Chains, Policy, broken_link, chain_of
from gpsfsm.execution.queue import QueueKind, QueueRow
from gpsfsm.execution.queues import LiveQueue
from tests.execution.queueing import FAIL, HANG, SECOND, SLEEP, Bench, Log, gate, text_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.queue import PlanState

Answers = dict[int, tuple[str, ...]]
"""By the place in the chain, from 1: the answers to what is asked then; the last one is taken."""


class Model:
    """A Regenerator: answers that a plan continues with, "" for one that is rejected."""

    def __init__(self, answers: Answers) -> None:
        self.answers = answers
        self.requests: list[tuple[int, int]] = []  # plan, number of the answer

    async def __call__(self, due: Due, write: Callable[[QueueRow], None], /) -> None:
        answers = self.answers.get(len(due.chain), ())
        if not due.kept:
            write(QueueRow(QueueKind.ASKED, due.gave_up, data={"before": due.before}))
        plan = ""
        for number, plan in enumerate(answers, start=1):
            if number >= max(len(due.kept), 1):
                self.requests.append((due.gave_up, due.before + number))
                data = {"round": number, "candidate": 1, "accepted": plan != "", "plan": plan}
                write(QueueRow(QueueKind.ATTEMPT, due.gave_up, data=data | {"latency_s": 1.0}))
        fields = {"accepted": plan != "", "round": len(answers), "candidate": 1}
        write(QueueRow(QueueKind.GENERATED, due.gave_up, data=fields))


def bench(
    answers: Answers, policy: Policy | None = None, **options: int | Bond
) -> tuple[Bench, Model]:
    made, model = Bench(**options), Model(answers)
    made.queue.continuing.by(model, policy or Policy())
    return made, model


def kinds(rows: Sequence[tuple[int, QueueRow]]) -> list[str]:
    return [f"{row.kind} {row.plan}" for _, row in rows]


def reasons(made: Bench) -> list[str]:
    return [row.message for _, row in made.log.rows if row.kind is QueueKind.GENERATED]


TWICE: Answers = {1: ("", text_of("Sleep", "Fail")), 2: (text_of("Sleep", "Sleep"),)}


def test_a_plan_that_gave_up_is_continued_twice_before_what_waits() -> None:
    made, model = bench(TWICE)
    made.queue.submit(FAIL)
    made.queue.submit(SLEEP)
    made.queue.run_all()
    assert kinds(made.log.rows) == [
        *("SUBMITTED 1", "SUBMITTED 2", "BEGUN 1", "ENDED 1"),
        *("ASKED 1", "ATTEMPT 1", "ATTEMPT 1", "GENERATED 1"),
        *("SUBMITTED 3", "BEGUN 3", "ENDED 3"),
        *("ASKED 3", "ATTEMPT 3", "GENERATED 3", "SUBMITTED 4", "BEGUN 4", "ENDED 4"),
        *("BEGUN 2", "ENDED 2"),
    ]
    assert made.statuses() == ["GAVE_UP", "COMPLETED", "GAVE_UP", "COMPLETED"]
    assert [made.queue.state(plan).continues for plan in (1, 2, 3, 4)] == [0, 0, 1, 3]
    assert model.requests == [(1, 1), (1, 2), (3, 3)]  # counted on along the chain
    assert made.queue.now_us() // SECOND == 6  # asking takes none
    rows = [row for _, row in made.log.rows]
    assert chain_of(rows, 3) == chain_of(rows, 1) == (1, 3, 4)
    assert chain_of(rows, 2) == (2,)
    assert broken_link(rows) == ""


texts = st.sampled_from((SLEEP, FAIL, HANG, text_of("Sleep", "Fail"), "<", ""))
sessions = st.lists(texts, max_size=3).map(tuple)


@given(
    plans=st.lists(texts.filter(bool), min_size=1, max_size=3),
    answers=st.dictionaries(st.integers(1, 4), sessions, max_size=4),
    most=st.integers(1, 4),
    total_s=st.none() | st.floats(0.5, 6),
)
def test_a_queue_that_was_left_after_any_row_ends_with_the_same_rows(
    plans: list[str], answers: Answers, most: int, total_s: float | None
) -> None:
    policy = Policy(most, total_s)
    made, model = bench(answers, policy)
    for text in plans:
        made.queue.submit(text)
    made.queue.run_all()
    whole = made.log.rows
    failed = [row.plan for _, row in whole if row.kind == "ENDED" and _gave_up(row)]
    generated = [row.plan for _, row in whole if row.kind is QueueKind.GENERATED]
    assert generated == failed  # each exactly once
    for length in range(len(plans), len(whole) + 1):
        again, other = bench(answers, policy)
        again.queue.restore(whole[:length])
        again.queue.run_all()
        rows = _without_repeats(whole[:length] + again.log.rows)
        assert kinds(rows) == kinds(whole)
        assert rows == whole  # with their times
        attempts = [row for _, row in whole[:length] if row.kind is QueueKind.ATTEMPT]
        assert other.requests == model.requests[len(attempts) :]  # none is asked again


def _gave_up(row: QueueRow) -> bool:
    return (row.data or {}).get("status") == "GAVE_UP"


def _without_repeats(rows: list[tuple[int, QueueRow]]) -> list[tuple[int, QueueRow]]:
    """A plan that was interrupted begins once more."""
    begun: set[int] = set()
    kept = []
    for at_us, row in rows:
        if row.kind is not QueueKind.BEGUN or row.plan not in begun:
            kept.append((at_us, row))
        if row.kind is QueueKind.BEGUN:
            begun.add(row.plan)
    return kept


ALWAYS: Answers = {place: (text_of(*["Sleep"] * place, "Fail"),) for place in range(1, 9)}


@pytest.mark.parametrize(
    ("policy", "plans", "reason"),
    [
        (Policy(1), 2, "no more than 1 continuation may be asked for"),
        (Policy(3), 4, "no more than 3 continuations may be asked for"),
        (Policy(8, 1.5), 3, "the time of 1.5 s for continuations is over"),
    ],
)
def test_it_is_bounded(policy: Policy, plans: int, reason: str) -> None:
    made, _ = bench(ALWAYS, policy)
    made.queue.submit(FAIL)
    made.queue.run_all()
    assert made.statuses() == ["GAVE_UP"] * plans
    assert reasons(made) == [""] * (plans - 1) + [reason]


def test_the_bound_of_the_queue_holds() -> None:
    made, _ = bench(ALWAYS, most_plans=2)
    made.queue.submit(FAIL)
    made.queue.run_all()
    assert reasons(made) == ["", "the queue takes no more than 2 plans"]


def test_bounds_that_make_no_sense() -> None:
    with pytest.raises(UsageError, match="at least one continuation"):
        Policy(0)
    with pytest.raises(UsageError, match="must be positive"):
        Policy(1, float("nan"))


def test_plans_that_are_stuck_or_cancelled_are_not_continued() -> None:
    made, model = bench(ALWAYS)
    made.queue.submit(HANG)
    cancelled = made.queue.submit(FAIL)
    made.queue.at(2 * SECOND, lambda: made.queue.cancel(cancelled) and None)
    made.queue.run_all()
    assert "STUCK" in made.statuses()
    assert model.requests == []


def test_a_regenerator_that_breaks_ends_the_chain() -> None:
    async def breaks(_due: Due, _write: Callable[[QueueRow], None], /) -> None:
        raise ValueError("what a day")

    async def refuses(_due: Due, _write: Callable[[QueueRow], None], /) -> None:
        raise UsageError("there is no room for what has happened")

    async def says_nothing(_due: Due, _write: Callable[[QueueRow], None], /) -> None:
        """No row GENERATED."""

    for regenerator, reason in (
        (breaks, "ValueError: what a day"),
        (refuses, "there is no room for what has happened"),
        (says_nothing, "it came to no end"),
    ):
        made = Bench()
        made.queue.continuing.by(regenerator, Policy())
        made.queue.submit(FAIL)
        made.queue.submit(SLEEP)
        made.queue.run_all()
        assert reasons(made) == [reason]
        assert made.statuses() == ["GAVE_UP", "COMPLETED"]


def test_a_log_that_fails_once_stops_the_queue() -> None:
    made, model = bench(TWICE)
    write = made.log.write_queue

    def fails(at_us: int, row: QueueRow) -> None:
        if row.kind is QueueKind.ATTEMPT:
            raise OSError("the disk is full")
        write(at_us, row)

    made.log.write_queue = fails  # type: ignore[method-assign]
    made.queue.submit(FAIL)
    made.queue.submit(SLEEP)
    with pytest.raises(OSError, match="the disk is full"):
        made.queue.run_all()
    assert kinds(made.log.rows)[-1] == "ASKED 1"
    assert model.requests == [(1, 1)]


def test_where_an_event_loop_runs_virtual_time_cannot_wait_for_a_model() -> None:
    made, _ = bench(TWICE)
    made.queue.submit(FAIL)

    async def run() -> None:
        made.queue.run_all()

    with pytest.raises(UsageError, match="by a LiveQueue"):
        asyncio.run(run())


def test_a_plan_that_was_not_accepted_for_that_is_noticed() -> None:
    made, _ = bench(TWICE)
    made.queue.submit(FAIL)
    made.queue.run_all()
    rows = [row for _, row in made.log.rows]
    place = next(n for n, row in enumerate(rows) if "continues" in (row.data or {}))
    rows[place] = rows[place]._replace(data={**(rows[place].data or {}), "text": SLEEP})
    assert broken_link(rows) == "plan 2 is not the one that was accepted to go on for plan 1"


def test_who_continues_plans_is_known_before_the_first_one() -> None:
    made = Bench()
    made.queue.submit(FAIL)
    with pytest.raises(UsageError, match="before the first plan"):
        made.queue.continuing.by(Model(TWICE), Policy())


def test_rows_that_no_queue_has_written_lead_to_nothing() -> None:
    def submitted(plan: int, continues: int) -> QueueRow:
        return QueueRow(QueueKind.SUBMITTED, plan, data={"text": FAIL, "continues": continues})

    chains, ended = Chains(), {"status": "GAVE_UP"}
    for row in (
        *(submitted(2, 3), submitted(3, 2), submitted(4, 4)),
        *(QueueRow(QueueKind.ENDED, 9, data=ended), QueueRow(QueueKind.GENERATED, 9)),
    ):
        chains.take(row)
    assert chains.due() is None
    rows = [submitted(2, 3), submitted(3, 2), submitted(4, 4)]
    assert [chain_of(rows, plan) for plan in (2, 3, 4)] == [(2, 3), (2, 3), (4,)]
    assert broken_link(rows[:1]) == "plan 2 is not the one that was accepted to go on for plan 3"


# -- in real time --------------------------------------------------------------------------------


class _Done:
    """A driver of a plan that fails at once, or sleeps, in real time."""

    def __init__(self, bench_: Bench, state: PlanState, compiled: Compiled) -> None:
        self.driver = bench_.begin(state, compiled)
        self.kernel, self.failure = self.driver.kernel, None

    def cancel(self, reason: str) -> None:
        self.driver.cancel(reason)

    async def run(self) -> None:
        await asyncio.sleep(0)
        self.driver.run()


class Slow(Model):
    """Does not answer before it is allowed to."""

    def __init__(self, answers: Answers) -> None:
        super().__init__(answers)
        self.begun, self.go = asyncio.Event(), asyncio.Event()

    async def __call__(self, due: Due, write: Callable[[QueueRow], None], /) -> None:
        self.begun.set()
        await self.go.wait()
        await super().__call__(due, write)


def live(bond: Bond | None = None) -> tuple[LiveQueue, Slow, Log]:
    log, made, model = Log(), Bench(), Slow(TWICE)
    queue = LiveQueue(gate, log, lambda state, plan: _Done(made, state, plan), bond=bond)
    queue.continuing.by(model, Policy())
    return queue, model, log


def test_in_real_time_everything_goes_on_while_a_model_is_asked() -> None:
    async def scenario() -> list[str]:
        queue, model, log = live()
        queue.submit(FAIL)
        serving = asyncio.ensure_future(queue.serve())
        await model.begun.wait()
        assert await queue.submitted(SLEEP) == 2
        queue.close()
        model.go.set()
        await serving
        assert [str(state.status) for state in queue.states()] == [
            *("GAVE_UP", "COMPLETED", "GAVE_UP", "COMPLETED")
        ]
        return [kind for kind in kinds(log.rows) if kind.startswith("BEGUN")]

    assert asyncio.run(scenario()) == ["BEGUN 1", "BEGUN 3", "BEGUN 4", "BEGUN 2"]


def test_who_stops_the_request_ends_the_chain() -> None:
    async def scenario() -> list[str]:
        queue, model, log = live()
        queue.submit(FAIL)
        queue.close()
        serving = asyncio.ensure_future(queue.serve())
        await model.begun.wait()
        queue.continuing.stop("interrupted")
        await serving
        assert log.rows[-1][1].message == "interrupted"
        return kinds(log.rows)

    assert asyncio.run(scenario())[-2:] == ["ENDED 1", "GENERATED 1"]


def test_when_the_bond_is_lost_the_request_ends_and_stays_owed() -> None:
    async def scenario() -> None:
        bond = Bond(60)
        queue, model, log = live(bond)
        queue.submit(FAIL)
        serving = asyncio.ensure_future(queue.serve())
        await model.begun.wait()
        bond.release()
        await asyncio.sleep(0.01)
        assert kinds(log.rows)[-2:] == ["ENDED 1", "BOND_LOST 0"]
        assert queue.continuing.due() is not None
        model.go.set()
        bond.renew()
        queue.close()
        await serving
        assert [str(state.status) for state in queue.states()][-1] == "COMPLETED"
        assert kinds(log.rows)[3:6] == ["BOND_LOST 0", "BOND_RENEWED 0", "ASKED 1"]

    asyncio.run(scenario())


def test_a_queue_that_is_cancelled_leaves_no_request_behind() -> None:
    async def scenario() -> None:
        queue, model, log = live()
        queue.submit(FAIL)
        serving = asyncio.ensure_future(queue.serve())
        await model.begun.wait()
        serving.cancel()
        with pytest.raises(asyncio.CancelledError):
            await serving
        assert len(asyncio.all_tasks()) == 1
        assert kinds(log.rows)[-1] == "ENDED 1"  # it stays owed

    asyncio.run(scenario())
