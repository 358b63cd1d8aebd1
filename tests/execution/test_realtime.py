"""Plans in real time: answers as they come, and runners that misbehave."""

from __future__ import annotations

import asyncio
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.runner import InDoubtError, Runner, StopRequested
from tests.execution.realtiming import (
    WAIT_S,
    Diary,
    after,
    broken,
    fine,
    for_ever,
    go,
    guarded,
    messages,
    once,
    order,
    plan,
    play,
    runner,
)
from tests.execution.support import Listing, compiled_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.execution.records import Record, RunValue
    from gpsfsm.execution.runner import RunContext


def test_a_plan_runs_and_what_is_loaded_is_unloaded() -> None:
    diary = Diary(A=fine, B=fine)
    sink, driver = play(plan("A", "B", "A"), diary)
    assert driver.kernel.status is Status.COMPLETED
    assert diary.lines == ["start A", "start B", "stop B", "stop A"]
    assert [record.data for record in sink.records if record.kind is Kind.SUCCEEDED] == [
        {"answer": 42}
    ] * 3


def test_answers_count_in_the_order_in_which_they_arrive() -> None:
    diary = Diary(A=after(0.3), B=after(0.15), C=after(0.01))
    sink, driver = play(plan("A", "B", "C", control="parallel_all"), diary)
    assert order(sink, Kind.SUCCEEDED) == [("SUCCEEDED", 3), ("SUCCEEDED", 2), ("SUCCEEDED", 1)]
    times = [at_us for at_us, _, _ in sink.rows]
    assert times == sorted(times)
    assert driver.kernel.status is Status.COMPLETED


def test_a_failure_is_handed_on_with_its_outputs() -> None:
    sink, driver = play(guarded("A", "B"), Diary(A=broken, B=fine))
    failed = next(record for record in sink.records if record.kind is Kind.FAILED)
    assert (failed.message, failed.data) == ("no grip", {"force": 1.5})
    assert driver.kernel.status is Status.COMPLETED


async def raises(context: RunContext) -> None:
    raise ZeroDivisionError("by zero")


async def leaves(context: RunContext) -> None:
    raise SystemExit(3)


async def cancels_itself(context: RunContext) -> None:
    raise asyncio.CancelledError


async def returns_rubbish(context: RunContext) -> object:
    return {"found": {1, 2}}


async def returns_a_list(context: RunContext) -> object:
    return ["found"]


async def floods(context: RunContext) -> dict[str, RunValue]:
    return {"text": "x" * 2_000_000}


async def travels_back(context: RunContext) -> None:
    await context.sleep(float("nan"))


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (raises, "ZeroDivisionError: by zero"),
        (leaves, "SystemExit: 3"),
        (cancels_itself, "CancelledError"),
        (returns_rubbish, "its output 'found' is no value that can be handed over"),
        (returns_a_list, "it returned list and not outputs by name"),
        (floods, "its outputs are too long"),
        (travels_back, "ValueError: a duration is not negative"),
        (
            lambda context: {"not": "awaited"},
            "TypeError: object dict can't be used in 'await' expr",
        ),
    ],
)
def test_whatever_goes_wrong_is_a_failure_and_the_plan_goes_on(
    act: Callable[[RunContext], Any], message: str
) -> None:
    sink, driver = play(guarded("A", "B"), Diary(A=act, B=fine))
    assert driver.kernel.status is Status.COMPLETED
    (said,) = messages(sink, Kind.FAILED)
    assert said.startswith(message)


def test_a_runner_whose_run_is_no_coroutine() -> None:
    class Plain(Runner):
        def run(self, parameters: object, context: object) -> Any:
            return {}

    sink, _ = asyncio.run(go(plan("A"), lambda interface, provider: Plain()))
    assert messages(sink, Kind.FAILED) == ["its methods have to be 'async def'"]


def test_an_action_that_has_used_up_its_time_is_stopped_and_has_failed() -> None:
    sink, driver = play(guarded("A", "B"), Diary(A=for_ever, B=fine), timeout_s=0.5)
    assert driver.kernel.status is Status.COMPLETED
    kinds = [str(record.kind) for record in sink.records if record.node == 1]
    assert kinds == ["TRIGGERED", "STARTED", "TIMEOUT", "STOPPING", "STOPPED", "FAILED"]


