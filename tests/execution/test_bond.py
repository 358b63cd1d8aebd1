"""The bond, alone and over runs in virtual and real time."""

from __future__ import annotations

import asyncio
import heapq
from typing import TYPE_CHECKING

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.errors import UsageError
from gpsfsm.execution.bond import Bond, LoopClock
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.runner import Runner
from gpsfsm.execution.virtual import VirtualDriver
from tests.oracle import R, par_all, plan, rec, seq
from tests.support import plan_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.execution.records import Record
    from tests.oracle import P

SECOND = 1_000_000


class Ticking:
    """A clock by hand."""

    def __init__(self) -> None:
        self.time_us = 0
        self.planned: list[tuple[int, int, Callable[[], None]]] = []
        self.count = 0

    def now_us(self) -> int:
        return self.time_us

    def at(self, at_us: int, action: Callable[[], None]) -> None:
        self.count += 1
        heapq.heappush(self.planned, (max(at_us, self.time_us), self.count, action))

    def go(self, until_s: float) -> None:
        until_us = round(until_s * SECOND)
        while self.planned and self.planned[0][0] <= until_us:
            self.time_us, _, action = heapq.heappop(self.planned)
            action()
        self.time_us = until_us


def watched(timeout_s: float = 2.0) -> tuple[Bond, Ticking, list[str]]:
    clock, said = Ticking(), []
    bond = Bond(timeout_s)
    bond.watch(clock, lost=said.append, renewed=lambda: said.append("renewed"))
    return bond, clock, said


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_timeout_must_be_positive(timeout_s: float) -> None:
    with pytest.raises(UsageError, match="above 0"):
        Bond(timeout_s)


def test_without_a_beat_it_is_lost_once() -> None:
    bond, clock, said = watched()
    clock.go(2.0)
    assert bond.held
    assert said == []
    clock.go(100.0)
    assert not bond.held
    assert said == ["the bond is lost: no beat for 2 s"]
    assert not clock.planned


def test_beats_keep_it_and_plan_one_look_only() -> None:
    bond, clock, said = watched()
    for beat in range(1, 50):
        clock.go(beat * 1.5)
        assert bond.beat()
        assert len(clock.planned) == 1
    clock.go(49 * 1.5 + 2.0)
    assert said == []
    clock.go(49 * 1.5 + 2.1)
    assert len(said) == 1


def test_a_beat_at_the_last_instant_counts() -> None:
    bond, clock, said = watched()
    clock.go(2.0)
    assert bond.beat()
    clock.go(4.0)
    assert bond.held
    assert said == []


def test_a_beat_that_comes_before_a_late_look_does_not_save_it() -> None:
    bond, clock, said = watched()
    clock.time_us = 3 * SECOND  # the loop was busy: nothing has looked yet
    assert not bond.held
    assert not bond.beat()
    clock.go(3.0)
    assert said == ["the bond is lost: no beat for 2 s"]
    assert not bond.beat()
    clock.go(9.0)
    assert len(said) == 1


def test_renewed_it_holds_and_can_be_lost_again() -> None:
    bond, clock, said = watched()
    clock.go(5.0)
    bond.renew()
    assert bond.held
    clock.go(6.9)
    assert said[1:] == ["renewed"]
    clock.go(8.0)
    assert said[2:] == ["the bond is lost: no beat for 2 s"]


def test_renewing_before_anybody_looked_tells_the_loss_first() -> None:
    bond, clock, said = watched()
    clock.time_us = 3 * SECOND
    bond.renew()
    clock.go(3.0)
    assert said == ["the bond is lost: no beat for 2 s", "renewed"]
    assert bond.held


def test_renewing_what_is_held_is_a_beat() -> None:
    bond, clock, said = watched()
    clock.go(1.5)
    bond.renew()
    clock.go(3.0)
    assert bond.held
    assert said == []


def test_released_it_is_lost_at_once_and_once() -> None:
    bond, clock, said = watched()
    bond.release()
    bond.release()
    assert not bond.held
    clock.go(9.0)
    assert said == ["the client has left"]


def test_it_is_watched_once_and_beats_before_that_do_nothing() -> None:
    bond = Bond(1.0)
    assert bond.beat()
    assert bond.held
    bond.watch(Ticking(), lost=lambda _: None)
    with pytest.raises(UsageError, match="only once"):
        bond.watch(Ticking(), lost=lambda _: None)


# -- over runs -----------------------------------------------------------------------------------


class Rows:
    """A sink that keeps everything."""

    def __init__(self) -> None:
        self.records: list[tuple[int, Record]] = []

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        self.records += [(at_us, record) for record in records]


class Made(Runner):
    """Sleeps its parameter ``s``; counts who is loaded and who acts."""

    loaded = 0
    acting = 0

    async def start(self, context: object) -> None:
        Made.loaded += 1

    async def stop(self) -> None:
        Made.loaded -= 1

    async def run(self, parameters: object, context: object) -> None:
        Made.acting += 1
        try:
            await context.sleep(1.0)  # type: ignore[attr-defined]
        finally:
            Made.acting -= 1


