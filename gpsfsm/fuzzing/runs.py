"""Runs: a scenario is played by the executor in virtual time, and properties look at the record."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.words import place
from gpsfsm.errors import misused
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.fuzzing.subject import Act, Fate, Subject, TimedScenario
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.capability import CHOICE
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.finding import Scenario, TraceStep
from gpsfsm.model.labels import verb
from gpsfsm.model.story import remark
from gpsfsm.simulation.makers import Scripted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import Record, RunValue
    from gpsfsm.model.capability import Provider
    from gpsfsm.model.plan import Element, Plan


_SECOND = 1_000_000
_OUTCOMES = {Kind.SUCCEEDED: Outcome.SUCCEEDED, Kind.FAILED: Outcome.FAILED}
_MAX_TRACE = 200
_MAX_STORY = 200
EVENTS = {Kind.STARTED: Event.STARTED, Kind.SUCCEEDED: Event.SUCCEEDED, Kind.FAILED: Event.FAILED}
_ENDINGS = {
    End.COMPLETED: "the {} completes",
    End.GAVE_UP: "the {} gives up",
    End.STUCK: "nothing more can happen: the {} is stuck",
    End.ENDLESS: "the {} runs on, and the run is cut off",
}


class Span(NamedTuple):
    """An instance is active: from its trigger until its outcome or its stop, in microseconds."""

    number: int
    begin_us: int
    end_us: float


class Moment(NamedTuple):
    """An input of the kernel and what followed from it; ``at_us`` in microseconds."""

    at_us: int
    happened: Input
    records: tuple[Record, ...]


@dataclass(frozen=True, slots=True)
class Happened:
    """One event of a run.

    ``kind`` is a word of docs/execution.md, such as TRIGGERED, STARTED, SUCCEEDED or FAILED.
    ``number``, ``element``, ``line`` and ``interface`` say which instance it is about; they are -1,
    "", 0 and "" for events of the run as a whole. ``data`` are parameters or outputs.
    """

    at_s: float
    kind: str
    number: int
    element: str
    line: int
    interface: str
    data: Mapping[str, RunValue]
    message: str


@dataclass(frozen=True)
class Run:
    """A run of a subject in a scenario.

    ``decided`` is the index of the moment at which the end of the run is certain. ``status`` is
    COMPLETED, GAVE_UP or STUCK, or CANCELLED if a run of a machine was cut off before that.
    """

    subject: Subject
    scenario: TimedScenario
    moments: tuple[Moment, ...]
    status: Status
    decided: int

    @property
    def compiled(self) -> Compiled:
        """The compiled plan."""
        return self.subject.compiled

    @property
    def plan(self) -> Plan:
        """The plan."""
        return self.subject.plan

    def runner(self, number: int) -> Element:
        """The runner instance with this number."""
        return self.plan.runners[number]

    @property
    def at_s(self) -> float:
        """The time in seconds until the end of the run was certain."""
        return self.decided_us / _SECOND

    @property
    def decided_us(self) -> int:
        """The time in microseconds until the end of the run was certain."""
        return self.moments[self.decided].at_us

    @cached_property
    def events(self) -> tuple[Happened, ...]:
        """Everything that happened, in order."""
        events = []
        automaton = self.compiled.automaton
        for at_us, _, records in self.moments:
            for record in records:
                number = record.node - 1
                exists = 0 <= number < len(self.plan.runners)
                runner = self.runner(number) if exists else None
                events.append(
                    Happened(
                        at_us / _SECOND,
                        record.kind.value,
                        number if exists else -1,
                        automaton.name(record.node) if exists else "",
                        0 if runner is None else runner.line,
                        "" if runner is None else runner.interface,
                        record.data or {},
                        record.message,
                    )
                )
        return tuple(events)

    @property
    def whole(self) -> str:
        """The kind of what runs: plan or machine."""
        return self.plan.vocabulary.terms.whole

    @property
    def end(self) -> End:
        """The end of the run, or a statement that it was cut off."""
        return End.ENDLESS if self.status is Status.CANCELLED else End(self.status.value)

    @property
    def choices(self) -> tuple[tuple[int, Outcome], ...]:
        """The outcomes that define the scenario; in a plan, those other than SUCCEEDED."""
        return tuple(
            (number, act.fate.outcome)
            for number, act in enumerate(self.scenario.acts)
            if act.fate is not Fate.SUCCEEDED
        )

    @cached_property
    def spans(self) -> tuple[Span, ...]:
        """The periods in which each instance is active, by instance."""
        return tuple(
            Span(number, self.triggered[number], self.ended.get(number, math.inf))
            for number in sorted(self.triggered)
        )

    @cached_property
    def triggered(self) -> dict[int, int]:
        """The time at which each instance was triggered, in microseconds, by its number.

        It includes those triggered at the instant at which the run ends (semantics, 4.4), which an
        executor may not have reached.
        """
        counts: dict[int, int] = {}
        for at_us, _, records in self.moments:
            for record in records:
                if record.kind is Kind.TRIGGERED:
                    counts.setdefault(record.node - 1, at_us)
        for number in self._at_the_end():
            counts.setdefault(number, self.decided_us)
        return counts

    @cached_property
    def ended(self) -> dict[int, int]:
        """The time of each instance's outcome, in microseconds, by its number."""
        return {number: at_us for number, (at_us, _) in self._ends.items()}

    @cached_property
    def outcomes(self) -> dict[int, Outcome]:
        """The outcomes that occurred, SUCCEEDED or FAILED, by number."""
        return {number: outcome for number, (_, outcome) in self._ends.items()}

    @cached_property
    def _ends(self) -> dict[int, tuple[int, Outcome]]:
        """With the outcomes that come at the very instant at which the run ends.

        Of those the executor only notes that they came: it has stopped listening.
        """
        ends = {
            record.node - 1: (at_us, Outcome(record.kind.value))
            for at_us, _, records in self.moments[: self.decided + 1]
            for record in records
            if record.kind in _OUTCOMES
        }
        for at_us, happened, _ in self.moments[self.decided + 1 :]:
            if at_us > self.decided_us:
                break
            if happened.kind in _OUTCOMES:
                outcome = Outcome(happened.kind.value)
                ends.setdefault(happened.number, (at_us, outcome))
            elif happened.kind is Kind.NOT_LOADED and self.subject.apart:
                ends.setdefault(happened.runner, (at_us, Outcome.FAILED))
        return ends

    @cached_property
    def active_at_end(self) -> tuple[int, ...]:
        """The instances that are active when the end is certain, in document order."""
        return tuple(sorted(number for number in self.triggered if number not in self._ends))

    def _at_the_end(self) -> list[int]:
        """The instances that the events until the end trigger, through joins, which take no time.

        What is triggered starts at that instant, but for those that are known not to start.
        """
        automaton = self.compiled.automaton
        todo = [Signal(0, Event.SUCCEEDED)]
        silent: set[int] = set()
        for _, _, records in self.moments[: self.decided + 1]:
            for record in records:
                if record.kind is Kind.STARTED:
                    todo.append(Signal(record.node, Event.STARTED))
                elif record.kind is Kind.TRIGGERED:
                    silent.add(record.node)  # whether it starts is among the records
        todo += (
            Signal(number + 1, Event(outcome.value)) for number, (_, outcome) in self._ends.items()
        )
        arrived = [0] * len(automaton.nodes)
        numbers: list[int] = []
        for signal in todo:  # it grows meanwhile
            for target in automaton.outputs.get(signal, ()):
                node = automaton.nodes[target]
                arrived[target] += 1
                if arrived[target] != max(node.need, 1):
                    continue
                if node.kind is NodeKind.JOIN:
                    todo.append(Signal(target, Event.SUCCEEDED))
                elif node.kind is NodeKind.RUNNER:
                    numbers.append(target - 1)
                    if target not in silent:
                        todo.append(Signal(target, Event.STARTED))
        return numbers