def test_one_that_blocks_its_thread_holds_up_nobody_else() -> None:
    free, begun = threading.Event(), threading.Event()

    async def hog(context: RunContext) -> None:
        begun.set()
        free.wait(WAIT_S)

    diary = Diary(A=hog, B=once(begun), C=fine)
    both = f'<Control type="parallel_any">{runner("A")}{runner("B")}</Control>'
    text = f"<Plan>{both}{runner('C')}</Plan>"
    sink, driver = play(text, diary, timeout_s=60, grace_s=0.2)
    free.set()
    assert driver.kernel.status is Status.COMPLETED
    assert messages(sink, Kind.STOPPED) == ["did not stop and was cut off"]
    assert diary.lines.count("stop A") == 0
    assert any("not unloaded within 0.2 s" in line for _, _, line in driver.logs)


def test_one_that_ignores_that_it_is_to_stop_gets_no_further_turn() -> None:
    turns = []
    begun = threading.Event()

    async def stubborn(context: RunContext) -> None:
        while True:
            begun.set()
            turns.append(context.stop_requested)
            try:
                await context.sleep(0.01)
            except BaseException:
                turns.append(True)

    sink, driver = play(
        plan("A", "B", control="parallel_any"), Diary(A=stubborn, B=once(begun)), grace_s=0.1
    )
    assert driver.kernel.status is Status.COMPLETED
    assert messages(sink, Kind.STOPPED) == ["did not stop and was cut off"]
    before = len(turns)
    time.sleep(0.1)
    assert len(turns) == before


def test_one_that_may_still_act_outside_is_waited_for() -> None:
    begun, outside = threading.Event(), ["the goal may still begin"]

    async def drives(context: RunContext) -> None:
        context.doubt = lambda: "".join(outside)
        begun.set()
        try:
            await context.sleep(WAIT_S)
        finally:
            await asyncio.sleep(0.5)  # five times as long as it may take to stop
            outside.clear()

    sink, driver = play(guarded("A", "B"), Diary(A=drives, B=fine), timeout_s=0.1, grace_s=0.1)
    assert driver.kernel.status is Status.COMPLETED
    assert messages(sink, Kind.STOPPED) == ["stopped"]
    assert not driver.doubts
    assert any("may still begin" in line for _, _, line in driver.logs)


def test_one_that_has_ended_and_left_something_outside_is_waited_for() -> None:
    begun, outside = threading.Event(), ["the goal may still begin"]

    async def drives(context: RunContext) -> None:
        context.doubt = lambda: "".join(outside)
        begun.set()
        threading.Timer(0.5, outside.clear).start()
        await context.sleep(WAIT_S)  # it is stopped, and cleans nothing up

    sink, driver = play(guarded("A", "B"), Diary(A=drives, B=fine), timeout_s=0.1, grace_s=5)
    assert driver.kernel.status is Status.COMPLETED
    ended = next(at for at, happened, _ in sink.rows if happened.kind is Kind.STOPPED)
    assert ended >= 450_000, "no step ends as long as its goal may act"
    assert not driver.doubts


async def never_ends(context: RunContext) -> None:
    context.doubt = lambda: "the goal may still begin"
    while True:
        with suppress(BaseException):
            await asyncio.sleep(WAIT_S)


async def does_not_know(context: RunContext) -> None:
    raise InDoubtError("the goal may still begin")


@pytest.mark.parametrize("act", [never_ends, does_not_know])
def test_a_run_ends_in_doubt_and_starts_nothing_more(
    act: Callable[[RunContext], Any],
) -> None:
    sink, driver = play(
        guarded("A", "B"), Diary(A=act, B=fine), timeout_s=0.1, grace_s=0.1, doubt_s=0.3
    )
    assert driver.kernel.status is Status.CANCELLED
    assert driver.doubts == ["the goal may still begin"]
    assert messages(sink, Kind.CANCEL) == ["in doubt: the goal may still begin"]
    assert order(sink, Kind.STARTED) == [("STARTED", 1)], "no recovery begins"


def test_stopping_raises_inside_the_runner_which_cleans_up() -> None:
    notes: list[object] = []
    begun = threading.Event()

    async def tidy(context: RunContext) -> None:
        begun.set()
        try:
            await asyncio.wait_for(asyncio.sleep(WAIT_S), WAIT_S)
        except StopRequested as stop:
            notes.append(context.stop_requested)
            await context.sleep(0.01)
            notes.append("tidied")
            raise stop

    sink, _ = play(plan("A", "B", control="parallel_any"), Diary(A=tidy, B=once(begun)))
    assert notes == [True, "tidied"]
    assert messages(sink, Kind.STOPPED) == ["stopped"]