def a_run(whole: P) -> tuple[VirtualDriver, Rows]:
    Made.loaded = Made.acting = 0
    rows = Rows()
    kernel = Kernel(compile_plan(plan_of(whole)))
    return VirtualDriver(kernel, rows, lambda *_: Made()), rows


MISSION = plan(
    seq(
        R("demo/A"),
        par_all(R("demo/A"), R("demo/B"), R("demo/C")),
        rec(R("demo/D")),
        R("demo/A"),
    )
)


def test_a_lost_bond_stops_a_run_at_every_instant() -> None:
    """Before the first answer, while runners act, between two steps, at the very end."""
    driver, rows = a_run(MISSION)
    driver.run()
    assert driver.kernel.status is Status.COMPLETED
    ends = sorted({at_us for at_us, _ in rows.records})
    assert len(ends) > 3
    for timeout_us in sorted({max(1, at + step) for at in ends for step in (-2, -1, 0, 1)}):
        driver, rows = a_run(MISSION)
        Bond(timeout_us / SECOND).watch(driver, lost=driver.cancel)
        driver.run()
        completed = timeout_us + 1 > ends[-1]
        assert driver.kernel.status is (Status.COMPLETED if completed else Status.CANCELLED)
        assert not driver.kernel.active
        assert not driver.kernel.loaded
        assert (Made.loaded, Made.acting) == (0, 0)
        said = [record.message for _, record in rows.records if record.kind is Kind.CANCEL]
        assert len(said) == (not completed)
        assert all(message.startswith("the bond is lost") for message in said)


def test_a_bond_lost_while_the_runner_is_loaded_leaves_nothing_loaded() -> None:
    driver, rows = a_run(MISSION)
    bond = Bond(1.0)
    bond.watch(driver, lost=driver.cancel)
    bond.release()  # comes before the answer to the first load
    driver.run()
    assert driver.kernel.status is Status.CANCELLED
    assert Made.loaded == 0
    assert rows.records[-1][1].kind is Kind.ENDED


def test_a_bond_lost_during_a_pause_ends_the_pause() -> None:
    driver, rows = a_run(MISSION)
    Bond(5.0).watch(driver, lost=driver.cancel)
    driver.at(SECOND // 2, lambda: driver.deliver(Input(Kind.PAUSE)))
    driver.run()
    assert driver.kernel.status is Status.CANCELLED
    kinds = [record.kind for _, record in rows.records]
    assert Kind.HELD in kinds
    assert Made.loaded == Made.acting == 0


def test_a_bond_lost_while_the_run_stops_changes_nothing() -> None:
    class Slow(Made):
        async def run(self, parameters: object, context: object) -> None:
            try:
                await context.sleep(100.0)  # type: ignore[attr-defined]
            finally:
                await context.sleep(3.0)  # type: ignore[attr-defined]

    rows = Rows()
    driver = VirtualDriver(Kernel(compile_plan(plan_of(MISSION))), rows, lambda *_: Slow())
    Bond(2.0).watch(driver, lost=driver.cancel)
    driver.at(SECOND, lambda: driver.cancel("a user"))
    driver.run()
    assert driver.kernel.status is Status.CANCELLED
    ended = [at for at, record in rows.records if record.kind is Kind.ENDED]
    assert ended == [4 * SECOND]  # stopped at 1 s, which takes 3 s


def test_a_run_that_hangs_ends_with_its_bond() -> None:
    class Hanging(Made):
        async def run(self, parameters: object, context: object) -> None:
            await context.sleep(float("inf"))  # type: ignore[attr-defined]

    driver = VirtualDriver(Kernel(compile_plan(plan_of(MISSION))), Rows(), lambda *_: Hanging())
    Bond(60.0).watch(driver, lost=driver.cancel)
    driver.run()
    assert driver.kernel.status is Status.CANCELLED
    assert driver.now_us() == 60 * SECOND + 1


def test_a_client_that_beats_lets_the_run_complete() -> None:
    driver, _ = a_run(MISSION)
    bond = Bond(0.5)
    bond.watch(driver, lost=driver.cancel)
    for beat in range(1, 20):
        driver.at(beat * SECOND * 2 // 5, lambda: bond.beat() and None)
    driver.run()
    assert driver.kernel.status is Status.COMPLETED


def test_the_loss_is_the_same_in_every_run() -> None:
    def one() -> list[tuple[int, Record]]:
        driver, rows = a_run(MISSION)
        Bond(1.25).watch(driver, lost=driver.cancel)
        driver.run()
        return rows.records

    first = one()
    assert all(one() == first for _ in range(5))


def test_real_time() -> None:
    async def client() -> tuple[list[str], bool, bool]:
        said: list[str] = []
        bond = Bond(0.2)
        bond.watch(LoopClock(asyncio.get_running_loop()), lost=said.append)
        for _ in range(10):
            await asyncio.sleep(0.04)
            bond.beat()
        held = bond.held and not said
        while not said:
            await asyncio.sleep(0.01)
        return said, held, bond.held

    said, held, after = asyncio.run(client())
    assert held
    assert not after
    assert said == ["the bond is lost: no beat for 0.2 s"]
