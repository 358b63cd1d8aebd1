"""The kernel, told what happens: tables by control, and every kind of record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.errors import InternalError
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Load, Start, Status, Stop, Unload
from tests.cases import many
from tests.execution.support import BEGIN, compiled_of, kinds, records_of, without_ends
from tests.oracle import R, par_all, par_any, plan, rec, seq
from tests.strategies import plans

if TYPE_CHECKING:
    from tests import oracle

TIMEOUT = Input(Kind.TIMEOUT, 0, message="60 s")
PAUSE, RESUME, CANCEL, SILENCE = (
    Input(kind) for kind in (Kind.PAUSE, Kind.RESUME, Kind.CANCEL, Kind.SILENCE)
)


def works(number: int) -> Input:
    return Input(Kind.SUCCEEDED, number)


def fails(number: int) -> Input:
    return Input(Kind.FAILED, number, message="no")


def stopped(number: int) -> Input:
    return Input(Kind.STOPPED, number, message="stopped")


def loads(runner: int) -> Input:
    return Input(Kind.LOADED, runner=runner)


def refuses(runner: int) -> Input:
    return Input(Kind.NOT_LOADED, runner=runner, message="no file")


def kernel_of(*children: oracle.R | oracle.C | str, begun: bool = True) -> Kernel:
    """A kernel whose runners, all different, are loaded as soon as it asks for them."""
    kernel = Kernel(compiled_of(plan(*children)))
    if begun:
        serve(kernel, BEGIN)
    return kernel


def serve(kernel: Kernel, *inputs: Input) -> list[str]:
    """Tell the kernel something, and load what it wants to have loaded; what is recorded."""
    events: list[str] = []
    todo = list(inputs)
    while todo:
        records, commands = kernel.step(todo.pop(0))
        events += kinds(records)
        todo[:0] = [loads(command.runner) for command in commands if isinstance(command, Load)]
    return events


def essence(records: list[str]) -> list[str]:
    """Without loading and unloading."""
    return [text for text in records if "LOAD" not in text]


@pytest.mark.parametrize(
    ("children", "inputs", "active", "status"),
    [
        (["A", "B"], [], [0], "RUNNING"),
        (["A", "B"], [works(0)], [1], "RUNNING"),
        (["A", "B"], [fails(0)], [], "GAVE_UP"),
        (["A", "B"], [works(0), works(1)], [], "COMPLETED"),
        (["A", rec("B"), "C"], [works(0)], [2], "RUNNING"),
        (["A", rec("B"), "C"], [fails(0)], [1], "RUNNING"),
        (["A", rec("B"), "C"], [fails(0), works(1)], [2], "RUNNING"),
        (["A", rec("B"), "C"], [fails(0), fails(1)], [], "GAVE_UP"),
        (["A", rec("B", "C")], [fails(0), fails(1)], [2], "RUNNING"),
        ([rec("A"), "B"], [], [1], "RUNNING"),
        ([seq()], [], [], "COMPLETED"),
        ([], [], [], "COMPLETED"),
        ([par_all("A", "B")], [], [0, 1], "RUNNING"),
        ([par_all("A", "B")], [works(1)], [0], "RUNNING"),
        ([par_all("A", "B")], [works(1), works(0)], [], "COMPLETED"),
        ([par_all("A", "B")], [fails(1)], [0], "STOPPING"),
        ([par_all("A", "B"), rec("C")], [fails(1)], [0, 2], "RUNNING"),
        ([par_all("A", "B"), rec("C")], [fails(1), works(0)], [2], "RUNNING"),
        ([par_any("A", "B")], [works(1)], [0], "STOPPING"),
        ([par_any("A", "B")], [fails(1)], [0], "RUNNING"),
        ([par_any("A", "B")], [fails(1), fails(0)], [], "GAVE_UP"),
        ([par_any("A", "B"), "C"], [works(0)], [1, 2], "RUNNING"),
        ([par_any("A", "B"), "C"], [works(0), works(1)], [2], "RUNNING"),
        ([par_any("A", "B"), "C"], [works(0), fails(1), works(2)], [], "COMPLETED"),
        ([par_any("A", seq()), rec("B")], [], [], "COMPLETED"),
    ],
)
def test_controls(
    children: list[oracle.R | oracle.C | str], inputs: list[Input], active: list[int], status: str
) -> None:
    kernel = kernel_of(*children)
    serve(kernel, *inputs)
    assert sorted(kernel.active) == active
    assert str(kernel.status) == status


def test_the_records_of_a_whole_run() -> None:
    kernel = Kernel(compiled_of(plan("A", par_any("B", "C"))))
    assert kinds(records_of(kernel, BEGIN)) == ["BEGIN", "TRIGGERED 0", "LOADING r0"]
    assert kinds(records_of(kernel, loads(0))) == ["LOADED r0", "STARTED 0"]
    assert kinds(records_of(kernel, works(0))) == [
        "SUCCEEDED 0",
        "UNLOADED r0",
        "TRIGGERED 1",
        "LOADING r1",
        "TRIGGERED 2",
        "LOADING r2",
    ]
    assert kinds(records_of(kernel, loads(1), loads(2))) == [
        *("LOADED r1", "STARTED 1", "LOADED r2", "STARTED 2")
    ]
    assert kinds(records_of(kernel, works(2))) == [
        "SUCCEEDED 2",
        "UNLOADED r2",
        "JOINED",
        "STOPPING 1",
    ]
    assert kinds(records_of(kernel, stopped(1))) == ["STOPPED 1", "UNLOADED r1", "ENDED COMPLETED"]


def test_what_is_to_be_done() -> None:
    kernel = Kernel(compiled_of(plan(R("A x=7"))))
    assert kernel.step(BEGIN)[1] == [Load(0)]
    assert kernel.step(loads(0))[1] == [Start(0, 0, {"x": 7})]
    assert kernel.step(CANCEL)[1] == [Stop(0)]
    assert kernel.step(stopped(0))[1] == [Unload(0)]


def test_everything_stops_in_reverse_order() -> None:
    kernel = kernel_of(par_all("A", "B", seq("C", "D")))
    serve(kernel, works(2))  # so D starts last
    records, commands = kernel.step(CANCEL)
    assert kinds(records) == ["CANCEL", "STOPPING 3", "STOPPING 1", "STOPPING 0"]
    assert commands == [Stop(3), Stop(1), Stop(0)]
    served = serve(kernel, stopped(0), stopped(1), stopped(3))
    assert served[-4:] == ["UNLOADED r3", "UNLOADED r1", "UNLOADED r0", "ENDED CANCELLED"]


def test_one_load_per_interface_and_provider() -> None:
    kernel = Kernel(compiled_of(plan(par_all("A x=1", "A x=2", R("A", provider="other/P")))))
    assert kernel.runners == (("A", "demo_runners/Demo"), ("A", "other/P"))
    records = kinds(records_of(kernel, BEGIN))
    assert [text for text in records if "LOADING" in text] == ["LOADING r0", "LOADING r1"]
    assert kinds(records_of(kernel, loads(0))) == ["LOADED r0", "STARTED 0", "STARTED 1"]


def test_a_runner_is_loaded_late_and_kept_for_those_who_may_need_it() -> None:
    kernel = Kernel(compiled_of(plan("A", "B", rec("A"), "B")))
    serve(kernel, BEGIN)
    assert list(kernel.loaded) == [0]
    serve(kernel, works(0))
    assert list(kernel.loaded) == [0, 1]  # if B fails, A is needed again
    serve(kernel, works(1))
    assert list(kernel.loaded) == [1]


def test_nothing_is_kept_for_a_join_that_has_too_few_inputs() -> None:
    # the empty unit cannot fail, so the parallel_any cannot, so the second Z is never triggered
    kernel = kernel_of("Z", par_any("A", seq()), rec("Z"), "W")
    serve(kernel, works(0))
    assert sorted(kernel.runners[runner][0] for runner in kernel.loaded) == ["A", "W"]


def test_nothing_is_kept_for_those_who_wait_for_a_start_that_never_comes() -> None:
    kernel = Kernel(compiled_of(plan("B", par_all("A", "B"), rec("C")), ["no-start"]))
    records_of(kernel, BEGIN, loads(0), works(0))
    assert list(kernel.loaded) == [0]
    assert "UNLOADED r0" in kinds(records_of(kernel, refuses(1)))
    assert kernel.status is Status.RUNNING


def test_a_runner_that_cannot_be_loaded_fails_its_instances() -> None:
    kernel = Kernel(compiled_of(plan(par_any("A", "A"), rec("B"))))
    records_of(kernel, BEGIN)
    records = records_of(kernel, refuses(0))
    assert kinds(records) == [
        *("NOT_LOADED r0", "FAILED 0", "FAILED 1", "JOINED", "TRIGGERED 2", "LOADING r1")
    ]
    assert records[0].message == "no file"
    assert "could not be loaded" in records[1].message
    assert kernel.active == {}


def test_it_is_tried_again_for_the_next_instance() -> None:
    kernel = Kernel(compiled_of(plan("A", rec("A"))))
    records_of(kernel, BEGIN)
    assert kinds(records_of(kernel, refuses(0)))[-2:] == ["TRIGGERED 1", "LOADING r0"]
    assert kinds(records_of(kernel, loads(0))) == ["LOADED r0", "STARTED 1"]


def test_an_answer_that_comes_late_changes_nothing() -> None:
    kernel = kernel_of(par_any("A", "B"), "C")
    serve(kernel, works(0), fails(1))
    before = dict(kernel.active)
    assert serve(kernel, works(1)) == ["LATE 1"]
    assert serve(kernel, works(1), stopped(0)) == ["LATE 1", "LATE 0"]
    assert kernel.active == before
    assert kernel.status is Status.RUNNING


def test_an_instance_that_ends_while_it_is_to_stop_has_stopped() -> None:
    kernel = kernel_of(par_any("A", "B"))
    serve(kernel, works(0))
    (record,) = [each for each in records_of(kernel, fails(1)) if each.node == 2]
    assert record.kind is Kind.STOPPED
    assert "FAILED" in record.message
    assert kernel.status is Status.COMPLETED


def test_a_timeout_stops_first_and_then_fails() -> None:
    kernel = kernel_of("A", rec("B"))
    records, commands = kernel.step(TIMEOUT)
    assert kinds(records) == ["TIMEOUT 0", "STOPPING 0"]
    assert commands == [Stop(0)]
    assert list(kernel.active) == [0]  # until it has stopped it acts, and nothing follows
    records, _ = kernel.step(stopped(0))
    assert essence(kinds(records)) == ["STOPPED 0", "FAILED 0", "TRIGGERED 1"]
    assert [record.message for record in records[:2]] == ["stopped", "60 s"]
    assert serve(kernel, stopped(0), TIMEOUT) == ["LATE 0", "LATE 0"]


def test_one_that_ends_by_itself_after_its_time_has_failed_nevertheless() -> None:
    kernel = kernel_of("A", rec("B"))
    serve(kernel, TIMEOUT)
    records, _ = kernel.step(works(0))
    assert essence(kinds(records)) == ["STOPPED 0", "FAILED 0", "TRIGGERED 1"]
    assert [record.message for record in records[:2]] == ["it has ended: SUCCEEDED", "60 s"]


def test_it_is_asked_to_stop_only_once() -> None:
    kernel = kernel_of(par_any("A", "B"))
    assert serve(kernel, TIMEOUT, TIMEOUT) == ["TIMEOUT 0", "STOPPING 0", "LATE 0"]
    records, commands = kernel.step(works(1))  # which ends the run
    assert essence(kinds(records)) == ["SUCCEEDED 1", "JOINED"]
    assert Stop(0) not in commands
    assert serve(kernel, TIMEOUT) == ["LATE 0"]
    assert essence(serve(kernel, stopped(0))) == ["STOPPED 0", "FAILED 0", "ENDED COMPLETED"]


def test_a_time_that_is_over_while_the_run_is_stopped_changes_nothing() -> None:
    kernel = kernel_of(par_any("A", "B"))
    assert serve(kernel, CANCEL, TIMEOUT)[-1] == "LATE 0"
    assert essence(serve(kernel, stopped(0), stopped(1))) == [
        *("STOPPED 0", "STOPPED 1", "ENDED CANCELLED")
    ]


def test_a_pause_holds_what_is_triggered() -> None:
    kernel = kernel_of(par_all("A", "B"), "C")
    assert serve(kernel, PAUSE) == ["PAUSE"]
    assert essence(serve(kernel, works(0), works(1))) == [
        *("SUCCEEDED 0", "SUCCEEDED 1", "JOINED", "HELD 2")
    ]
    assert kernel.status is Status.RUNNING
    assert essence(serve(kernel, RESUME)) == ["RESUME", "TRIGGERED 2", "STARTED 2"]
    assert serve(kernel, works(2))[-1] == "ENDED COMPLETED"


def test_a_run_may_end_during_a_pause() -> None:
    kernel = kernel_of(par_any("A", "B"), rec("C"))
    serve(kernel, PAUSE, fails(0), fails(1))
    assert essence(serve(kernel, CANCEL)) == ["CANCEL", "STOPPED 2", "ENDED CANCELLED"]


def test_pauses_before_the_beginning_and_twice() -> None:
    kernel = kernel_of("A", begun=False)
    assert serve(kernel, PAUSE, PAUSE, BEGIN) == ["PAUSE", "PAUSE", "BEGIN", "HELD 0"]
    assert essence(serve(kernel, RESUME, RESUME)) == [
        *("RESUME", "TRIGGERED 0", "STARTED 0", "RESUME")
    ]


def test_a_cancel_before_the_beginning() -> None:
    kernel = kernel_of("A", begun=False)
    assert serve(kernel, CANCEL) == ["CANCEL", "ENDED CANCELLED"]
    with pytest.raises(InternalError):
        kernel.step(BEGIN)


def test_a_cancel_while_a_runner_is_loaded_waits_for_it() -> None:
    kernel = kernel_of(par_all("A", "A"), begun=False)
    records_of(kernel, BEGIN)
    assert kinds(records_of(kernel, CANCEL)) == ["CANCEL", "STOPPED 1", "STOPPED 0"]
    assert kernel.status is Status.STOPPING
    assert kinds(records_of(kernel, loads(0))) == ["LOADED r0", "UNLOADED r0", "ENDED CANCELLED"]


def test_how_it_ends_is_decided_once() -> None:
    kernel = kernel_of(par_any("A", "B"))
    serve(kernel, works(0), CANCEL, SILENCE)
    assert serve(kernel, stopped(1))[-1] == "ENDED COMPLETED"


def test_silence_is_stuck() -> None:
    kernel = kernel_of(par_all("A", "B"))
    assert serve(kernel, works(0), SILENCE)[-2:] == ["SILENCE", "STOPPING 1"]
    assert serve(kernel, stopped(1))[-1] == "ENDED STUCK"


@pytest.mark.parametrize("happened", [BEGIN, loads(0), Input(Kind.TRIGGERED, 0)], ids=str)
def test_what_makes_no_sense_is_refused(happened: Input) -> None:
    kernel = kernel_of("A")
    with pytest.raises(InternalError):
        kernel.step(happened)


ANSWERS = (Kind.SUCCEEDED, Kind.FAILED)


def follow(kernel: Kernel, draw: st.DataObject) -> list[Input]:
    """A random run, to its end; the inputs."""
    inputs = [BEGIN]
    kernel.step(BEGIN)
    while kernel._loading or kernel.active:
        waiting = [loads(runner) for runner in kernel._loading]
        pending = [Input(answer, number) for number in kernel.active for answer in ANSWERS]
        inputs.append(draw.draw(st.sampled_from(waiting or pending)))
        kernel.step(inputs[-1])
    return inputs


@settings(max_examples=many(60))
@given(whole=plans(min_runners=1, max_runners=5), data=st.data())
def test_runners_are_unloaded_as_soon_as_nothing_can_need_them(
    whole: oracle.P, data: st.DataObject
) -> None:
    compiled = without_ends(compiled_of(whole))
    inputs = tuple(follow(Kernel(compiled), data))
    kernel = Kernel(compiled)
    once: set[int] = set()
    for length, happened in enumerate(inputs, start=1):
        kernel.step(happened)
        if kernel.status.ended:
            break
        once |= set(kernel.loaded)
        busy = {kernel.runner_of[number] for number in kernel.active}
        before = triggered(Kernel(compiled), inputs[:length])
        later = later_triggers(kernel, inputs[:length]) - before
        needed = busy | {kernel.runner_of[number] for number in later}
        assert set(kernel.loaded) == needed & once
    assert not kernel.loaded
    assert not kernel.active


def triggered(kernel: Kernel, inputs: tuple[Input, ...]) -> set[int]:
    records = records_of(kernel, *inputs)
    return {record.node - 1 for record in records if record.kind is Kind.TRIGGERED}


def later_triggers(kernel: Kernel, inputs: tuple[Input, ...]) -> set[int]:
    """The instances that are triggered in some continuation: all of them are tried."""
    later: set[int] = set()
    todo, seen = [inputs], set()
    while todo:
        path = todo.pop()
        key = frozenset((value.kind, value.number, value.runner) for value in path)
        if key in seen:
            continue
        seen.add(key)
        again = Kernel(kernel.compiled)
        records = records_of(again, *path)
        later |= {record.node - 1 for record in records if record.kind is Kind.TRIGGERED}
        waiting = [loads(runner) for runner in again._loading]
        pending = [Input(answer, number) for number in again.active for answer in ANSWERS]
        todo += [(*path, following) for following in waiting or pending]
    return later