def test_time_limits_hold_while_a_runner_cleans_up() -> None:
    notes: list[str] = []
    begun = threading.Event()

    async def tidy(context: RunContext) -> None:
        begun.set()
        try:
            await context.sleep(WAIT_S)
        finally:
            try:
                async with asyncio.timeout(0.05):
                    await asyncio.sleep(WAIT_S)
            except TimeoutError:
                notes.append("gave that up")

    sink, _ = play(plan("A", "B", control="parallel_any"), Diary(A=tidy, B=once(begun)))
    assert notes == ["gave that up"]
    assert messages(sink, Kind.STOPPED) == ["stopped"]


def test_the_last_started_is_stopped_first_and_unloaded_first() -> None:
    diary = Diary(A=for_ever, B=for_ever, C=after(0.2))
    sink, _ = play(plan("A", "B", "C", control="parallel_any"), diary)
    started = [node for _, node in order(sink, Kind.STARTED) if node != 3]
    assert [node for _, node in order(sink, Kind.STOPPING)] == started[::-1]
    unloaded = [record.runner for record in sink.records if record.kind is Kind.UNLOADED]
    loaded = [
        record.runner
        for record in sink.records
        if record.kind is Kind.LOADED and record.runner != 2
    ]
    assert [2, *loaded[::-1]] == unloaded
    stops = [line[5:] for line in diary.lines if line.startswith("stop")]
    assert stops == ["ABC"[runner] for runner in unloaded]


def test_the_plan_goes_on_once_what_has_used_up_its_time_has_stopped() -> None:
    acting: list[str] = []
    both: list[str] = []

    async def slow_to_stop(context: RunContext) -> None:
        acting.append("A")
        try:
            await context.sleep(WAIT_S)
        except StopRequested:
            await context.sleep(0.2)  # and then it succeeds all the same
        acting.remove("A")

    async def recovers(context: RunContext) -> None:
        both.extend(acting)

    sink, driver = play(
        guarded("A", "B"), Diary(A=slow_to_stop, B=recovers), timeout_s=0.5, grace_s=WAIT_S
    )
    assert both == []
    assert messages(sink, Kind.STOPPED) == ["it has ended: SUCCEEDED"]
    assert messages(sink, Kind.FAILED) == ["its time is over"]
    assert driver.kernel.status is Status.COMPLETED


def test_an_answer_after_the_end_of_an_instance_is_late() -> None:
    free = threading.Event()

    async def deaf(context: RunContext) -> None:
        free.wait(WAIT_S)  # it blocks its thread, so it is cut off
        await asyncio.sleep(0)

    async def recovers(context: RunContext) -> None:
        free.set()
        await context.sleep(0.5)

    sink, driver = play(guarded("A", "B"), Diary(A=deaf, B=recovers), timeout_s=1.0, grace_s=0.2)
    assert messages(sink, Kind.STOPPED) == ["did not stop and was cut off"]
    assert driver.kernel.status is Status.COMPLETED
    assert driver.now_us() >= 1_200_000  # the grace time was over when it went on


def test_cancelling_from_another_thread_leaves_nothing_active() -> None:
    started: list[int] = []
    diary = Diary(A=for_ever, B=for_ever)

    def before(driver: RealtimeDriver) -> None:
        driver.watchers.append(lambda _at_us, _input, actual: look(driver, actual))

    def look(driver: RealtimeDriver, records: Sequence[Record]) -> None:
        started.extend(record.node for record in records if record.kind is Kind.STARTED)
        if len(started) == 2:
            started.append(0)
            threading.Thread(target=driver.cancel, args=["that is enough"]).start()

    sink, driver = play(plan("A", "B", control="parallel_all"), diary, before=before)
    assert driver.kernel.status is Status.CANCELLED
    assert messages(sink, Kind.CANCEL) == ["that is enough"]
    assert messages(sink, Kind.STOPPED) == ["stopped", "stopped"]
    assert sorted(diary.lines) == ["start A", "start B", "stop A", "stop B"]


def test_cancelling_before_the_beginning_and_while_loading() -> None:
    _, driver = play(plan("A"), Diary(A=for_ever), before=lambda driver: driver.cancel("no"))
    assert driver.kernel.status is Status.CANCELLED


