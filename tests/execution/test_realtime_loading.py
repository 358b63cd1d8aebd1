"""Loading in real time, what depends on what, a journal that is full, and lanes."""

from __future__ import annotations

import asyncio
import threading
import time
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.lane import Lane, in_thread
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Kind, Status
from gpsfsm.execution.runner import Runner, RunnerError
from tests.execution.realtiming import (
    WAIT_S,
    Diary,
    after,
    fine,
    for_ever,
    go,
    guarded,
    messages,
    plan,
    play,
)
from tests.execution.support import Listing, compiled_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.execution.records import Record
    from gpsfsm.execution.runner import LoadContext, RunContext

# -- loading --------------------------------------------------------------------------------


def test_a_runner_that_cannot_be_made_fails_its_instances() -> None:
    def make(interface: str, provider: str) -> Runner:
        if interface == "demo/A":
            raise RunnerError("there is no such runner")
        return Diary(B=fine).make(interface, provider)

    sink, driver = asyncio.run(go(guarded("A", "B"), make))
    assert messages(sink, Kind.NOT_LOADED) == ["there is no such runner"]
    assert driver.kernel.status is Status.COMPLETED


def test_a_runner_that_is_none_is_not_loaded() -> None:
    sink, _ = asyncio.run(go(plan("A"), lambda interface, provider: "text"))  # type: ignore[arg-type,return-value]
    assert messages(sink, Kind.NOT_LOADED) == ["str is not a runner"]


def test_loading_is_bounded() -> None:
    class Slow(Runner):
        async def start(self, context: LoadContext) -> None:
            await asyncio.sleep(WAIT_S)

        async def run(self, parameters: object, context: object) -> None:
            raise AssertionError

    sink, driver = asyncio.run(go(plan("A"), lambda interface, provider: Slow(), load_s=0.1))
    assert messages(sink, Kind.NOT_LOADED) == ["not loaded within 0.1 s"]
    assert driver.kernel.status is Status.GAVE_UP


def needs(*pairs: tuple[str, str]) -> Callable[[str, str], list[tuple[str, str]]]:
    def depends_on(interface: str, provider: str) -> list[tuple[str, str]]:
        return [(f"demo/{b}", f"demo/{b}") for a, b in pairs if interface == f"demo/{a}"]

    return depends_on


def test_what_a_runner_depends_on_is_loaded_before_and_unloaded_after_it_once() -> None:
    diary = Diary(A=fine, B=fine)
    depends_on = needs(("A", "C"), ("B", "C"), ("C", "D"))
    _, driver = play(plan("A", "B", control="parallel_all"), diary, depends_on=depends_on)
    assert driver.kernel.status is Status.COMPLETED
    starts = [line for line in diary.lines if line.startswith("start")]
    stops = [line for line in diary.lines if line.startswith("stop")]
    assert starts[:2] == ["start D", "start C"]
    assert sorted(starts) == ["start A", "start B", "start C", "start D"]
    assert stops[-2:] == ["stop C", "stop D"]
    assert sorted(stops) == ["stop A", "stop B", "stop C", "stop D"]


def test_runners_that_depend_on_each_other_are_loaded_all_the_same() -> None:
    diary = Diary(A=fine)
    _, driver = play(plan("A"), diary, depends_on=needs(("A", "B"), ("B", "A")))
    assert driver.kernel.status is Status.COMPLETED
    assert diary.lines == ["start B", "start A", "stop A", "stop B"]


def test_without_what_it_depends_on_a_runner_is_not_loaded() -> None:
    diary = Diary(A=fine)

    def make(interface: str, provider: str) -> Runner:
        if interface == "demo/C":
            raise RunnerError("no power")
        return diary.make(interface, provider)

    sink, _ = asyncio.run(go(plan("A"), make, depends_on=needs(("A", "B"), ("B", "C"))))
    assert messages(sink, Kind.NOT_LOADED) == ["demo/C, which it depends on: no power"]
    assert diary.lines == []


