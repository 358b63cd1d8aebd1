"""Events of a server, attributed to the instances of a plan, and what they lead to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.dispatching.explanation import explained, quiet
from gpsfsm.dispatching.mirror import Attribution, Mirror, Trace, instances
from gpsfsm.errors import InternalError
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Record, Status
from gpsfsm.ros.fabric import RunnerEvent, event_of
from gpsfsm.watch.record_text import Words

GO = "nav2_capabilities/WaypointRunner"
SAY = "perception_capabilities/SpeechRunner"
MUX = "capabilities2_runner/InputMultiplexRunner"
DONE = "fabric_capabilities/FabricCompletionRunner"


def go(x: int) -> str:
    return f'<Runner interface="{GO}" provider="{GO}" x="{x}.0" y="2.0"/>'


def block(kind: str, *parts: str) -> str:
    return f'<Control type="{kind}">\n' + "\n".join(parts) + "\n</Control>"


def plan(*parts: str) -> str:
    return "<Plan>\n" + "\n".join(parts) + "\n</Plan>\n"


class Followed:
    """A plan on fabric-v2 or -v1, followed by events."""

    def __init__(self, text: str, engine: str = "fabric-v2", plan_id: str = "") -> None:
        reading = read_for_engine(text, engine, "plan.xml", builtin_capabilities().library)
        assert isinstance(reading, EngineReading)
        self.instances = instances(reading)
        self.kernel = Kernel(reading.compiled)
        self.rows: list[tuple[Input, tuple[Record, ...]]] = []
        self.trace = Trace()
        self.mirror = Mirror(self.kernel, self, Attribution(self.instances, plan_id))
        self.mirror.watchers.append(self.trace)
        self.mirror.begin()

    def write(self, _at_us: int, happened: Input, records: object) -> None:
        assert isinstance(records, list | tuple)
        self.rows.append((happened, tuple(records)))

    def take(self, code: str, instance: int, interface: str = GO, **more: Any) -> None:
        self.mirror.take(RunnerEvent(code, interface, interface, instance, **more))

    @property
    def explanation(self) -> list[str]:
        words = Words(self.kernel.automaton, self.kernel.runners)
        status = self.kernel.status
        return explained(status, self.trace, words, 5_000_000, has_events=True)


def test_instances_are_those_that_the_engine_makes() -> None:
    followed = Followed(plan(go(1), block("recovery", go(2)), go(3)))
    assert [(each.place, each.interface, each.number) for each in followed.instances] == [
        *((0, GO, 0), (1, GO, 1), (2, MUX, -1), (3, GO, 2), (4, DONE, -1))
    ]


def test_a_run_is_followed_to_its_end_from_whatever_number() -> None:
    followed = Followed(plan(go(1), block("recovery", go(2)), go(3)))
    followed.take("FAILED", 130, triggers=GO, target=131)
    followed.take("SUCCEEDED", 131, triggers=MUX, target=132)
    followed.take("SUCCEEDED", 132, MUX, triggers=GO, target=133)
    assert followed.kernel.status is Status.RUNNING
    followed.take("SUCCEEDED", 133, triggers=DONE, target=134)
    assert followed.kernel.status is Status.COMPLETED
    assert followed.explanation == [
        "line 2: WaypointRunner (x=1.0, y=2.0) failed, and the plan continued"
    ]


def test_what_acts_on_after_the_end_is_told_of() -> None:
    followed = Followed(plan(block("parallel_any", go(1), go(2))), "fabric-v1")
    followed.take("SUCCEEDED", 0)
    assert followed.kernel.status is Status.COMPLETED
    assert followed.explanation == [
        "line 4: WaypointRunner (x=2.0, y=2.0) was still active, "
        "and may continue to act until the next plan"
    ]


def message(instance: str, trigger: str = "") -> Any:
    """A message of the topic, as far as it is read."""
    source = SimpleNamespace(capability=GO, provider=GO, instance_id=instance)
    target = SimpleNamespace(capability="", instance_id="", parameters=[])
    connection = SimpleNamespace(source=source, target=target)
    code = SimpleNamespace(code=4)
    return SimpleNamespace(
        event=SimpleNamespace(code=code, trigger_id=trigger, connection=connection)
    )


def test_events_of_other_clients_of_the_server_are_left_out() -> None:
    name = "0b0a45c1-5f8b-5d6c-8a3c-6d6f0a2f2f00"
    assert event_of(message(name)) is None
    assert event_of(message("", name)) is None
    for own, number in ((message("12"), 12), (message("", "13"), 13), (message(""), -1)):
        event = event_of(own)
        assert event is not None
        assert event.instance == number


def test_events_of_other_plans_change_nothing() -> None:
    followed = Followed(plan(go(1), go(2)), plan_id="mine")
    followed.take("SUCCEEDED", 9, SAY)
    followed.take("SUCCEEDED", 9, triggers=DONE, target=10, plan_id="theirs")
    followed.take("SUCCEEDED", 50, triggers=GO, target=51)
    followed.take("SUCCEEDED", 49)  # of another plan, now that the numbers are known
    assert followed.mirror.foreign == 3
    assert list(followed.kernel.active) == [1]


def test_an_event_that_is_published_for_each_target_counts_once() -> None:
    followed = Followed(plan(go(1), go(2)))
    followed.take("SUCCEEDED", 5)
    followed.take("SUCCEEDED", 5)
    followed.take("FAILED", 5)
    assert list(followed.kernel.active) == [1]
    assert not followed.mirror.notes


def test_events_without_numbers_are_of_the_one_that_acts() -> None:
    followed = Followed(plan(go(1), go(2)))
    followed.take("SUCCEEDED", -1)
    followed.take("SUCCEEDED", -1)
    assert followed.kernel.status is Status.COMPLETED


def test_what_the_engine_would_not_do_is_noted_once() -> None:
    followed = Followed(plan(go(1), go(2), go(3)))
    followed.take("SUCCEEDED", 5)
    for _ in range(3):
        followed.take("TRIGGERED", 7)
    assert followed.mirror.notes == [
        "the server reports TRIGGERED of line 4, WaypointRunner (x=3.0, y=2.0), which does not act "
        "by now on fabric-v2: an event was lost, or this server is another one"
    ]


def test_a_failure_that_nothing_takes_is_the_end() -> None:
    followed = Followed(plan(go(1), go(2)))
    followed.take("SUCCEEDED", 5)
    followed.take("FAILED", 6)
    assert followed.kernel.status is Status.HANG
    assert followed.explanation == [
        "the plan left its specified part at line 3: WaypointRunner (x=2.0, y=2.0): it failed, "
        "and nothing follows that; the server keeps waiting (HANG)"
    ]


def test_silence_is_told_of_those_that_act_and_only_where_events_could_come() -> None:
    followed = Followed(plan(go(1), block("recovery", go(2)), go(3)))
    followed.take("FAILED", 7, triggers=GO, target=8)
    words = Words(followed.kernel.automaton, followed.kernel.runners)
    (said,) = quiet(followed.trace, words, has_events=True)
    assert said.startswith("line 4: WaypointRunner (x=2.0")
    assert said.endswith(" is active, but no event comes from it")
    assert quiet(followed.trace, words, has_events=False) == []


def test_a_join_that_waits_for_ever_is_explained() -> None:
    # on fabric-v2 a runner that emits no STARTED keeps the others of a block from starting
    followed = Followed(plan(go(1), block("parallel_all", go(2), go(3)), go(4)))
    followed.take("SUCCEEDED", 5)
    assert followed.kernel.status is Status.HANG
    assert followed.explanation == [
        "the join of line 3: parallel_all has 1 of 3 inputs, and no more can come; the server "
        "keeps waiting (HANG)"
    ]


def test_an_input_too_many_is_explained() -> None:
    followed = Followed(plan(go(1), block("recovery", go(2)), block("recovery", go(3)), go(4)))
    followed.take("SUCCEEDED", 5)
    assert followed.kernel.status is Status.ABORT
    assert followed.explanation == [
        "the plan left its specified part at line 3: recovery: its join got an input after it had "
        "fired, so the Capabilities2 server aborts; restart it"
    ]


def test_what_acts_is_said_of_a_run_that_has_no_end() -> None:
    followed = Followed(plan(go(1), go(2)))
    followed.take("SUCCEEDED", 5)
    (sentence,) = followed.explanation
    assert sentence.startswith("line 3: WaypointRunner (x=2.0, y=2.0) was active for ")
    assert "on fabric-v2 not every failure is an event" in sentence


@pytest.mark.parametrize("status", [Status.COMPLETED, Status.REFUSED])
def test_the_server_may_report_the_end(status: Status) -> None:
    followed = Followed(plan(go(1), go(2)))
    followed.mirror.reported(status, "it says so")
    assert followed.kernel.status is status
    happened, records = followed.rows[-2]
    assert (happened.kind, records[0].message) == (Kind.REPORTED, "it says so")
    assert followed.rows[-1][1][-1] == Record(Kind.ENDED, data={"status": status.value})


def test_no_server_reports_what_it_cannot_know() -> None:
    followed = Followed(plan(go(1)))
    with pytest.raises(InternalError, match="no server reports 'GAVE_UP'"):
        followed.mirror.deliver(Input(Kind.REPORTED, outputs={"status": "GAVE_UP"}))
