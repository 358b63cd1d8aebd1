"""The kernel: it takes what happens, follows the automaton and says what to do, with which values.

It is a function of its inputs alone: no clock, no randomness, no input or output, no set whose
order could matter. So a run is its inputs, and replaying them gives the same records.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from gpsfsm.errors import InternalError
from gpsfsm.execution.pruning import FAILED, STARTED, SUCCEEDED, Pruning, number_of
from gpsfsm.execution.records import (
    Command,
    Input,
    Kind,
    Load,
    Record,
    Start,
    Status,
    Stop,
    Unload,
)
from gpsfsm.late import collecting_rarely
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import ValueType, fitting
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.capability import Binding, Provider
    from gpsfsm.model.plan import Element

VERSION = 3
"""Raised whenever the same inputs, or the same simulated runners, may lead to other records."""

Step = tuple[list[Record], list[Command]]
"""What an input leads to: records in order, and what to do once they are journaled."""


class Kernel:
    """One run of a compiled plan.

    ``runners`` are the different (interface, provider) of the plan in the order of their first use.
    They are loaded when an instance first needs them and unloaded as soon as no instance can need
    them any more. With ``apart`` every instance has a runner to itself, so that each can fail to
    start on its own, as scenarios have it (semantics, 4.2). ``bound`` are the providers that the
    bindings of the plan mean, by interface and provider: what was checked is what runs.
    """

    _prunes = True  # what can happen no more is seen, and not needed any longer

    @collecting_rarely()
    def __init__(self, compiled: Compiled, *, apart: bool = False) -> None:
        automaton = compiled.automaton
        self.compiled = compiled
        self.automaton = automaton
        self.status = Status.QUEUED
        self.paused = False
        self.active: dict[int, None] = {}  # instances that act, in the order of their start
        self.overdue: dict[int, str] = {}  # those of them that are to stop: their time is over
        self.loaded: dict[int, None] = {}  # runners, in the order in which they were loaded
        self.visits = 0  # nodes looked at to follow events: what running costs
        self._targets: dict[int, list[int]] = {}
        for source, event, target in automaton.edges:
            self._targets.setdefault(number_of(source, event), []).append(target)
        self._need = [node.need for node in automaton.nodes]
        self._is_join = [node.kind is NodeKind.JOIN for node in automaton.nodes]
        self._traits = automaton.traits
        self._nowhere = Status.STUCK if self._traits.gives_up else Status.HANG
        self._arrived = [0] * len(automaton.nodes)
        self._fired = bytearray(len(automaton.nodes))
        self._outputs: dict[int, Mapping[str, RunValue]] = {}
        self._arriving: dict[int, Mapping[str, RunValue]] = {}
        self.apart = apart
        self._prepare_runners()
        self._pruning = self._pruning_of(compiled) if self._prunes else None
        self._loading: dict[int, list[int]] = {}  # runner: the instances that wait for it
        self._visits: dict[int, str] = {}  # which one it is, of those that are not the first
        self._refused: list[int] = []  # those whose runner could not be loaded, just now
        # instances that wait for their runner, with their parameters
        self._waiting: dict[int, dict[str, RunValue]] = {}
        self._held: list[int] = []
        self._outcome: Status | None = None
        self._queue: deque[int] = deque()
        self._records: list[Record] = []
        self._commands: list[Command] = []

    def _prepare_runners(self) -> None:
        plan, bindings = self.automaton.plan, self.compiled.bindings
        numbers: dict[tuple[str, str], int] = {}
        keys: list[tuple[str, str]] = []
        bound: dict[tuple[str, str], Provider | None] = {}
        self.runner_of: list[int] = []
        for number, element in enumerate(plan.runners):
            binding = bindings[number]
            key = (
                (element.interface, element.provider)
                if binding is None
                else (binding.semantic or binding.interface.name, binding.provider.name)
            )
            keys.append(key)
            provider = None if binding is None else binding.provider
            if bound.setdefault(key, provider) is None or provider is None:
                bound[key] = None  # somebody has written the names of another one
            self.runner_of.append(number if self.apart else numbers.setdefault(key, len(numbers)))
        self.runners = tuple(keys if self.apart else numbers)
        self.bound = {key: each for key, each in bound.items() if each is not None}

    def _pruning_of(self, compiled: Compiled) -> Pruning:
        return Pruning(
            compiled,
            self._targets,
            runner_of=self.runner_of,
            runners=len(self.runners),
            fired=self._fired,
        )

    @property
    def pruned(self) -> int:
        """The number of looks that it took to see what cannot happen any more."""
        return 0 if self._pruning is None else self._pruning.visits

    @property
    def ending(self) -> Status | None:
        """The end of a run that is to stop, or has ended; None as long as it goes on."""
        return self._outcome

    def is_stopping(self, number: int) -> bool:
        """True if an active instance has been asked to stop while the run goes on."""
        return number in self.overdue

    def waiting_for(self, runner: int) -> int:
        """The number of instances that wait until the runner is loaded."""
        return len(self._loading.get(runner, ()))

    # -- inputs -----------------------------------------------------------------------------

    def step(self, happened: Input) -> Step:
        """Take in one input. Raises InternalError for one that makes no sense now."""
        self._records, self._commands = [], []
        assert not self._queue or self._outcome is not None, "signals have run their course"
        self._take(happened)
        self._settle()
        return self._records, self._commands

    def _take(self, happened: Input) -> None:
        kind, number = happened.kind, happened.number
        if kind is Kind.BEGIN:
            self._begin()
        elif kind in (Kind.SUCCEEDED, Kind.FAILED):
            self._answer(happened)
        elif kind is Kind.TIMEOUT:
            self._time_out(number, happened.message)
        elif kind is Kind.STOPPED:
            self._stopped(number, happened.message)
        elif kind in (Kind.LOADED, Kind.NOT_LOADED):
            self._load_answer(happened)
        elif kind is Kind.PAUSE:
            self.paused = True
            self._record(Kind.PAUSE)
        elif kind is Kind.RESUME:
            self._resume()
        elif kind is Kind.CANCEL:
            self._record(Kind.CANCEL, message=happened.message)
            self._outcome = self._outcome or Status.CANCELLED
        elif kind is Kind.SILENCE:
            self._record(Kind.SILENCE)
            self._outcome = self._outcome or self._nowhere
        elif kind is Kind.REPORTED:
            self._reported(happened)
        else:
            raise InternalError(f"the kernel cannot be told {kind}")

    def _reported(self, happened: Input) -> None:
        """Whoever drives the run says how it has ended."""
        status = happened.outputs.get("status")
        if status not in (Status.COMPLETED, Status.REFUSED):
            raise InternalError(f"no server reports {status!r:.40}")
        self._record(Kind.REPORTED, data=happened.outputs, message=happened.message)
        self._outcome = self._outcome or Status(status)

    def _begin(self) -> None:
        if self.status is not Status.QUEUED:
            raise InternalError("a run can begin only once")
        self.status = Status.RUNNING
        self._record(Kind.BEGIN)
        self._queue.append(SUCCEEDED)  # of the start node

    def _answer(self, happened: Input) -> None:
        number = happened.number
        node = self.automaton.runner_node(number)
        if number not in self.active:
            self._record(Kind.LATE, node, message=happened.kind)
            return
        if self.is_stopping(number) or self.status is not Status.RUNNING:
            # it ended by itself while it was to stop
            self._stopped(number, f"it has ended: {happened.kind}")
            return
        del self.active[number]
        succeeded = happened.kind is Kind.SUCCEEDED
        outputs = handed_over(self.compiled.bindings[number], succeeded, happened.outputs)
        self._outputs[node] = outputs
        self._record(
            Kind.SUCCEEDED if succeeded else Kind.FAILED,
            node,
            data=outputs or None,
            message=happened.message,
        )
        self._emit_outcome(node, succeeded)

    def _emit_outcome(self, node: int, succeeded: bool) -> None:
        self._queue.append(node * 4 + (SUCCEEDED if succeeded else FAILED))
        self._never(node * 4 + (FAILED if succeeded else SUCCEEDED))
        number = self.automaton.runner_number(node)
        if self._pruning is not None and self._pruning.ended(number):
            self._unload(self.runner_of[number])

    def _time_out(self, number: int, message: str) -> None:
        """Its time is over: it has to stop, and only once it has stopped has it failed."""
        node = self.automaton.runner_node(number)
        stopping = self.is_stopping(number) or self.status is not Status.RUNNING
        if number not in self.active or stopping:
            self._record(Kind.LATE, node, message=Kind.TIMEOUT)
            return
        self.overdue[number] = message
        self._record(Kind.TIMEOUT, node, message=message)
        self._ask_to_stop(number)

    def _ask_to_stop(self, number: int) -> None:
        self._record(Kind.STOPPING, self.automaton.runner_node(number))
        self._commands.append(Stop(number))

    def _stopped(self, number: int, message: str) -> None:
        node = self.automaton.runner_node(number)
        if number not in self.active:
            self._record(Kind.LATE, node, message=Kind.STOPPED)
            return
        del self.active[number]
        self._record(Kind.STOPPED, node, message=message)
        overdue = self.overdue.pop(number, None)
        if overdue is None:
            return
        self._record(Kind.FAILED, node, message=overdue)
        if self.status is Status.RUNNING:
            self._emit_outcome(node, succeeded=False)

    def _load_answer(self, happened: Input) -> None:
        runner = happened.runner
        waiting = self._loading.pop(runner, None)
        if waiting is None:
            raise InternalError("a runner that nobody asked for was loaded")
        if happened.kind is Kind.LOADED:
            self.loaded[runner] = None
            self._record(Kind.LOADED, runner=runner)
        else:
            self._record(Kind.NOT_LOADED, runner=runner, message=happened.message)
        while waiting:
            number = waiting.pop(0)
            if number not in self._waiting:
                continue
            parameters = self._waiting.pop(number)
            if happened.kind is Kind.LOADED:
                self._start(number, parameters)
            else:
                self._refused = waiting
                self._not_started(number)

    def _not_started(self, number: int) -> None:
        """An instance cannot start, since its runner could not be loaded."""
        node = self.automaton.runner_node(number)
        self._record(Kind.FAILED, node, message="its runner could not be loaded")
        self._never(node * 4 + STARTED)
        if self._traits.refusals_hang:
            self._never(node * 4 + SUCCEEDED)
            self._never(node * 4 + FAILED)
        else:
            self._emit_outcome(node, succeeded=False)

    def _resume(self) -> None:
        self.paused = False
        self._record(Kind.RESUME)
        held, self._held = self._held, []
        for number in held:
            self._dispatch(number)

    # -- what follows -----------------------------------------------------------------------

    def _record(
        self,
        kind: Kind,
        node: int = -1,
        *,
        runner: int = -1,
        data: Mapping[str, RunValue] | None = None,
        message: str = "",
    ) -> None:
        self._records.append(Record(kind, node, runner, data, message))

    def _settle(self) -> None:
        """Let all signals run their course, then see whether the run has ended."""
        while self._queue and self._outcome is None:
            self._follow(self._queue.popleft())
        if self.status is Status.QUEUED and self._outcome is not None:
            self.status = Status.RUNNING  # cancelled before it began
        if self.status is Status.RUNNING:
            if self._outcome is None and self._is_still():
                self._outcome = self._nowhere
            if self._outcome is not None:
                self._stop_all()
        if self.status is Status.STOPPING and not (self.active or self._loading):
            for runner in reversed(self.loaded):
                self._commands.append(Unload(runner))
                self._record(Kind.UNLOADED, runner=runner)
            self.loaded.clear()
            assert self._outcome is not None
            assert self._outcome.ended, "what has an end has ended"
            assert not self.overdue, "what is to stop has stopped before the run ends"
            self.status = self._outcome
            self._record(Kind.ENDED, data={"status": self.status.value})

    def _is_still(self) -> bool:
        """True if no instance is left that could have an outcome."""
        return not (self.active or self._waiting or self._held)

    def _follow(self, signal: int) -> None:
        for target in self._targets.get(signal, ()):
            self.visits += 1
            if self._is_join[target]:
                self._arrived[target] += 1
                if self._arrived[target] == self._need[target] and not self._breaks(target):
                    self._fired[target] = 1
                    self._record(Kind.JOINED, target)
                    self._queue.appendleft(target * 4 + SUCCEEDED)
                    self._arrived[target] += target in self._traits.looping
                if self._breaks(target):
                    self._outcome = Status.ABORT
                    return
            elif target == self.automaton.complete:
                self._outcome = Status.COMPLETED
                return
            elif target == self.automaton.give_up:
                self._outcome = Status.GAVE_UP
                return
            elif not self._fired[target]:
                self._fired[target] = 1
                self._arriving[target] = (
                    {} if signal & 3 == STARTED else self._outputs.get(signal >> 2, {})
                )
                self._trigger(self.automaton.runner_number(target))

    def _trigger(self, number: int) -> None:
        if self.paused:
            self._held.append(number)
            self._record(Kind.HELD, self.automaton.runner_node(number))
        else:
            self._dispatch(number)

    def _dispatch(self, number: int) -> None:
        parameters = self._parameters(number)
        node, visit = self.automaton.runner_node(number), self._visits.get(number, "")
        self._record(Kind.TRIGGERED, node, data=parameters or None, message=visit)
        self._launch(number, parameters)

    def _launch(self, number: int, parameters: dict[str, RunValue]) -> None:
        """Start an instance, after its runner is loaded."""
        runner = self.runner_of[number]
        if runner in self.loaded:
            self._start(number, parameters)
            return
        self._waiting[number] = parameters
        if runner in self._loading:
            self._loading[runner].append(number)
            return
        self._loading[runner] = [number]
        self._record(Kind.LOADING, runner=runner)
        self._commands.append(Load(runner))

    def _parameters(self, number: int) -> dict[str, RunValue]:
        plan, binding = self.automaton.plan, self.compiled.bindings[number]
        arriving = self._arriving[self.automaton.runner_node(number)]
        if binding is not None and plan.vocabulary is Vocabulary.TREE:
            arriving = {}  # leaves hand nothing over, whatever the runners do that they stand for
        return parameters(plan.runners[number], binding, arriving)

    def _start(self, number: int, parameters: dict[str, RunValue]) -> None:
        node = self.automaton.runner_node(number)
        self.active[number] = None
        self._record(Kind.STARTED, node)
        self._commands.append(Start(number, self.runner_of[number], parameters.copy()))
        if node in self._traits.silent:
            self._never(node * 4 + STARTED)
        else:
            self._queue.append(node * 4 + STARTED)

    def _stop_all(self) -> None:
        """Ask every active instance to stop, the last one first; nothing more is triggered."""
        self.status = Status.STOPPING
        self._queue.clear()
        for number in reversed([*self._waiting, *self._held]):
            self._record(Kind.STOPPED, self.automaton.runner_node(number), message="never started")
        self._waiting.clear()
        self._held.clear()
        for number in reversed(self.active):
            if not self.is_stopping(number):
                self._ask_to_stop(number)

    # -- what cannot happen any more --------------------------------------------------------

    def _breaks(self, join: int) -> bool:
        """True if the engine aborts at the inputs that have arrived."""
        return self._arrived[join] > 1 and join in self._traits.breaking

    def _never(self, signal: int) -> None:
        """A signal never comes; unload what nothing needs any more because of that."""
        if self._pruning is not None:
            for runner in self._pruning.never(signal, self.loaded):
                self._unload(runner)

    def _unload(self, runner: int) -> None:
        if runner in self.loaded and self._outcome is None:
            del self.loaded[runner]
            self._record(Kind.UNLOADED, runner=runner)
            self._commands.append(Unload(runner))


def parameters(
    runner: Element, binding: Binding | None, arriving: Mapping[str, RunValue]
) -> dict[str, RunValue]:
    """Parameters as they arrive, else as the plan or its fallback has them, else defaults (8.2).

    An undescribed runner gets what the plan writes and all that arrives.
    """
    if binding is None:
        return {
            name: converted(value, ValueType.ANY)
            for name, value in {**runner.parameters, **arriving}.items()
        }
    provider = binding.provider
    types = {parameter.name: parameter.type for parameter in provider.configuration}
    types.update((expected.name, expected.type) for expected in provider.inputs)
    worked_with = ((name, binding.worked_with(name)) for name in types)
    values: dict[str, RunValue] = {name: value for name, value in worked_with if value is not None}
    for name, arrived in arriving.items():
        if name in types:
            values[name] = converted(arrived, types[name])
    return values


def converted(value: RunValue, wanted: ValueType) -> RunValue:
    """A whole number where a double is wanted is one; everything else stays as it is.

    Lists are copied: what a runner does to what it gets must not reach anybody else.
    """
    if isinstance(value, list):
        inner = ValueType.DOUBLE if wanted is ValueType.DOUBLES else ValueType.ANY
        return [converted(item, inner) for item in value]
    return fitting(value, wanted)


def handed_over(
    binding: Binding | None, succeeded: bool, outputs: Mapping[str, RunValue]
) -> Mapping[str, RunValue]:
    """The outputs that travel with an outcome: those that the provider declares for it.

    A runner may hand one over under an alias: the names of outputs differ between engines.
    """
    if binding is None:
        return outputs
    from gpsfsm.model.event import Event

    event = Event.SUCCEEDED if succeeded else Event.FAILED
    declared = [output for output in binding.provider.outputs if output.event is event]
    values = {}
    for output in declared:
        name = next((name for name in (output.name, *output.aliases) if name in outputs), None)
        if name is not None:
            values[output.name] = outputs[name]
    return values
