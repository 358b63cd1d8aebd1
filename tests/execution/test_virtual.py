"""Virtual time: what comes first, what a runner is given, and how a run ends."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from tests.cases import many
from tests.execution.support import BEGIN, Listing, compiled_of, drive, kinds
from tests.oracle import par_all, par_any, plan, rec, seq
from tests.strategies import plans

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import RunValue
    from tests import oracle


class Takes(Runner):
    """Takes as many seconds as its parameter ``s`` says; fails if ``ok`` is false."""

    async def run(
        self, parameters: Mapping[str, Any], context: RunContext
    ) -> Mapping[str, RunValue]:
        await context.sleep(parameters.get("s", 1))
        if not parameters.get("ok", True):
            raise RunnerError("it was to fail", why="asked for")
        return {"now": context.now_s}


def taking(whole: oracle.P, **options: Any) -> tuple[Listing, VirtualDriver]:
    return drive(compiled_of(whole), lambda interface, provider: Takes(), **options)


def ends(sink: Listing) -> list[tuple[int, str]]:
    """When which instance has ended."""
    return [
        (at_us, text)
        for at_us, _, records in sink.rows
        for text in kinds(records)
        if text.startswith(("SUCCEEDED", "FAILED", "TIMEOUT"))
    ]


def test_the_clock_jumps_to_what_comes_next() -> None:
    sink, driver = taking(plan(par_all("A s=7200", "B s=1.5", "C s=36000"), "D s=0.25"))
    assert ends(sink) == [
        (1_500_000, "SUCCEEDED 1"),
        (7_200_000_000, "SUCCEEDED 0"),
        (36_000_000_000, "SUCCEEDED 2"),
        (36_000_250_000, "SUCCEEDED 3"),
    ]
    assert driver.kernel.status is Status.COMPLETED


def test_at_one_instant_comes_first_what_was_planned_first() -> None:
    sink, _ = taking(plan(par_all("A s=2", "B s=2", "C s=2"), rec("D")))
    assert [text for _, text in ends(sink)] == ["SUCCEEDED 0", "SUCCEEDED 1", "SUCCEEDED 2"]
    # the first sleep of B was asked for later than that of A, the second one as well
    sink, _ = taking(plan(par_all(seq("A s=1", "C s=1"), seq("B s=1", "D s=1"))))
    assert [text for _, text in ends(sink)] == [f"SUCCEEDED {number}" for number in (0, 2, 1, 3)]


def test_nothing_ends_at_the_instant_of_its_start() -> None:
    class Quick(Runner):
        async def run(self, parameters: object, context: RunContext) -> None:
            return None

    sink, driver = drive(compiled_of(plan("A", "B")), lambda interface, provider: Quick())
    assert ends(sink) == [(1, "SUCCEEDED 0"), (2, "SUCCEEDED 1")]
    assert driver.now_us() == 2


def test_a_sleep_of_no_time_takes_some() -> None:
    sink, _ = taking(plan("A s=0", "B s=1e-9"))
    assert [at_us for at_us, _ in ends(sink)] == [1, 2]


def test_a_timeout() -> None:
    sink, driver = taking(plan("A s=10", rec("B s=1")), timeout_s=5)
    assert ends(sink) == [
        (5_000_000, "TIMEOUT 0"),
        (5_000_000, "FAILED 0"),
        (6_000_000, "SUCCEEDED 1"),
    ]
    assert driver.kernel.status is Status.COMPLETED


def test_one_that_ends_in_time_has_no_timeout() -> None:
    sink, driver = taking(plan("A s=5", "B s=5"), timeout_s=5.1)
    assert [text for _, text in ends(sink)] == ["SUCCEEDED 0", "SUCCEEDED 1"]
    assert driver.now_us() == 10_000_000


def test_a_failure_says_why() -> None:
    sink, driver = taking(plan("A ok=false", rec("B")))
    (failed,) = [record for record in sink.records if record.kind is Kind.FAILED]
    assert (failed.message, failed.data) == ("it was to fail", {"why": "asked for"})
    assert driver.kernel.status is Status.COMPLETED


def test_what_an_instance_is_given() -> None:
    seen: list[tuple[Any, ...]] = []

    class Curious(Runner):
        async def start(self, context: LoadContext) -> None:
            seen.append((context.interface, context.provider, context.services["world"]))

        async def run(self, parameters: Mapping[str, Any], context: RunContext) -> None:
            luck = context.random.random()
            seen.append((context.number, context.element, context.key, context.now_s, luck))
            assert not context.stop_requested

    compiled = compiled_of(plan("A", par_all("A", "A")))
    runs = []
    for seed in (1, 1, 2):
        drive(compiled, lambda interface, provider: Curious(), seed=seed, services={"world": 7})
        runs.append(list(seen))
        seen.clear()
    assert runs[0] == runs[1]
    loaded, *acting = runs[0]
    assert loaded == ("A", "demo_runners/Demo", 7)
    assert [entry[:4] for entry in acting] == [
        (0, "/Plan/Runner[1]", "1:/Plan/Runner[1]", 0.0),
        (1, "/Plan/Control[1]/Runner[1]", "1:/Plan/Control[1]/Runner[1]", 1e-6),
        (2, "/Plan/Control[1]/Runner[2]", "1:/Plan/Control[1]/Runner[2]", 1e-6),
    ]
    luck = [entry[4] for entry in acting + runs[2][1:]]
    assert len(set(luck)) == 6  # of its own for every instance and seed


def test_one_runner_for_all_its_instances() -> None:
    made: list[Runner] = []

    def make(interface: str, provider: str) -> Runner:
        made.append(Takes())
        return made[-1]

    drive(compiled_of(plan("A", "B", par_all("A", "A"), "B")), make)
    assert len(made) == 2


def test_runners_go_in_the_order_that_the_kernel_says() -> None:
    messages: list[str] = []

    class Telling(Takes):
        async def start(self, context: LoadContext) -> None:
            self.name = context.interface
            messages.append(f"+{self.name}")

        async def stop(self) -> None:
            messages.append(f"-{self.name}")

    def make(interface: str, provider: str) -> Runner:
        return Telling()

    drive(compiled_of(plan("A", par_any("B s=1", "C s=2", "D s=3"))), make)
    assert messages == ["+A", "-A", "+B", "+C", "+D", "-B", "-D", "-C"]


def test_a_pause_and_going_on_in_virtual_time() -> None:
    def before(driver: VirtualDriver) -> None:
        driver.at(500_000, lambda: driver.deliver(Input(Kind.PAUSE)))
        driver.at(9_000_000, lambda: driver.deliver(Input(Kind.RESUME)))

    sink, driver = taking(plan("A s=1", "B s=1"), before=before)
    assert ends(sink) == [(1_000_000, "SUCCEEDED 0"), (10_000_000, "SUCCEEDED 1")]
    assert driver.kernel.status is Status.COMPLETED


def test_a_cancel_in_virtual_time() -> None:
    sink, driver = taking(
        plan(par_all("A s=5", "B s=1")),
        before=lambda driver: driver.at(2_000_000, lambda: driver.cancel("enough")),
    )
    assert driver.kernel.status is Status.CANCELLED
    assert driver.now_us() == 2_000_000
    (cancel,) = [record for record in sink.records if record.kind is Kind.CANCEL]
    assert cancel.message == "enough"


def test_what_is_planned_for_later_does_not_happen_once_the_run_has_ended() -> None:
    late: list[int] = []
    _, driver = taking(
        plan("A s=1"), before=lambda driver: driver.at(10**9, lambda: late.append(1))
    )
    assert late == []
    driver.cancel("too late")
    assert driver.kernel.status is Status.COMPLETED


def test_an_empty_plan_takes_no_time() -> None:
    sink, driver = taking(plan())
    assert kinds(sink.records) == ["BEGIN", "ENDED COMPLETED"]
    assert driver.now_us() == 0


@settings(max_examples=many(50))
@given(whole=plans(max_runners=8), seed=st.integers(0, 100))
def test_the_driver_holds_what_the_kernel_thinks_it_does(whole: oracle.P, seed: int) -> None:
    class Lucky(Runner):
        async def run(self, parameters: object, context: RunContext) -> None:
            await context.sleep(context.random.uniform(0, 3))
            assert context.random.random() < 0.6

    compiled = compiled_of(whole)
    driver = VirtualDriver(
        Kernel(compiled), Listing(), lambda interface, provider: Lucky(), seed=seed
    )
    driver.deliver(BEGIN)
    before = 0
    while not driver.kernel.status.ended:
        assert driver.advance()
        assert before <= driver.now_us()
        before = driver.now_us()
        if driver.kernel.status is Status.RUNNING:
            assert list(driver._acting) == list(driver.kernel.active)
        else:  # who has stopped tells the kernel a moment later
            assert set(driver._acting) <= set(driver.kernel.active)
        if not driver.kernel._loading:
            assert list(driver._runners) == list(driver.kernel.loaded)
    assert not driver._runners


@pytest.mark.parametrize("size", [2_000])
def test_a_long_plan(size: int) -> None:
    _, driver = taking(plan(*(f"A s={1 + number % 3}" for number in range(size))))
    assert driver.kernel.status is Status.COMPLETED
    assert driver.kernel.visits == size + 1  # each node once, and completion


def needing(*pairs: str) -> Callable[[str, str], list[tuple[str, str]]]:
    """``"AB"``: A depends on B."""

    def depends_on(interface: str, provider: str) -> list[tuple[str, str]]:
        return [(b, provider) for a, b in pairs if interface == a]

    return depends_on


def loading(
    whole: oracle.P, pairs: tuple[str, ...], broken: str = "", *, apart: bool = False
) -> tuple[list[str], Listing]:
    """What is loaded (+) and unloaded (-) in which order, and what is recorded."""
    lines: list[str] = []

    class Telling(Takes):
        def __init__(self, name: str) -> None:
            self.name = name

        async def start(self, context: LoadContext) -> None:
            if self.name == broken:
                raise RunnerError("no power")
            lines.append(f"+{self.name}")

        async def stop(self) -> None:
            lines.append(f"-{self.name}")

    sink = Listing()
    kernel = Kernel(compiled_of(whole), apart=apart)
    depends_on = needing(*pairs)
    VirtualDriver(kernel, sink, lambda name, _: Telling(name), depends_on=depends_on).run()
    return lines, sink


def test_what_a_runner_depends_on_is_loaded_before_and_unloaded_after_it_once() -> None:
    whole = plan(par_all("A s=1", "B s=2"))
    lines, sink = loading(whole, ("AC", "BC", "CD"))
    assert lines == ["+D", "+C", "+A", "+B", "-A", "-B", "-C", "-D"]
    assert sink.records == loading(whole, ())[1].records  # what others need is no event of the run


def test_one_that_others_depend_on_may_be_of_the_plan_itself() -> None:
    lines, _ = loading(plan("A", "B s=1"), ("AB",))
    assert lines == ["+B", "+A", "-A", "-B", "+B", "-B"]  # in between nobody needs B
    lines, _ = loading(plan(par_all("A s=1", "B s=2")), ("AB",))
    assert lines == ["+B", "+A", "-A", "-B"]


def test_runners_that_depend_on_each_other_are_loaded_all_the_same() -> None:
    assert loading(plan("A"), ("AB", "BA"))[0] == ["+B", "+A", "-A", "-B"]


def test_without_what_it_depends_on_a_runner_is_not_loaded() -> None:
    lines, sink = loading(plan("A"), ("AB", "AC"), broken="C")
    (refused,) = [record for record in sink.records if record.kind is Kind.NOT_LOADED]
    assert refused.message == "demo_runners/Demo, which it depends on: no power"
    assert lines == ["+B", "-B"]


def test_instances_with_runners_of_their_own_share_what_these_depend_on() -> None:
    lines, _ = loading(plan(par_all("A s=1", "A s=2")), ("AB",), apart=True)
    assert lines == ["+B", "+A", "+A", "-A", "-A", "-B"]


def test_durations_are_exact_and_never_none() -> None:
    """Two that take a second each end with the one of two seconds, and not behind it."""
    sink, driver = taking(plan(par_all(seq("A s=1", "B s=1"), "C s=2", "D s=0", "E s=0.000001")))
    assert ends(sink) == [
        (1, "SUCCEEDED 3"),
        (1, "SUCCEEDED 4"),
        (1_000_000, "SUCCEEDED 0"),
        (2_000_000, "SUCCEEDED 2"),
        (2_000_000, "SUCCEEDED 1"),
    ]
    assert driver.kernel.status is Status.COMPLETED


def test_what_ends_with_the_run_is_not_stopped() -> None:
    sink, _ = taking(plan(par_any("A s=1", "B s=1", "C s=2")))
    said = {record.node - 1: record.message for record in sink.records if record.kind == "STOPPED"}
    assert said == {1: "it has ended: SUCCEEDED", 2: "stopped"}


def test_a_very_long_sleep_ends() -> None:
    sink, driver = taking(plan("A s=1e9", "B s=99e10"))
    assert [at_us for at_us, _ in ends(sink)] == [10**15, 10**15 + 99 * 10**16]
    assert driver.kernel.status is Status.COMPLETED
    _, endless = taking(plan("A s=1e12"))
    assert endless.kernel.status is Status.STUCK


def test_a_run_longer_than_what_can_be_counted_is_not_called_stuck() -> None:
    nine = [f"A{number} s=9e11" for number in range(10)]
    _, driver = taking(plan(*nine))
    assert (driver.kernel.status, driver.now_us()) == (Status.COMPLETED, 9 * 10**18)
    with pytest.raises(
        GpsfsmError, match=r"more than 9e\+12 s, the longest time that gpsfsm counts"
    ):
        taking(plan(*nine, "B s=1"))
    _, endless = taking(plan(*nine, "B s=1e12"))
    assert endless.kernel.status is Status.STUCK


def test_a_runner_that_cannot_be_loaded_fails_after_its_trigger() -> None:
    """Also for an instance that is triggered at the instant at which another learns of it."""

    def make(interface: str, provider: str) -> Runner:
        if interface == "Bad":
            raise RunnerError("it is broken")
        return Takes()

    whole = plan(par_all(seq("Bad", rec("Bad", rec("A"))), seq("Quick", "Bad")))
    sink, _ = drive(compiled_of(whole), make)
    began: dict[int, int] = {}
    for at_us, _, records in sink.rows:
        for record in records:
            if record.kind == "TRIGGERED":
                began[record.node] = at_us
            elif record.kind in ("FAILED", "SUCCEEDED"):
                assert began[record.node] < at_us