def test_cancelling_the_task_cancels_the_run() -> None:
    async def main() -> tuple[Listing, Status]:
        sink = Listing()
        driver = RealtimeDriver(Kernel(compiled_of(plan("A"))), sink, Diary(A=for_ever).make)
        task = asyncio.create_task(driver.run())
        await asyncio.sleep(0.2)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return sink, driver.kernel.status

    sink, status = asyncio.run(main())
    assert status is Status.CANCELLED
    assert messages(sink, Kind.CANCEL) == ["the process was interrupted"]


def test_a_run_that_cannot_be_written_stops_its_runners_also_if_it_is_cancelled() -> None:
    stopped: list[str] = []

    async def slow_to_stop(context: RunContext) -> None:
        try:
            await context.sleep(300)
        finally:
            stopping.set()
            await asyncio.sleep(0.1)
            stopped.append("stopped")

    class Full(Listing):
        def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
            if happened.kind is Kind.CANCEL:
                raise OSError("no space is left")
            super().write(at_us, happened, records)

    stopping = threading.Event()

    async def main() -> None:
        diary = Diary(A=slow_to_stop)
        driver = RealtimeDriver(Kernel(compiled_of(plan("A"))), Full(), diary.make)
        task = asyncio.create_task(driver.run())
        await asyncio.sleep(0.2)
        driver.cancel("enough")
        async with asyncio.timeout(WAIT_S):
            while not stopping.is_set():
                await asyncio.sleep(0.001)
        task.cancel()
        with pytest.raises((asyncio.CancelledError, OSError)):
            await task
        assert stopped == ["stopped"]
        assert diary.lines == ["start A", "stop A"]

    asyncio.run(main())


def test_pause_holds_what_is_triggered() -> None:
    def before(driver: RealtimeDriver) -> None:
        driver.pause()
        driver.watchers.append(lambda at_us, _, actual: go_on(driver, at_us, actual))

    def go_on(driver: RealtimeDriver, at_us: int, records: Sequence[Record]) -> None:
        if any(record.kind is Kind.HELD for record in records):
            driver.at(at_us + 100_000, driver.resume)

    sink, driver = play(plan("A", "B"), Diary(A=fine, B=fine), before=before)
    assert driver.kernel.status is Status.COMPLETED
    assert order(sink, Kind.HELD, Kind.STARTED) == [
        ("STARTED", 1),
        ("HELD", 2),
        ("STARTED", 2),
    ]
    (held,) = [at for at, _, each in sink.rows if any(r.kind is Kind.HELD for r in each)]
    started = [at for at, _, each in sink.rows if any(r.kind is Kind.STARTED for r in each)]
    assert started[1] >= held + 100_000


def test_lines_of_runners_are_kept_up_to_a_limit() -> None:
    async def chatter(context: RunContext) -> None:
        for line in range(5_000):
            context.log(f"line {line} \udc80")
        context.log("x" * 20_000)

    sink, driver = play(plan("A"), Diary(A=chatter))
    lines = [happened.message for _, happened, _ in sink.rows if happened.kind is Kind.LOG]
    assert len(lines) == 1_001
    assert lines[0] == "line 0 \\udc80"
    assert lines[-1] == "it logs too much: no more of it"
    assert len(driver.logs) == 1_001


def test_speed_is_the_time_of_the_run() -> None:
    async def hour(context: RunContext) -> dict[str, RunValue]:
        began = context.now_s
        await context.sleep(3_600)
        return {"took": context.now_s - began}

    sink, driver = play(plan("A"), Diary(A=hour), speed=36_000)
    data = next(record.data for record in sink.records if record.kind is Kind.SUCCEEDED)
    assert data is not None
    assert float(str(data["took"])) >= 3_600
    assert driver.now_us() >= 3_600_000_000
    with pytest.raises(ValueError, match="above 0"):
        RealtimeDriver(driver.kernel, sink, Diary().make, speed=0)


def test_the_key_tells_runs_apart_and_is_the_same_again() -> None:
    keys: list[str] = []

    async def tell(context: RunContext) -> None:
        keys.append(context.key)

    for run_id in ("one", "two", "one"):
        play(plan("A", "A"), Diary(A=tell), run_id=run_id)
    assert len(set(keys)) == 4
    assert keys[:2] == keys[4:]
