"""Exploration: all runs of a small plan, taken through the very kernel that executes plans.

All outcomes and all orders of answers are tried. With z3 and the brute force of the tests this is
the third judge, and the only one that asks the engine.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Load, Record, Status
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Collection, Hashable, Iterator

    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.capability import Binding

_Choice = Input | None
"""What comes next: an input; None: the next instance that waits for its runner will not start."""

_ANSWERS = {Outcome.SUCCEEDED: Kind.SUCCEEDED, Outcome.FAILED: Kind.FAILED}
_EVENTS = {Kind.STARTED: Event.STARTED, Kind.SUCCEEDED: Event.SUCCEEDED, Kind.FAILED: Event.FAILED}


class TooManyRunsError(GpsfsmError):
    """There are more runs than the limit allows: nothing follows from those that were seen."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run: what came in, what followed, how it ended.

    ``outcomes`` are the outcomes that came, by the number of the instance, in their order; an
    instance that hangs has none. ``active`` are the numbers of the instances that were active when
    the run ended, in document order. To these belong instances that are triggered at that very
    instant (semantics, 4.4), also if the engine, which ends the run at once, does not start them.
    """

    inputs: tuple[Input, ...]
    records: tuple[Record, ...]
    status: Status
    outcomes: dict[int, Outcome] = field(default_factory=dict)
    active: tuple[int, ...] = ()


def explore(
    compiled: Compiled,
    *,
    faults: Collection[str] = (),
    orders: bool = True,
    limit: int = 100_000,
) -> Iterator[Run]:
    """All runs of a plan, in a fixed order.

    ``faults`` are the fault models ``no-start`` and ``hang`` (semantics, 4.2); declared outcomes
    count too. For ``no-start`` compile with ``start_chain=True``; every instance then has a runner
    to itself, so that it can fail to start on its own. A plan that hangs ends as STUCK.

    Without ``orders`` answers that differ in their order alone lead on once: there are far fewer
    runs, and still every ending, and every set of instances that can be active at the end.

    Raises TooManyRunsError where there would be more runs than ``limit``.

    >>> from gpsfsm.compile import compile_plan
    >>> from gpsfsm.syntax import parse
    >>> go = '<Runner interface="a/Go" provider="a/Go"/>'
    >>> plan = parse(f'<Plan><Control type="parallel_any">{go}{go}</Control></Plan>').plan
    >>> [(str(run.status), run.active) for run in explore(compile_plan(plan))]
    ... # doctest: +NORMALIZE_WHITESPACE
    [('COMPLETED', (1,)), ('COMPLETED', ()), ('GAVE_UP', ()),
     ('COMPLETED', (0,)), ('COMPLETED', ()), ('GAVE_UP', ())]
    """
    allowed = [_allowed(binding, faults) for binding in compiled.bindings]
    todo: list[tuple[_Choice, ...]] = [()]
    seen: set[Hashable] = set()
    count = 0
    while todo:
        path = todo.pop()
        state = _State(compiled, allowed, apart="no-start" in faults)
        for choice in path:
            state.take(choice)
        if not orders:
            if state.key() in seen:
                continue
            seen.add(state.key())
        if state.kernel.status is not Status.RUNNING:
            count += 1
            if count > limit:
                raise TooManyRunsError(f"the plan has more than {limit:,} runs")
            yield state.run()
        todo += [(*path, choice) for choice in reversed(state.choices())]


def _allowed(binding: Binding | None, faults: Collection[str]) -> tuple[Outcome, ...]:
    """The outcomes that an instance can have (semantics, 4.2 and 8.1)."""
    allowed = dict.fromkeys(Outcome, True)
    allowed[Outcome.NO_START] = "no-start" in faults
    allowed[Outcome.HANG] = "hang" in faults
    if binding is not None:
        declared = binding.provider.outcomes
        allowed[Outcome.HANG] |= declared.may_hang
        allowed[Outcome.SUCCEEDED] &= not declared.never_succeeds
        if binding.never_fails:
            allowed[Outcome.FAILED] = allowed[Outcome.NO_START] = False
    return tuple(outcome for outcome, possible in allowed.items() if possible)


class _State:
    """A kernel on its way, and what may come next."""

    def __init__(
        self, compiled: Compiled, allowed: list[tuple[Outcome, ...]], *, apart: bool
    ) -> None:
        self.kernel = Kernel(compiled, apart=apart)
        self._allowed = allowed
        self._apart = apart
        self._inputs: list[Input] = []
        self._records: list[Record] = []
        self._loads: deque[int] = deque()  # runners that are to be loaded
        self._unstarted: dict[int, None] = {}  # instances that will fail without having started
        self._outcomes: dict[int, Outcome] = {}
        self._deliver(Input(Kind.BEGIN))

    def take(self, choice: _Choice) -> None:
        """Let something happen."""
        if choice is None:
            self._unstarted[self._loads.popleft()] = None
            return
        if choice.kind is Kind.LOADED:
            self._loads.popleft()
        elif choice.kind is Kind.NOT_LOADED:
            del self._unstarted[choice.runner]
            self._outcomes[choice.runner] = Outcome.NO_START
        elif choice.kind is not Kind.SILENCE:
            self._outcomes[choice.number] = Outcome(choice.kind.value)
        self._deliver(choice)

    def _deliver(self, happened: Input) -> None:
        records, commands = self.kernel.step(happened)
        self._inputs.append(happened)
        self._records += records
        self._loads += [command.runner for command in commands if isinstance(command, Load)]

    def choices(self) -> list[_Choice]:
        """The inputs that may come next; none once the run is to end."""
        if self.kernel.status is not Status.RUNNING:
            return []
        inputs: list[_Choice] = []
        if self._loads:  # loading takes no time here: nothing comes before it
            runner = self._loads[0]
            allowed = self._allowed[runner] if self._apart else ()
            if not self._apart or any(outcome is not Outcome.NO_START for outcome in allowed):
                inputs.append(Input(Kind.LOADED, runner=runner))
            return [*inputs, None] if Outcome.NO_START in allowed else inputs
        active = self.kernel.active
        for number in sorted([*active, *self._unstarted]):
            if number in self._unstarted:
                inputs.append(Input(Kind.NOT_LOADED, runner=number))
                continue
            inputs += [
                Input(answer, number)
                for outcome, answer in _ANSWERS.items()
                if outcome in self._allowed[number]
            ]
        hangs = all(Outcome.HANG in self._allowed[number] for number in active)
        return [*inputs, Input(Kind.SILENCE)] if hangs and not self._unstarted else inputs

    def key(self) -> Hashable:
        """The state that the rest of the run depends on."""
        return (
            frozenset(self._outcomes.items()),
            frozenset(self._unstarted),
            tuple(self._loads),
            self.kernel.status,
        )

    def run(self) -> Run:
        """The run, once nothing more is triggered: what is active is stopped."""
        active = self._active()
        for runner in tuple(self._loads):
            self._deliver(Input(Kind.LOADED, runner=runner))
        for runner in self._unstarted:
            self._deliver(Input(Kind.NOT_LOADED, runner=runner))
        for number in reversed([*self.kernel.active]):
            self._deliver(Input(Kind.STOPPED, number))
        assert self.kernel.status.ended
        return Run(
            tuple(self._inputs),
            tuple(self._records),
            self.kernel.status,
            dict(self._outcomes),
            active,
        )

    def _active(self) -> tuple[int, ...]:
        """The instances that are triggered by now and have no outcome yet.

        Read off the records, since the kernel stops looking at the instant of the end.
        """
        came = [
            Signal(record.node, _EVENTS[record.kind])
            for record in self._records
            if record.kind in _EVENTS
        ]
        automaton = self.kernel.automaton
        silent = {automaton.runner_node(number) for number in self._unstarted}
        triggered = _triggered(automaton, [Signal(0, Event.SUCCEEDED), *came], silent)
        ended = set(self._outcomes)
        return tuple(
            number
            for number in range(len(automaton.runners))
            if automaton.runner_node(number) in triggered and number not in ended
        )


def _triggered(automaton: Automaton, came: list[Signal], silent: Collection[int]) -> set[int]:
    """The nodes that are triggered at the instant at which these events have come.

    Joins take no time, and what is triggered has STARTED at that instant unless it is ``silent``.
    """
    arrived = [0] * len(automaton.nodes)
    triggered: set[int] = set()
    todo = deque(dict.fromkeys(came))
    started = {signal.node for signal in todo if signal.event is Event.STARTED}
    ended = {signal.node for signal in todo if signal.event is not Event.STARTED}
    while todo:
        for target in automaton.outputs.get(todo.popleft(), ()):
            node = automaton.nodes[target]
            arrived[target] += 1
            if arrived[target] != max(node.need, 1):
                continue
            triggered.add(target)
            if node.kind is NodeKind.JOIN:
                todo.append(Signal(target, Event.SUCCEEDED))
            elif target not in silent and target not in started and target not in ended:
                todo.append(Signal(target, Event.STARTED))
    return triggered
