"""A run that a server drives, mirrored: its events are the inputs of a kernel of the same engine.

The kernel follows the automaton, so that the rows of the journal are those of a run of our own, and
it knows where the plan stands, which the server does not tell: a failure that nothing takes is the
end (HANG), while the server goes on waiting. Nothing is started or stopped here.

The server numbers runner instances since its own start, the profile numbers them in each plan: the
difference is the same for all instances of a plan, and follows from the events.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.execution.host import Host
from gpsfsm.execution.records import Input, Kind, Status
from gpsfsm.watch.record_text import Words

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from gpsfsm.compile.engine_text import EngineReading
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Record, RunValue, Start
    from gpsfsm.ros.fabric import RunnerEvent

_MOST_NOTES = 50
_OUTCOMES = {"SUCCEEDED": Kind.SUCCEEDED, "FAILED": Kind.FAILED}
_ACTING = ("TRIGGERED", *_OUTCOMES)


@dataclass(frozen=True, slots=True)
class Instance:
    """A runner instance as the engine has it.

    ``place`` is its number in the plan as the engine counts, joins and completion included;
    ``number`` the number of the runner instance in the automaton, -1 for what the engine adds.
    """

    place: int
    interface: str
    provider: str
    number: int = -1


def instances(reading: EngineReading) -> tuple[Instance, ...]:
    """All instances that an engine makes of a plan."""
    sources = [each.source for each in reading.connections.connections if each.source.named]
    elements = sorted(each.element for each in sources if each.element is not None)
    numbers = {element: number for number, element in enumerate(elements)}
    return tuple(
        Instance(
            each.instance,
            each.interface,
            each.provider,
            -1 if each.element is None else numbers[each.element],
        )
        for each in sources
    )


class Attribution:
    """Attributes events to the instances of one plan; ``plan_id`` is what the server calls it.

    >>> from gpsfsm.ros.fabric import RunnerEvent
    >>> attribution = Attribution([Instance(0, "a/Go", "a/Go", 0), Instance(1, "a/Go", "a/Go", 1)])
    >>> attribution.instance(RunnerEvent("SUCCEEDED", "a/Go", "a/Go", 40), [0]).number
    0
    >>> attribution.instance(RunnerEvent("SUCCEEDED", "a/Go", "a/Go", 41), [1]).number
    1
    """

    def __init__(self, all_instances: Sequence[Instance], plan_id: str = "") -> None:
        self._instances = all_instances
        self.plan_id = plan_id
        self._shifts: set[int] = set()  # what may have to be taken off the server's numbers

    def instance(self, event: RunnerEvent, active: Collection[int]) -> Instance | None:
        """The instance that an event is about; None if it is none of this plan.

        ``active`` are the numbers of those that act, one of which the first event must be about.
        """
        if event.plan_id and self.plan_id and event.plan_id != self.plan_id:
            return None
        if event.instance < 0:
            return self._by_name(event, active)
        shifts = {
            event.instance - each.place
            for each in self._named(event.interface, event.provider)
            if self._shifts or each.number in active
        }
        if event.target >= 0:
            shifts &= {event.target - each.place for each in self._named(event.triggers)}
        if self._shifts:
            shifts &= self._shifts
        if not shifts:
            return None
        self._shifts = shifts
        possible = [
            each
            for each in self._named(event.interface, event.provider)
            if event.instance - each.place in shifts
        ]
        acting = [each for each in possible if each.number in active]
        return (acting or possible)[0]

    def _named(self, interface: str, provider: str = "") -> list[Instance]:
        return [
            each
            for each in self._instances
            if each.interface == interface and (not provider or each.provider == provider)
        ]

    def _by_name(self, event: RunnerEvent, active: Collection[int]) -> Instance | None:
        """The one that acts and has these names; None if several do."""
        named = self._named(event.interface, event.provider)
        acting = [each for each in named if each.number in active]
        return acting[0] if len(acting) == 1 else None


class Mirror(Host):
    """The host of a run that a server drives. ``notes`` tell what it does otherwise."""

    def __init__(self, kernel: Kernel, sink: Sink, attribution: Attribution) -> None:
        super().__init__(kernel, sink)
        self.notes: list[str] = []
        self.foreign = 0
        self._attribution = attribution
        self._words = Words(kernel.automaton, kernel.runners)
        self._ended: set[int] = set()
        self._began = time.monotonic()

    def now_us(self) -> int:
        """Microseconds since the plan was submitted."""
        return int((time.monotonic() - self._began) * 1_000_000)

    def note(self, message: str, **data: RunValue) -> None:
        """Write down something about the run as a whole."""
        self.mark(Input(Kind.NOTE, outputs=data, message=message))

    def begin(self) -> None:
        """The server runs the plan."""
        if self.kernel.status is Status.QUEUED:
            self.deliver(Input(Kind.BEGIN))

    def reported(self, status: Status, message: str) -> None:
        """The server says how the plan has ended."""
        self.deliver(Input(Kind.REPORTED, outputs={"status": status.value}, message=message))

    def take(self, event: RunnerEvent) -> None:
        """Take in an event of the server."""
        if self.kernel.status.ended or event.code not in _ACTING:
            return
        instance = self._attribution.instance(event, self.kernel.active)
        if instance is None:
            self.foreign += 1
            return
        number = instance.number
        if number < 0 or number in self._ended:  # an event is published once for each target
            return
        if number not in self.kernel.active:
            self._unexpected(number, event.code)
        elif event.code in _OUTCOMES:
            self._ended.add(number)
            self.deliver(Input(_OUTCOMES[event.code], number))

    def _unexpected(self, number: int, code: str) -> None:
        if len(self.notes) >= _MOST_NOTES:
            return
        node = self.kernel.automaton.runner_node(number)
        engine = self.kernel.automaton.traits.engine
        note = (
            f"the server reports {code} of line {self._words.element(node).line}, "
            f"{self._words.node(node)}, which does not act by now on {engine}: "
            "an event was lost, or this server is another one"
        )
        if note not in self.notes:
            self.notes.append(note)
            self.note(note)

    # -- what the kernel wants done: the server does it -----------------------------------------

    def start(self, command: Start) -> None:
        """The server has started it."""

    def load(self, runner: int) -> None:
        """The server has loaded all runners before it began."""
        self.deliver(Input(Kind.LOADED, runner=runner))

    def stop(self, number: int) -> None:
        """The server reports no more of it."""
        self.deliver(Input(Kind.STOPPED, number, message="the server reports no more of it"))

    def unload(self, runner: int) -> None:
        """The server does it with the next plan."""


class Trace:
    """The fate of each node, for the explanation of the end; a watcher of a host."""

    def __init__(self) -> None:
        self.active: dict[int, int] = {}  # node: when it started
        self.ended: dict[int, Kind] = {}
        self.joined: set[int] = set()

    def __call__(self, at_us: int, _happened: Input, records: Sequence[Record]) -> None:
        """Take in what has happened."""
        for record in records:
            if record.kind is Kind.STARTED:
                self.active[record.node] = at_us
            elif record.kind in (Kind.SUCCEEDED, Kind.FAILED):
                self.active.pop(record.node, None)
                self.ended[record.node] = record.kind
            elif record.kind is Kind.JOINED:
                self.joined.add(record.node)