_FOR_EVER_S = 1e12


def play(subject: Subject, scenario: TimedScenario, *, seed: int = 0) -> Run:
    """Run a plan in a scenario; the same scenario and seed give the same run.

    The seed decides only the values that runners output. Raises ValueError if the scenario belongs
    to another plan.
    """
    for value, kind in ((subject, Subject), (scenario, TimedScenario)):
        if not isinstance(value, kind):
            raise misused("play", f"a {kind.__name__}", value, "gpsfsm.subject_of makes a subject")
    if len(scenario.acts) != len(subject.plan.runners) * subject.visits:
        raise ValueError("the scenario does not fit the plan: it has another number of acts")
    kernel = fresh_kernel(subject)
    sink = Moments(kernel)
    driver = _Driver(subject, scenario, kernel, sink, seed)
    driver.run()
    if subject.is_machine:
        return _machine_run(subject, scenario, kernel, sink)
    return Run(subject, scenario, tuple(sink.moments), kernel.status, sink.decided)


def fresh_kernel(subject: Subject) -> Kernel:
    """A kernel for one run."""
    if subject.is_machine:
        from gpsfsm.execution.machine_kernel import MachineKernel  # loads networkx

        return MachineKernel(subject.compiled, most_visits=subject.most_visits)
    return Kernel(subject.compiled, apart=subject.apart)


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
        self._late = not subject.is_machine  # there, an answer would be that of the next visit
        self._answered: set[int] = set()
        limit_ms = subject.limit_ms
        visits_of = getattr(kernel, "visits_of", None)

        def act_of(number: int) -> Act:
            visit = 1 if visits_of is None else visits_of[number]
            return subject.act_in(scenario, number, visit)

        super().__init__(
            kernel,
            sink,
            lambda *key: _Acting(kernel.bound.get(key), act_of),
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
        if not self._late:
            return
        act = self._acts[number]
        if act.fate is Fate.LATE and number not in self._answered:
            self._answered.add(number)
            at_us = self.now_us() + act.duration_us
            self.at(at_us, self.deliver, Input(Kind.SUCCEEDED, number))


class _Acting(Scripted):
    """Does what the scenario says of the instance, with outputs as the provider declares them."""

    def __init__(self, provider: Provider | None, act_of: Callable[[int], Act]) -> None:
        super().__init__(provider, {})
        self._act_of = act_of

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Take the time, then end."""
        act = self._act_of(context.number)
        if act.fate in (Fate.LATE, Fate.HANG):
            await context.sleep(_FOR_EVER_S)
        await context.sleep(act.duration_us / 1e6)
        event = Event.SUCCEEDED if act.fate is Fate.SUCCEEDED else Event.FAILED
        has_outputs = self._provider is not None and bool(self._provider.outputs)
        outputs = self._outputs(event, parameters, context.random) if has_outputs else {}
        if event is Event.FAILED:
            error = RunnerError("the scenario says so")
            error.outputs = outputs
            raise error
        return outputs


def scenario_of(run: Run) -> Scenario:
    """The run as a counterexample; outcomes that are not listed are SUCCEEDED."""
    plan = run.plan
    trace = [
        TraceStep(EVENTS[record.kind], plan.path(runner), runner.line, runner.file)
        for moment in run.moments
        for record in moment.records
        if record.kind in EVENTS
        for runner in (run.runner(record.node - 1),)
    ]
    return Scenario(
        outcomes=tuple((plan.path(run.runner(number)), outcome) for number, outcome in run.choices),
        ends=run.end,
        trace=tuple(trace[-_MAX_TRACE:]),
        trace_truncated=len(trace) > _MAX_TRACE,
        sentences=tuple(map(remark, _story(run))),
    )


def _story(run: Run) -> Iterator[str]:
    """The run in short sentences; of a long one the beginning and the end."""
    records = (record for moment in run.moments for record in moment.records)
    started = {record.node for record in records if record.kind is Kind.STARTED}
    overdue: set[int] = set()  # it is said of these that they are stopped
    sentences = [
        f"{moment.at_us / _SECOND:.6g} s: {sentence}"
        for index, moment in enumerate(run.moments)
        for sentence in _sentences(run, index, started, overdue)
    ]
    if len(sentences) > _MAX_STORY:
        half = _MAX_STORY // 2
        sentences = [*sentences[:half], f"… {len(sentences) - 2 * half} more", *sentences[-half:]]
    yield from sentences


def _sentences(run: Run, index: int, started: set[int], overdue: set[int]) -> Iterator[str]:
    for record in run.moments[index].records:
        if record.node >= 1 and record.node <= len(run.plan.runners):
            stopping = index >= run.decided
            if run.subject.is_machine:
                stopping = record.node not in overdue
                overdue.add(record.node) if record.kind is Kind.TIMEOUT else None
                if record.kind is Kind.STOPPED:
                    overdue.discard(record.node)
            sentence = _sentence(record, started, stopping=stopping)
            if sentence:
                visit = f": {record.message}" if sentence == "starts" and record.message else ""
                runner = run.runner(record.node - 1)
                if runner.interface == CHOICE and record.kind in _CHOSEN:
                    sentence = verb(runner, _CHOSEN[record.kind])
                yield f"{place(runner)} {sentence}{visit}"
    if index == run.decided:
        yield _ENDINGS[run.end].format(run.whole)


_CHOSEN = {Kind.SUCCEEDED: Event.SUCCEEDED, Kind.FAILED: Event.FAILED}


def _sentence(record: Record, started: set[int], *, stopping: bool) -> str:
    if record.kind is Kind.STARTED:
        return "starts"
    if record.kind is Kind.SUCCEEDED:
        return "succeeds"
    if record.kind is Kind.FAILED:
        return "fails" if record.node in started else "does not start"
    if record.kind is Kind.TIMEOUT:
        return "has used up its time and is stopped"
    if record.kind is Kind.LATE:
        return "answers too late, which changes nothing"
    return "is stopped" if record.kind is Kind.STOPPED and stopping else ""


_OVER = (*_OUTCOMES, Kind.STOPPING, Kind.STOPPED)
"""What ends a visit: its outcome, or that the machine stops it."""


@dataclass(frozen=True)
class MachineRun(Run):
    """A run of a machine, whose instances are visited again and again.

    An instance is active from the instant of its trigger to that of its outcome or its stop
    (semantics, 9.2). What happens at the instant at which the run ends is read off the
    configuration of the kernel, which has stopped listening by then: ``active`` are the instances
    that are active after it.

        records    A triggered, A failed, A triggered, B triggered, A stops, B succeeded: completed
        spans      A from 0 s to 1 s, A from 1 s to 2 s, B from 1 s to 3 s
    """

    active: tuple[int, ...] = ()

    @cached_property
    def spans(self) -> tuple[Span, ...]:
        """The times at which instances are active, by instance, then by visit."""
        begun: dict[int, int] = {}
        spans: list[Span] = []
        for index, (at_us, _, records) in enumerate(self.moments[: self.decided + 1]):
            # at the end all that is active is stopped, which is not what the machine says
            over = _OVER if index < self.decided else (*_OUTCOMES,)
            for record in records:
                number = record.node - 1
                if record.kind is Kind.TRIGGERED:
                    begun[number] = at_us
                elif record.kind in over and number in begun:
                    spans.append(Span(number, begun.pop(number), at_us))
        for number, begin_us in begun.items():
            gone = number not in self.active  # the instant of the end has stopped it
            spans.append(Span(number, begin_us, self.decided_us if gone else math.inf))
        cut_off = self.status is Status.CANCELLED  # then nothing begins at the last instant
        new = (number for number in self.active if number not in begun and not cut_off)
        spans += (Span(number, self.decided_us, math.inf) for number in new)
        return tuple(sorted(spans))

    @cached_property
    def triggered(self) -> dict[int, int]:
        """The first trigger of each instance, in microseconds, by its number."""
        first: dict[int, int] = {}
        for span in self.spans:
            first.setdefault(span.number, span.begin_us)
        return first

    @cached_property
    def _ends(self) -> dict[int, tuple[int, Outcome]]:
        """The last outcome of each instance."""
        return {number: (at_us, outcome) for at_us, number, outcome in self._outcomes}

    @cached_property
    def _outcomes(self) -> tuple[tuple[int, int, Outcome], ...]:
        return tuple(
            (at_us, record.node - 1, _OUTCOMES[record.kind])
            for at_us, _, records in self.moments[: self.decided + 1]
            for record in records
            if record.kind in _OUTCOMES
        )

    @cached_property
    def active_at_end(self) -> tuple[int, ...]:
        """The instances that are active when it is fixed how the run ends, in document order."""
        return tuple(sorted({each.number for each in self.spans if each.end_us == math.inf}))

    @property
    def choices(self) -> tuple[tuple[int, Outcome], ...]:
        """All outcomes, as they come; then who hangs."""
        visits = [0] * len(self.plan.runners)
        for span in self.spans:
            visits[span.number] += 1
        hanging = (
            (number, Outcome.HANG)
            for number in self.active_at_end
            if self.subject.act_in(self.scenario, number, visits[number]).fate is Fate.HANG
        )
        return (*((number, outcome) for _, number, outcome in self._outcomes), *hanging)


def _machine_run(
    subject: Subject, scenario: TimedScenario, kernel: Kernel, sink: Moments
) -> MachineRun:
    """The run that a kernel has made."""
    from gpsfsm.execution.machine_kernel import MachineKernel

    assert isinstance(kernel, MachineKernel)
    bits = kernel.configuration.active | kernel.configuration.hanging
    active = tuple(number for number in range(bits.bit_length()) if bits >> number & 1)
    return MachineRun(subject, scenario, tuple(sink.moments), kernel.status, sink.decided, active)
