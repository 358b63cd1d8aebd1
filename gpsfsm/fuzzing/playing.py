"""Playing a scenario: the executor runs the plan in virtual time, and what befalls it is given."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.fuzzing.acts import Fate
from gpsfsm.fuzzing.record import Moment, Run
from gpsfsm.model.event import Event
from gpsfsm.simulation.drawn import Scripted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.records import Record, RunValue
    from gpsfsm.fuzzing.acts import TimedScenario
    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.model.capability import Provider

__all__ = ["Moments", "play"]

_FOR_EVER_S = 1e12


def play(subject: Subject, scenario: TimedScenario, *, seed: int = 0) -> Run:
    """Run a plan in a scenario; the same scenario and seed give the same run.

    The seed decides the values that runners hand over, and nothing else. Raises ValueError if the
    scenario is one of another plan.
    """
    if len(scenario.acts) != len(subject.plan.runners):
        raise ValueError("the scenario does not fit the plan: it has another number of acts")
    kernel = Kernel(subject.compiled, apart=subject.apart)
    sink = Moments(kernel)
    driver = _Driver(subject, scenario, kernel, sink, seed)
    driver.run()
    return Run(subject, scenario, tuple(sink.moments), kernel.status, sink.decided)


class Moments:
    """A sink that keeps everything, and notes when it is fixed how the run ends."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self.moments: list[Moment] = []
        self.decided = -1

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Keep an input and what follows from it."""
        if self.decided < 0 and self._kernel.status not in (Status.QUEUED, Status.RUNNING):
            self.decided = len(self.moments)
        self.moments.append(Moment(at_us, happened, tuple(records)))


class _Driver(VirtualDriver):
    """Lets runners fail to start, and lets answers come that nobody waits for any more."""

    def __init__(
        self, subject: Subject, scenario: TimedScenario, kernel: Kernel, sink: Moments, seed: int
    ) -> None:
        self._acts = scenario.acts
        self._answered: set[int] = set()
        limit_ms = subject.limit_ms
        super().__init__(
            kernel,
            sink,
            lambda *key: _Acting(kernel.bound.get(key), scenario),
            seed=seed,
            timeout_s=None if limit_ms is None else limit_ms / 1_000,
        )

    def load(self, runner: int) -> None:
        """Load a runner, unless the scenario says that it does not start."""
        if not self.kernel.apart or self._acts[runner].fate is not Fate.NO_START:
            super().load(runner)
            return
        self.refuse(runner, "the scenario says so", self._acts[runner].duration_us)

    def stop(self, number: int) -> None:
        """Let it stop; the answer of one that is late comes after that."""
        super().stop(number)
        act = self._acts[number]
        if act.fate is Fate.LATE and number not in self._answered:
            self._answered.add(number)
            at_us = self.now_us() + act.duration_us
            self.at(at_us, self.deliver, Input(Kind.SUCCEEDED, number))


class _Acting(Scripted):
    """Does what the scenario says of the instance, with outputs as the provider declares them."""

    def __init__(self, provider: Provider | None, scenario: TimedScenario) -> None:
        super().__init__(provider, {})
        self._acts = scenario.acts

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Take the time, then end."""
        act = self._acts[context.number]
        if act.fate in (Fate.LATE, Fate.HANG):
            await context.sleep(_FOR_EVER_S)
        await context.sleep(act.duration_us / 1e6)
        event = Event.SUCCEEDED if act.fate is Fate.SUCCEEDED else Event.FAILED
        known = self._provider is not None and bool(self._provider.outputs)
        outputs = self._outputs(event, parameters, context.random) if known else {}
        if event is Event.FAILED:
            error = RunnerError("the scenario says so")
            error.outputs = outputs
            raise error
        return outputs
