"""What holds for all plans: the engine's run is one of the automaton's, whatever is done to it."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Load, Status
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.model.automaton import Signal
from gpsfsm.model.event import Event, Outcome
from tests.analysis.test_scenarios import findings_of
from tests.cases import many
from tests.execution.support import BEGIN, Listing, Luck, compiled_of, drive, kinds, without_ends
from tests.strategies import faults, plans
from tests.support import decided

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import Record
    from tests import oracle

EVENTS = {Kind.STARTED: Event.STARTED, Kind.SUCCEEDED: Event.SUCCEEDED, Kind.FAILED: Event.FAILED}


def events(records: list[Record]) -> list[Signal]:
    """What the instances have emitted."""
    return [Signal(record.node, EVENTS[record.kind]) for record in records if record.kind in EVENTS]


def outcomes(records: list[Record]) -> dict[int, Outcome]:
    return {
        signal.node - 1: Outcome(signal.event.value)
        for signal in events(records)
        if signal.event is not Event.STARTED
    }


class Play:
    """A run of the kernel with given outcomes, in an order that luck decides.

    Instances without an outcome hang. Every instance has a runner to itself.
    """

    def __init__(self, compiled: Compiled, scenario: Mapping[int, Outcome], luck: int) -> None:
        self.kernel = Kernel(compiled, apart=True)
        self.records: list[Record] = []
        self._scenario = scenario
        self._random = random.Random(luck)  # noqa: S311
        self._pending: list[Input] = []
        self._tell(BEGIN)
        while not self.kernel.status.ended and self._pending:
            self._tell(self._pending.pop(self._random.randrange(len(self._pending))))
        if not self.kernel.status.ended:
            self._tell(Input(Kind.SILENCE))
        for number in list(self.kernel.active):
            self._tell(Input(Kind.STOPPED, number))

    def _tell(self, happened: Input) -> None:
        records, commands = self.kernel.step(happened)
        self.records += records
        for command in commands:
            if isinstance(command, Load):
                missing = self._scenario.get(command.runner) is Outcome.NO_START
                kind = Kind.NOT_LOADED if missing else Kind.LOADED
                self._pending.append(Input(kind, runner=command.runner))
        if happened.kind is Kind.LOADED and self.kernel.status is Status.RUNNING:
            outcome = self._scenario.get(happened.runner, Outcome.HANG)
            if outcome is not Outcome.HANG:
                self._pending.append(Input(Kind(outcome.value), happened.runner))


@settings(max_examples=many(150))
@given(whole=plans(max_runners=12), seed=st.integers(0, 1000))
def test_a_run_is_one_of_the_automaton(whole: oracle.P, seed: int) -> None:
    compiled = compiled_of(whole)
    sink, driver = drive(compiled, seed=seed)
    came = outcomes(sink.records)
    maximal = Evaluator(compiled.automaton).run(lambda number: came.get(number, Outcome.SUCCEEDED))
    assert maximal.ends.value == driver.kernel.status.value
    assert all(maximal.happens(signal) for signal in events(sink.records))
    # what came suffices for that end
    assert Evaluator(compiled.automaton).surely(came).ends.value == driver.kernel.status.value


@settings(max_examples=many(150))
@given(whole=plans(max_runners=12), data=st.data(), models=faults())
def test_the_kernel_follows_every_scenario(
    whole: oracle.P, data: st.DataObject, models: frozenset[str]
) -> None:
    compiled = without_ends(compiled_of(whole, models))
    kinds_of = [outcome for outcome in Outcome if outcome is not Outcome.NO_START or models]
    count = len(compiled.automaton.runners)
    drawn = data.draw(st.lists(st.sampled_from(kinds_of), min_size=count, max_size=count))
    scenario = dict(enumerate(drawn))
    played = Play(compiled, scenario, data.draw(st.integers(0, 1000)))
    run = Evaluator(compiled.automaton).run(scenario.__getitem__)
    happened = events(played.records)
    assert len(happened) == len(set(happened))
    of_instances = {
        Signal(node.index, event)
        for node in compiled.automaton.runners
        for event in EVENTS.values()
        if run.happens(Signal(node.index, event))
    }
    assert set(happened) == of_instances  # the whole maximal run, nothing less and nothing more
    joined = {record.node for record in played.records if record.kind is Kind.JOINED}
    triggered = {record.node for record in played.records if record.kind is Kind.TRIGGERED}
    assert joined | triggered == set(run.triggered)


@settings(max_examples=many(80))
@given(whole=plans(max_runners=6), models=faults(), data=st.data())
def test_every_scenario_that_is_shown_replays(
    whole: oracle.P, models: frozenset[str], data: st.DataObject
) -> None:
    decision = decided(whole, faults=models)
    compiled = decision.deciders.compiled
    plan = compiled.automaton.plan
    number_of = {plan.path(runner): number for number, runner in enumerate(plan.runners)}
    for finding in findings_of(decision):
        shown = finding.scenario
        if shown is None:
            continue
        scenario = {number_of[path]: outcome for path, outcome in shown.outcomes}
        for number in range(len(plan.runners)):  # what is left open may turn out in any way
            scenario.setdefault(number, data.draw(st.sampled_from([*Outcome][:2])))
        luck = data.draw(st.integers(0, 1000))
        assert Play(compiled, scenario, luck).kernel.status.value == shown.ends.value
        maximal = events(Play(without_ends(compiled), scenario, luck).records)
        claimed = [Signal(number_of[step.element] + 1, step.event) for step in shown.trace]
        assert set(claimed) <= set(maximal)


@settings(max_examples=many(40))
@given(whole=plans(max_runners=8), seed=st.integers(0, 1000))
def test_cancel_at_every_event(whole: oracle.P, seed: int) -> None:
    compiled = compiled_of(whole)
    after = 0
    while True:
        driver, sink = steps(compiled, seed, after)
        if driver.kernel.status.ended:
            break
        stopping = driver.kernel.status is Status.STOPPING
        driver.cancel("enough")
        finish(driver)
        started = {signal.node for signal in events(sink.records)}
        ended = {
            record.node
            for record in sink.records
            if record.kind in (Kind.SUCCEEDED, Kind.FAILED, Kind.STOPPED)
        }
        assert started <= ended
        assert stopping or driver.kernel.status is Status.CANCELLED
        assert kinds(sink.records)[-1] == f"ENDED {driver.kernel.status}"
        after += 1


def steps(compiled: Compiled, seed: int, count: int) -> tuple[VirtualDriver, Listing]:
    """A run after so many events."""
    sink = Listing()
    driver = VirtualDriver(Kernel(compiled), sink, lambda interface, provider: Luck(), seed=seed)
    if count:
        driver.deliver(BEGIN)
    for _ in range(count - 1):
        if not driver.kernel.status.ended:
            assert driver.advance()
    return driver, sink


def finish(driver: VirtualDriver) -> None:
    """Let a run end; then nothing is active and nothing loaded, for kernel and driver."""
    while not driver.kernel.status.ended:
        assert driver.advance()
    assert not driver.kernel.active
    assert not driver.kernel.loaded
    assert not driver._acting
    assert not driver._runners


@settings(max_examples=many(40))
@given(whole=plans(max_runners=8), seed=st.integers(0, 1000), pause=st.integers(1, 40))
def test_a_pause_at_every_event_changes_nothing_but_time(
    whole: oracle.P, seed: int, pause: int
) -> None:
    compiled = compiled_of(whole)
    plain, _ = drive(compiled, seed=seed)
    decided_then = outcomes(plain.records)
    after = 1
    while True:
        driver, sink = steps(compiled, seed, after)
        if driver.kernel.status.ended:
            break
        driver.deliver(Input(Kind.PAUSE))
        driver.at(driver.now_us() + pause * 100_000, lambda to=driver: to.deliver(RESUME))
        finish(driver)
        # who acts, acts as before; what is late may come too late to act at all, or never be late
        came = outcomes(sink.records)
        both = came.keys() & decided_then.keys()
        assert {number: came[number] for number in both} == {n: decided_then[n] for n in both}
        assert events(sink.records)[:1] == events(plain.records)[:1]
        maximal = Evaluator(compiled.automaton).surely({**decided_then, **came})
        assert maximal.ends.value == sink.records[-1].data["status"]  # type: ignore[index]
        assert plain.records[-1].data == sink.records[-1].data
        after += 1


RESUME = Input(Kind.RESUME)
