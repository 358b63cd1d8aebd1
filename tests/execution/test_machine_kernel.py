"""Runs of machines: the kernel does what the instants say, however slow the hosts are."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gpsfsm.compile import compile_plan
from gpsfsm.compile.instants import AT_FIRST, COMPLETED, GAVE_UP, GOING, Instants
from gpsfsm.compile.machines import machine_of
from gpsfsm.execution.machine_kernel import MachineKernel, kernel_of
from gpsfsm.execution.records import Input, Kind, Load, Record, Start, Status, Stop
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.simulation.makers import Drawn
from tests.analysis.machines.random_machines import machine, machines
from tests.cases import many

if TYPE_CHECKING:
    from collections.abc import Sequence

    import networkx as nx

_STARTED, _SUCCEEDED, _FAILED, _STOPPED = range(4)


def kernel_for(graph: nx.MultiDiGraph[Any], most_visits: int | None = None) -> MachineKernel:
    """A kernel of a machine that is well-formed."""
    plan, problems = machine_of(graph)
    assert plan is not None, problems
    kernel = kernel_of(compile_plan(plan), most_visits=most_visits)
    assert isinstance(kernel, MachineKernel)
    return kernel


@dataclass
class SlowHost:
    """A host that answers in any order: it keeps what it was asked for."""

    kernel: MachineKernel
    acting: dict[int, Start] = field(default_factory=dict)
    stopping: set[int] = field(default_factory=set)
    loading: set[int] = field(default_factory=set)
    starts: list[tuple[int, int]] = field(default_factory=list)
    records: list[Record] = field(default_factory=list)

    def step(self, happened: Input) -> list[Record]:
        """Take in an input, and remember what is to be done."""
        records, commands = self.kernel.step(happened)
        self.records += records
        for command in commands:
            if isinstance(command, Start):
                assert command.number not in self.acting, "nothing acts twice at once"
                self.acting[command.number] = command
                self.starts.append((command.number, command.visit))
            elif isinstance(command, Stop):
                assert command.number in self.acting, "only what acts is asked to stop"
                assert command.number not in self.stopping, "and only once"
                self.stopping.add(command.number)
            elif isinstance(command, Load):
                assert command.runner not in self.loading
                self.loading.add(command.runner)
        return records

    def inputs(self) -> list[Input]:
        """Everything that can come next."""
        can = [
            Input(kind, number)
            for number in sorted(self.acting)
            for kind in (Kind.SUCCEEDED, Kind.FAILED)
        ]
        can += [Input(Kind.STOPPED, number) for number in sorted(self.stopping)]
        can += [Input(Kind.TIMEOUT, n) for n in sorted(self.acting) if n not in self.stopping]
        for runner in sorted(self.loading):
            can += [Input(kind, runner=runner) for kind in (Kind.LOADED, Kind.NOT_LOADED)]
        return can

    def take(self, happened: Input) -> list[Record]:
        """Let one of them come."""
        if happened.kind in (Kind.LOADED, Kind.NOT_LOADED):
            self.loading.remove(happened.runner)
        elif happened.kind is not Kind.TIMEOUT:
            del self.acting[happened.number]
            self.stopping.discard(happened.number)
        return self.step(happened)


@settings(max_examples=many(300))
@given(graph=machines(), data=st.data())
def test_whatever_the_host_does_the_configurations_are_those_of_the_instants(
    graph: nx.MultiDiGraph[Any], data: st.DataObject
) -> None:
    assume(machine_of(graph)[0] is not None)
    kernel = kernel_for(graph)
    host, instants = SlowHost(kernel), Instants(kernel.automaton)
    host.step(Input(Kind.BEGIN))
    instant = instants.first()
    at, visits = instant.configuration, started(instant.events, kernel)
    assert kernel.configuration == at
    for _ in range(data.draw(st.integers(0, 25), "steps")):
        if kernel.status is not Status.RUNNING:
            break
        happened = data.draw(st.sampled_from(host.inputs()), "input")
        for number, event in outcomes_in(host.take(happened)):
            if at.ended != GOING:
                break
            instant = instants.after(at, number, event)
            at = instant.configuration
            visits += started(instant.events, kernel)
        assert kernel.configuration == at
        if kernel.status is Status.RUNNING:
            assert at.active
            assert at.ended == GOING
            assert [visits.count(n) for n in range(len(kernel.runner_of))] == kernel.visits_of
    ended = {GOING: Status.STUCK, COMPLETED: Status.COMPLETED, GAVE_UP: Status.GAVE_UP}
    while not kernel.status.ended:  # what is left is stopped, or let go
        if kernel.status is Status.RUNNING:
            host.step(Input(Kind.CANCEL))
            ended[GOING] = Status.CANCELLED
            continue
        waited = [Input(Kind.STOPPED, number) for number in sorted(host.stopping)]
        waited += [Input(Kind.LOADED, runner=runner) for runner in sorted(host.loading)]
        host.take(waited[0])
    assert kernel.status is ended[at.ended]
    assert not host.acting
    assert not host.loading
    assert len(set(host.starts)) == len(host.starts), "each visit acts once"


def started(events: Sequence[int], kernel: MachineKernel) -> list[int]:
    """The runners that an instant starts."""
    runners = range(1, len(kernel.runner_of) + 1)
    return [each // 4 - 1 for each in events if each % 4 == _STARTED and each // 4 in runners]


def outcomes_in(records: Sequence[Record]) -> list[tuple[int, int]]:
    """The outcomes among the records of an input, in order."""
    events = {Kind.SUCCEEDED: _SUCCEEDED, Kind.FAILED: _FAILED}
    return [(each.node - 1, events[each.kind]) for each in records if each.kind in events]


def test_what_was_stopped_and_triggered_starts_again_once_it_has_stopped() -> None:
    kernel = kernel_for(
        machine("start SUCCEEDED a", "start SUCCEEDED b", "b FAILED stop a", "b FAILED a")
    )
    host = SlowHost(kernel)
    host.step(Input(Kind.BEGIN))
    for runner in (0, 1):
        host.take(Input(Kind.LOADED, runner=runner))
    a, b = 0, 1
    kinds = [(each.kind, each.node - 1, each.message) for each in host.take(Input(Kind.FAILED, b))]
    assert kinds == [
        (Kind.FAILED, b, ""),
        (Kind.STOPPING, a, ""),
        (Kind.TRIGGERED, a, "visit 2"),
    ]
    assert host.starts == [(a, 1), (b, 1)]
    late = host.take(Input(Kind.SUCCEEDED, a))
    assert [(each.kind, each.message) for each in late] == [
        (Kind.STOPPED, "it has ended: SUCCEEDED"),
        (Kind.STARTED, "visit 2"),
    ]
    assert host.starts[2:] == [(a, 2)]
    assert kernel.status is Status.RUNNING


def test_what_a_stop_triggers_starts_once_it_has_stopped() -> None:
    kernel = kernel_for(
        machine(
            "start SUCCEEDED a",
            "start SUCCEEDED b",
            "start SUCCEEDED c",
            "b FAILED stop a",
            "a STOPPED d",
            "c SUCCEEDED b",
        )
    )
    host = SlowHost(kernel)
    host.step(Input(Kind.BEGIN))
    a, b, c, d = range(4)
    for runner in (a, b, c):
        host.take(Input(Kind.LOADED, runner=runner))
    host.take(Input(Kind.FAILED, b))
    assert host.loading == set(), "what a stop triggers is not even loaded"
    host.take(Input(Kind.SUCCEEDED, c))
    assert host.starts[3:] == [(b, 2)], "what another instant triggers does not wait"
    host.take(Input(Kind.STOPPED, a))
    assert host.loading == {d}


def test_a_machine_that_goes_on_for_ever_is_cancelled_by_its_bound() -> None:
    kernel = kernel_for(machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED a"), 50)
    moments = Moments()
    VirtualDriver(kernel, moments, lambda *_: Drawn(None, failure=0.5), seed=4).run()
    assert kernel.status is Status.CANCELLED
    assert kernel.visits_of == [50]
    assert any(
        "50 visits have begun" in each.message
        for each in moments.records
        if each.kind is Kind.CANCEL
    )


class Moments:
    """A sink that keeps all records."""

    def __init__(self) -> None:
        self.records: list[Record] = []

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Keep them."""
        del at_us, happened
        self.records += records


def test_the_outcome_of_a_visit_depends_on_seed_instance_and_visit_alone() -> None:
    graph = machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED a")
    for seed in range(5):
        kernel, moments = kernel_for(graph, 30), Moments()
        VirtualDriver(kernel, moments, lambda *_: Drawn(None, failure=0.5), seed=seed).run()
        ends = [each.kind for each in moments.records if each.kind in (Kind.SUCCEEDED, Kind.FAILED)]
        for visit, kind in enumerate(ends, start=1):
            name = "/machine/a" if visit == 1 else f"/machine/a#{visit}"
            fate = f"{seed}:{name}:{kernel.automaton.fingerprint}"
            source = random.Random(fate)  # noqa: S311
            fails = [source.random() for _ in range(2)][1] < 0.5  # the first is for hanging
            assert kind is (Kind.FAILED if fails else Kind.SUCCEEDED)
        assert len(ends) == 30


def test_the_configuration_before_the_first_instant_is_empty() -> None:
    assert kernel_for(machine("start SUCCEEDED a")).configuration == AT_FIRST
