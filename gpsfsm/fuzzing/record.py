"""What is known of a run that was played: what properties look at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.execution.records import Kind, Status
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import Input, Record, RunValue
    from gpsfsm.fuzzing.acts import TimedScenario
    from gpsfsm.fuzzing.subject import Subject
    from gpsfsm.model.plan import Element, Plan

__all__ = ["Happened", "Moment", "Run"]

_SECOND = 1_000_000
_OUTCOMES = (Kind.SUCCEEDED, Kind.FAILED)


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
    """A run.

    ``decided`` is the index of the moment at which it was fixed how the run ends. ``status`` is
    COMPLETED, GAVE_UP or STUCK.
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
        """How long the run took, in seconds, until it was fixed how it ends."""
        return self.decided_us / _SECOND

    @property
    def decided_us(self) -> int:
        """The same in microseconds."""
        return self.moments[self.decided].at_us

    @cached_property
    def events(self) -> tuple[Happened, ...]:
        """Everything that happened, in order."""
        found = []
        automaton = self.compiled.automaton
        for at_us, _, records in self.moments:
            for record in records:
                number = record.node - 1
                known = 0 <= number < len(self.plan.runners)
                runner = self.runner(number) if known else None
                found.append(
                    Happened(
                        at_us / _SECOND,
                        record.kind.value,
                        number if known else -1,
                        automaton.name(record.node) if known else "",
                        0 if runner is None else runner.line,
                        "" if runner is None else runner.interface,
                        record.data or {},
                        record.message,
                    )
                )
        return tuple(found)

    @cached_property
    def triggered(self) -> dict[int, int]:
        """When each instance was triggered, in microseconds, by its number.

        With those that are triggered at the instant at which the run ends (semantics, 4.4): the
        executor stops at that instant, and may not have come to them.
        """
        found: dict[int, int] = {}
        for at_us, _, records in self.moments:
            for record in records:
                if record.kind is Kind.TRIGGERED:
                    found.setdefault(record.node - 1, at_us)
        for number in self._at_the_end():
            found.setdefault(number, self.decided_us)
        return found

    @cached_property
    def ended(self) -> dict[int, int]:
        """When the outcome of each instance came, in microseconds, by its number."""
        return {number: at_us for number, (at_us, _) in self._ends.items()}

    @cached_property
    def outcomes(self) -> dict[int, Outcome]:
        """The outcomes that came: SUCCEEDED or FAILED, by number."""
        return {number: outcome for number, (_, outcome) in self._ends.items()}

    @cached_property
    def _ends(self) -> dict[int, tuple[int, Outcome]]:
        """With the outcomes that come at the very instant at which the run ends.

        Of those the executor only notes that they came: it has stopped listening.
        """
        found = {
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
                found.setdefault(happened.number, (at_us, outcome))
            elif happened.kind is Kind.NOT_LOADED and self.subject.apart:
                found.setdefault(happened.runner, (at_us, Outcome.FAILED))
        return found

    @cached_property
    def active_at_end(self) -> tuple[int, ...]:
        """The instances that are active when it is fixed how the run ends, in document order."""
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
        found: list[int] = []
        for signal in todo:  # it grows meanwhile
            for target in automaton.outputs.get(signal, ()):
                node = automaton.nodes[target]
                arrived[target] += 1
                if arrived[target] != max(node.need, 1):
                    continue
                if node.kind is NodeKind.JOIN:
                    todo.append(Signal(target, Event.SUCCEEDED))
                elif node.kind is NodeKind.RUNNER:
                    found.append(target - 1)
                    if target not in silent:
                        todo.append(Signal(target, Event.STARTED))
        return found