def test_unloading_that_fails_or_hangs_is_only_logged() -> None:
    class Bad(Runner):
        def __init__(self, name: str) -> None:
            self.name = name

        async def run(self, parameters: object, context: object) -> None:
            return None

        async def stop(self) -> None:
            if self.name == "demo/A":
                raise ValueError("stuck")
            await asyncio.sleep(WAIT_S)

    _, driver = asyncio.run(go(plan("A", "B"), lambda name, provider: Bad(name), grace_s=0.1))
    assert driver.kernel.status is Status.COMPLETED
    assert [line for _, _, line in driver.logs] == [
        "unloading demo/A: ValueError: stuck",
        "unloading demo/B: RunnerError: not unloaded within 0.1 s",
    ]


def test_all_may_share_one_thread() -> None:
    names: list[str] = []

    async def tell(context: RunContext) -> None:
        names.append(threading.current_thread().name)

    play(plan("A", "B"), Diary(A=tell, B=tell), isolate=False)
    assert names == ["runners", "runners"]
    play(plan("A", "B"), Diary(A=tell, B=tell))
    assert names[2:] == ["runner demo/A", "runner demo/B"]


# -- the journal ----------------------------------------------------------------------------


class Full(Listing):
    """A sink that is full after some inputs."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self.room = room

    def write(self, at_us: int, happened: Any, records: Any) -> None:
        if len(self.rows) == self.room:
            raise OSError("the disk is full")
        super().write(at_us, happened, records)


@pytest.mark.parametrize("room", range(6))
def test_when_nothing_can_be_written_everything_stops(room: int) -> None:
    diary = Diary(A=fine, B=after(0.05), C=for_ever)
    text = plan("A", "B", "C")

    async def main() -> Full:
        sink = Full(room)
        driver = RealtimeDriver(Kernel(compiled_of(text)), sink, diary.make)
        async with asyncio.timeout(WAIT_S):
            with pytest.raises(OSError, match="the disk is full"):
                await driver.run()
        return sink

    sink = asyncio.run(main())
    assert len(sink.rows) == room
    started = sorted(line[6:] for line in diary.lines if line.startswith("start"))
    stopped = sorted(line[5:] for line in diary.lines if line.startswith("stop"))
    assert started == stopped


def test_the_journal_is_written_before_a_runner_acts() -> None:
    sink = Listing()
    seen: list[Record] = []

    async def look(context: RunContext) -> None:
        seen.extend(sink.records)

    async def main() -> None:
        driver = RealtimeDriver(Kernel(compiled_of(plan("A"))), sink, Diary(A=look).make)
        await driver.run()

    asyncio.run(main())
    assert [str(each.kind) for each in seen] == [
        "BEGIN",
        "TRIGGERED",
        "LOADING",
        "LOADED",
        "STARTED",
    ]


# -- threads --------------------------------------------------------------------------------


def test_a_function_that_blocks_runs_in_a_thread_of_its_own() -> None:
    async def main() -> None:
        assert await in_thread(lambda a, *, b: a + b, 1, b=2) == 3
        with pytest.raises(ZeroDivisionError):
            await in_thread(lambda: 1 // 0)
        with pytest.raises(RuntimeError, match="StopIteration"):
            await in_thread(lambda: next(iter(())))
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.05):
                await in_thread(time.sleep, 0.3)

    asyncio.run(main())


def test_a_lane_survives_what_its_tasks_do_and_ends_when_it_is_closed() -> None:
    lane = Lane("tested")
    done = threading.Event()

    async def leave() -> None:
        raise SystemExit

    lane.do(lambda: lane.task(leave()) and None)
    lane.do(done.set)
    assert done.wait(WAIT_S)
    lane.close()
    end = time.monotonic() + WAIT_S
    while any(thread.name == "tested" for thread in threading.enumerate()):
        assert time.monotonic() < end
        time.sleep(0.01)
    lane.do(done.clear)
    assert done.is_set()
