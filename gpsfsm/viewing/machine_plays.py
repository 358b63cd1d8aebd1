"""Plays of machines: a run is its steps, visit after visit, and a loop is played once.

A scenario of a machine lists its outcomes in the order of the run (semantics, 9.3): the kernel of
machines is handed one a second, and what it asks to stop has stopped at once.

    A fails, B succeeds, and so on      records  A started, A failed, B started, B succeeded, A …
    the run is shown up to the end of the first round, and has not ended then
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.execution.machine_kernel import kernel_of
from gpsfsm.execution.records import Input, Kind, Load, Status, Stop
from gpsfsm.model.event import End, Outcome
from gpsfsm.model.story import Statement

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import Record
    from gpsfsm.model.finding import Scenario

_SECOND_US = 1_000_000
_ANSWERS = {Outcome.SUCCEEDED: Kind.SUCCEEDED, Outcome.FAILED: Kind.FAILED}


class MachinePlay(NamedTuple):
    """The records of a run, and the index of the record of each of its steps."""

    records: list[dict[str, Any]]
    steps: list[int]


def played_machine(
    compiled: Compiled,
    scenario: Scenario,
    numbers: Mapping[str, int],
    row_of: Callable[[Record, int], dict[str, Any] | None],
) -> MachinePlay | None:
    """The run of a scenario; None if the machine takes another course.

    ``numbers``: runners by element path. ``row_of`` makes a row of a record and its time.
    """
    outcomes = [(numbers[path], outcome) for path, outcome in scenario.outcomes if path in numbers]
    if len(outcomes) != len(scenario.outcomes):
        return None
    player = _Player(compiled, row_of)
    status = player.run(outcomes, silence=scenario.ends is End.STUCK)
    endless = scenario.ends is End.ENDLESS and status is Status.RUNNING
    if status is None or not (endless or status.value == scenario.ends.value):
        return None
    return MachinePlay(player.records, player.steps)


def machine_marks(scenario: Scenario, played: MachinePlay) -> list[int]:
    """The index of the record at which each sentence of the story stands."""
    return list(_marks(scenario, played))


def _marks(scenario: Scenario, played: MachinePlay) -> Iterator[int]:
    step, mark = 0, 0
    sentences = scenario.sentences
    for place, sentence in enumerate(sentences):
        if sentence.statement is Statement.STEPS_LEFT_OUT:
            step += sentence.count
        elif sentence.statement.event is not None and step < len(played.steps):
            mark = played.steps[step]
            step += 1
        elif place == len(sentences) - 1:
            mark = len(played.records) - 1
        yield mark


class _Player:
    def __init__(
        self, compiled: Compiled, row_of: Callable[[Record, int], dict[str, Any] | None]
    ) -> None:
        self.kernel = kernel_of(compiled)
        self.records: list[dict[str, Any]] = []
        self.steps: list[int] = []
        self._row_of = row_of
        self._at_us = 0

    def run(self, outcomes: Sequence[tuple[int, Outcome]], *, silence: bool) -> Status | None:
        """The status after these outcomes; None if one of them cannot occur."""
        kernel = self.kernel
        self._deliver(Input(Kind.BEGIN))
        hanging = set()
        for number, outcome in outcomes:
            self._at_us += _SECOND_US
            if kernel.status is not Status.RUNNING or number not in kernel.active:
                return None
            self.steps.append(len(self.records))
            if outcome in _ANSWERS:
                self._deliver(Input(_ANSWERS[outcome], number))
            else:  # it is active for ever: nothing is recorded
                hanging.add(number)
        if silence and kernel.status is Status.RUNNING and hanging.issuperset(kernel.active):
            self._at_us += _SECOND_US
            self._deliver(Input(Kind.SILENCE))
        while kernel.status is not Status.RUNNING and not kernel.status.ended:
            self._deliver(Input(Kind.STOPPED, next(reversed(kernel.active))))
        last = max(len(self.records) - 1, 0)
        self.steps = [min(step, last) for step in self.steps]
        return kernel.status

    def _deliver(self, happened: Input) -> None:
        """Take in an input; what is to be loaded is there at once, and what is to stop stops."""
        arrived = [happened]
        for each in arrived:
            records, commands = self.kernel.step(each)
            rows = (self._row_of(record, self._at_us) for record in records)
            self.records += [row for row in rows if row is not None]
            for command in commands:
                if isinstance(command, Load):
                    arrived.append(Input(Kind.LOADED, runner=command.runner))
                elif isinstance(command, Stop) and self.kernel.status is Status.RUNNING:
                    arrived.append(Input(Kind.STOPPED, command.number))
